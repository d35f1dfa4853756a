"""Exact cuts from the ranks of values: next value, median, quantile, without a law assumed.

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

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from alphacut.fuzzy.arrays import Array, Rows
from alphacut.fuzzy.knowledge.observations import Observations
from alphacut.fuzzy.refused import require
from alphacut.fuzzy.sets.numbers import Stepwise


@dataclass(frozen=True, eq=False)
class Windows:
    """Nested ranges of gaps, and the level from which each of them is the cut.

    Args:
        level: Probability outside, rising from 0, shape (k,).
        low: First gap, shape (k,).
        high: Last gap, shape (k,).
    """

    level: Array
    low: Rows
    high: Rows


@lru_cache(maxsize=64)
def windows(n: int, quantile: float | None, open_ends: tuple[bool, bool]) -> Windows:
    """Nested windows of gaps between n sorted values, and the level of each.

    The largest window holds all n + 1 gaps; `_removes_lowest` says which gap is removed next.

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
    """Probability that a quantile, or the next value, lies in each gap of n sorted values.

    Args:
        n: Number of values.
        quantile: Probability of the quantile; None for the next value, which is equally probable in
            all gaps.

    Returns:
        Probability of each of the n + 1 gaps, of all lower gaps, and of all higher ones, (n + 1,).
    """
    from scipy.stats import binom

    gaps = np.arange(n + 1)
    if quantile is None:
        return np.full(n + 1, 1 / (n + 1)), gaps / (n + 1), (n - gaps) / (n + 1)
    law = binom(n, quantile)
    return law.pmf(gaps), law.cdf(gaps - 1), law.sf(gaps)


def _removes_lowest(
    gaps: tuple[Array, Array, Array], low: int, high: int, open_ends: tuple[bool, bool]
) -> bool:
    """True if the next gap to remove is the lowest of the window, False if it is the highest.

    A gap at an open end is removed first, then the less probable one, then the one at the end from
    which less was removed.

    Args:
        gaps: Probabilities as of `_gaps`.
        low: First gap of the window.
        high: Last gap of the window.
        open_ends: Whether the lowest and the highest gap of all have no physical bound.
    """
    probability, below, above = gaps
    low_is_open = open_ends[0] and low == 0
    high_is_open = open_ends[1] and high == len(probability) - 1
    if low_is_open != high_is_open:
        return low_is_open
    if probability[low] != probability[high]:
        return bool(probability[low] < probability[high])
    return bool(below[low] <= above[high])


def rank_cuts(data: Observations, quantile: float | None) -> tuple[Stepwise, float]:
    """Return the α-cuts from ranks, and the least level at which the values decide both ends.

    Args:
        data: The values.
        quantile: Probability of the quantile; None for the next value.

    Returns:
        The cuts; below the level they repeat the first that is finite. Physical bounds count as
        ends.

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
