"""Relations: ways to say a problem otherwise, and checks of all results against the plain one."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
import xarray as xr

from benchmarks.relations.stated import contradictions

ROUNDED = 1e-6
"""Share of an output's size by which numbers may differ that are the same but for rounding."""
Chance = np.random.Generator
Problem = dict[str, Any]
"""Numbers of a problem by name, however it is said."""


@dataclass(frozen=True)
class Relation:
    """A way to say a problem otherwise.

    Args:
        name: In words.
        changed: Numbers of the problem that are said otherwise; None where it does not apply.
        within: Share of an output's size within which every number stays; None where it need not.
    """

    name: str
    changed: Callable[[Problem, Chance], Problem | None]
    within: float | None = None


SHUFFLED = Relation(
    "inputs in another order",
    lambda x, chance: {"fuzzy": {str(k): x["fuzzy"][k] for k in chance.permutation([*x["fuzzy"]])}},
)
ONE_LEVEL = Relation("one level", lambda x, chance: {"alpha": (float(chance.choice(x["alpha"])),)})
ONE_OUTPUT = Relation("one output", lambda x, chance: {"outputs": x["outputs"][:1]})


@dataclass(frozen=True)
class Kind:
    """Problems of a kind: how one is drawn at random, what its result states, its relations."""

    drawn: Callable[[Chance], Problem]
    stated: Callable[[Problem], xr.Dataset]
    relations: Sequence[Relation]

    def checked(
        self, problem: Problem, chance: Chance, relations: Sequence[Relation] = (), pairs: int = 0
    ) -> Iterator[tuple[str, list[str]]]:
        """Names of the relations that apply with the contradictions found, a failure among them.

        Args:
            problem: The problem.
            chance: Source of chance.
            relations: Those that are checked, one at a time; all, if none is given.
            pairs: Number of pairs of relations that are checked as well, drawn at random.
        """
        plain, single = self.stated(problem), relations or self.relations
        both = list(combinations(single, 2))
        rows = [*((x,) for x in single), *(both[k] for k in chance.permutation(len(both))[:pairs])]
        for row in rows:
            said = self._said(problem, row, chance)
            if said is None:
                continue
            shares = [relation.within for relation in row]
            within = None if None in shares else max(share or 0.0 for share in shares)
            try:
                lines = contradictions(plain, self.stated(said), within=within)
            except Exception as error:
                lines = [f"{type(error).__name__}: {error}"]
            yield " and ".join(relation.name for relation in row), lines

    def _said(self, problem: Problem, row: Sequence[Relation], chance: Chance) -> Problem | None:
        """The problem said otherwise by all relations of a row; None where one does not apply."""
        for relation in row:
            changes = relation.changed(problem, chance)
            if changes is None:
                return None
            problem = problem | changes
        return problem
