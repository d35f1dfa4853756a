"""PETSc's Krylov methods on the matrix-free operators, by shell matrices.

Give it to `solve_side` in the place of `ConjugateGradient`; PETSc is not for several threads, so
the sides are solved one after another.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from alphacut.rve.image.fields.conjugate_gradient import ConvergenceError, Linear, Solution
from alphacut.rve.petsc import PETSc
from alphacut.rve.solver.options import PREFIX, OptionError
from alphacut.rve.solver.petsc_options import in_database
from alphacut.stochastic.theta.truncated_normal import Array

DEFAULTS = {"ksp_type": "cg", "ksp_norm_type": "natural", "pc_type": "python", "ksp_max_it": "2000"}


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
class PetscSolver:
    """A Krylov method of PETSc.

    Args:
        accuracy: Energy that may be left, relative; sets the tolerance of the residual.
        options: PETSc's options without their prefix, over the defaults.
    """

    accuracy: float = 3e-6
    options: Mapping[str, str] = field(default_factory=dict)
    threads: ClassVar[int] = 1

    def coarser(self, factor: float) -> PetscSolver:
        """The method with less accuracy, for a start."""
        return replace(self, accuracy=min(0.1, factor * self.accuracy))

    def solve(
        self,
        operator: Linear,
        preconditioner: Linear,
        load: Array,
        scale: Array,
        start: Array | None = None,
    ) -> Solution:
        """Fields with operator(fields) = load, all systems as one.

        Raises:
            ConvergenceError: PETSc stops before its tolerance.
            OptionError: PETSc has no use for an option.
        """
        matrix = PETSc.Mat().createPython(
            (load.size, load.size), Shell(operator, load.shape), comm=PETSc.COMM_SELF
        )
        matrix.setOption(PETSc.Mat.Option.SPD, True)
        ksp = PETSc.KSP().create(PETSc.COMM_SELF)
        ksp.setOperators(matrix)
        ksp.setOptionsPrefix(PREFIX)
        tolerance = {"ksp_rtol": repr(float(np.sqrt(self.accuracy) / 10))}
        options = {**DEFAULTS, **tolerance, **self.options}
        if "ksp_type" in self.options and "ksp_norm_type" not in self.options:
            del options["ksp_norm_type"]  # the natural norm is for conjugate gradients
        with in_database(options, wanted=tuple(self.options)):
            ksp.setFromOptions()
            kind = ksp.getPC().getType()
            if kind not in ("python", "none"):
                raise OptionError(
                    f"-{PREFIX}pc_type {kind} needs the entries of a matrix, and an image has an"
                    " operator only: take python (Fourier transform, the default) or none"
                )
            if kind == "python":
                ksp.getPC().setPythonContext(Shell(preconditioner, load.shape))
            ksp.setUp()
        right = PETSc.Vec().createWithArray(load.ravel(), comm=PETSc.COMM_SELF)
        found = right.duplicate()
        if start is not None:
            found.array[:] = start.ravel()
            ksp.setInitialGuessNonzero(True)
        ksp.solve(right, found)
        if ksp.getConvergedReason() <= 0:
            raise ConvergenceError(
                f"PETSc stopped after {ksp.getIterationNumber()} iterations without convergence; "
                "allow more by ksp_max_it or ask for less accuracy"
            )
        return Solution(found.array.reshape(load.shape).copy(), ksp.getIterationNumber())
