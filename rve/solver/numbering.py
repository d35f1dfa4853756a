"""Unknowns of the product space level by level, and their reduced matrix: K_per = Pᵀ K P.

P only renumbers: every node becomes one pair of unknowns or, on the fixed line, none. So it needs
no matrix product; PETSc's local-to-global map carries it, and DOLFINx adds element matrices where
they belong. The order is: the planar unknowns of level 0, those of the vertices on the mid-level
above, those of level 1, and so on. A rank owns levels with the mid-level above each.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp

from alphacut.base.arrays import Array, Ints
from alphacut.rve.fenicsx import MPI, PETSc
from alphacut.rve.mesh.periodicity import unknowns
from alphacut.rve.mesh.prism_grid import PrismGrid


class Elimination:
    """The constraint u = P U of nodal values u by pairs of unknowns U, over the ranks of `comm`.

    Args:
        pairs: Number p of the pair of each node of this rank, whose unknowns are 2p and 2p + 1,
            −1 where the node is held, shape (nodes,).
        cells: Pairs of the nodes of all cells that touch this rank's rows, shape (cells, nodes).
        rows: Unknowns of this rank.
        size: Number of unknowns of all ranks.
        comm: Communicator.

    Attributes:
        matrix: Zeros in the pattern of all unknowns that share a cell, for Pᵀ K P.
    """

    def __init__(
        self, pairs: Ints, cells: Ints, rows: range, size: int, comm: MPI.Intracomm
    ) -> None:
        self._num_nodes, self._sizes = len(pairs), (len(rows), size)
        self._map = PETSc.LGMap().create(pairs.astype(PETSc.IntType), bsize=2, comm=comm)
        self.matrix = self._zero_matrix(cells, rows)
        self._free_nodes = np.flatnonzero(pairs >= 0)
        blocks = pairs[self._free_nodes].astype(PETSc.IntType)
        needed = PETSc.IS().createBlock(2, blocks, comm=PETSc.COMM_SELF)
        self._values = PETSc.Vec().createSeq(2 * len(blocks), comm=PETSc.COMM_SELF)
        vector = self.matrix.createVecRight()
        self._scatter = PETSc.Scatter().create(vector, needed, self._values, None)

    def _zero_matrix(self, cells: Ints, rows: range) -> PETSc.Mat:
        has_unknown, size = cells >= 0, self._sizes[1]
        cell = np.broadcast_to(np.arange(len(cells))[:, None], cells.shape)[has_unknown]
        unit = np.ones(len(cell), np.int8)
        cell_to_pair = sp.csr_matrix((unit, (cell, cells[has_unknown])), (len(cells), size // 2))
        pair_to_cell = cell_to_pair.T.tocsr()[rows.start // 2 : rows.stop // 2]
        neighbours = pair_to_cell @ cell_to_pair
        neighbours.sort_indices()
        blocks = np.broadcast_to(np.int8(1), (neighbours.nnz, 2, 2))
        bsr = blocks, neighbours.indices, neighbours.indptr
        pattern = sp.bsr_matrix(bsr, shape=self._sizes).tocsr()
        indptr, indices = (x.astype(PETSc.IntType) for x in (pattern.indptr, pattern.indices))
        matrix = PETSc.Mat().createAIJ((self._sizes, self._sizes), bsize=2, comm=self._map.comm)
        matrix.setPreallocationCSR((indptr, indices, np.zeros(pattern.nnz)))
        matrix.setLGMap(self._map, self._map)
        matrix.setOption(PETSc.Mat.Option.SPD, True)
        return matrix

    def forces(self, values: Array) -> PETSc.Vec:
        """Pᵀ f of forces on this rank's nodes, (nodes · 2,): those of partners are added."""
        vector = PETSc.Vec().createMPI(self._sizes, bsize=2, comm=self._map.comm)
        vector.setLGMap(self._map)
        nodes = np.arange(self._num_nodes, dtype=PETSc.IntType)
        vector.setValuesBlockedLocal(nodes, values, addv=PETSc.InsertMode.ADD_VALUES)
        vector.assemble()
        return vector

    def displacements(self, vector: PETSc.Vec) -> Array:
        """P U of this rank's nodes, zero where held, shape (nodes, 2)."""
        self._scatter.scatter(vector, self._values)
        displacements = np.zeros((self._num_nodes, 2))
        displacements[self._free_nodes] = self._values.array_r.reshape(-1, 2)
        return displacements


