"""PETSc's solve of the reduced product-space system: options under one prefix, failure an error."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from petsc4py import PETSc

from rve.petsc_options import in_database
from rve.solver_options import PREFIX, SolverOptions
from stochastic.truncated_normal import Array


class Preconditioner(Protocol):
    """What PETSc calls for `pc_type python`."""

    def apply(self, _pc: PETSc.PC, residual: PETSc.Vec, result: PETSc.Vec) -> None:
        """Put the preconditioned residual into `result`."""


class ConvergenceError(RuntimeError):
    """A linear solver stopped before it reached its tolerance."""


class LinearSolver:
    """A PETSc Krylov or direct solver for one reduced stiffness and any number of loads.

    Args:
        matrix: The reduced stiffness, symmetric positive definite.
        options: PETSc options.
        context: What `pc_type python` stands for.

    Raises:
        OptionError: PETSc does not know an option or its value.
    """

    def __init__(self, matrix: PETSc.Mat, options: SolverOptions, context: Preconditioner | None) -> None:
        matrix.setOption(PETSc.Mat.Option.SPD, True)
        self.krylov = PETSc.KSP().create(matrix.comm)
        self.krylov.setOptionsPrefix(PREFIX)
        self.krylov.setOperators(matrix)
        with in_database(options.all, wanted=options.given):
            self.krylov.setFromOptions()
            if self.krylov.pc.getType() == "python":
                self.krylov.pc.setPythonContext(context)
            self.krylov.setUp()

    def solve(self, load: PETSc.Vec) -> tuple[Array, int, float]:
        """The whole solution vector, on every rank, the number of iterations, and the relative residual as it truly is.

        Raises:
            ConvergenceError: The tolerance was not reached, or the result is not finite.
        """
        x = load.duplicate()
        self.krylov.solve(load, x)
        reason, iterations = self.krylov.getConvergedReason(), self.krylov.getIterationNumber()
        if reason <= 0 or not np.isfinite(x.norm()):
            raise ConvergenceError(
                f"{self.krylov.getType()} with {self.krylov.pc.getType()} stopped after {iterations} iterations without reaching "
                f"its tolerance (PETSc reason {reason}): raise -{PREFIX}ksp_max_it or take another solver"
            )
        parts = x.comm.tompi4py().allgather(x.array_r.copy())
        residual = self.krylov.getOperators()[0] * x - load
        return np.concatenate(parts), iterations, residual.norm() / load.norm()
