"""PETSc's solve of the reduced product-space system: options under one prefix, failure an error.

The default is conjugate gradients with this project's preconditioner, for which ``pc_type python``
stands. Options under the prefix ``-rve_`` override it, such as ``-rve_pc_type gamg``; those under
``-rve_level_`` are of the preconditioner's plane problems.
"""

from __future__ import annotations

import logging
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np

from alphacut.base.errors import FailedError, RefusedError
from alphacut.rve.fenicsx import PETSc, option_is_used
from alphacut.rve.interruption import uninterrupted
from alphacut.rve.solver.theta_preconditioner import PREFIX, ThetaPreconditioner

DEFAULTS = {
    "ksp_type": "cg",
    "ksp_rtol": "1e-8",
    "ksp_norm_type": "unpreconditioned",
    "pc_type": "python",
}
MAX_ITERATIONS = 500
"""Iterations by the preconditioner, which takes tens at most; others may take ten times as many."""

PRINTS = re.compile(r"(_view|_monitor\w*|_converged_(reason|rate))$")
"""Options that make PETSc print: to standard error if they have no value."""


@dataclass(frozen=True)
class SolverOptions:
    """The default with the PETSc options, without prefix, that override it.

    Those of the environment, PETSC_OPTIONS, come after the default and before `overrides`.
    """

    overrides: Mapping[str, str] = field(default_factory=dict)
    environment: Mapping[str, str] = field(
        default_factory=lambda: dict(PETSc.Options(PREFIX).getAll())
    )

    @property
    def all(self) -> dict[str, str]:
        """Everything that is put to PETSc."""
        chosen = {**DEFAULTS, **self.environment, **self.overrides}
        chosen |= {x: "ascii:stderr" for x, y in chosen.items() if PRINTS.search(x) and not y}
        max_iterations = MAX_ITERATIONS * (1 if chosen["pc_type"] == "python" else 10)
        return {"ksp_max_it": str(max_iterations), **chosen}

    @property
    def by_levels(self) -> bool:
        """True for the preconditioner that solves level by level."""
        return self.all["pc_type"] == "python"

    def described(self, elements: str) -> str:
        """Return in words how the form is assembled, over which elements, and how it is solved."""
        krylov = self.all["ksp_type"]
        return f"one UFL form over {elements} by DOLFINx, solved by PETSc's {krylov} with {self}"

    def __str__(self) -> str:
        changes = {**self.environment, **self.overrides}.items()
        words = [f"-{PREFIX}{name} {value}".strip() for name, value in changes]
        return " ".join(["theta", *words] if self.by_levels else words)


def require_petsc(petsc: object) -> None:
    """Refuse what is no table of options of PETSc by their names without dash and prefix."""
    allowed = 'a dict of options without dash and prefix, as {"ksp_type": "gmres"}'
    if not isinstance(petsc, Mapping):
        cure = ""
        if words := re.findall(r"-(\S+)\s+([^-\s]\S*)", petsc if isinstance(petsc, str) else ""):
            cure = f"write {dict(words)}".replace("'", '"')
        raise RefusedError("petsc", repr(petsc), allowed, cure)
    for name in petsc:
        bare = str(name).lstrip("-").removeprefix(PREFIX)
        if name != bare:
            raise RefusedError("petsc", repr(name), allowed, f'write "{bare}"')


LOG = logging.getLogger(__name__)


class ConvergenceError(FailedError):
    """A linear solver stopped before it reached its tolerance."""


@dataclass(frozen=True)
class Solutions:
    """Solutions of K x = f.

    Args:
        vectors: x of each load f.
        iterations: Of each.
        residual: Largest |K x − f| over |f|.
    """

    vectors: list[PETSc.Vec]
    iterations: tuple[int, ...]
    residual: float


def krylov_solver(
    matrix: PETSc.Mat, options: SolverOptions, preconditioner: Callable[[], ThetaPreconditioner]
) -> PETSc.KSP:
    """PETSc Krylov solver of a reduced stiffness, symmetric positive definite, set up.

    `preconditioner` makes the one along θ; it is called where the options do not name another.

    Raises:
        RefusedError: PETSc refuses an option or its value, or does not use it.
        ConvergenceError: A factorisation failed.
    """
    PETSc.garbage_cleanup(matrix.comm)  # frees the solvers of earlier samples, on all ranks
    ksp = PETSc.KSP().create(matrix.comm)
    ksp.setOptionsPrefix(PREFIX)
    ksp.setOperators(matrix)
    translations = [matrix.createVecRight() for _ in range(2)]  # which multigrid takes
    for component, vector in enumerate(translations):
        vector.array[component::2] = 1.0
        vector.normalize()
    matrix.setNearNullSpace(PETSc.NullSpace().create(vectors=translations, comm=matrix.comm))
    with in_database(options), uninterrupted(second_ends=True):
        ksp.setFromOptions()
        if options.by_levels:
            ksp.pc.setPythonContext(preconditioner())
        ksp.setUp()
    return ksp


