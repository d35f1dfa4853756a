"""The linear solvers of the product-space cell by name: PETSc options, readable in one place.

`theta` is the default: conjugate gradients with this project's preconditioner (`rve.theta_preconditioner`). The others are there
to compare with. `pc_type python` stands for the preconditioner of the set's own name. Options given under the prefix `-rve_` on the
command line override a named set.
"""

from __future__ import annotations

from collections.abc import Mapping

PREFIX = "rve_"
_CG = {"ksp_type": "cg", "ksp_rtol": "1e-9", "ksp_norm_type": "preconditioned", "ksp_max_it": "2000"}

SOLVERS: Mapping[str, Mapping[str, str]] = {
    # Kronecker-like in θ, exact Cholesky factors of each level
    "theta": {**_CG, "pc_type": "python"},
    # one exact Cholesky block for each level of θ and for what lies between, added up
    "blocks": {**_CG, "pc_type": "python"},
    # algebraic multigrid at its defaults
    "gamg": {**_CG, "pc_type": "gamg"},
    # sparse direct
    "mumps": {"ksp_type": "preonly", "pc_type": "cholesky", "pc_factor_mat_solver_type": "mumps"},
}


def describe(name: str, options: Mapping[str, str]) -> str:
    """The solver's name, with the options that differ from the named set."""
    changed = [f"-{PREFIX}{key} {value}".strip() for key, value in options.items() if SOLVERS[name].get(key) != value]
    return " ".join([name, *changed])
