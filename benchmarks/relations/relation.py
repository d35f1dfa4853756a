"""Relations: ways to say a problem otherwise, and checks of all results against the plain one."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any, Protocol, Self

import numpy as np

from benchmarks.relations.stated import Stated, contradictions

ROUNDED = 1e-6
"""Share of an output's size by which numbers may differ that are the same but for rounding."""
Chance = np.random.Generator


class Subject(Protocol):
    """A problem that gives its results in one frame of reference, however it is said."""

    @classmethod
    def drawn(cls, chance: Chance) -> Self:
        """A random problem."""

    def stated(self) -> Stated:
        """What its result states."""


@dataclass(frozen=True)
class Relation:
    """A way to say a problem otherwise.

    Args:
        name: In words.
        said: The problem said otherwise; None where it does not apply.
        within: Share of an output's size within which every number stays; None where it need not.
    """

    name: str
    said: Callable[[Any, Chance], Any]
    within: float | None = None


def shuffled(subject: Any, chance: Chance) -> Any:
    """The problem with its fuzzy inputs in another order."""
    order = map(str, chance.permutation([*subject.fuzzy]))
    return replace(subject, fuzzy={name: subject.fuzzy[name] for name in order})


def one_level(subject: Any, chance: Chance) -> Any:
    """The problem on one of its levels."""
    return replace(subject, alpha=(float(chance.choice(subject.alpha)),))


def checked(
    subject: Subject, relations: Sequence[Relation], chance: Chance, *, pairs: int = 0
) -> Iterator[tuple[str, list[str]]]:
    """Names of the relations that apply with the contradictions found, a failure among them.

    Args:
        subject: The problem.
        relations: Ways to say it otherwise, checked one at a time.
        chance: Source of chance.
        pairs: Number of pairs of relations that are checked as well, drawn at random.
    """
    plain, both = subject.stated(), list(combinations(relations, 2))
    drawn = chance.permutation(len(both))[:pairs]
    for row in [*((x,) for x in relations), *(both[k] for k in drawn)]:
        said: Any = subject
        for relation in row:
            said = said and relation.said(said, chance)
        if said is None:
            continue
        shares = [relation.within for relation in row]
        within = None if None in shares else max(share or 0.0 for share in shares)
        try:
            lines = contradictions(plain, said.stated(), within=within)
        except Exception as error:
            lines = [f"{type(error).__name__}: {error}"]
        yield " and ".join(relation.name for relation in row), lines
