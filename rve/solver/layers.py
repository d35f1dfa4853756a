"""Layers of the product space between its unknowns and DOLFINx: the constraint u = Q x.

A displacement of the prisms has nodal values U_k on level k, at all nodes of its triangles, and M_k
on the mid-level above it, at vertices alone. At height ζ of layer k it is one of six-node
triangles,

    u = (1 − ζ) U_k + ζ U_k+1 + 4 ζ (1 − ζ) J (M_k − (V_k + V_k+1) / 2),

where V_k are the values of U_k at vertices and J injects linear into quadratic triangles. With
periodicity and the fixed corner this is u = Q x on the slices of a layer, for the unknowns x of its
two levels and its mid-level, and the reduced stiffness is K = Qᵀ diag(A_k) Q, where A_k is what
DOLFINx assembles over the slices of layer k.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from alphacut.base.arrays import Array, Ints
from alphacut.rve.fenicsx import PETSc, aij, columns
from alphacut.rve.mesh.prism_grid import Triangulation
from alphacut.rve.solver.numbering import LevelNumbering
from alphacut.rve.solver.theta_preconditioner import interpolated_vertices


@dataclass(frozen=True)
class BlockSum:
    """Entries of Bᵀ A B as sums of those of A, for matrices A of one pattern.

    SciPy's product would leave out sums that are zero by chance, so that its pattern depended on
    the entries of A.

    Args:
        sums: Matrix from the entries of A to those of Bᵀ A B, both in the order of CSR.
        block: Bᵀ A B, whose entries are set anew for each A.
    """

    sums: sp.csr_matrix
    block: sp.csr_matrix

    def scaled(self, factors: Array) -> sp.csr_matrix:
        """Return `sums` of entries of A that are multiplied by factors, one for each."""
        return self.sums @ sp.diags(factors)

    def filled(self, entries: Array) -> sp.csr_matrix:
        """Return `block` with these entries; the next call changes it."""
        self.block.data = entries
        return self.block


class LayerConstraint:
    """The constraint u = Q x of all slices, layer after layer, by the unknowns of the levels.

    Args:
        numbering: Reduced unknowns, all on this rank.
        heights: ζ of the slices, inside (0, 1), shape (slices,).
        node: Number of each node of DOLFINx's space on the slices of a layer: slice after slice, in
            each as in the plane mesh; shape (nodes,).
        pattern: Pattern of DOLFINx's matrix in that space, in blocks of 2 × 2.

    Attributes:
        matrix: Q, shape (layers · 2 nodes, unknowns).
        transposed: Qᵀ.
    """

    def __init__(
        self, numbering: LevelNumbering, heights: Array, node: Ints, pattern: sp.bsr_matrix
    ) -> None:
        plane, layers = numbering.grid.plane, numbering.grid.layers
        of_layer = layer_interpolation(plane, heights)[node] @ _periodicity(numbering)
        Q = sp.kron(of_layer, sp.eye(2), "coo")
        layer = np.arange(layers)[:, None]
        places = (Q.row + layer * Q.shape[0]).ravel(), (Q.col + layer * numbering.stride).ravel()
        shape = layers * Q.shape[0], numbering.size
        all_layers = sp.csr_matrix((np.tile(Q.data, layers), places), shape)
        self.matrix, self.transposed = aij(all_layers), aij(all_layers.T.tocsr())
        self._pattern = _scalar_pattern(pattern)
        # the CSR pattern of diag(A_k): `sp.kron` and `sp.block_diag` take ten times as long
        rows, entries = self._pattern.shape[0], self._pattern.nnz
        starts = np.append(0, (self._pattern.indptr[1:] + layer * entries).ravel())
        self._indptr = starts.astype(PETSc.IntType)
        self._indices = (self._pattern.indices + layer * rows).ravel().astype(PETSc.IntType)
        # The preconditioner's blocks are Bᵀ A B with B from hats, then from bubbles, to the slices:
        # (1 − ζ), ζ at a node, and 4 ζ (1 − ζ) / 2 from both ends of the edge of a midpoint.
        on_slice, plane_node = np.divmod(node, len(plane.points))
        unknown = numbering.planar[plane_node]
        ends = np.where(unknown[:, None] < 0, -1, interpolated_vertices(numbering)[unknown])
        row = np.repeat(np.repeat(on_slice, 2), np.diff(self._pattern.indptr))  # slice of an entry
        lower, upper = 1 - heights[row], heights[row]
        hats, bubbles = (_block_sum(pattern, x) for x in (unknown[:, None], ends))
        self._hats, self._bubbles = hats, bubbles
        self._lower, self._upper = hats.scaled(lower**2), hats.scaled(upper**2)
        self._bubble = bubbles.scaled((2 * lower * upper) ** 2)

    def empty_values(self) -> Array:
        """Return an array for the values of A_k in CSR, shape (layers, entries)."""
        entries = self._pattern.nnz
        return np.empty((len(self._indices) // entries, entries))

    def set_layer(self, values: Array, blocks: Array) -> None:
        """Set the values of a layer, (entries,), to those of DOLFINx's blocks."""
        np.take(blocks, self._pattern.data, out=values, mode="clip")  # "raise" copies

    def block_diagonal(self, values: Array) -> PETSc.Mat:
        """Return diag(A_k) on the values of all layers, shape (layers, entries)."""
        size = len(self._indptr) - 1
        csr = values.ravel(), self._indices, self._indptr
        return aij(sp.csr_matrix(csr, (size, size)))

    def level_blocks(self, values: Array) -> Iterator[sp.csr_matrix]:
        """Yield the blocks of the hats of all levels, then of the bubbles of all mid-levels."""
        below = [*(self._lower @ x for x in values), 0.0]  # of the layer above each level
        above = [0.0, *(self._upper @ x for x in values)]
        for from_above, from_below in zip(below, above, strict=True):
            yield self._hats.filled(from_above + from_below)
        for x in values:
            yield self._bubbles.filled(self._bubble @ x)


