"""Unknowns of the product space level by level, and their reduced matrix: K_per = Pᵀ K P.

P only renumbers: every node becomes one pair of unknowns or, on the fixed line, none. So it needs
no matrix product; PETSc's local-to-global map carries it, and DOLFINx adds element matrices where
they belong. The order is: the planar unknowns of level 0, those of the vertices on the mid-level
above, those of level 1, and so on. A rank owns levels with the mid-level above each.
"""

from __future__ import annotations

from functools import cached_property
from typing import TypeVar

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from alphacut.base.arrays import Array, Ints
from alphacut.rve.fenicsx import MPI, PETSc
from alphacut.rve.mesh.periodicity import unknowns
from alphacut.rve.mesh.prism_grid import PrismGrid

Number = TypeVar("Number", bound=np.generic)


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
        self._num_nodes = len(pairs)
        self._local_and_global_size = (len(rows), size)  # of this rank, and of all
        self._local_to_global = PETSc.LGMap().create(
            pairs.astype(PETSc.IntType), bsize=2, comm=comm
        )
        self.matrix = self._zero_matrix(cells, rows)

        # Values of the unknowns of this rank's nodes are fetched from the ranks that own them.
        self._free_nodes = np.flatnonzero(pairs >= 0)
        blocks = pairs[self._free_nodes].astype(PETSc.IntType)
        needed = PETSc.IS().createBlock(2, blocks, comm=PETSc.COMM_SELF)
        self._values = PETSc.Vec().createSeq(2 * len(blocks), comm=PETSc.COMM_SELF)
        vector = self.matrix.createVecRight()
        self._scatter = PETSc.Scatter().create(vector, needed, self._values, None)

    def _zero_matrix(self, cells: Ints, rows: range) -> PETSc.Mat:
        """Return a PETSc matrix of zeros with entries for all pairs of unknowns that share a cell.

        Args:
            cells: Pairs of the nodes of all cells that touch this rank's rows, −1 where a node is
                held, shape (cells, nodes of a cell).
            rows: Unknowns of this rank, two for each pair.

        Returns:
            This rank's rows of the matrix, marked as symmetric positive definite. Entries at held
            nodes are dropped when they are added by local numbers.
        """
        num_pairs = self._local_and_global_size[1] // 2
        has_unknown = cells >= 0
        all_cells = np.arange(len(cells))[:, np.newaxis]
        cell = np.broadcast_to(all_cells, cells.shape)[has_unknown]
        ones = np.ones(len(cell), np.int8)
        places = (cell, cells[has_unknown])
        cell_to_pair = sp.csr_matrix((ones, places), (len(cells), num_pairs))
        pair_to_cell = cell_to_pair.T.tocsr()[rows.start // 2 : rows.stop // 2]
        # The product has an entry where two pairs share a cell. Its value is not used.
        neighbours = pair_to_cell @ cell_to_pair
        neighbours.sort_indices()

        blocks = np.broadcast_to(np.int8(1), (neighbours.nnz, 2, 2))
        bsr = blocks, neighbours.indices, neighbours.indptr
        pattern = sp.bsr_matrix(bsr, shape=self._local_and_global_size).tocsr()
        indptr = pattern.indptr.astype(PETSc.IntType)
        indices = pattern.indices.astype(PETSc.IntType)
        matrix = PETSc.Mat().createAIJ(
            (self._local_and_global_size, self._local_and_global_size),
            bsize=2,
            comm=self._local_to_global.comm,
        )
        matrix.setPreallocationCSR((indptr, indices, np.zeros(pattern.nnz)))
        matrix.setLGMap(self._local_to_global, self._local_to_global)
        matrix.setOption(PETSc.Mat.Option.SPD, True)
        return matrix

    def forces(self, values: Array) -> PETSc.Vec:
        """Return the reduced forces Pᵀ f, added up over periodic partners and over ranks.

        The matrix P leads from the unknowns to the displacements of nodes. All ranks must call.

        Args:
            values: Forces on this rank's nodes, shape (2 nodes,); the two components of a node are
                adjacent. Forces on held nodes are left out.
        """
        vector = PETSc.Vec().createMPI(
            self._local_and_global_size, bsize=2, comm=self._local_to_global.comm
        )
        vector.setLGMap(self._local_to_global)
        nodes = np.arange(self._num_nodes, dtype=PETSc.IntType)
        vector.setValuesBlockedLocal(nodes, values, addv=PETSc.InsertMode.ADD_VALUES)
        vector.assemble()
        return vector

    def displacements(self, vector: PETSc.Vec) -> Array:
        """Return P U at this rank's nodes, zero where held, shape (nodes, 2)."""
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
        planar: Unknown of each planar node, −1 where held, shape (n,); vertices' come first.
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
        self.grid = grid
        self.planar = unknowns(grid.plane.points, grid.plane.lattice)
        self.level_size = 2 * (int(self.planar.max()) + 1)
        self.mid_level_size = 2 * (int(self.planar[: grid.plane.vertices].max()) + 1)
        self.stride = self.level_size + self.mid_level_size
        self.size = grid.layers * self.stride + self.level_size

        # The last ranks have a level more, and with it no mid-level above their last one. So levels
        # go with the prisms, which are divided evenly, and few entries are of other ranks.
        first = (grid.layers + 1) * comm.rank // comm.size
        last = (grid.layers + 1) * (comm.rank + 1) // comm.size
        self.levels = range(first, last)
        self.mid_levels = range(first, min(last, grid.layers))
        self.rows = range(min(first * self.stride, self.size), min(last * self.stride, self.size))
        self.layers = range(max(0, first - 1), self.mid_levels.stop) if self.levels else range(0)

    @cached_property
    def pairs(self) -> Ints:
        """Number of each node's pair of unknowns, −1 where it is held at 0, shape (nodes,).

        The pair p stands for the unknowns 2 p and 2 p + 1, the two displacements. Nodes are those
        of the grid: of all levels, and then the vertices of all mid-levels.
        """
        vertices = self.planar[: self.grid.plane.vertices]
        first_on_level = np.arange(self.grid.layers + 1)[:, np.newaxis] * (self.stride // 2)
        first_on_mid_level = first_on_level[:-1] + self.level_size // 2
        on_levels = np.where(self.planar >= 0, self.planar + first_on_level, -1)
        on_mid_levels = np.where(vertices >= 0, vertices + first_on_mid_level, -1)
        return np.concatenate([on_levels.ravel(), on_mid_levels.ravel()])

    def split(self, fields: NDArray[Number]) -> tuple[NDArray[Number], NDArray[Number]]:
        """Return the coefficients of hat and of bubble functions of θ as views of one array.

        Hat functions are piecewise linear, one at each level of θ; bubble functions are quadratic,
        one in each layer between two levels, at the vertices of the triangles alone.

        Args:
            fields: Coefficients of the hats of all levels, then of the bubbles of all layers, shape
                (…, size).

        Returns:
            Hats, shape (…, layers + 1, unknowns of a level), and bubbles, shape (…, layers,
            unknowns of the vertices of a level).
        """
        layers = self.grid.layers
        first_bubble = (layers + 1) * self.level_size
        shape = fields.shape[:-1]
        hats = fields[..., :first_bubble].reshape(*shape, layers + 1, -1)
        return hats, fields[..., first_bubble:].reshape(*shape, layers, -1)

    def nodal_values(self) -> sp.csr_matrix:
        """Return the matrix from coefficients of hats and bubbles along θ to nodal values.

        The value on a level is its hat coefficient. The value on a mid-level, half-way between two
        levels, is its bubble coefficient plus the mean of the hats above and below.

        Returns:
            Square sparse matrix. Its columns are the hats of all levels, then the bubbles of all
            mid-levels. Its rows are the unknowns level by level: of level 0, of the mid-level above
            it, of level 1, and so on.
        """
        layers = self.grid.layers
        vertices = np.arange(self.mid_level_size)
        hats, bubbles = self.split(np.arange(self.size))
        on_levels = np.arange(layers + 1)[:, np.newaxis] * self.stride + np.arange(self.level_size)
        # The unknowns of vertices stand first on a level, so that hats at vertices are a slice.
        on_mid_levels = on_levels[:-1, :1] + self.level_size + vertices
        below = hats[:-1, : self.mid_level_size]
        above = hats[1:, : self.mid_level_size]
        rows = np.concatenate([on_levels.ravel(), np.tile(on_mid_levels.ravel(), 3)])
        columns = np.concatenate([part.ravel() for part in (hats, bubbles, below, above)])
        ones = np.ones(hats.size + bubbles.size)
        values = np.concatenate([ones, np.full(2 * bubbles.size, 0.5)])
        return sp.csr_matrix((values, (rows, columns)), (self.size, self.size))
