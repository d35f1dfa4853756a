"""The linear system of a planar cell: periodicity by elimination on a pattern kept for all materials, and its Cholesky factor."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp
from petsc4py import PETSc

from rve.triangulation import Integers
from stochastic.truncated_normal import Array

SOLVER = "MUMPS Cholesky"


class PlanarError(RuntimeError):
    """The linear system of a planar cell was not solved."""


class PeriodicPattern:
    """K ↦ the entries of Pᵀ K P, for several K that then share one sparsity pattern.

    Args:
        nodes: Periodic number of each node, two degrees of freedom on each; those of node 0 are fixed.
        matrices: Unreduced matrices, one for each pattern to come.
    """

    def __init__(self, nodes: Integers, matrices: Sequence[sp.csr_matrix]) -> None:
        target = (2 * nodes[:, None] + np.arange(2)).ravel() - 2
        size = int(target.max()) + 1
        keys, self._kept = [], []
        for full in matrices:
            row, column = np.repeat(target, np.diff(full.indptr)), target[full.indices]
            self._kept.append((row >= 0) & (column >= 0))
            keys.append((row * size + column)[self._kept[-1]])
        united, place = np.unique(np.concatenate(keys), return_inverse=True)
        self._place = np.split(place, np.cumsum([k.size for k in keys])[:-1])
        self.rows = np.searchsorted(united, np.arange(size + 1) * size)
        self.columns = united % size

    def __call__(self, which: int, full: sp.csr_matrix) -> Array:
        """Entries in CSR order of the matrix whose pattern is number `which`."""
        return np.bincount(self._place[which], weights=full.data[self._kept[which]], minlength=self.columns.size)


class Cholesky:
    """Sparse factorisation that keeps its ordering while values change.

    Args:
        rows: CSR row pointer.
        columns: CSR column indices.
    """

    def __init__(self, rows: Integers, columns: Integers) -> None:
        size = rows.size - 1
        self._system = sp.csr_matrix((np.ones(columns.size), columns, rows), shape=(size, size))
        self._rows, self._columns = rows.astype(PETSc.IntType), columns.astype(PETSc.IntType)
        self._matrix = PETSc.Mat().createAIJ((size, size), csr=(self._rows, self._columns, self._system.data), comm=PETSc.COMM_SELF)
        self._matrix.setOption(PETSc.Mat.Option.SPD, True)
        self._factor = PETSc.PC().create(PETSc.COMM_SELF)
        self._factor.setOptionsPrefix("rve_planar_")
        self._factor.setType("cholesky")
        self._factor.setFactorSolverType("mumps")

    def solve(self, values: Array, loads: Array) -> Array:
        """Solutions of the columns of `loads` for the matrix with these `values`.

        Raises:
            PlanarError: The residual is no good.
        """
        scale = np.abs(values).max()
        self._system.data[:] = values / scale
        self._matrix.setValuesCSR(self._rows, self._columns, self._system.data)
        self._matrix.assemble()
        self._factor.setOperators(self._matrix)
        self._factor.setUp()
        right, left = self._matrix.createVecs()
        solutions = np.empty_like(loads)
        for k in range(loads.shape[1]):
            left.array = loads[:, k] / scale
            self._factor.apply(left, right)
            solutions[:, k] = right.array
        residual = float(np.linalg.norm(scale * (self._system @ solutions) - loads)) / max(float(np.linalg.norm(loads)), 1e-300)
        if not residual < 1e-8:  # also catches nan
            raise PlanarError(f"the Cholesky factorisation leaves a relative residual of {residual:.1e}; 1e-8 is allowed: check the moduli")
        return solutions
