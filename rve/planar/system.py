"""Linear system of a planar cell: periodic elimination and Cholesky factor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from cvxopt import cholmod, matrix, spmatrix

from alphacut.rve.solver.c_loops import WEDGES, c_loops
from alphacut.rve.solver.level_stiffness import LevelPattern
from alphacut.stochastic.theta.truncated_normal import Array

SOLVER = "CHOLMOD"
AREA = 4.0
_BASIS_TOLERANCE = 1e-11  # relative change of the stiffness by one more solution in the basis


class PlanarError(RuntimeError):
    """The linear system of a planar cell was not solved."""


class Cholesky:
    """Sparse factorisation that keeps its ordering while values change.

    Args:
        pattern: Lower triangle of the matrix.
    """

    def __init__(self, pattern: LevelPattern) -> None:
        self._size, (self._rows, self._columns) = pattern.size, pattern.rows_columns
        rows, columns = (part.astype(np.int64) for part in pattern.rows_columns)
        self._matrix = spmatrix(1.0, rows, columns, (self._size, self._size))
        self._factor = cholmod.symbolic(self._matrix)

    def product(self, values: Array, vectors: Array) -> Array:
        """The symmetric matrix with these `values` times vectors, shape (size, k)."""
        given, found = np.ascontiguousarray(vectors), np.zeros(vectors.shape)
        c_loops(WEDGES).add_symmetric(
            len(values), self._rows.ctypes, self._columns.ctypes, values.ctypes, given.shape[1],
            given.ctypes, found.ctypes,
        )  # fmt: skip
        return found

    def solve(self, values: Array, loads: Array) -> Array:
        """Solutions of the columns of `loads` for the matrix with these `values`.

        Raises:
            PlanarError: The matrix is not positive definite, or the residual is no good.
        """
        scale = np.abs(values).max()
        self._matrix.V = matrix(values / scale)
        found = matrix(loads / scale)
        try:
            cholmod.numeric(self._matrix, self._factor)
            cholmod.solve(self._factor, found)
        except ArithmeticError:
            raise PlanarError(
                "the stiffness has no Cholesky factor: check the moduli, or take the series"
            ) from None
        solutions = np.asarray(found)
        residual = float(np.linalg.norm(self.product(values, solutions) - loads))
        residual /= max(float(np.linalg.norm(loads)), 1e-300)
        if not residual < 1e-8:  # also catches nan
            raise PlanarError(
                f"the Cholesky factorisation leaves a relative residual of {residual:.1e}; 1e-8 is"
                " allowed: check the moduli"
            )
        return solutions


@dataclass(frozen=True)
class Pencil:
    """One cell's system (fixed + E · unit) for any modulus E of the particle.

    Args:
        factor: Solves it.
        values: Stored entries of the matrix's stiffness, and of the particle's for 1 Pa.
        loads: Of both, forces of the three unit strains, shape (unknowns, 3).
        uniform: Of both, energy without fluctuation, shape (3, 3).
    """

    factor: Cholesky
    values: tuple[Array, ...]
    loads: tuple[Array, ...]
    uniform: tuple[Array, ...]

    def solve(self, modulus: float) -> tuple[Array, Array]:
        """Negative fluctuations, shape (unknowns, 3), and stiffness in Pa, shape (3, 3)."""
        values, load, uniform = (
            fixed + modulus * unit for fixed, unit in (self.values, self.loads, self.uniform)
        )
        correction = self.factor.solve(values, load)
        return correction, (uniform - load.T @ correction) / AREA  # ⟨σ⟩ by Hill–Mandel

    def applied(self, vectors: Array) -> tuple[Array, ...]:
        """K V of both parts for vectors of shape (unknowns, k)."""
        return tuple(self.factor.product(values, vectors) for values in self.values)


class ModulusBasis:
    """Galerkin on the solutions at a few moduli of the particle.

    The energy is stationary, so each solution matches value and slope of the stiffness there, and
    the error falls like that of a rational interpolant of twice as many nodes. Solutions are added
    where the last one changed most, until it changed nothing.

    Args:
        pencil: The system.
    """

    def __init__(self, pencil: Pencil) -> None:
        self._pencil, self.size = pencil, 0
        self._vectors = np.empty((pencil.loads[0].shape[0], 0))
        self._projected = [np.empty((0, 0)), np.empty((0, 0))]  # Vᵀ K V of both parts

    def stiffness(self, moduli: Array) -> Array:
        """Stiffness for every one of `moduli` in Pa, shape (m, 3, 3)."""
        low, high = float(moduli.min()), float(moduli.max())
        for modulus in (low, high):
            self._add(modulus)
        found, taken = self._galerkin(moduli), {low, high}
        worst: float | None = float(moduli[np.argmin(np.abs(np.log(moduli / np.sqrt(low * high))))])
        while worst is not None and worst not in taken:
            self._add(worst)
            taken.add(worst)
            better = self._galerkin(moduli)
            change = np.abs(better - found).max(axis=(1, 2)) / np.abs(better).max(axis=(1, 2))
            change[[float(e) in taken and e != worst for e in moduli]] = 0.0
            found = better
            left = np.where([float(e) in taken for e in moduli], 0.0, change)
            worst = float(moduli[left.argmax()]) if change.max() > _BASIS_TOLERANCE else None
        return found

    def _add(self, modulus: float) -> None:
        """Put the three solutions at `modulus` into the orthonormal basis."""
        solution = self._pencil.solve(modulus)[0]
        fresh = solution / np.linalg.norm(solution, axis=0)
        for _ in range(2):
            fresh = np.linalg.qr(fresh - self._vectors @ (self._vectors.T @ fresh))[0]
        for k, image in enumerate(self._pencil.applied(fresh)):
            side = self._vectors.T @ image
            self._projected[k] = np.block([[self._projected[k], side], [side.T, fresh.T @ image]])
        self._vectors = np.hstack([self._vectors, fresh])
        self.size += 1

    def _galerkin(self, moduli: Array) -> Array:
        fixed, unit = self._projected
        loads = [self._vectors.T @ load for load in self._pencil.loads]
        stiffness = []
        for modulus in moduli:
            load = loads[0] + modulus * loads[1]
            uniform = self._pencil.uniform[0] + modulus * self._pencil.uniform[1]
            stiffness.append(
                (uniform - load.T @ np.linalg.solve(fixed + modulus * unit, load)) / AREA
            )
        return np.array(stiffness)
