"""Measured values, and exact cuts of any law from their ranks.

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

        Raises:
            RefusedError: There is no value, one is not a number, or one lies outside the bounds.
        """
        low, high = (None, None) if bounds is None else bounds
        low = -np.inf if low is None else checked_number("lower bound", low)
        high = np.inf if high is None else checked_number("upper bound", high)
        allowed = "(lower, upper) with lower < upper, None for none"
        require(low < high, "bounds", value=bounds, allowed=allowed)
        require(len(values) > 0, "values", value=list(values), allowed="one or more")
        within = f"values within the bounds [{low:g}, {high:g}]"
        for number, value in enumerate(values, 1):
            checked_number(f"value {number}", value)
            require(low <= value <= high, f"value {number}", value=value, allowed=within)
        return cls(np.sort(np.asarray(values, float)), (low, high))


class Windows(NamedTuple):
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
    from scipy.stats import binom

    # probability of the quantity in each gap, in all lower and in all higher ones
    gaps = np.arange(n + 1)
    if quantile is None:
        inside, below, above = np.full(n + 1, 1 / (n + 1)), gaps / (n + 1), (n - gaps) / (n + 1)
    else:
        law = binom(n, quantile)
        inside, below, above = law.pmf(gaps), law.cdf(gaps - 1), law.sf(gaps)
    low, high, level = 0, n, 0.0
    windows_by_level = {level: (low, high)}
    while low < high:
        # a gap at an open end first, then the less probable one, then that where less was removed
        is_low_closed, is_high_closed = not open_ends[0] or low > 0, not open_ends[1] or high < n
        lowest, highest = (inside[low], below[low]), (inside[high], above[high])
        if (is_low_closed, *lowest) <= (is_high_closed, *highest):
            low += 1
        else:
            high -= 1
        level = max(level, min(below[low] + above[high], 1.0))
        windows_by_level[level] = low, high  # of equal levels the last window
    windows_by_level.pop(1.0, None)
    first, last = np.array(list(windows_by_level.values())).T
    return Windows(np.array(list(windows_by_level)), first, last)


def rank_cuts(data: Observations, quantile: float | None) -> tuple[Stepwise, float]:
    """Return the α-cuts from ranks, and the least level at which the values decide both ends.

    Below that level the cuts repeat the first that is finite; a finite physical bound is an end.

    Args:
        data: The values.
        quantile: Probability of the quantile; None for the next value.
    """
    low, high = data.bounds
    nested = windows(len(data.values), quantile, (bool(np.isinf(low)), bool(np.isinf(high))))
    levels = np.append(nested.level, 1.0)
    lower = np.append(low, data.values)[nested.low]
    upper = np.append(data.values, high)[nested.high]
    centre = float(np.quantile(data.values, 0.5 if quantile is None else quantile))  # cut at α = 1
    finite = np.flatnonzero(np.isfinite(lower) & np.isfinite(upper))
    if not len(finite):
        return Stepwise((0.0,), (centre,), (centre,)), 1.0
    first = finite[0]
    lower[:first], upper[:first] = lower[first], upper[first]
    centre = float(np.clip(centre, lower[-1], upper[-1]))
    cuts = Stepwise(tuple(levels), (*lower, centre), (*upper, centre))
    return cuts, float(levels[first])
