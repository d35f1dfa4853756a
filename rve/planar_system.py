"""The linear system of a planar cell: periodicity by elimination on a pattern kept for all materials, and its Cholesky factor."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp
from petsc4py import PETSc

from rve.triangulation import Integers
from stochastic.truncated_normal import Array

SOLVER = "MUMPS Cholesky"
AREA = 4.0
_BASIS_TOLERANCE = 1e-11  # relative change of the stiffness by one more solution in the basis


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


class Pencil:
    """One cell's system for any modulus E of the particle: (fixed + E · unit), periodic, under the three unit strains.

    Args:
        fixed: Unreduced stiffness of the matrix.
        unit: Unreduced stiffness of the particle for a modulus of 1 Pa.
        nodes: Periodic number of each node.
        periodic: P, shape (2n, unknowns).
        affine: Displacements of the three unit strains, shape (2n, 3).
    """

    def __init__(self, fixed: sp.csr_matrix, unit: sp.csr_matrix, nodes: Integers, periodic: sp.csr_matrix, affine: Array) -> None:
        pattern = PeriodicPattern(nodes, [fixed, unit])
        self._values = pattern(0, fixed), pattern(1, unit)
        self._shape = pattern.columns, pattern.rows
        self._factor = Cholesky(pattern.rows, pattern.columns)
        forces = fixed @ affine, unit @ affine
        self.loads = tuple(np.asarray(periodic.T @ force) for force in forces)
        self.uniform = tuple(np.asarray(affine.T @ force) for force in forces)  # 3 × 3: energy without fluctuation

    def solve(self, modulus: float) -> tuple[Array, Array]:
        """Fluctuations less their sign, shape (unknowns, 3), and the stiffness in Pa, shape (3, 3), for the particle's modulus in Pa."""
        load = self.loads[0] + modulus * self.loads[1]
        correction = self._factor.solve(self._values[0] + modulus * self._values[1], load)
        uniform = self.uniform[0] + modulus * self.uniform[1]
        return correction, (uniform - load.T @ correction) / AREA  # ⟨σ⟩ by Hill–Mandel

    def project(self, basis: Array) -> tuple[Array, Array]:
        """Vᵀ K V of both parts for a basis V, shape (unknowns, k)."""
        parts = [basis.T @ (sp.csr_matrix((values, *self._shape)) @ basis) for values in self._values]
        return parts[0], parts[1]


class ModulusBasis:
    """Galerkin on the solutions at a few moduli of the particle.

    The energy is stationary, so each solution matches value and slope of the stiffness there, and the error falls like that of a
    rational interpolant of twice as many nodes. Solutions are added where the last one changed most, until it changed nothing.

    Args:
        pencil: The system.
    """

    def __init__(self, pencil: Pencil) -> None:
        self._pencil, self.size = pencil, 0
        self._vectors = np.empty((pencil.loads[0].shape[0], 0))

    def stiffness(self, moduli: Array) -> Array:
        """Stiffness for every one of `moduli` in Pa, shape (m, 3, 3)."""
        if moduli.size <= 2:
            self.size = moduli.size
            return np.array([self._pencil.solve(float(e))[1] for e in moduli])
        self._add(float(moduli.min()))
        self._add(float(moduli.max()))
        found, taken = self._galerkin(moduli), {float(moduli.min()), float(moduli.max())}
        change = np.array([0.0 if float(e) in taken else np.inf for e in moduli])
        middle = np.sqrt(moduli.min() * moduli.max())
        while change.max() > _BASIS_TOLERANCE:
            candidates = np.flatnonzero(change == change.max())
            worst = float(moduli[candidates[np.argmin(np.abs(np.log(moduli[candidates] / middle)))]])
            self._add(worst)
            taken.add(worst)
            better = self._galerkin(moduli)
            change = np.abs(better - found).max(axis=(1, 2)) / np.abs(better).max(axis=(1, 2))
            change[[float(e) in taken for e in moduli]] = 0.0
            found = better
        return found

    def _add(self, modulus: float) -> None:
        solution = self._pencil.solve(modulus)[0]
        self._vectors = np.linalg.qr(np.hstack([self._vectors, solution / np.linalg.norm(solution, axis=0)]))[0]
        self.size += 1

    def _galerkin(self, moduli: Array) -> Array:
        fixed, unit = self._pencil.project(self._vectors)
        loads = [self._vectors.T @ load for load in self._pencil.loads]
        stiffness = []
        for modulus in moduli:
            load = loads[0] + modulus * loads[1]
            uniform = self._pencil.uniform[0] + modulus * self._pencil.uniform[1]
            stiffness.append((uniform - load.T @ np.linalg.solve(fixed + modulus * unit, load)) / AREA)
        return np.array(stiffness)
