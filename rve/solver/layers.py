"""Layers of the product space between its unknowns and DOLFINx: the constraint u = Q x.

A displacement of the prisms has nodal values U_k on level k, at all nodes of its triangles, and M_k
on the mid-level above it, at vertices alone. At height ζ of layer k it is one of six-node
triangles,

    u = (1 − ζ) U_k + ζ U_k+1 + 4 ζ (1 − ζ) J (M_k − (V_k + V_k+1) / 2),

where V_k are the values of U_k at vertices and J injects linear into quadratic triangles. With
periodicity and the fixed corner this is u = Q x on the slices of a layer, for the unknowns x of its
two levels and its mid-level. Q is the same for all layers, and the reduced stiffness is
K = Σ_k Q_kᵀ A_k Q_k, where A_k is what DOLFINx assembles over the slices of layer k.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from alphacut.base.arrays import Array, Ints
from alphacut.rve.fenicsx import PETSc
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
        indptr, indices: Pattern of Bᵀ A B in CSR.
    """

    sums: sp.csr_matrix
    indptr: Ints
    indices: Ints

    def scaled(self, factors: Array) -> sp.csr_matrix:
        """Return `sums` of entries of A that are multiplied by factors, one for each."""
        return self.sums @ sp.diags(factors)


class LayerConstraint:
    """The constraint u = Q x of the slices of any layer by the unknowns of its levels.

    Args:
        numbering: Reduced unknowns, all on this rank.
        heights: ζ of the slices, inside (0, 1), shape (slices,).
        node: Number of each node of DOLFINx's space: slice after slice, in each as in the plane
            mesh; shape (nodes,).
        pattern: Pattern of DOLFINx's matrix in that space, in blocks of 2 × 2.

    Attributes:
        windows: Unknowns of each layer, those of its levels and mid-level.
        matrix: Q, shape (2 nodes, unknowns of a layer).
        transposed: Qᵀ.
    """

    def __init__(
        self, numbering: LevelNumbering, heights: Array, node: Ints, pattern: sp.bsr_matrix
    ) -> None:
        plane = numbering.grid.plane
        pairs = layer_interpolation(plane, heights)[node] @ _periodicity(numbering)
        self.matrix = sp.kron(pairs, sp.eye(2), "csr")
        self.transposed = self.matrix.T.tocsr()
        width, layers = self.matrix.shape[1], range(numbering.grid.layers)
        self.windows = [slice(k * numbering.stride, k * numbering.stride + width) for k in layers]
        self._pattern = _scalar_pattern(pattern)
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

    def scalar_matrix(self, values: Array) -> sp.csr_matrix:
        """Return A_k from the values of DOLFINx's matrix, in the order of its blocks; copied."""
        pattern = self._pattern
        return sp.csr_matrix((values[pattern.data], pattern.indices, pattern.indptr), pattern.shape)

    def level_blocks(self, layers: list[sp.csr_matrix]) -> Iterator[sp.csr_matrix]:
        """Yield the blocks of the hats of all levels, then of the bubbles of all mid-levels."""
        values = [layer.data for layer in layers]
        below = [*(self._lower @ x for x in values), 0.0]  # of the layer above each level
        above = [0.0, *(self._upper @ x for x in values)]
        for from_above, from_below in zip(below, above, strict=True):
            yield _csr(from_above + from_below, self._hats)
        for x in values:
            yield _csr(self._bubble @ x, self._bubbles)


class LayerMatrix:
    """K = Σ_k Q_kᵀ A_k Q_k; a context of PETSc's ``python`` matrix."""

    def __init__(self, constraint: LayerConstraint, layers: list[sp.csr_matrix]) -> None:
        self._constraint, self._layers = constraint, layers

    def mult(self, _matrix: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Set y to K x; called by PETSc."""
        constraint, unknowns, result = self._constraint, x.array_r, np.zeros(x.local_size)
        for window, stiffness in zip(constraint.windows, self._layers, strict=True):
            displacements = constraint.matrix @ unknowns[window]
            result[window] += constraint.transposed @ (stiffness @ displacements)
        y.array[:] = result

    def level_blocks(self) -> Iterator[sp.csr_matrix]:
        """Yield the blocks of the hats of all levels, then of the bubbles of all mid-levels."""
        return self._constraint.level_blocks(self._layers)


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
    return BlockSum(by_component[:, _scalar_pattern(pattern).data], scalar.indptr, scalar.indices)


def _scalar_pattern(pattern: sp.bsr_matrix) -> sp.csr_matrix:
    """Return the CSR pattern of a block matrix; its values are their places among the blocks'."""
    places = np.arange(pattern.data.size).reshape(-1, 2, 2)
    blocks = sp.bsr_matrix((places, pattern.indices, pattern.indptr), pattern.shape)
    return blocks.tocsr()


def _csr(values: Array, pattern: BlockSum) -> sp.csr_matrix:
    return sp.csr_matrix((values, pattern.indices, pattern.indptr))
