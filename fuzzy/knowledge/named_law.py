"""Exact cuts under a named law: normal, or log-normal through the logarithms of the values.

Next value and mean by Student's t, quantiles by the non-central t (Hahn and Meeker, Statistical
Intervals, 1991, chapters 4 and 14).
"""

from __future__ import annotations

from functools import lru_cache
from typing import Literal

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.knowledge.observations import Observations
from alphacut.fuzzy.refused import checked_number, require
from alphacut.fuzzy.sets.claimed import ClaimedNumber, CoverageClaim
from alphacut.fuzzy.sets.numbers import Stepwise

Law = Literal["normal", "log-normal"]
LEVELS = np.unique(
    np.round(np.concatenate([np.geomspace(1e-9, 1, 600), np.linspace(0.0025, 1, 400)]), 12)
)
"""Levels at which the cuts are exact: hundredths and quarters of them among others. Between two of
them the wider cut holds.
"""


def law_cuts(
    data: Observations, law: Law, quantile: float | None, *, mean: bool
) -> tuple[Stepwise, float]:
    """Return the α-cuts of a quantity under a named law, and the least level with finite ends.

    Args:
        data: The values.
        law: Name of the law.
        quantile: Probability of the quantile to bound; None for the next value, or for the mean.
        mean: Whether the mean is to be bounded, which `from_data` allows with a normal law alone.

    Returns:
        The cuts at the `LEVELS`, clipped to the physical bounds, and the level, which is 0 with
        bounds on both sides.

    Raises:
        RefusedError: The values do not fit the law: fewer than two, all equal, not positive, or
            censored without an end.
    """
    is_logarithmic = law == "log-normal"
    cure = "give bounds=(lower, upper) in place of a law, or measure more"
    is_positive, allowed = data.lower[0] > 0, "positive ones with a log-normal law"
    require(
        is_positive or not is_logarithmic,
        "least value",
        value=data.lower[0],
        allowed=allowed,
        cure=cure,
    )
    are_finite = np.isfinite([data.lower, data.upper]).all()
    are_distinct = not data.exact or data.lower[0] < data.lower[-1]
    is_enough = data.count > 1 and are_finite and are_distinct
    values = f"{data.count} from {data.lower[0]:g} to {data.upper[-1]:g}"
    allowed = "two or more, finite, unlike"
    require(is_enough, f"values of a {law} law", value=values, allowed=allowed, cure=cure)
    normal_data = data.mapped(np.log) if is_logarithmic else data
    lower, upper = _normal_cuts(normal_data, 0.5 if mean else quantile)
    if is_logarithmic:
        with np.errstate(over="ignore"):
            lower, upper = np.exp(lower), np.exp(upper)
    return _clip_cuts(lower, upper, data.bounds)


def _normal_cuts(data: Observations, quantile: float | None) -> tuple[Array, Array]:
    """Lower and upper ends at the `LEVELS` under a normal law: mean + factor · deviation.

    They are the widest over all values within their intervals; see `_factors` for the quantile.
    """
    lower_factor, upper_factor = _factors(data.count, quantile)
    least, greatest = _deviation_range(data)
    lower = data.lower.mean() + lower_factor * np.where(lower_factor < 0, greatest, least)
    upper = data.upper.mean() + upper_factor * np.where(upper_factor > 0, greatest, least)
    return lower, upper


def _deviation_range(data: Observations) -> tuple[float, float]:
    """Lower and upper bound of the standard deviation of values anywhere within their intervals.

    By the triangle inequality it differs from that of the middles by at most the norm of the half
    widths over √(n − 1).
    """
    middle, half_width = (data.lower + data.upper) / 2, (data.upper - data.lower) / 2
    deviation = float(middle.std(ddof=1))
    change = float(np.sqrt((half_width**2).sum() / (data.count - 1)))
    return max(deviation - change, 0.0), deviation + change


@lru_cache(maxsize=64)
def _factors(n: int, quantile: float | None) -> tuple[Array, Array]:
    """Factors k with which mean + k · deviation are ends of confidence intervals, (levels,) each.

    At each α of `LEVELS` the confidence is 1 − α. Student's t serves for the next value, the mean
    and the median, the non-central t for other quantiles.

    Args:
        n: Number of values.
        quantile: Probability of the quantile, 0.5 for mean and median; None for the next value.
    """
    tail = LEVELS / 2
    if quantile is None or quantile == 0.5:
        from scipy.stats import t

        variance = 1 + 1 / n if quantile is None else 1 / n
        factor = np.maximum(t.isf(tail, n - 1), 0.0) * np.sqrt(variance)
        return -factor, factor
    from scipy.stats import nct, norm

    noncentrality = norm.ppf(quantile) * np.sqrt(n)
    lower, upper = nct.ppf(tail, n - 1, noncentrality), nct.isf(tail, n - 1, noncentrality)
    return lower / np.sqrt(n), upper / np.sqrt(n)


def _clip_cuts(lower: Array, upper: Array, bounds: tuple[float, float]) -> tuple[Stepwise, float]:
    """Cuts at the `LEVELS` clipped to physical bounds, and the level from which they are finite.

    Below that level the cuts repeat the first finite one; with two bounds the level is 0.
    """
    low, high = bounds
    upper = np.minimum.accumulate(np.clip(upper, low, high))
    # at α = 1 both are one point, to round-off
    lower = np.minimum(np.maximum.accumulate(np.clip(lower, low, high)), upper[-1])
    first = int((np.isfinite(lower) & np.isfinite(upper)).argmax())
    is_bounded = bool(np.isfinite(bounds).all())
    least, greatest = (low, high) if is_bounded else (lower[first], upper[first])
    lower[:first], upper[:first] = lower[first], upper[first]
    cuts = Stepwise((0.0, *LEVELS), (least, *lower), (greatest, *upper))
    return cuts, 0.0 if is_bounded else float(LEVELS[first])


def from_scatter(mean: float, deviation: float, count: int) -> ClaimedNumber:
    """Return the fuzzy number of the mean of a normal law with known standard deviation.

    Args:
        mean: Mean of the values.
        deviation: Standard deviation of one value.
        count: Number of values, 1 or more.

    Raises:
        RefusedError: The deviation or the count is not positive.
    """
    from scipy.stats import norm

    checked_number("mean", mean)
    checked_number("deviation", deviation, positive=True)
    checked_number("count", count, positive=True, whole=True)
    half_width = deviation / np.sqrt(count) * np.maximum(norm.isf(LEVELS / 2), 0.0)
    law = f"{count} values drawn alike and independently from a normal law of known deviation"
    cuts, decided = _clip_cuts(mean - half_width, mean + half_width, (-np.inf, np.inf))
    return ClaimedNumber(cuts, CoverageClaim("mean", (law,)), decided)
