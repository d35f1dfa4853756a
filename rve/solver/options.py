"""The linear solvers of the product-space cell by name: PETSc options, readable in one place.

`theta` is the default: conjugate gradients with this project's preconditioner
(`rve.theta_preconditioner`). The others are there to compare with. `pc_type python` stands for that
preconditioner. Options given under the prefix `-rve_` on the command line override a named set.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

PREFIX = "rve_"
_CG = {
    "ksp_type": "cg",
    "ksp_rtol": "2e-9",
    "ksp_norm_type": "preconditioned",
    "ksp_max_it": "2000",
}
# a pressure weighs less in the residual than in the solution
_GMRES = {"ksp_type": "gmres", "ksp_gmres_restart": "200", "ksp_rtol": "1e-10"}


class OptionError(ValueError):
    """A PETSc option that PETSc does not take."""


SOLVERS: Mapping[str, Mapping[str, str]] = {
    # Kronecker-like in θ, exact Cholesky factors of each level
    "theta": {**_CG, "pc_type": "python"},
    # algebraic multigrid at its defaults
    "gamg": {**_CG, "pc_type": "gamg"},
    # sparse direct
    "mumps": {"ksp_type": "preonly", "pc_type": "cholesky", "pc_factor_mat_solver_type": "mumps"},
}


@dataclass(frozen=True)
class SolverOptions:
    """A named set with what overrides it.

    Args:
        solver: Name in `SOLVERS`.
        given: PETSc options without prefix that override the set.

    Raises:
        ValueError: No solver of that name.
    """

    solver: str = "theta"
    given: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.solver not in SOLVERS:
            raise ValueError(f"the solver is {self.solver!r}; known are {', '.join(SOLVERS)}")

    @property
    def all(self) -> dict[str, str]:
        """Everything that is put to PETSc."""
        return {**SOLVERS[self.solver], **self.given}

    @property
    def indefinite(self) -> SolverOptions:
        """The same for a saddle point: GMRES in place of conjugate gradients."""
        return replace(self, given={**_GMRES, **self.given})

    @property
    def loose(self) -> SolverOptions:
        """The same for solutions to be projected on, whose errors count by their square."""
        return replace(self, given={"ksp_rtol": "1e-7", **self.given})

    @property
    def residual_limit(self) -> float:
        """Relative residual above which a system counts as not solved, 1e-7 … 1e-5."""
        try:
            wanted = 100 * float(self.given.get("ksp_rtol", 0))
        except ValueError:
            wanted = 0.0
        return min(1e-5, max(1e-7, wanted))

    def __str__(self) -> str:
        return " ".join(
            [
                self.solver,
                *(f"-{PREFIX}{name} {value}".strip() for name, value in self.given.items()),
            ]
        )
