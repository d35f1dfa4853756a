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


@dataclass(frozen=True)
class SolverOptions:
    """The default solver with the PETSc options, without prefix, that override it.

    Those of the environment, PETSC_OPTIONS, come after the default and before `overrides`. A value
    of "" stands for an option without one.
    """

    overrides: Mapping[str, str] = field(default_factory=dict)
    environment: Mapping[str, str] = field(
        # petsc4py takes the next option for the value of one without a value.
        default_factory=lambda: {
            name: "" if re.match("-[A-Za-z]", value) else value
            for name, value in PETSc.Options(PREFIX).getAll().items()
        }
    )

    @property
    def chosen(self) -> dict[str, str]:
        """Values of the options that override the default solver, by their names without prefix."""
        return {**self.environment, **self.overrides}

    @property
    def all(self) -> dict[str, str]:
        """Values of all options that PETSc is given, by their names without prefix.

        The default solver (conjugate gradients to a relative residual of 1e-8, preconditioned along
        θ) is overridden by the environment, and both by `overrides`. Options that print and have no
        value get standard error as their value, and others without a value "true", which PETSc
        refuses where it expects a number or a name. The default limit of iterations is 500 with the
        preconditioner along θ, and 5000 with others.
        """
        defaults = {
            "ksp_type": "cg",
            "ksp_rtol": "1e-8",
            "ksp_norm_type": "unpreconditioned",
            "pc_type": "python",
        }
        chosen = defaults | self.chosen
        # Options that make PETSc print do so to standard error if they have no value: tables of
        # results go to standard output.
        prints = re.compile(r"(_view|_monitor\w*|_converged_(reason|rate))$")
        for name, value in chosen.items():
            if not value:
                chosen[name] = "ascii:stderr" if prints.search(name) else "true"
        # The preconditioner along θ takes tens of iterations at most, others may take hundreds.
        max_iterations = 500 if chosen["pc_type"] == "python" else 5000
        return {"ksp_max_it": str(max_iterations), **chosen}

    @property
    def by_levels(self) -> bool:
        """Whether the preconditioner is the one that solves level by level."""
        return self.all["pc_type"] == "python"

    def described(self, elements: str) -> str:
        """Return in words how the form is assembled, over which elements, and how it is solved."""
        krylov = self.all["ksp_type"]
        return f"one UFL form over {elements} by DOLFINx, solved by PETSc's {krylov} with {self}"

    def __str__(self) -> str:
        """Return "theta" for the preconditioner along θ, and the options that were changed."""
        words = ["theta"] if self.by_levels else []
        words += [f"-{PREFIX}{name} {value}".strip() for name, value in self.chosen.items()]
        return " ".join(words)