@uninterrupted(second_ends=True)
def solve(
    ksp: PETSc.KSP, loads: Sequence[PETSc.Vec], guesses: Sequence[PETSc.Vec] = ()
) -> Solutions:
    """Solve for each load, from a guess of each solution or from zero.

    Where the solver's vectors are n times as long as a load, n loads are solved at once: divided by
    their norms, they stand one after another in a vector.

    Raises:
        ConvergenceError: The tolerance was not reached, or a solution is not finite.
    """
    matrix, _ = ksp.getOperators()
    together = matrix.size[0] // loads[0].size
    vectors, iterations, residuals = [], [], []
    ksp.setInitialGuessNonzero(bool(guesses))
    for first in range(0, len(loads), together):
        group = slice(first, first + together)
        norms = [load.norm() or 1.0 for load in loads[group]]
        b, x = matrix.createVecLeft(), matrix.createVecRight()
        _join(loads[group], norms, into=b)
        if guesses:
            _join(guesses[group], norms, into=x)
        ksp.solve(b, x)  # eq. 7: K U = F
        reason, count = ksp.getConvergedReason(), ksp.getIterationNumber()
        if reason <= 0 or not np.isfinite(x.norm()):
            raise ConvergenceError(
                f"{ksp.getType()} with {ksp.pc.getType()} stopped after {count}"
                f" iterations without reaching its tolerance (PETSc reason {reason})",
                f"raise -{ksp.getOptionsPrefix()}ksp_max_it or take another solver",
            )
        LOG.debug("%s with %s: %d iterations", ksp.getType(), ksp.pc.getType(), count)
        product = b.duplicate()
        matrix.mult(x, product)
        vectors += _split(x, loads[group], norms)
        iterations += together * [count]
        residuals.append((product - b).norm())  # at least that of each load, whose norm is 1
    return Solutions(vectors, tuple(iterations), max(residuals))


def _join(vectors: Sequence[PETSc.Vec], norms: Sequence[float], *, into: PETSc.Vec) -> None:
    """Set a vector to vectors over norms, one after another."""
    parts = [vector.array_r / norm for vector, norm in zip(vectors, norms, strict=True)]
    into.array[:] = np.concatenate(parts)


def _split(
    joined: PETSc.Vec, loads: Sequence[PETSc.Vec], norms: Sequence[float]
) -> list[PETSc.Vec]:
    """Return the vectors that `_join` has joined, each in the layout of its load."""
    vectors = [load.duplicate() for load in loads]
    parts = np.split(joined.array_r, len(vectors))
    for vector, part, norm in zip(vectors, parts, norms, strict=True):
        vector.array[:] = part * norm
    return vectors


@contextmanager
def in_database(options: SolverOptions) -> Iterator[None]:
    """Context with the options in PETSc's database, which is restored at its end.

    What the environment gave stays there, unless an override has its place meanwhile.

    Raises:
        RefusedError: PETSc refuses an option, or has not used an override in the block.
    """
    database, environment = PETSc.Options(PREFIX), options.environment
    from_environment = environment.keys() - options.overrides.keys()
    added = {name: value for name, value in options.all.items() if name not in from_environment}
    for name, value in added.items():
        database[name] = value
    try:
        yield
        unused = [name for name in options.overrides if not option_is_used(PREFIX + name)]
    except PETSc.Error as failure:
        reason = str(failure).splitlines()[-1].strip()
        if options.overrides:
            if "norm type" in reason:
                reason += f"; say -{PREFIX}ksp_norm_type preconditioned, or none, beside it"
            raise RefusedError("PETSc", str(options), "what PETSc takes", reason) from failure
        raise ConvergenceError(f"PETSc cannot set up {options}: {reason}") from failure
    finally:
        for name in added:
            database.delValue(name)
        for name in environment.keys() & added.keys():
            database[name] = environment[name]
            database.getString(name)  # read, so that PETSc does not call it unused
    if unused:
        value = options.overrides[unused[0]]
        option = f"-{PREFIX}{unused[0]}"
        raise RefusedError(option, value, "options that PETSc uses", "check its spelling")
