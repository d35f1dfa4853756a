"""PETSc's Krylov methods on the matrix-free operators, by shell matrices.

Give it to `solve_side` in the place of `ConjugateGradient`; PETSc is not for several threads, so
the sides are solved one after another.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from alphacut.rve.image.fields.solver import ConvergenceError, Solution, Solver
from alphacut.rve.image.fields.system import Linear, System
from alphacut.rve.interruption import uninterrupted
from alphacut.rve.petsc import PETSc, in_database
from alphacut.rve.solver.options import PREFIX, OptionError

DEFAULTS = {"ksp_type": "cg", "ksp_norm_type": "natural", "pc_type": "python", "ksp_max_it": "2000"}
TOLERANCES = frozenset({"ksp_rtol", "ksp_atol", "ksp_convergence_test"})
MOST_ROUNDS = 20


class Shell:
    """A linear map of fields as PETSc calls it, for a matrix and for a preconditioner."""

    def __init__(self, linear: Linear, shape: tuple[int, ...]) -> None:
        self.linear, self.shape = linear, shape

    def mult(self, _matrix: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Put the image of x into y."""
        y.array[:] = self.linear.apply(x.array_r.reshape(self.shape)).ravel()

    def apply(self, _preconditioner: PETSc.PC, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Put the image of x into y."""
        self.mult(None, x, y)


@dataclass(frozen=True)
class PetscSolver(Solver):
    """A Krylov method of PETSc.

    PETSc's tolerances are of residuals. So the method is called again, on what is left, until the
    energy is bounded as asked for; not so where the options name a tolerance.

    Args:
        accuracy: Energy that the fields may lack, relative, in (0, 0.1].
        options: PETSc's options without their prefix, over the defaults.

    Raises:
        ValueError: The accuracy lies outside its range.
    """

    options: Mapping[str, str] = field(default_factory=dict)

    def solve(self, system: System) -> Solution:
        """Fields of all systems as one; the load is overwritten.

        Raises:
            ConvergenceError: PETSc stops before its tolerance, or its fields lack too much energy.
            OptionError: PETSc has no use for an option.
        """
        fields, residual = system.begin()
        method, change = self._method(system), np.empty_like(residual)
        right, left = (
            PETSc.Vec().createWithArray(a.ravel(), comm=PETSc.COMM_SELF) for a in (residual, change)
        )
        rounds = MOST_ROUNDS if TOLERANCES.isdisjoint(self.options) else 1
        iterations = 0
        for _ in range(rounds):
            with uninterrupted():
                method.solve(right, left)
            iterations += method.getIterationNumber()
            if method.getConvergedReason() <= 0:
                raise ConvergenceError(
                    f"PETSc stopped after {iterations} iterations without convergence; "
                    "allow more by ksp_max_it or ask for less accuracy"
                )
            fields += change
            residual -= system.operator.apply(change)
            lacking = float((system.lacking(residual) / system.scale).max())
            if rounds == 1 or lacking <= self.accuracy:
                return Solution(fields, iterations)
        raise ConvergenceError(
            f"PETSc's fields have not converged in {MOST_ROUNDS} calls (up to {lacking:.1e} of the"
            f" energy left, {self.accuracy:.1e} asked for); take another ksp_type"
        )

    def _method(self, system: System) -> PETSc.KSP:
        """The Krylov method, set up."""
        shape, size = system.load.shape, system.load.size
        matrix = PETSc.Mat().createPython(
            (size, size), Shell(system.operator, shape), comm=PETSc.COMM_SELF
        )
        matrix.setOption(PETSc.Mat.Option.SPD, True)
        ksp = PETSc.KSP().create(PETSc.COMM_SELF)
        ksp.setOperators(matrix)
        ksp.setOptionsPrefix(PREFIX)
        with in_database(self._all_options, wanted=tuple(self.options)):
            ksp.setFromOptions()
            kind = ksp.getPC().getType()
            if kind not in ("python", "none"):
                raise OptionError(
                    f"-{PREFIX}pc_type {kind} needs the entries of a matrix, and an image has an"
                    " operator only: take python (Fourier transform, the default) or none"
                )
            if kind == "python":
                ksp.getPC().setPythonContext(Shell(system.preconditioner, shape))
            ksp.setUp()
        return ksp

    @property
    def _all_options(self) -> dict[str, str]:
        """Everything that is put to PETSc."""
        tolerance = {"ksp_rtol": repr(float(np.sqrt(self.accuracy) / 10))}
        options = {**DEFAULTS, **tolerance, **self.options}
        if "ksp_type" in self.options and "ksp_norm_type" not in self.options:
            del options["ksp_norm_type"]  # the natural norm is for conjugate gradients
        return options
