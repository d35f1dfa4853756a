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
from alphacut.base.errors import checked_number, require, require_sequence
from alphacut.fuzzy.sets.numbers import Stepwise

Values = Sequence[float] | NDArray[np.float64]
Limits = tuple[float | None, float | None]


@dataclass(frozen=True, eq=False)
class Observations:
    """Measured values of a quantity, and the physical bounds of what it can be.

    Args:
        values: The n ≥ 1 values in rising order, shape (n,).
        bounds: Lower and upper physical bound; −inf and inf where there is none.
    """

    values: Array
    bounds: tuple[float, float]

    @classmethod
    def from_values(cls, values: Values, bounds: Limits | None = None) -> Observations:
        """Check measured values and physical bounds, and return them with the values sorted.

        Args:
            values: One or more finite values in any order; equal values are allowed.
            bounds: Lower and upper end of what is physically possible, each None where there is no
                bound. Values on a bound are allowed.

        Raises:
            RefusedError: `values` is no list, tuple or array, or is empty; a value is not a finite
                number or lies outside the bounds; `bounds` is no pair, or its lower end is not
                below its upper end.
        """
        allowed = "(lower, upper) with lower < upper, None for none"
        # Without a bound the end is infinite, so that no comparison below needs a special case.
        low = -np.inf
        high = np.inf
        if bounds is not None:
            require_sequence("bounds", bounds, allowed)
            require(len(bounds) == 2, "bounds", value=bounds, allowed=allowed)
            if bounds[0] is not None:
                low = checked_number("lower bound", bounds[0])
            if bounds[1] is not None:
                high = checked_number("upper bound", bounds[1])
        require(low < high, "bounds", value=bounds, allowed=allowed)
        require_sequence("values", values, "a list of one or more numbers")
        require(len(values) > 0, "values", value=list(values), allowed="one or more")
        within = f"values within the bounds [{low:g}, {high:g}]"
        for number, value in enumerate(values, 1):
            checked_number(f"value {number}", value)
            require(low <= value <= high, f"value {number}", value=value, allowed=within)
        return cls(np.sort(np.asarray(values, float)), (low, high))


class Windows(NamedTuple):
    """Nested ranges of gaps between sorted values, three arrays of shape (ranges,).

    Args:
        level: Probability of the gaps outside each range, rising from 0.
        low: Index of the first gap of each range; gap 0 lies below all values.
        high: Index of the last gap of each range.
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
        """Return the probabilities that a quantity lies in each of the gaps between n values.

        Gap k, for k = 0 … n, lies between the k-th and the next of the n sorted values; gap 0 lies
        below all of them and gap n above all. The probabilities do not depend on the distribution
        of the values, if it is continuous.

        Args:
            n: Number of values, 1 or more.
            quantile: Probability in (0, 1) of the quantile that is meant; None for the next value
                of the same distribution.

        Returns:
            The probabilities that the quantity lies `inside` gap k, in a gap `below` it, and in a
            gap `above` it, shape (n + 1,) each. The three add up to 1.
        """
        from scipy.stats import binom

        gaps = np.arange(n + 1)
        if quantile is None:
            return cls(np.full(n + 1, 1 / (n + 1)), gaps / (n + 1), (n - gaps) / (n + 1))
        # Each value lies below the q-quantile with the probability q, independently. So the number
        # of values below it has a binomial distribution, and with k of them it lies in gap k.
        count = binom(n, quantile)
        return cls(count.pmf(gaps), count.cdf(gaps - 1), count.sf(gaps))


@lru_cache(maxsize=64)
def windows(n: int, quantile: float | None, open_ends: tuple[bool, bool]) -> Windows:
    """Return nested ranges of the gaps between n sorted values, and the level of each.

    Gap k lies between the k-th and the next value; gap 0 lies below all values and gap n above all.
    The first range has all n + 1 gaps and the level 0. Then one gap after another is removed from
    an end of the range, first a gap that has no physical bound at its end, else the less probable
    one. The level α is the probability that the quantity lies in a removed gap; it lies in the
    range with the probability 1 − α.

    Args:
        n: Number of values, 1 or more.
        quantile: Probability in (0, 1) of the quantile that is meant; None for the next value of
            the same distribution.
        open_ends: Whether there is no physical bound below, and none above, the values.

    Returns:
        The first gap `low` and the last gap `high` of each range, and its level. The levels rise
        from 0 on and stay below 1. Of ranges with equal levels the narrowest is returned. The
        arrays are cached and must not be changed.
    """
    # For gap k: the probabilities that the quantity lies inside it, in a gap below, and above it.
    gaps = _GapProbabilities.of(n, quantile)
    low = 0
    high = n
    level = 0.0
    windows_by_level = {level: (low, high)}
    while low < high:
        # Of the two gaps at the ends one without a bound is removed first, else the less probable
        # one, else the one on whose side less was removed. Tuples are compared in this order, and
        # False counts as less than True.
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
    """Return the α-cuts of the next value or of a quantile, from the ranks of measured values.

    P(quantity in its cut at α) ≥ 1 − α, whatever the distribution is. The ends of a cut are
    measured values or finite physical bounds. The cut at α = 1 is one point, the quantile of the
    sample, or its median for the next value, moved into the cut below if need be.

    Args:
        data: The sorted values and their physical bounds, infinite for none.
        quantile: Probability in (0, 1) of the quantile that is meant; None for the next value.

    Returns:
        The cuts, and the smallest level from which the values and bounds decide both ends. Below
        that level a cut would be infinite; the number repeats the first finite one there instead.
        The level is 1 if only the point at α = 1 is finite, as it is for one value without bounds.
    """
    low, high = data.bounds
    nested = windows(len(data.values), quantile, (bool(np.isinf(low)), bool(np.isinf(high))))
    levels = np.append(nested.level, 1.0)
    # Gap k begins at the k-th value, gap 0 at the lower bound; the last gap ends at the upper one.
    lower = np.append(low, data.values)[nested.low]
    upper = np.append(data.values, high)[nested.high]
    centre = float(np.quantile(data.values, 0.5 if quantile is None else quantile))
    # A range that holds a gap at an end without a bound has an infinite end: the values do not
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
