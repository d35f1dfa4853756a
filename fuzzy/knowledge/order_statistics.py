"""Exact cuts from the ranks of values: next value, median, quantile, without a law assumed.

Between n values in rising order, with the physical bounds at both ends, there are n + 1 gaps. The
probability that the quantity lies in gap k does not depend on the law: 1/(n + 1) for the next value
(conformal prediction), binomial for a quantile. Gaps are taken away from the ends; the cut is what
is left, and its level the probability taken away. Ties and discrete laws only add coverage.

Between two gaps the cut holds more than it claims: for the next value by 1/(n + 1) at most, for a
quantile by up to one binomial probability, which no rule that looks at the ranks alone can avoid. A
random number, drawn apart from the values, makes the coverage exact: it decides where between the
two levels the gap goes (a randomised, or smoothed, test turned into a set).

Sources: Wilks, Annals of Mathematical Statistics 12 (1941), 91-96; David and Nagaraja, Order
Statistics, section 7.1; Vovk, Gammerman and Shafer, Algorithmic Learning in a Random World, chapter
2.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from alphacut.fuzzy.knowledge.observations import Observations
from alphacut.fuzzy.sets.numbers import Array
from alphacut.fuzzy.sets.stepwise import Stepwise

Side = Literal["both", "lower", "upper"]


@dataclass(frozen=True, eq=False)
class Windows:
    """Nested rows of gaps with the level from which each is the cut.

    Args:
        level: Probability outside, rising from 0, shape (k,).
        low: First gap, shape (k,).
        high: Last gap, shape (k,).
    """

    level: Array
    low: NDArray[np.intp]
    high: NDArray[np.intp]


@lru_cache(maxsize=64)
def windows(n: int, quantile: float | None, side: Side, open_ends: tuple[bool, bool]) -> Windows:
    """Windows of gaps for n values.

    Args:
        n: Number of values.
        quantile: Probability of the quantile in (0, 1); None for the next value.
        side: Ends that move: "upper" is an upper limit, "lower" a lower one.
        open_ends: Ends without a physical bound: their gaps go first.
    """
    from scipy.stats import binom

    places = np.arange(n + 1)
    inside = np.full(n + 1, 1 / (n + 1)) if quantile is None else binom.pmf(places, n, quantile)
    outside = (
        (lambda low, high: (low + n - high) / (n + 1)) if quantile is None else _tails(n, quantile)
    )
    low, high = 0, n
    rows = [(0.0, low, high)]
    while low < high:
        if _takes_lower(inside, outside, low, high, side, open_ends):
            low += 1
        else:
            high -= 1
        rows.append((min(outside(low, high), 1.0), low, high))
    last = [
        row
        for row, after in zip(rows, [*rows[1:], (2.0, 0, 0)], strict=True)
        if after[0] > row[0] and row[0] < 1
    ]
    level, first, final = zip(*last, strict=True)
    return Windows(np.array(level), np.array(first), np.array(final))


def _tails(n: int, quantile: float) -> Callable[[int, int], float]:
    """Probability of a gap below `low` or above `high`."""
    from scipy.stats import binom

    below, above = binom.cdf(np.arange(-1, n), n, quantile), binom.sf(np.arange(n + 1), n, quantile)
    return lambda low, high: float(below[low] + above[high])


def _takes_lower(
    inside: Array,
    outside: Callable[[int, int], float],
    low: int,
    high: int,
    side: Side,
    open_ends: tuple[bool, bool],
) -> bool:
    """Whether the next gap goes from below.

    An open end goes first, then the less probable gap, then the end with less taken away.
    """
    if side != "both":
        return side == "lower"
    n = len(inside) - 1
    left, right = open_ends[0] and low == 0, open_ends[1] and high == n
    if left != right:
        return left
    if inside[low] != inside[high]:
        return bool(inside[low] < inside[high])
    return outside(low, n) <= outside(0, high)


def rank_cuts(
    data: Observations, quantile: float | None, side: Side, share: float = 1.0
) -> tuple[Stepwise, float]:
    """Cuts by ranks, and the least level at which the values (and bounds) decide both ends.

    Args:
        data: The values.
        quantile: Probability of the quantile; None for the next value.
        side: Ends that move.
        share: Share in (0, 1] of the way to the next level at which a gap goes: 1 never claims too
            much; one drawn evenly makes the coverage exact.

    Raises:
        ValueError: They decide no cut at all.
    """
    low, high = data.bounds
    found = windows(data.count, quantile, side, (bool(np.isinf(low)), bool(np.isinf(high))))
    levels = np.append(found.level, 1.0)
    levels[1:] = levels[:-1] + share * np.diff(levels)
    lower, upper = np.append(low, data.lower)[found.low], np.append(data.upper, high)[found.high]
    centre = _centre(data, 0.5 if quantile is None else quantile, side)
    finite = np.flatnonzero(np.isfinite(lower) & np.isfinite(upper))
    decided = float(levels[finite[0]]) if len(finite) else 1.0
    if not len(finite) and not np.isfinite(centre):
        raise ValueError(
            "the values decide no cut: give bounds=(lower, upper), what is physically possible"
        )
    if not len(finite):
        return Stepwise((0.0,), (centre,), (centre,)), decided
    lower[: finite[0]], upper[: finite[0]] = lower[finite[0]], upper[finite[0]]
    centre = float(np.clip(centre, lower[-1], upper[-1]))
    return Stepwise(tuple(levels), (*lower, centre), (*upper, centre)), decided


def _centre(data: Observations, quantile: float, side: Side) -> float:
    """Point that stays at α = 1: the sample's quantile, or the fixed end of a one-sided claim."""
    if side != "both":
        return data.bounds[0 if side == "upper" else 1]
    ends = [
        np.quantile(row[np.isfinite(row)], quantile)
        for row in (data.lower, data.upper)
        if np.isfinite(row).any()
    ]
    return float(np.mean(ends)) if ends else np.nan


def least_alpha(n: int, quantile: float | None = None, side: Side = "both") -> float:
    """Least α at which n values decide the cut without physical bounds, on the sides that move.

    Next value: 2/(n + 1) on both sides, 1/(n + 1) on one; quantile q: qⁿ + (1 − q)ⁿ, or the one of
    the two that the side needs.
    """
    if quantile is None:
        return (2 if side == "both" else 1) / (n + 1)
    return {
        "both": quantile**n + (1 - quantile) ** n,
        "upper": quantile**n,
        "lower": (1 - quantile) ** n,
    }[side]


def values_needed(alpha: float, quantile: float | None = None, side: Side = "both") -> int:
    """Least number of values that decide the cut at `alpha` without physical bounds.

    Raises:
        ValueError: `alpha` lies outside (0, 1].
    """
    if not 0 < alpha <= 1:
        raise ValueError(
            f"α is {alpha:g}; it must lie in (0, 1]: no number of values decides the cut at 0"
        )
    n = 1
    while least_alpha(n, quantile, side) > alpha:
        n *= 2
    counts = range(n // 2 + 1, n + 1)
    return counts[
        bisect_left(counts, True, key=lambda count: least_alpha(count, quantile, side) <= alpha)
    ]
