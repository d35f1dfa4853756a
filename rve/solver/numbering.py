"""Unknowns of the product space level by level, and their reduced matrix: K_per = Pᵀ K P.

P only renumbers: every node becomes one pair of unknowns or, on the fixed line, none. So it needs
no matrix product; PETSc's local-to-global map carries it, and DOLFINx adds element matrices where
they belong. The order is: the planar unknowns of level 0, those of the vertices on
the mid-level above, those of level 1, and so on. A rank owns levels with the mid-level above each.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp

from alphacut.fuzzy.arrays import Array, Ints
from alphacut.rve.fenicsx import MPI, PETSc
from alphacut.rve.mesh.periodicity import identify
from alphacut.rve.mesh.prism_grid import PrismGrid


def map_of(pairs: Ints, comm: MPI.Intracomm) -> PETSc.LGMap:
    """PETSc's local-to-global map of nodes to their pairs of unknowns, −1 where eliminated."""
    return PETSc.LGMap().create(pairs.astype(PETSc.IntType), bsize=2, comm=comm)


def zero_matrix(pairs: Ints, local_map: PETSc.LGMap, rows: range, size: int) -> PETSc.Mat:
    """PETSc matrix of zeros with the sparsity pattern of all unknowns that share a cell.

    Args:
        pairs: Pair number of each node of the cells that touch these rows, −1 where eliminated,
            shape (cells, nodes).
        local_map: Nodes of this rank to pairs of unknowns.
        rows: Unknowns of this rank.
        size: Number of unknowns of all ranks.
    """
    has_unknown = pairs >= 0
    cell = np.broadcast_to(np.arange(len(pairs))[:, None], pairs.shape)[has_unknown]
    ones = np.ones(len(cell), np.int8)
    cell_to_pair = sp.csr_matrix((ones, (cell, pairs[has_unknown])), (len(pairs), size // 2))
    pair_to_cell = cell_to_pair.T.tocsr()[rows.start // 2 : rows.stop // 2]
    neighbours = pair_to_cell @ cell_to_pair
    neighbours.sort_indices()
    blocks = np.broadcast_to(np.int8(1), (neighbours.nnz, 2, 2))
    bsr = blocks, neighbours.indices, neighbours.indptr
    pattern = sp.bsr_matrix(bsr, shape=(len(rows), size)).tocsr()
    indptr, indices = (x.astype(PETSc.IntType) for x in (pattern.indptr, pattern.indices))
    sizes = (len(rows), size)
    matrix = PETSc.Mat().createAIJ((sizes, sizes), bsize=2, comm=local_map.comm)
    matrix.setPreallocationCSR((indptr, indices, np.zeros(pattern.nnz)))
    matrix.setLGMap(local_map, local_map)
    matrix.setOption(PETSc.Mat.Option.SPD, True)
    return matrix


def reduced_vector(values: Array, local_map: PETSc.LGMap, num_rows: int, size: int) -> PETSc.Vec:
    """PETSc vector of unknowns, `num_rows` of `size` here: nodal values, partners' added."""
    vector = PETSc.Vec().createMPI((num_rows, size), bsize=2, comm=local_map.comm)
    vector.setLGMap(local_map)
    nodes = np.arange(len(values) // 2, dtype=PETSc.IntType)
    vector.setValuesBlockedLocal(nodes, values, addv=PETSc.InsertMode.ADD_VALUES)
    vector.assemble()
    return vector


class NodeScatter:
    """Scatter of vectors of unknowns, as `vector` is one, to this rank's nodes by `pairs`."""

    def __init__(self, pairs: Ints, vector: PETSc.Vec) -> None:
        self._free_nodes = np.flatnonzero(pairs >= 0)
        self._shape = len(pairs), 2
        blocks = pairs[self._free_nodes].astype(PETSc.IntType)
        needed = PETSc.IS().createBlock(2, blocks, comm=PETSc.COMM_SELF)
        self._values = PETSc.Vec().createSeq(2 * len(blocks), comm=PETSc.COMM_SELF)
        self._scatter = PETSc.Scatter().create(vector, needed, self._values, None)

    def __call__(self, vector: PETSc.Vec) -> Array:
        """Displacements of the nodes, zero where eliminated, shape (nodes, 2)."""
        self._scatter.scatter(vector, self._values)
        displacements = np.zeros(self._shape)
        displacements[self._free_nodes] = self._values.array_r.reshape(-1, 2)
        return displacements


class LevelNumbering:
    """Numbering of the unknowns after elimination, two at each remaining node.

    Args:
        grid: Topology.
        comm: Communicator.

    Attributes:
        periodicity: Unknowns of one level.
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
        self.grid, self.periodicity = grid, identify(grid.plane)
        self.level_size = 2 * self.periodicity.count
        self.mid_level_size = 2 * self.periodicity.vertices
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
        """Number p of each node's pair of displacements, unknowns 2p and 2p + 1, −1 where held."""
        planar, layers = self.periodicity.unknown, self.grid.layers
        vertices = planar[: self.grid.plane.vertices]
        first_pair = np.arange(layers + 1)[:, None] * (self.stride // 2)  # of each level
        on_levels = np.where(planar >= 0, planar + first_pair, -1)
        mid_first = first_pair[:-1] + self.level_size // 2
        on_mid_levels = np.where(vertices >= 0, vertices + mid_first, -1)
        return np.concatenate([on_levels.ravel(), on_mid_levels.ravel()])

    @property
    def rank_levels(self) -> tuple[slice, slice]:
        """Levels and mid-levels of this rank among all."""
        levels, mid_levels = self.levels, self.mid_levels
        return slice(levels.start, levels.stop), slice(mid_levels.start, mid_levels.stop)

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
