"""Measured values as intervals, and exact cuts of any law from their ranks.

Between n values in rising order, with the physical bounds at both ends, there are n + 1 gaps. The
probability that the quantity lies in gap k does not depend on the law: 1/(n + 1) for the next value
(conformal prediction), binomial for a quantile. Gaps are removed from the ends; the cut consists of
the remaining gaps, and its level is the probability of the removed ones. Ties and discrete laws add
coverage.

Sources: Wilks, Annals of Mathematical Statistics 12 (1941), 91-96; David and Nagaraja, Order
Statistics, section 7.1; Vovk, Gammerman and Shafer, Algorithmic Learning in a Random World, chapter
2.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from alphacut.fuzzy.arrays import Array, Ints
from alphacut.fuzzy.refused import RefusedError, checked_number, require
from alphacut.fuzzy.sets.numbers import Stepwise

Values = Sequence[float] | Sequence[tuple[float, float]] | NDArray[np.float64]
Limits = tuple[float | None, float | None]


@dataclass(frozen=True, eq=False)
class Observations:
    """Values that are known to lie between two ends each, both rows in rising order.

    Args:
        lower: Lower ends, shape (n,), rising; −∞ where a value is only known from above.
        upper: Upper ends, shape (n,), rising; ∞ where a value is only known from below.
        bounds: Physically possible values; infinite where there is none.
    """

    lower: Array
    upper: Array
    bounds: tuple[float, float]

    @classmethod
    def from_values(cls, values: Values, bounds: Limits | None = None) -> Observations:
        """Return the observations of values as measured, numbers or pairs, within physical bounds.

        Raises:
            RefusedError: There is no value, a value is not a number, a pair is not in order, or a
                value lies outside the bounds.
        """
        low, high = _limits(bounds)
        ends = np.array([_ends(number, value) for number, value in enumerate(values, 1)])
        require(len(ends) > 0, "values", value=list(values), allowed="one or more")
        lower, upper = ends.T
        is_possible = (upper >= low) & (lower <= high)
        row = int(np.argmin(is_possible))
        allowed = f"values within the bounds [{low:g}, {high:g}]"
        require(is_possible.all(), f"value {row + 1}", value=ends[row].tolist(), allowed=allowed)
        return cls(np.sort(np.maximum(lower, low)), np.sort(np.minimum(upper, high)), (low, high))

    @property
    def count(self) -> int:
        """Number of values n."""
        return len(self.lower)

    @property
    def exact(self) -> bool:
        """True if every value is known exactly."""
        return bool((self.lower == self.upper).all())

    @property
    def is_censored(self) -> bool:
        """True if a value has an infinite end, which no bound replaces."""
        return bool(np.isinf([self.lower, self.upper]).any())

    def mapped(self, function: np.ufunc) -> Observations:
        """Observations of a rising function of the values, such as the logarithm."""
        with np.errstate(divide="ignore"):
            low, high = (float(function(end)) for end in self.bounds)
            return Observations(function(self.lower), function(self.upper), (low, high))


def _limits(bounds: Limits | None) -> tuple[float, float]:
    """Return the physical bounds as two floats, infinite where there is none."""
    lower, upper = (None, None) if bounds is None else bounds
    low = -np.inf if lower is None else checked_number("lower bound", lower)
    high = np.inf if upper is None else checked_number("upper bound", upper)
    allowed = "(lower, upper) with lower < upper, None for none"
    require(low < high, "bounds", value=bounds, allowed=allowed)
    return low, high


def _is_number(value: object) -> bool:
    """True for a number that a float can hold; truth values are none."""
    if isinstance(value, bool) or not isinstance(value, int | float | np.number):
        return False
    return not isinstance(value, int) or abs(value) < sys.float_info.max


def _ends(position: int, value: object) -> tuple[float, float]:
    """Lower and upper end of the measured value at a position from 1: a number or a pair."""
    ends = np.atleast_1d(np.asarray(value, object))
    has_ends = ends.ndim == 1 and len(ends) in (1, 2) and not np.ma.is_masked(value)  # type: ignore[no-untyped-call]
    if has_ends and all(_is_number(end) for end in ends):
        low, high = float(ends[0]), float(ends[-1])
        if low <= high and np.isfinite((low, high)).any():  # at most one end is infinite
            return low, high
    allowed = "finite numbers, or pairs (lower, upper) in order, one end of which may be infinite"
    raise RefusedError(f"value {position}", value, allowed)


@dataclass(frozen=True, eq=False)
class Windows:
    """Nested ranges of gaps from `low` to `high`, and the level of each, the probability outside.

    Three arrays of shape (k,), levels rising from 0.
    """

    level: Array
    low: Ints
    high: Ints


@lru_cache(maxsize=64)
def windows(n: int, quantile: float | None, open_ends: tuple[bool, bool]) -> Windows:
    """Nested windows of the n + 1 gaps between n sorted values, and the level of each.

    Args:
        n: Number of values.
        quantile: Probability of the quantile in (0, 1); None for the next value.
        open_ends: Ends without a physical bound: their gaps are removed first.
    """
    inside, below, above = _gaps(n, quantile)
    low, high, level = 0, n, 0.0
    windows_by_level = {level: (low, high)}
    while low < high:
        if _removes_lowest((inside, below, above), low, high, open_ends):
            low += 1
        else:
            high -= 1
        level = max(level, min(below[low] + above[high], 1.0))
        windows_by_level[level] = low, high  # of equal levels the last window
    windows_by_level.pop(1.0, None)
    first, last = np.array(list(windows_by_level.values())).T
    return Windows(np.array(list(windows_by_level)), first, last)


def _gaps(n: int, quantile: float | None) -> tuple[Array, Array, Array]:
    """Probability of the quantity in each of the n + 1 gaps, in all lower, in all higher ones."""
    from scipy.stats import binom

    gaps = np.arange(n + 1)
    if quantile is None:
        return np.full(n + 1, 1 / (n + 1)), gaps / (n + 1), (n - gaps) / (n + 1)
    law = binom(n, quantile)
    return law.pmf(gaps), law.cdf(gaps - 1), law.sf(gaps)


def _removes_lowest(
    gaps: tuple[Array, Array, Array], low: int, high: int, open_ends: tuple[bool, bool]
) -> bool:
    """True if the next gap to remove is the lowest of the window, False if it is the highest."""
    probability, below, above = gaps
    # a gap at an open end first, then the less probable one, then that where less was removed
    low_is_open = open_ends[0] and low == 0
    high_is_open = open_ends[1] and high == len(probability) - 1
    if low_is_open != high_is_open:
        return low_is_open
    if probability[low] != probability[high]:
        return bool(probability[low] < probability[high])
    return bool(below[low] <= above[high])


def rank_cuts(data: Observations, quantile: float | None) -> tuple[Stepwise, float]:
    """Return the α-cuts from ranks, and the least level at which the values decide both ends.

    Below that level the cuts repeat the first that is finite. Physical bounds count as ends.

    Args:
        data: The values.
        quantile: Probability of the quantile; None for the next value.

    Raises:
        RefusedError: The values decide no cut at all.
    """
    low, high = data.bounds
    nested = windows(data.count, quantile, (bool(np.isinf(low)), bool(np.isinf(high))))
    levels = np.append(nested.level, 1.0)
    lower = np.append(low, data.lower)[nested.low]
    upper = np.append(data.upper, high)[nested.high]
    centre = _centre(data, 0.5 if quantile is None else quantile)
    finite = np.flatnonzero(np.isfinite(lower) & np.isfinite(upper))
    if not len(finite):
        has_centre, allowed = np.isfinite(centre), "finite ends: the values decide no cut"
        require(has_centre, "bounds", value=data.bounds, allowed=allowed)
        return Stepwise((0.0,), (centre,), (centre,)), 1.0
    first = finite[0]
    lower[:first], upper[:first] = lower[first], upper[first]
    centre = float(np.clip(centre, lower[-1], upper[-1]))
    cuts = Stepwise(tuple(levels), (*lower, centre), (*upper, centre))
    return cuts, float(levels[first])


def _centre(data: Observations, quantile: float) -> float:
    """Return the sample quantile, the cut at α = 1: mean of those of lower and of upper ends."""
    rows = (row[np.isfinite(row)] for row in (data.lower, data.upper))
    ends = [np.quantile(row, quantile) for row in rows if len(row)]
    return float(np.mean(ends)) if ends else np.nan
