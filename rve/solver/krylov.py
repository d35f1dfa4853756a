"""PETSc's solve of the reduced product-space system: options under one prefix, failure an error."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from alphacut.rve.petsc import PETSc
from alphacut.rve.solver.options import PREFIX, SolverOptions
from alphacut.rve.solver.petsc_options import in_database
from alphacut.rve.solver.saddle import Saddle
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
        values: The whole vectors, on every rank, shape (size, loads).
        iterations: For each load.
        residual: The largest relative residual, as it truly is.
        pressures: Whole vectors of the pressures of a `Saddle`, shape (pressures, loads).
    """

    values: Array
    iterations: tuple[int, ...]
    residual: float
    pressures: Array | None = None


class SideBySide:
    """The operator I ⊗ K: several vectors side by side, entry by entry, as one; called by PETSc."""

    def __init__(self, matrix: PETSc.Mat, columns: int) -> None:
        (rows, size), self.matrix = matrix.getSizes()[0], matrix
        self.source = PETSc.Mat().createDense(((rows, size), (None, columns)), comm=matrix.comm)
        self.source.setUp()
        self.source.assemble()
        self.target = matrix.matMult(self.source)

    def mult(self, _matrix: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Y = (I ⊗ K) x; K is read once for all vectors."""
        source = self.source.getDenseArray()
        source[:] = x.array_r.reshape(source.shape)
        self.matrix.matMult(self.source, result=self.target)
        y.array[:] = self.target.getDenseArray(readonly=True).ravel()


class LinearSolver:
    """A PETSc Krylov or direct solver for one reduced stiffness.

    Loads are treated together, as one vector, where the preconditioner can: every factor is then
    read once for all of them.

    Args:
        matrix: The reduced stiffness, symmetric positive definite, or a `Saddle`.
        options: PETSc options.
        context: What `pc_type python` stands for; None for PETSc's own preconditioners.
        together: Number of loads that the preconditioner treats together, 1 for one at a time.

    Raises:
        OptionError: PETSc does not know an option or its value.
    """

    def __init__(
        self,
        matrix: PETSc.Mat | Saddle,
        options: SolverOptions,
        context: Preconditioner | None,
        *,
        together: int = 1,
    ) -> None:
        self.together, self.saddle = together, matrix if isinstance(matrix, Saddle) else None
        self.matrix = matrix
        if isinstance(matrix, Saddle):
            self.matrix = matrix.assembled() if context is None else matrix.matrix()
        self.krylov = PETSc.KSP().create(self.matrix.comm)
        self.krylov.setOptionsPrefix(PREFIX)
        self.krylov.setOperators(self.matrix if together == 1 else self._side_by_side())
        with in_database(options.all, wanted=options.given):
            self.krylov.setFromOptions()
            if self.krylov.pc.getType() == "python":
                self.krylov.pc.setPythonContext(context)
            self.krylov.setUp()

    def _side_by_side(self) -> PETSc.Mat:
        if self.saddle is not None:
            return self.saddle.matrix(self.together)
        local, size = (
            self.matrix.getLocalSize()[0] * self.together,
            self.matrix.getSize()[0] * self.together,
        )
        operator = PETSc.Mat().createPython(
            ((local, size),) * 2, SideBySide(self.matrix, self.together), comm=self.matrix.comm
        )
        operator.setUp()
        return operator

    def solve(self, loads: Sequence[PETSc.Vec]) -> Solutions:
        """Solve for all loads.

        Raises:
            ConvergenceError: The tolerance was not reached, or a solution is not finite.
        """
        norms = np.array([load.norm() or 1.0 for load in loads])
        columns = np.stack([load.array_r for load in loads], axis=1) / norms
        groups = (
            [columns]
            if self.together == len(loads)
            else [columns[:, [k]] for k in range(len(loads))]
        )
        solved = [self._solve(group) for group in groups]
        values = np.concatenate([values for values, _ in solved], axis=1) * norms
        iterations = tuple(count for values, count in solved for _ in range(values.shape[1]))
        residual = max(self._residual(load, values[:, k]) for k, load in enumerate(loads))
        if self.saddle is None:
            whole = np.concatenate(self.matrix.comm.tompi4py().allgather(values))
            return Solutions(whole, iterations, residual)
        whole, pressures = self.saddle.split(values)
        return Solutions(whole, iterations, residual, pressures)

    def _solve(self, columns: Array) -> tuple[Array, int]:
        """This rank's solutions for unit loads, shape (local size, loads), and iterations."""
        load = self.krylov.getOperators()[0].createVecLeft()
        load.array[:] = columns.ravel()
        x = load.duplicate()
        self.krylov.solve(load, x)
        reason, iterations = self.krylov.getConvergedReason(), self.krylov.getIterationNumber()
        if reason <= 0 or not np.isfinite(x.norm()):
            raise ConvergenceError(
                f"{self.krylov.getType()} with {self.krylov.pc.getType()} stopped after"
                f" {iterations} iterations without reaching its tolerance (PETSc reason {reason}):"
                f" raise -{PREFIX}ksp_max_it or take another solver"
            )
        return x.array_r.reshape(columns.shape).copy(), iterations

    def _residual(self, load: PETSc.Vec, solution: Array) -> float:
        x, residual = load.duplicate(), load.duplicate()
        x.array[:] = solution
        self.matrix.mult(x, residual)
        residual.axpy(-1, load)
        return float(residual.norm() / (load.norm() or 1.0))