class LayerMatrix:
    """K = Qᵀ diag(A_k) Q; a context of PETSc's ``python`` matrix.

    Args:
        constraint: Q and the pattern of A_k.
        values: Those of A_k, shape (layers, entries).
    """

    def __init__(self, constraint: LayerConstraint, values: Array) -> None:
        self._constraint, self._values = constraint, values
        self._layers = constraint.block_diagonal(values)

    def mult(self, _matrix: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Set y to K x; called by PETSc. Several x may stand one after another in a vector.

        They are read and multiplied together, which takes little longer than one.
        """
        Q, transposed = self._constraint.matrix, self._constraint.transposed
        fields = columns(x.array_r.reshape(-1, Q.size[1]))
        forces = self._layers.matMult(Q.matMult(fields))
        products = transposed.matMult(forces)  # named, since its array does not keep it alive
        y.array[:] = products.getDenseArray().T.ravel()

    def level_blocks(self) -> Iterator[sp.csr_matrix]:
        """Yield the blocks of the hats of all levels, then of the bubbles of all mid-levels."""
        return self._constraint.level_blocks(self._values)


def layer_interpolation(plane: Triangulation, heights: Array) -> sp.csr_matrix:
    """Return the matrix from nodal values of a layer of prisms to those of its slices.

    Rows are the nodes of slice after slice; columns those of the level below, the vertices of the
    mid-level, and the nodes of the level above.
    """
    nodes, vertices = len(plane.points), plane.vertices
    midpoints = np.repeat(np.arange(nodes - vertices), 2), plane.ends.ravel()
    halves = sp.csr_matrix((np.full(plane.ends.size, 0.5), midpoints))
    injection = sp.vstack([sp.eye(vertices), halves])  # J
    ζ = heights[:, None]
    bubble = sp.kron(4 * ζ * (1 - ζ), injection)
    half = sp.kron(2 * ζ * (1 - ζ), injection @ sp.eye(vertices, nodes))  # of J V / 2
    below, above = sp.kron(1 - ζ, sp.eye(nodes)), sp.kron(ζ, sp.eye(nodes))
    return sp.hstack([below - half, bubble, above - half], "csr")


def _periodicity(numbering: LevelNumbering) -> sp.csr_matrix:
    """Return the matrix from pairs of unknowns of a layer to its nodes, zero where held."""
    planar, vertices = numbering.planar, numbering.planar[: numbering.grid.plane.vertices]
    mid_first, above_first = numbering.level_size // 2, numbering.stride // 2
    pair = np.concatenate([planar, vertices + mid_first, planar + above_first])
    is_free = np.concatenate([planar, vertices, planar]) >= 0
    values = np.ones(is_free.sum()), (np.flatnonzero(is_free), pair[is_free])
    return sp.csr_matrix(values, (len(pair), above_first + mid_first))


def _block_sum(pattern: sp.bsr_matrix, parents: Ints) -> BlockSum:
    """Return Bᵀ A B of matrices A of 2 × 2 blocks, where B is 1 from each node's parents, else 0.

    `parents` are numbers of pairs of unknowns, −1 for none, shape (nodes, parents).
    """
    entries, size = len(pattern.indices), int(parents.max()) + 1
    node = np.repeat(np.arange(len(parents)), np.diff(pattern.indptr))
    row, column = parents[node][:, :, None], parents[pattern.indices][:, None, :]
    is_free = (row >= 0) & (column >= 0)
    keys, place = np.unique((row * size + column)[is_free], return_inverse=True)
    entry = np.broadcast_to(np.arange(entries)[:, None, None], is_free.shape)[is_free]
    sums = sp.csr_matrix((np.ones(len(place)), (place, entry)), (len(keys), entries))
    indptr = np.searchsorted(keys, np.arange(size + 1) * size)
    blocks = np.ones((len(keys), 2, 2)), keys % size, indptr
    scalar = _scalar_pattern(sp.bsr_matrix(blocks, (2 * size, 2 * size)))
    by_component = sp.kron(sums, sp.eye(4), "csr")[scalar.data]
    return BlockSum(by_component[:, _scalar_pattern(pattern).data], scalar)


def _scalar_pattern(pattern: sp.bsr_matrix) -> sp.csr_matrix:
    """Return the CSR pattern of a block matrix; its values are their places among the blocks'."""
    places = np.arange(pattern.data.size).reshape(-1, 2, 2)
    blocks = sp.bsr_matrix((places, pattern.indices, pattern.indptr), pattern.shape)
    return blocks.tocsr()
