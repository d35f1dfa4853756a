"""Cuts of a mean without a law: they need physical bounds.

Without bounds no statement about a mean holds for all laws: a rare, far value moves the mean and is
not seen (Bahadur and Savage, Annals of Mathematical Statistics 27, 1956, 1115-1122). With bounds,
the distribution function lies within a band around that of the values (Smirnov, exact for n
values), and the mean between the means of the band's edges (Anderson, Bulletin of the International
Statistical Institute 43, 1969, 249-251).
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from alphacut.fuzzy.knowledge.named_law import LEVELS
from alphacut.fuzzy.knowledge.observations import Observations
from alphacut.fuzzy.knowledge.order_statistics import Side
from alphacut.fuzzy.sets.numbers import Array
from alphacut.fuzzy.sets.stepwise import Stepwise


def mean_cuts(data: Observations, side: Side) -> Stepwise:
    """Cuts of the mean of a law within the bounds.

    Raises:
        ValueError: A bound is missing.
    """
    low, high = data.bounds
    if not np.isfinite(data.bounds).all():
        cure = (
            "give bounds=(lower, upper), what is physically possible, or law='normal' or"
            " 'log-normal'"
        )
        raise ValueError(
            f"no number of values decides a mean without a law or bounds (Bahadur and Savage):"
            f" {cure}"
        )
    band = _band(data.count, side)
    count = np.arange(data.count + 1) / data.count
    sums = [np.append(0.0, np.cumsum(row)) / data.count for row in (data.lower, data.upper)]
    lower = low * band + np.interp(1 - band, count, sums[0])
    upper = high * band + sums[1][-1] - np.interp(band, count, sums[1])
    lower = np.full_like(lower, low) if side == "upper" else lower
    upper = np.full_like(upper, high) if side == "lower" else upper
    return Stepwise(
        (0.0, *LEVELS), (low, *np.maximum.accumulate(lower)), (high, *np.minimum.accumulate(upper))
    )


@lru_cache(maxsize=64)
def _band(n: int, side: Side) -> Array:
    """Half width of the band that one side leaves with the probability of each level."""
    from scipy.stats import ksone

    band: Array = ksone.isf(LEVELS / 2 if side == "both" else LEVELS, n)
    return np.clip(band, 0.0, 1.0)
