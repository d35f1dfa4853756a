"""Fuzzy numbers whose cuts change at few levels: what order statistics give."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.sets.numbers import Cut, Cuts, FuzzyNumber, level, nested


@dataclass(frozen=True)
class Stepwise(FuzzyNumber):
    """Fuzzy number by nested cuts, each of which holds from its level up to the next one.

    Args:
        alpha: Levels from which the cuts hold, rising from 0, at most 1.
        lower: Lower ends, not falling.
        upper: Upper ends, not rising.

    Raises:
        RefusedError: Lengths differ, levels do not rise from 0 within [0, 1], or cuts are not
            finite, nested intervals.
    """

    alpha: tuple[float, ...]
    lower: tuple[float, ...]
    upper: tuple[float, ...]

    def __post_init__(self) -> None:
        rows = nested(self.alpha, self.lower, self.upper)
        for name, row in zip(("alpha", "lower", "upper"), rows, strict=True):
            object.__setattr__(self, name, row)

    @cached_property
    def cuts(self) -> Cuts:
        """The cuts at every level and at the floating-point number just below the next one."""
        ends = [*(np.nextafter(level, 0.0) for level in self.alpha[1:]), 1.0]
        rows = [
            (at, k)
            for k, (start, end) in enumerate(zip(self.alpha, ends, strict=True))
            for at in dict.fromkeys((start, float(end)))
        ]
        return Cuts(
            tuple(at for at, _ in rows),
            tuple(self.lower[k] for _, k in rows),
            tuple(self.upper[k] for _, k in rows),
        )

    def cut(self, alpha: float) -> Cut:
        """The cut that holds at `alpha` in [0, 1]."""
        at = bisect_right(self.alpha, level(alpha)) - 1
        return Cut(self.lower[at], self.upper[at])


def outer_steps(
    alpha: Sequence[float] | Array, lower: Sequence[float] | Array, upper: Sequence[float] | Array
) -> Stepwise:
    """Steps around nested cuts known at some levels: between two levels the wider cut holds.

    Args:
        alpha: Levels, rising; the first cut holds from 0 on. One that rounding has lifted above a
            decimal, as 0.1 + 0.2, counts as that decimal.
        lower: Lower ends.
        upper: Upper ends.
    """
    levels = (0.0, *(min(float(level), round(float(level), 12)) for level in alpha[1:]))
    return Stepwise(levels, tuple(lower), tuple(upper))