def require_petsc(petsc: object) -> None:
    """Raise unless `petsc` is a mapping of PETSc's options by their names without dash and prefix.

    Values are not checked, nor whether PETSc knows the names.

    Raises:
        RefusedError: It is no mapping, or a name begins with a dash or with `rve_`. For a command
            line such as "-ksp_type cg" the hint says what to write.
    """
    allowed = 'a dict of options without dash and prefix, as {"ksp_type": "gmres"}'
    if not isinstance(petsc, Mapping):
        cure = ""
        if isinstance(petsc, str):
            # A command line such as "-ksp_type cg" is written as the dict that it means.
            words = dict(re.findall(r"-(\S+)\s+([^-\s]\S*)", petsc))
            if words:
                cure = f"write {words}".replace("'", '"')
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
        vectors: Solution x of each load f.
        iterations: Iterations for each load.
        residual: Largest |K x − f| over |f|.
    """

    vectors: list[PETSc.Vec]
    iterations: tuple[int, ...]
    residual: float


def krylov_solver(
    matrix: PETSc.Mat, options: SolverOptions, preconditioner: Callable[[], ThetaPreconditioner]
) -> PETSc.KSP:
    """Return PETSc's Krylov solver of a reduced stiffness, set up for solving.

    Reduced means that periodic partners share unknowns and one corner is held at zero. The
    preconditioner is factorised. All ranks of the matrix must call.

    Args:
        matrix: Symmetric positive definite matrix or operator, with the two displacements of each
            node one after another. The translations are set as its near null space.
        options: The default solver and what overrides it.
        preconditioner: Function that makes the preconditioner along θ. It is called where the
            options do not name another one.

    Raises:
        RefusedError: PETSc refuses an option or its value, or does not use it.
        ConvergenceError: A factorisation failed though no option overrides the default.
    """
    PETSc.garbage_cleanup(matrix.comm)  # frees the solvers of earlier samples, on all ranks
    ksp = PETSc.KSP().create(matrix.comm)
    ksp.setOptionsPrefix(PREFIX)
    ksp.setOperators(matrix)
    # Algebraic multigrid needs the displacements with almost no energy, which are translations:
    # only one corner is held. Rotations are not periodic.
    translations = [matrix.createVecRight() for _ in range(2)]
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
    """Solve K x = f for each load f.

    Where the vectors of the solver are n times as long as a load, n loads are solved at once. They
    stand one after another in a vector, each divided by its norm (by 1 if it is zero).

    Args:
        ksp: Solver of K, or of the block-diagonal matrix of n times K. Whether it starts from zero
            or from a guess is set in it.
        loads: Right-hand sides f, at least one; their number is a multiple of n.
        guesses: First guess of each solution; zero if not given.

    Returns:
        A new vector for each load, the iterations for each load, and the largest |K x − f| / |f|,
        computed anew from the solutions. For n loads at once it is the root of the sum of their
        squares.

    Raises:
        ConvergenceError: The tolerance was not reached, or a solution is not finite.
    """
    matrix, _ = ksp.getOperators()
    together = matrix.size[0] // loads[0].size
    vectors: list[PETSc.Vec] = []
    iterations: list[int] = []
    max_residual = 0.0
    ksp.setInitialGuessNonzero(bool(guesses))
    for first in range(0, len(loads), together):
        group = slice(first, first + together)
        norms = [load.norm() or 1.0 for load in loads[group]]
        b = matrix.createVecLeft()
        x = matrix.createVecRight()
        _join(loads[group], norms, into=b)
        if guesses:
            _join(guesses[group], norms, into=x)
        ksp.solve(b, x)  # eq. 7: K U = F
        reason = ksp.getConvergedReason()
        count = ksp.getIterationNumber()
        # PETSc's reasons are positive where the tolerance was reached. A direct solver of a
        # singular matrix may report success with infinite values.
        if reason <= 0 or not np.isfinite(x.norm()):
            raise ConvergenceError(
                f"{ksp.getType()} with {ksp.pc.getType()} stopped after {count}"
                f" iterations without reaching its tolerance (PETSc reason {reason})",
                f"raise -{ksp.getOptionsPrefix()}ksp_max_it or take another solver",
            )
        LOG.debug("%s with %s: %d iterations", ksp.getType(), ksp.pc.getType(), count)
        vectors += _split(x, loads[group], norms)
        iterations += together * [count]
        # The residual of all loads together is at least that of each load, whose norm is 1. PETSc's
        # own residual is a recursion, or one of the preconditioned system.
        residual = b.duplicate()
        matrix.mult(x, residual)
        residual.axpy(-1.0, b)
        max_residual = max(max_residual, residual.norm())
    return Solutions(vectors, tuple(iterations), max_residual)


def _join(vectors: Sequence[PETSc.Vec], norms: Sequence[float], *, into: PETSc.Vec) -> None:
    """Set a vector to vectors over norms, one after another."""
    parts = [vector.array_r / norm for vector, norm in zip(vectors, norms, strict=True)]
    into.array[:] = np.concatenate(parts)


def _split(
    joined: PETSc.Vec, loads: Sequence[PETSc.Vec], norms: Sequence[float]
) -> list[PETSc.Vec]:
    """Return the vectors that stand one after another in a long vector, times their norms.

    Args:
        joined: Vector of n times the length of a load.
        loads: n vectors, in whose layout over the ranks the new ones are made.
        norms: Factor of each, shape (n,).
    """
    vectors = [load.duplicate() for load in loads]
    parts = np.split(joined.array_r, len(vectors))
    for vector, part, norm in zip(vectors, parts, norms, strict=True):
        vector.array[:] = part * norm
    return vectors


@contextmanager
def in_database(options: SolverOptions) -> Iterator[None]:
    """Put the options into PETSc's database for a `with` block, and restore it at the block's end.

    Options of the environment stay in the database, but in the block an override replaces its
    namesake.

    Args:
        options: The default solver, the options of the environment, and the overrides.

    Raises:
        RefusedError: PETSc raised an error in the block and options override the default, or it has
            not used one of these options.
        ConvergenceError: PETSc raised an error in the block though no option overrides the default.
    """
    database = PETSc.Options(PREFIX)
    environment = options.environment
    chosen = options.chosen
    added = {name: value for name, value in options.all.items() if environment.get(name) != value}
    for name, value in added.items():
        database[name] = value
    try:
        yield
        unused = [name for name in chosen if not option_is_used(PREFIX + name)]
    except PETSc.Error as failure:
        reason = str(failure).splitlines()[-1].strip()
        for name in chosen:
            if options.all[name] == "true" != chosen[name]:
                raise RefusedError(f"value of -{PREFIX}{name}", None, "", reason) from failure
        if chosen:
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
        value = chosen[unused[0]]
        option = f"-{PREFIX}{unused[0]}"
        raise RefusedError(option, value, "options that PETSc uses", "check its spelling")
