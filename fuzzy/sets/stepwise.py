"""Fuzzy numbers whose cuts change at few levels: what order statistics give."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from alphacut.fuzzy.sets.numbers import Array, Cut, Cuts, FuzzyNumber


@dataclass(frozen=True)
class Stepwise(FuzzyNumber):
    """Fuzzy number by nested cuts, each of which holds from its level up to the next one.

    Args:
        alpha: Levels from which the cuts hold, rising from 0, at most 1.
        lower: Lower ends, not falling.
        upper: Upper ends, not rising.
        outer: Whether truer cuts are narrower between the levels.

    Raises:
        ValueError: Lengths differ, levels do not rise from 0 within [0, 1], or cuts are not finite,
            nested intervals.
    """

    alpha: tuple[float, ...]
    lower: tuple[float, ...]
    upper: tuple[float, ...]
    outer: bool = field(default=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        level, lower, upper = (
            np.asarray(getattr(self, name), float) for name in ("alpha", "lower", "upper")
        )
        if (
            not (0 < len(level) == len(lower) == len(upper))
            or level[0] != 0
            or level[-1] > 1
            or (np.diff(level) <= 0).any()
        ):
            raise ValueError(
                f"there are {len(level)} levels, {len(lower)} lower and {len(upper)} upper ends;"
                f" levels must rise from 0 within [0, 1], with as many ends"
            )
        ends = np.concatenate([lower, upper[::-1]])
        if not np.isfinite(ends).all() or (np.diff(ends) < 0).any():
            raise ValueError(
                "the ends of the cuts are not nested or not finite; lower ends must rise with α,"
                " upper ends fall"
            )
        for name, row in (("alpha", level), ("lower", lower), ("upper", upper)):
            object.__setattr__(self, name, tuple(row.tolist()))

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
        """The cut that holds at `alpha` in [0, 1].

        Raises:
            ValueError: `alpha` lies outside [0, 1].
        """
        if not 0 <= alpha <= 1:
            raise ValueError(f"the α of a cut is {alpha:g}; it must lie in [0, 1]")
        at = bisect_right(self.alpha, alpha) - 1
        return Cut(self.lower[at], self.upper[at])

    def known(self, alpha: float) -> float:
        """Greatest level up to `alpha` whose cut is no wider than it is told."""
        return self.alpha[bisect_right(self.alpha, alpha) - 1] if self.outer else alpha


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
    return Stepwise(levels, tuple(lower), tuple(upper), outer=True)
