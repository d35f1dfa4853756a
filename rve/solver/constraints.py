"""Elimination of the periodic constraints from the product-space system: K_per = Pᵀ K P.

P only renumbers: every node becomes one unknown pair or none. So it needs no matrix product;
PETSc's local-to-global map carries it and element matrices are added where they belong.

Unknowns are numbered level by level: all planar unknowns of level 0, the vertex unknowns half-way
to level 1, those of level 1, and so on; two displacement components each. On several ranks each
owns whole levels.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from mpi4py import MPI

from alphacut.rve.mesh.periodicity import Periodicity
from alphacut.rve.mesh.prism_grid import PrismGrid
from alphacut.rve.mesh.triangulation import Integers
from alphacut.rve.petsc import PETSc
from alphacut.stochastic.theta.truncated_normal import Array


@dataclass(frozen=True)
class LevelNumbering:
    """Positions of the unknowns of each level.

    Args:
        grid: Topology.
        periodicity: Unknowns of one level.
    """

    grid: PrismGrid
    periodicity: Periodicity

    @property
    def stride(self) -> int:
        """Unknowns from one level to the next."""
        return 2 * (self.periodicity.count + self.periodicity.vertices)

    @property
    def size(self) -> int:
        """Unknowns in all."""
        return self.grid.layers * self.stride + 2 * self.periodicity.count

    @cached_property
    def unknown_of_node(self) -> Integers:
        """First of the two unknowns of each grid node, −1 on the fixed line, shape (nodes,)."""
        planar, vertices = (
            self.periodicity.unknown,
            self.periodicity.unknown[: self.grid.plane.vertices],
        )
        level, middle = (
            np.arange(self.grid.layers + 1)[:, None],
            np.arange(self.grid.layers)[:, None],
        )
        full = np.where(planar >= 0, 2 * planar + level * self.stride, -1)
        half = np.where(
            vertices >= 0, 2 * (vertices + self.periodicity.count) + middle * self.stride, -1
        )
        return np.concatenate([full.ravel(), half.ravel()])

    def local_levels(self, comm: MPI.Comm) -> range:
        """Levels of this rank; with a level goes what lies between it and the next."""
        layers, size = self.grid.layers, comm.size
        first = [-(-layers * rank // size) for rank in range(size)] + [layers + 1]
        return range(first[comm.rank], first[comm.rank + 1])

    def local_layers(self, comm: MPI.Comm) -> range:
        """Layers of this rank."""
        levels = self.local_levels(comm)
        return range(levels.start, min(levels.stop, self.grid.layers))

    def local_size(self, comm: MPI.Comm) -> int:
        """Unknowns of this rank."""
        levels = self.local_levels(comm)
        return len(levels) * self.stride - (
            2 * self.periodicity.vertices if levels.stop > self.grid.layers else 0
        )

    def local_map(self, nodes: Integers, comm: MPI.Comm) -> PETSc.LGMap:
        """Reduced unknowns of DOLFINx's local nodes; −1 where dropped."""
        first = self.unknown_of_node[nodes]
        return PETSc.LGMap().create(
            np.where(first >= 0, first // 2, -1).astype(PETSc.IntType), bsize=2, comm=comm
        )

    def couplings(self) -> sp.csr_matrix:
        """Pattern of unknown pairs that share a wedge, by blocks of 2."""
        pairs = self.unknown_of_node[self.grid.cells] // 2
        kept = pairs >= 0
        cell = np.broadcast_to(np.arange(len(pairs))[:, None], pairs.shape)
        incidence = sp.csr_matrix(
            (np.ones(kept.sum(), np.int8), (cell[kept], pairs[kept])),
            shape=(len(pairs), self.size // 2),
        )
        return (incidence.T @ incidence).astype(bool).tocsr()

    def matrix(self, local_map: PETSc.LGMap, comm: MPI.Comm) -> PETSc.Mat:
        """Zero matrix in 2 × 2 blocks that keeps Pᵀ K P of element matrices."""
        first = sum(comm.allgather(self.local_size(comm))[: comm.rank])
        rows = self.couplings()[first // 2 : (first + self.local_size(comm)) // 2]
        rows.sort_indices()
        csr = (
            rows.indptr.astype(PETSc.IntType),
            rows.indices.astype(PETSc.IntType),
            np.zeros(4 * rows.nnz),
        )
        matrix = PETSc.Mat().createBAIJ(
            ((self.local_size(comm), self.size),) * 2, bsize=2, csr=csr, comm=comm
        )
        matrix.setLGMap(local_map, local_map)
        return matrix

    def vector(self, local_map: PETSc.LGMap, values: Array, comm: MPI.Comm) -> PETSc.Vec:
        """Pᵀ f from contributions in DOLFINx's local numbering, shape (local nodes · 2,)."""
        vector = PETSc.Vec().createMPI((self.local_size(comm), self.size), bsize=2, comm=comm)
        vector.setLGMap(local_map)
        nodes = np.arange(len(values) // 2, dtype=PETSc.IntType)
        vector.setValuesBlockedLocal(nodes, values, addv=PETSc.InsertMode.ADD_VALUES)
        vector.assemble()
        return vector

    def to_nodes(self, solution: Array) -> Array:
        """Displacements of all nodes from the solution, shape (nodes, 2), zero on the line."""
        first = self.unknown_of_node
        values = solution[np.maximum(first, 0)[:, None] + np.arange(2)]
        return np.where(first[:, None] >= 0, values, 0.0)