class LevelNumbering:
    """Numbering of the unknowns after elimination, two at each remaining node.

    Args:
        grid: Topology.
        comm: Communicator.

    Attributes:
        planar: Unknown of each planar node, −1 at the corners, shape (n,); vertices' come first.
        level_size: Number of unknowns of a level.
        mid_level_size: Number of unknowns of a mid-level, half-way between two: those of vertices.
        stride: Sum of both.
        size: Number of unknowns of all ranks.
        levels: Levels of this rank.
        mid_levels: Mid-levels of this rank.
        rows: Unknowns of this rank.
        layers: Layers with a cell that has one of these unknowns.
    """

    def __init__(self, grid: PrismGrid, comm: MPI.Intracomm) -> None:
        self.grid, self.planar = grid, unknowns(grid.plane.points)
        self.level_size = 2 * (int(self.planar.max()) + 1)
        self.mid_level_size = 2 * (int(self.planar[: grid.plane.vertices].max()) + 1)
        self.stride = self.level_size + self.mid_level_size
        self.size = grid.layers * self.stride + self.level_size
        # the last ranks have a level more, and with it no mid-level above their last one: so
        # levels go with the prisms that are divided evenly, and few entries are of other ranks
        first, last = ((grid.layers + 1) * k // comm.size for k in (comm.rank, comm.rank + 1))
        self.levels, self.mid_levels = range(first, last), range(first, min(last, grid.layers))
        ends = (min(k * self.stride, self.size) for k in (first, last))
        self.rows = range(*ends)
        self.layers = range(max(0, first - 1), self.mid_levels.stop) if self.levels else range(0)

    @cached_property
    def pairs(self) -> Ints:
        """Number p of each node's pair of displacements, −1 where held."""
        planar, layers = self.planar, self.grid.layers
        vertices = planar[: self.grid.plane.vertices]
        first_pair = np.arange(layers + 1)[:, None] * (self.stride // 2)  # of each level
        on_levels = np.where(planar >= 0, planar + first_pair, -1)
        mid_first = first_pair[:-1] + self.level_size // 2
        on_mid_levels = np.where(vertices >= 0, vertices + mid_first, -1)
        return np.concatenate([on_levels.ravel(), on_mid_levels.ravel()])

    def split(self, fields: Any) -> tuple[Any, Any]:
        """Views of hats, (…, layers + 1, n), and bubbles, (…, layers, v), of fields, (…, size).

        In these a field is the hats of all levels, then the bubbles of all mid-levels.
        """
        layers, first_bubble = self.grid.layers, (self.grid.layers + 1) * self.level_size
        hats, bubbles = fields[..., :first_bubble], fields[..., first_bubble:]
        shape = fields.shape[:-1]
        return hats.reshape(*shape, layers + 1, -1), bubbles.reshape(*shape, layers, -1)

    def nodal_values(self) -> sp.csr_matrix:
        """Matrix from hats and bubbles, as in `split`, to unknowns: to nodal values."""
        layers, v = self.grid.layers, self.mid_level_size
        hats, bubbles = self.split(np.arange(self.size))
        on_levels = np.arange(layers + 1)[:, None] * self.stride + np.arange(self.level_size)
        on_mid_levels = np.arange(layers)[:, None] * self.stride + self.level_size + np.arange(v)
        # a mid-level has its bubble and half of the hats above and below
        rows = [on_levels, on_mid_levels, on_mid_levels, on_mid_levels]
        columns = [hats, bubbles, hats[:-1, :v], hats[1:, :v]]
        values = np.repeat([1.0, 1.0, 0.5, 0.5], [part.size for part in rows])
        places = tuple(np.concatenate([part.ravel() for part in x]) for x in (rows, columns))
        return sp.csr_matrix((values, places), (self.size, self.size))
