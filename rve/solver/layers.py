"""Layers of the product space between its unknowns and DOLFINx: the constraint u = Q x.

A displacement of the prisms has nodal values U_k on level k, at all nodes of its triangles, and M_k
on the mid-level above it, at vertices alone. At height ζ of layer k it is one of six-node
triangles,

    u = (1 − ζ) U_k + ζ U_k+1 + 4 ζ (1 − ζ) J (M_k − (V_k + V_k+1) / 2),

where V_k are the values of U_k at vertices and J injects linear into quadratic triangles. With
periodicity and the fixed corner this is u = Q x_k on the slices of layer k, for the unknowns x_k of
its two levels and its mid-level. Q is the same for all layers. The reduced stiffness is the sum of
Qᵀ A_k Q over the layers, where A_k is what DOLFINx assembles over the slices of layer k.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.lib.stride_tricks import sliding_window_view

from alphacut.base.arrays import Array, Ints
from alphacut.rve.fenicsx import PETSc, aij, columns
from alphacut.rve.mesh.prism_grid import Triangulation
from alphacut.rve.solver.numbering import LevelNumbering
from alphacut.rve.solver.theta_preconditioner import interpolated_vertices


class LayerConstraint:
    """The constraint u = Q x_k between the unknowns of a layer and the nodes of its slices.

    Args:
        numbering: Numbering of the unknowns, all on this rank.
        heights: Height ζ of each slice in its layer, inside (0, 1), shape (slices,).
        interpolation: Matrix of `layer_interpolation`, its rows in the order of DOLFINx's nodes on
            the slices, shape (nodes, nodes of a layer of prisms).
        node: Number of each of DOLFINx's nodes: slice after slice, and within each as in the plane
            mesh; shape (nodes,).
    """

    def __init__(
        self, numbering: LevelNumbering, heights: Array, interpolation: sp.csr_matrix, node: Ints
    ) -> None:
        self.numbering = numbering
        self.heights = heights
        scalar = interpolation @ _periodicity(numbering)
        by_component = sp.kron(scalar, sp.eye(2), "csr")
        self._matrix = aij(by_component)  # Q
        self._transposed = aij(by_component.T.tocsr())
        on_slice, plane_node = np.divmod(node, len(numbering.grid.plane.points))
        self.on_slice = on_slice
        self.unknown = numbering.planar[plane_node]

    def displacements(self, unknowns: Array) -> Array:
        """Return displacements of the slices of all layers k, which are Q x_k.

        x_k are the unknowns of the two levels and the mid-level of the layer. The matrix Q leads
        from them to the displacements of DOLFINx's nodes on the slices: periodic, zero at one
        corner, interpolated along θ. It is the same for all layers.

        Args:
            unknowns: Unknowns of several fields, shape (fields, unknowns), level by level: of level
                0, of the mid-level above it, of level 1, and so on. At least one field.

        Returns:
            Displacements, shape (fields, layers, 2 nodes); the two components of a node are
            adjacent.
        """
        # The unknowns of a layer follow one another, and those of the level above it are also the
        # first ones of the next layer: x_k are overlapping windows of x.
        stride, width = self.numbering.stride, self._matrix.size[1]
        windows = sliding_window_view(unknowns, width, axis=1)[:, ::stride]
        products = self._matrix.matMult(columns(windows.reshape(-1, width)))
        return np.array(products.getDenseArray().T).reshape(*windows.shape[:2], -1)

    def forces(self, on_slices: Array) -> Array:
        """Return the reduced forces Σ_k Qᵀ f_k of forces f_k on the slices of each layer k.

        The matrix Q leads from the unknowns of a layer (of its two levels and its mid-level) to the
        displacements of DOLFINx's nodes on its slices.

        Args:
            on_slices: Forces f_k on DOLFINx's nodes, shape (fields, layers, 2 nodes); the two
                components of a node are adjacent.

        Returns:
            Forces on the unknowns level by level, shape (fields, unknowns).
        """
        fields, layers, size = on_slices.shape
        products = self._transposed.matMult(columns(on_slices.reshape(-1, size)))
        by_layer = products.getDenseArray().T.reshape(fields, layers, -1)
        stride, level_size = self.numbering.stride, self.numbering.level_size
        # A layer's forces are those on its lower level and its mid-level, one stride of unknowns,
        # and then those on its upper level, which the next layer adds to.
        total = np.zeros((fields, layers + 1, stride))
        total[:, :-1] = by_layer[..., :stride]
        total[:, 1:, :level_size] += by_layer[..., stride:]
        return total.reshape(fields, -1)[:, : self.numbering.size]


@dataclass(frozen=True)
class BlockSum:
    """The product Bᵀ A B as sums of entries of A, for matrices A of one pattern.

    The entries of B are 0 and 1. SciPy's product would leave out sums that are zero by chance, so
    that its pattern depended on the entries of A.

    Args:
        sums: Matrix from the blocks of A to those of Bᵀ A B, each of 2 × 2 entries.
        pattern: CSR pattern of Bᵀ A B; its values are their places among the entries of the blocks.
    """

    sums: sp.csr_matrix
    pattern: sp.csr_matrix

    @classmethod
    def of_parents(cls, pattern: sp.bsr_matrix, parents: Ints) -> BlockSum:
        """Prepare the product Bᵀ A B, for a matrix B of zeros and ones.

        Rows of B are nodes, columns are parents, and a one stands where a node depends on a parent.
        A couples nodes, Bᵀ A B couples parents. A block of Bᵀ A B is the sum of the blocks of A
        between all nodes that depend on these two parents.

        Args:
            pattern: Sparsity pattern of A in blocks of 2 × 2; its values are not used.
            parents: Numbers of the pairs of unknowns that a node depends on, shape (nodes,
                parents), −1 for none. At least one is not −1.

        Returns:
            The sums by which `entries` makes the entries of Bᵀ A B from the blocks of A.
        """
        size = int(parents.max()) + 1
        node = _rows(pattern)
        row = parents[node][:, :, np.newaxis]
        column = parents[pattern.indices][:, np.newaxis, :]
        is_free = (row >= 0) & (column >= 0)
        # Row and column as one number, so that sorted unique numbers are the CSR order.
        keys, place = np.unique((row * size + column)[is_free], return_inverse=True)
        num_blocks = len(pattern.indices)
        all_blocks = np.arange(num_blocks)[:, np.newaxis, np.newaxis]
        block = np.broadcast_to(all_blocks, is_free.shape)[is_free]
        ones = np.ones(len(place))
        sums = sp.csr_matrix((ones, (place, block)), (len(keys), num_blocks))
        indptr = np.searchsorted(keys, np.arange(size + 1) * size)
        blocks = np.ones((len(keys), 2, 2))
        product = sp.bsr_matrix((blocks, keys % size, indptr), (2 * size, 2 * size))
        return cls(sums, _scalar_pattern(product))

    def scaled(self, factors: Array) -> BlockSum:
        """Return the product for matrices A whose blocks are multiplied by factors first."""
        sums = self.sums.copy()
        sums.data *= factors[sums.indices]
        return BlockSum(sums, self.pattern)

    def entries(self, blocks: Array) -> Array:
        """Return the entries of Bᵀ A B in the order of CSR from the blocks of A, shape (n, 4)."""
        return np.asarray((self.sums @ blocks).ravel()[self.pattern.data])

    def matrix(self, entries: Array) -> sp.csr_matrix:
        """Return Bᵀ A B with some entries, without a copy of them."""
        csr = entries, self.pattern.indices, self.pattern.indptr
        return sp.csr_matrix(csr, self.pattern.shape)


class LayerPattern:
    """What follows from the pattern of DOLFINx's matrix A_k, the same for all layers.

    Args:
        constraint: The constraint u = Q x_k.
        pattern: Pattern of A_k in blocks of 2 × 2.
    """

    def __init__(self, constraint: LayerConstraint, pattern: sp.bsr_matrix) -> None:
        self.constraint = constraint
        self.num_blocks = len(pattern.indices)
        scalar = _scalar_pattern(pattern)
        self._places = scalar.data
        # The CSR pattern of the block diagonal matrix diag(A_k). `sp.kron` and `sp.block_diag` take
        # ten times as long to make it.
        layer = np.arange(constraint.numbering.grid.layers)[:, np.newaxis]
        starts = np.append(0, (scalar.indptr[1:] + layer * scalar.nnz).ravel())
        indices = (scalar.indices + layer * scalar.shape[0]).ravel()
        self._indptr = starts.astype(PETSc.IntType)
        self._indices = indices.astype(PETSc.IntType)

        # The blocks of the preconditioner are Bᵀ A B, where B takes hat functions, and then bubble
        # functions, of θ to the slices. A hat is 1 − ζ or ζ at a node. A bubble is 4 ζ (1 − ζ) at a
        # vertex, and half of it at a midpoint from each end of its edge.
        unknown = constraint.unknown[:, np.newaxis]
        ends = np.where(unknown < 0, -1, interpolated_vertices(constraint.numbering)[unknown[:, 0]])
        hats = BlockSum.of_parents(pattern, unknown)
        bubbles = BlockSum.of_parents(pattern, ends)
        height = constraint.heights[constraint.on_slice[_rows(pattern)]]  # of each block
        self._lower_hats = hats.scaled((1 - height) ** 2)
        self._upper_hats = hats.scaled(height**2)
        self._bubbles = bubbles.scaled((2 * height * (1 - height)) ** 2)

    def block_diagonal(self, blocks: Array) -> PETSc.Mat:
        """Return diag(A_k) from the blocks of all layers, shape (layers, blocks, 4)."""
        values = np.take(blocks.reshape(len(blocks), -1), self._places, axis=1).ravel()
        size = len(self._indptr) - 1
        return aij(sp.csr_matrix((values, self._indices, self._indptr), (size, size)))

    def level_blocks(self, blocks: Array) -> Iterator[sp.csr_matrix]:
        """Yield the diagonal blocks of the stiffness in the basis of the preconditioner.

        First come the blocks of the piecewise linear hat functions of θ, one at each level, then
        those of the quadratic bubble functions, one in each layer. A block is the sum over the
        layers of the stiffness of the slices, weighted by the squared function and with periodic
        partners added up.

        Args:
            blocks: Blocks of 2 × 2 entries, row by row, of the stiffness matrices of the slices of
                each layer, shape (layers, blocks, 4), layers at least 1.

        Yields:
            Matrix in CSR of all unknowns of a plane, or for bubbles of those of its vertices. The
            arrays of indices are shared by all blocks of a kind.
        """
        # A level is the upper end of the layer below it and the lower end of the layer above it.
        lower = [self._lower_hats.entries(layer) for layer in blocks]
        upper = [self._upper_hats.entries(layer) for layer in blocks]
        # Nothing is below the first level, and nothing above the last one.
        nothing: Array = np.zeros(lower[0].shape)
        upper.insert(0, nothing)
        lower.append(nothing)
        for from_below, from_above in zip(upper, lower, strict=True):
            yield self._lower_hats.matrix(from_below + from_above)
        for layer in blocks:
            yield self._bubbles.matrix(self._bubbles.entries(layer))


class LayerMatrix:
    """The reduced stiffness K = Σ Qᵀ A_k Q; a context of PETSc's ``python`` matrix.

    Args:
        pattern: Pattern of A_k.
        blocks: Blocks of A_k of all layers, shape (layers, blocks, 4).
    """

    def __init__(self, pattern: LayerPattern, blocks: Array) -> None:
        self._pattern = pattern
        self._blocks = blocks
        self._layers = pattern.block_diagonal(blocks)

    def mult(self, _matrix: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Set y to K x, with K = Σ_k Qᵀ A_k Q; called by PETSc.

        A_k is the stiffness of the slices of layer k, and Q leads from the unknowns of a layer to
        the displacements of its slices. Several x may stand one after another in a vector. They are
        multiplied together, which takes little longer than one of them, since matrices are read
        once.

        Args:
            x: One or several vectors of unknowns, level by level.
            y: Vector of the same length, which is overwritten.
        """
        constraint = self._pattern.constraint
        fields = x.array_r.reshape(-1, constraint.numbering.size)
        u = constraint.displacements(fields)
        products = self._layers.matMult(columns(u.reshape(len(fields), -1)))
        on_slices = products.getDenseArray().T.reshape(u.shape)
        y.array[:] = constraint.forces(on_slices).ravel()

    def level_blocks(self) -> Iterator[sp.csr_matrix]:
        """Yield the blocks of the hats of all levels, then of the bubbles of all mid-levels."""
        return self._pattern.level_blocks(self._blocks)


