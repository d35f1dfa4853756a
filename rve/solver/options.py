"""The linear solvers of the product-space cell by name: PETSc options, readable in one place.

`theta` is the default: conjugate gradients with this project's preconditioner, for which
``pc_type python`` stands. The others are there to compare with. Options under the prefix ``-rve_``
override a named set; those under ``-rve_level_`` are of the preconditioner's plane problems.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from alphacut.fuzzy.refused import RefusedError

PREFIX = "rve_"
LEVEL = "level_"
_CG = {
    "ksp_type": "cg",
    "ksp_rtol": "1e-8",
    "ksp_norm_type": "unpreconditioned",
    "ksp_max_it": "500",
}

SOLVERS: Mapping[str, Mapping[str, str]] = {
    "theta": {**_CG, "pc_type": "python"},
    # algebraic multigrid, told the translations of every level
    "gamg": {**_CG, "ksp_max_it": "5000", "pc_type": "gamg", "pc_gamg_threshold": "0.01"},
    # sparse direct
    "mumps": {"ksp_type": "preonly", "pc_type": "cholesky", "pc_factor_mat_solver_type": "mumps"},
}


class OptionError(RefusedError):
    """A PETSc option that PETSc does not take."""


@dataclass(frozen=True)
class SolverOptions:
    """A named set with what overrides it.

    Args:
        solver: Name in `SOLVERS`.
        overrides: PETSc options without prefix that override the set.

    Raises:
        RefusedError: No solver of that name.
    """

    solver: str = "theta"
    overrides: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.solver not in SOLVERS:
            raise RefusedError("solver", self.solver, ", ".join(SOLVERS))

    @property
    def all(self) -> dict[str, str]:
        """Everything that is put to PETSc."""
        return {**SOLVERS[self.solver], **self.overrides}

    @property
    def by_levels(self) -> bool:
        """True for the preconditioner that solves level by level."""
        return self.all["pc_type"] == "python"

    @property
    def residual_limit(self) -> float:
        """Relative residual above which a system counts as not solved, 1e-7 … 1e-5."""
        try:
            tolerance = 100 * float(self.overrides.get("ksp_rtol", 0))
        except ValueError:
            tolerance = 0.0
        return min(1e-5, max(1e-7, tolerance))

    def __str__(self) -> str:
        overrides = (f"-{PREFIX}{name} {value}".strip() for name, value in self.overrides.items())
        return " ".join([self.solver, *overrides])
