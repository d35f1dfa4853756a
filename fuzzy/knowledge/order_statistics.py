"""Measured values, and exact cuts of any distribution from their ranks.

Between n values in rising order, with the physical bounds at both ends, there are n + 1 gaps. The
probability that the quantity lies in gap k does not depend on the distribution of the values:
1/(n + 1) for the next value (conformal prediction), binomial for a quantile. Gaps are removed from
the ends; the cut consists of the remaining gaps, and its level is the probability of the removed
gaps. Ties and discrete distributions add coverage.

Sources: Wilks, Annals of Mathematical Statistics 12 (1941), 91-96; David and Nagaraja, Order
Statistics, section 7.1; Vovk, Gammerman and Shafer, Algorithmic Learning in a Random World, chapter
2.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from alphacut.base.arrays import Array, Ints
from alphacut.base.errors import checked_number, require
from alphacut.fuzzy.sets.numbers import Stepwise

Values = Sequence[float] | NDArray[np.float64]
Limits = tuple[float | None, float | None]


@dataclass(frozen=True, eq=False)
class Observations:
    """Measured values, rising, shape (n,), and the physically possible ones, infinite for none."""

    values: Array
    bounds: tuple[float, float]

    @classmethod
    def from_values(cls, values: Values, bounds: Limits | None = None) -> Observations:
        """Return the observations of values as measured, within physical bounds.

        Args:
            values: The values in any order.
            bounds: Lower and upper bound, None for one that does not exist.

        Raises:
            RefusedError: There is no value, one is not a number, or one lies outside the bounds.
        """
        low = -np.inf
        high = np.inf
        if bounds is not None:
            if bounds[0] is not None:
                low = checked_number("lower bound", bounds[0])
            if bounds[1] is not None:
                high = checked_number("upper bound", bounds[1])
        allowed = "(lower, upper) with lower < upper, None for none"
        require(low < high, "bounds", value=bounds, allowed=allowed)
        require(len(values) > 0, "values", value=list(values), allowed="one or more")
        within = f"values within the bounds [{low:g}, {high:g}]"
        for number, value in enumerate(values, 1):
            checked_number(f"value {number}", value)
            require(low <= value <= high, f"value {number}", value=value, allowed=within)
        return cls(np.sort(np.asarray(values, float)), (low, high))


class Windows(NamedTuple):
    """Nested ranges of gaps, three arrays of shape (k,).

    Args:
        level: Probability of the gaps outside each range, rising from 0.
        low: First gap of each range.
        high: Last gap of each range.
    """

    level: Array
    low: Ints
    high: Ints


@dataclass(frozen=True, eq=False)
class _GapProbabilities:
    """Probability that a quantity lies in each gap, below it and above it, shape (n + 1,) each."""

    inside: Array
    below: Array
    above: Array

    @classmethod
    def of(cls, n: int, quantile: float | None) -> _GapProbabilities:
        """Return the probabilities of the next value, or of a quantile, among n values."""
        from scipy.stats import binom

        gaps = np.arange(n + 1)
        if quantile is None:
            return cls(np.full(n + 1, 1 / (n + 1)), gaps / (n + 1), (n - gaps) / (n + 1))
        # The number of values below the quantile has a binomial distribution.
        count = binom(n, quantile)
        return cls(count.pmf(gaps), count.cdf(gaps - 1), count.sf(gaps))


@lru_cache(maxsize=64)
def windows(n: int, quantile: float | None, open_ends: tuple[bool, bool]) -> Windows:
    """Return nested windows of the n + 1 gaps between n sorted values, and the level of each.

    Args:
        n: Number of values.
        quantile: Probability of the quantile in (0, 1); None for the next value.
        open_ends: Whether the lower and the upper end have no physical bound: gaps there are
            removed first.
    """
    gaps = _GapProbabilities.of(n, quantile)
    low = 0
    high = n
    level = 0.0
    windows_by_level = {level: (low, high)}
    while low < high:
        # Remove the gap at an open end first, then the less probable gap of the two ends, then the
        # gap at the end where less was removed.
        is_low_closed = not open_ends[0] or low > 0
        is_high_closed = not open_ends[1] or high < n
        lowest = (is_low_closed, gaps.inside[low], gaps.below[low])
        highest = (is_high_closed, gaps.inside[high], gaps.above[high])
        if lowest <= highest:
            low += 1
        else:
            high -= 1
        # The level is the probability of all gaps that were removed. Rounding must not let it fall,
        # nor lift it above 1.
        level = max(level, min(gaps.below[low] + gaps.above[high], 1.0))
        windows_by_level[level] = (low, high)  # of equal levels the last window
    # At level 1 the cut is the estimate itself, which the caller adds.
    windows_by_level.pop(1.0, None)
    ranges = np.array(list(windows_by_level.values()))
    return Windows(np.array(list(windows_by_level)), low=ranges[:, 0], high=ranges[:, 1])


def rank_cuts(data: Observations, quantile: float | None) -> tuple[Stepwise, float]:
    """Return the α-cuts from ranks, and the smallest level at which the values decide both ends.

    Below that level the cuts repeat the first that is finite; a finite physical bound is an end.
    The cut at α = 1 is the sample's quantile, the median for the next value.

    Args:
        data: The values.
        quantile: Probability of the quantile; None for the next value.
    """
    low, high = data.bounds
    nested = windows(len(data.values), quantile, (bool(np.isinf(low)), bool(np.isinf(high))))
    levels = np.append(nested.level, 1.0)
    # Gap k begins at the k-th value, gap 0 at the lower bound; the last gap ends at the upper one.
    lower = np.append(low, data.values)[nested.low]
    upper = np.append(data.values, high)[nested.high]
    centre = float(np.quantile(data.values, 0.5 if quantile is None else quantile))
    # A window that holds a gap at an end without a bound has an infinite end: the values do not
    # decide it.
    finite = np.flatnonzero(np.isfinite(lower) & np.isfinite(upper))
    if not len(finite):
        return Stepwise((0.0,), (centre,), (centre,)), 1.0
    first = finite[0]
    lower[:first] = lower[first]
    upper[:first] = upper[first]
    centre = float(np.clip(centre, lower[-1], upper[-1]))  # cuts are nested
    cuts = Stepwise(tuple(levels), tuple(np.append(lower, centre)), tuple(np.append(upper, centre)))
    return cuts, float(levels[first])
