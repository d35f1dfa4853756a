"""PETSc's solve of the reduced product-space system: options under one prefix, failure an error."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from alphacut.rve.interruption import uninterrupted
from alphacut.rve.petsc import PETSc, in_database
from alphacut.rve.solver.operators import Saddle, SideBySide
from alphacut.rve.solver.options import PREFIX, SolverOptions
from alphacut.stochastic.theta.truncated_normal import Array


class Preconditioner(Protocol):
    """Interface of PETSc's `pc_type python`."""

    def apply(self, _pc: PETSc.PC, residual: PETSc.Vec, result: PETSc.Vec) -> None:
        """Put the preconditioned residual into `result`."""


class ConvergenceError(RuntimeError):
    """A linear solver stopped before it reached its tolerance."""


@dataclass(frozen=True)
class Solutions:
    """Solutions of one system for several loads.

    Args:
        values: This rank's part of the vectors, shape (its unknowns, loads).
        pressures: This rank's part of the pressures of a `Saddle`, shape (its pressures, loads).
        iterations: For each load.
        residual: The largest relative residual, as it truly is; nan where nobody asked.
    """

    values: Array
    pressures: Array | None
    iterations: tuple[int, ...]
    residual: float


class Operator(Protocol):
    """A matrix that is applied to several vectors side by side."""

    def matrix(self, columns: int = 1) -> PETSc.Mat:
        """PETSc's matrix for so many vectors side by side."""


class LinearSolver:
    """A PETSc Krylov or direct solver for one reduced stiffness.

    Loads are treated together, as one vector, where the preconditioner can: every factor is then
    read once for all of them.

    Args:
        matrix: The reduced stiffness, symmetric positive definite, or an operator.
        options: PETSc options.
        context: What `pc_type python` stands for; None for PETSc's own preconditioners.
        together: Number of loads that the preconditioner treats together, 1 for one at a time.

    Raises:
        OptionError: PETSc does not know an option or its value.
    """

    def __init__(
        self,
        matrix: PETSc.Mat | Operator,
        options: SolverOptions,
        context: Preconditioner | None,
        *,
        together: int = 1,
    ) -> None:
        self.together = together
        self.saddle = matrix if isinstance(matrix, Saddle) else None
        self.matrix = matrix if isinstance(matrix, PETSc.Mat) else None
        if isinstance(matrix, PETSc.Mat):
            operator = matrix if together == 1 else SideBySide([matrix], together).matrix(together)
        elif isinstance(matrix, Saddle) and context is None:
            operator = matrix.assembled()
        else:
            operator = matrix.matrix(together)
        self.krylov = PETSc.KSP().create(operator.comm)
        self.krylov.setOptionsPrefix(PREFIX)
        self.krylov.setOperators(operator)
        with uninterrupted(), in_database(options.all, wanted=options.given):
            self.krylov.setFromOptions()
            if self.krylov.pc.getType() == "python":
                self.krylov.pc.setPythonContext(context)
            self.krylov.setUp()

    def solve(self, loads: Sequence[PETSc.Vec], *, measured: bool = True) -> Solutions:
        """Solve for all loads.

        Args:
            loads: Right-hand sides.
            measured: Whether to find the residual.

        Raises:
            ConvergenceError: The tolerance was not reached, or a solution is not finite.
        """
        norms = np.array([load.norm() or 1.0 for load in loads])
        columns = np.stack([load.array_r for load in loads], axis=1) / norms
        groups = np.split(columns, 1 if self.together == len(loads) else len(loads), axis=1)
        solved = [self._solve(group) for group in groups]
        values = np.concatenate([values for values, _ in solved], axis=1) * norms
        iterations = tuple(count for values, count in solved for _ in range(values.shape[1]))
        residual = max(self._residuals(loads, values)) if measured else np.nan
        if self.saddle is None:
            return Solutions(values, None, iterations, residual)
        return Solutions(*self.saddle.split(values), iterations, residual)

    @uninterrupted()
    def _solve(self, columns: Array) -> tuple[Array, int]:
        """This rank's solutions for unit loads, shape (local size, loads), and iterations."""
        load = self.krylov.getOperators()[0].createVecLeft()
        load.array[:] = columns.ravel()
        x = load.duplicate()
        self.krylov.solve(load, x)  # eq. 7: K U = F
        reason, iterations = self.krylov.getConvergedReason(), self.krylov.getIterationNumber()
        if reason <= 0 or not np.isfinite(x.norm()):
            raise ConvergenceError(
                f"{self.krylov.getType()} with {self.krylov.pc.getType()} stopped after"
                f" {iterations} iterations without reaching its tolerance (PETSc reason {reason}):"
                f" raise -{PREFIX}ksp_max_it or take another solver"
            )
        return x.array_r.reshape(columns.shape).copy(), iterations

    @uninterrupted()
    def _residuals(self, loads: Sequence[PETSc.Vec], solutions: Array) -> list[float]:
        """Relative residual of each load."""
        operator, found = self.krylov.getOperators()[0], []
        if self.matrix is None and self.together > 1:
            x, y = operator.createVecs()
            x.array[:] = solutions.ravel()
            operator.mult(x, y)
            products = y.array_r.reshape(solutions.shape)
        for k, load in enumerate(loads):
            x, residual = load.duplicate(), load.duplicate()
            if self.matrix is None and self.together > 1:
                residual.array[:] = products[:, k]
            else:
                x.array[:] = solutions[:, k]
                (operator if self.matrix is None else self.matrix).mult(x, residual)
            residual.axpy(-1, load)
            found.append(float(residual.norm() / (load.norm() or 1.0)))
        return found