def layer_interpolation(plane: Triangulation, heights: Array) -> sp.csr_matrix:
    """Return the matrix from nodal values of a layer of prisms to nodal values on its slices.

    At the height ζ the value is (1 − ζ) below + ζ above + 4 ζ (1 − ζ) (middle − (below + above) /
    2), with the values on the level below, the level above and the mid-level. At a midpoint of an
    edge the last factor is the mean of its values at the two ends, since the mid-level has values
    at vertices alone.

    Args:
        plane: The plane mesh of six-node triangles, its vertices numbered first.
        heights: Height ζ of each slice in the layer, from 0 at the level below to 1, shape
            (slices,).

    Returns:
        Sparse matrix. Its rows are the nodes of one slice after another. Its columns are the nodes
        of the level below, the vertices of the mid-level, and the nodes of the level above.
    """
    num_nodes, num_vertices = len(plane.points), plane.vertices
    midpoints = np.repeat(np.arange(num_nodes - num_vertices), 2)
    halves = sp.csr_matrix((np.full(plane.ends.size, 0.5), (midpoints, plane.ends.ravel())))
    injection = sp.vstack([sp.eye(num_vertices), halves])  # from vertices to all nodes of a plane
    vertex_injection = injection @ sp.eye(num_vertices, num_nodes)  # from the nodes of a level
    ζ = heights[:, np.newaxis]
    correction = sp.kron(2 * ζ * (1 - ζ), vertex_injection)
    below = sp.kron(1 - ζ, sp.eye(num_nodes)) - correction
    above = sp.kron(ζ, sp.eye(num_nodes)) - correction
    return sp.hstack([below, sp.kron(4 * ζ * (1 - ζ), injection), above], "csr")


