"""PETSc options of the product-space cell, and how they are chosen.

The default is conjugate gradients with this project's preconditioner, for which ``pc_type python``
stands. Options under the prefix ``-rve_`` override it, such as ``-rve_pc_type gamg``; those under
``-rve_level_`` are of the preconditioner's plane problems.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field

PREFIX = "rve_"
LEVEL = "level_"
DEFAULTS = {
    "ksp_type": "cg",
    "ksp_rtol": "1e-8",
    "ksp_norm_type": "unpreconditioned",
    "pc_type": "python",
}
MOST_ITERATIONS = 500
"""Iterations by the preconditioner, which takes tens at most; others may take ten times as many."""

PRINTS = re.compile(r"(_view|_monitor\w*|_converged_(reason|rate))$")
"""Options that make PETSc print."""


def _to_standard_error(name: str, value: str) -> str:
    """Where PETSc prints: a view, monitor or reason without a value goes to standard error."""
    prints = PRINTS.search(name) and not value
    return "ascii:stderr" if prints else value


@dataclass(frozen=True)
class SolverOptions:
    """The default with what overrides it.

    Args:
        overrides: PETSc options without prefix.
    """

    overrides: Mapping[str, str] = field(default_factory=dict)

    @property
    def all(self) -> dict[str, str]:
        """Everything that is put to PETSc."""
        chosen = {**DEFAULTS, **self.overrides}
        chosen = {name: _to_standard_error(name, value) for name, value in chosen.items()}
        most = MOST_ITERATIONS * (1 if chosen["pc_type"] == "python" else 10)
        return {"ksp_max_it": str(most), **chosen}

    @property
    def by_levels(self) -> bool:
        """True for the preconditioner that solves level by level."""
        return self.all["pc_type"] == "python"

    def __str__(self) -> str:
        words = [f"-{PREFIX}{name} {value}".strip() for name, value in self.overrides.items()]
        return " ".join(["theta", *words] if self.by_levels else words)