def _periodicity(numbering: LevelNumbering) -> sp.csr_matrix:
    """Return the matrix of zeros and ones from the pairs of unknowns of a layer to its nodes.

    Args:
        numbering: `planar`, the number of the pair of unknowns (two displacements) of each node of
            a plane, the same for periodic partners and −1 where a node is held; and the numbers of
            unknowns of a level (`level_size`) and of a level with its mid-level (`stride`).

    Returns:
        Sparse matrix. Rows are the nodes of the level below, the vertices of the mid-level and the
        nodes of the level above; a node that is held has no entry. Columns are the pairs of
        unknowns in the same order.
    """
    planar = numbering.planar
    vertices = planar[: numbering.grid.plane.vertices]
    first_on_mid_level = numbering.level_size // 2
    first_above = numbering.stride // 2
    pair = np.concatenate([planar, vertices + first_on_mid_level, planar + first_above])
    is_free = np.concatenate([planar, vertices, planar]) >= 0
    ones = np.ones(np.count_nonzero(is_free))
    places = np.flatnonzero(is_free), pair[is_free]
    return sp.csr_matrix((ones, places), (len(pair), first_above + first_on_mid_level))


def _rows(pattern: sp.bsr_matrix) -> Ints:
    """Return the row of each block of a matrix."""
    return np.repeat(np.arange(len(pattern.indptr) - 1), np.diff(pattern.indptr))


def _scalar_pattern(pattern: sp.bsr_matrix) -> sp.csr_matrix:
    """Return the CSR pattern of a matrix of blocks of 2 × 2.

    Args:
        pattern: Matrix of blocks; its values are not used.

    Returns:
        Matrix whose values are places: the index of each entry in the flattened array of all
        blocks, which has the shape (blocks, 2, 2).
    """
    places = np.arange(pattern.data.size).reshape(-1, 2, 2)
    blocks = sp.bsr_matrix((places, pattern.indices, pattern.indptr), pattern.shape)
    return blocks.tocsr()
