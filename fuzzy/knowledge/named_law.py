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
from alphacut.fuzzy.refused import real, require
from alphacut.fuzzy.sets.claimed import Claim, Claimed
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
    logarithmic, finite = law == "log-normal", np.isfinite([data.lower, data.upper]).all()
    cure = "give bounds=(lower, upper) in place of a law, or measure more"
    positive = not logarithmic or data.lower[0] > 0
    require(
        positive,
        "least value",
        value=data.lower[0],
        allowed="positive ones with a log-normal law",
        cure=cure,
    )
    are_distinct = not data.exact or data.lower[0] < data.lower[-1]
    values = f"{data.count} from {data.lower[0]:g} to {data.upper[-1]:g}"
    enough = data.count > 1 and finite and are_distinct
    require(
        enough,
        f"values of a {law} law",
        value=values,
        allowed="two or more, finite, unlike",
        cure=cure,
    )
    about = data.mapped(np.log) if logarithmic else data
    lower, upper = _student(about, 0.5 if mean else quantile)
    with np.errstate(over="ignore"):
        lower, upper = (np.exp(lower), np.exp(upper)) if logarithmic else (lower, upper)
    return _within(lower, upper, data.bounds)


def _student(data: Observations, quantile: float | None) -> tuple[Array, Array]:
    """Return lower and upper bounds of the cuts at the `LEVELS`: mean + factor · deviation.

    The widest cuts over all values within their intervals are taken.
    """
    below, above = _factors(data.count, quantile)
    least, most = _scatter(data)
    lower = data.lower.mean() + below * np.where(below < 0, most, least)
    upper = data.upper.mean() + above * np.where(above > 0, most, least)
    return lower, upper


def _scatter(data: Observations) -> tuple[float, float]:
    """Return least and greatest standard deviation of values anywhere within their intervals.

    By the triangle inequality it differs from that of the middles by the norm of the half widths.
    """
    middle, half = (data.lower + data.upper) / 2, (data.upper - data.lower) / 2
    spread, give = float(middle.std(ddof=1)), float(np.sqrt((half**2).sum() / (data.count - 1)))
    return max(spread - give, 0.0), spread + give


@lru_cache(maxsize=64)
def _factors(n: int, quantile: float | None) -> tuple[Array, Array]:
    """Return the factors of the standard deviation for lower and upper end at the `LEVELS`.

    Student's t for next value, mean and median, the non-central t for other quantiles.

    Args:
        n: Number of values.
        quantile: Probability of the quantile, 0.5 for mean and median; None for the next value.
    """
    tail = LEVELS / 2
    if quantile is None or quantile == 0.5:
        from scipy.stats import t

        reach = np.maximum(t.isf(tail, n - 1), 0.0) * np.sqrt(
            (1 + 1 / n) if quantile is None else 1 / n
        )
        return -reach, reach
    from scipy.stats import nct, norm

    shift = norm.ppf(quantile) * np.sqrt(n)
    return nct.ppf(tail, n - 1, shift) / np.sqrt(n), nct.isf(tail, n - 1, shift) / np.sqrt(n)


def _within(lower: Array, upper: Array, bounds: tuple[float, float]) -> tuple[Stepwise, float]:
    """Return the cuts clipped to physical bounds, and the level from which on they are finite.

    Below that level the cuts repeat the first finite one; with two bounds the level is 0.
    """
    low, high = bounds
    upper = np.minimum.accumulate(np.clip(upper, low, high))
    # at α = 1 both are one point, to round-off
    lower = np.minimum(np.maximum.accumulate(np.clip(lower, low, high)), upper[-1])
    first = int((np.isfinite(lower) & np.isfinite(upper)).argmax())
    bounded = bool(np.isfinite(bounds).all())
    least, most = (low, high) if bounded else (lower[first], upper[first])
    lower[:first], upper[:first] = lower[first], upper[first]
    steps = Stepwise((0.0, *LEVELS), (least, *lower), (most, *upper))
    return steps, 0.0 if bounded else float(LEVELS[first])


def from_scatter(mean: float, deviation: float, count: int) -> Claimed:
    """Return the fuzzy number of the mean of a normal law with known standard deviation.

    Args:
        mean: Mean of the values.
        deviation: Standard deviation of one value.
        count: Number of values, 1 or more.

    Raises:
        RefusedError: The deviation or the count is not positive.
    """
    from scipy.stats import norm

    real("mean", mean)
    real("deviation", deviation, positive=True)
    real("count", count, positive=True, whole=True)
    reach = deviation / np.sqrt(count) * np.maximum(norm.isf(LEVELS / 2), 0.0)
    law = f"{count} values drawn alike and independently from a normal law of known deviation"
    steps, decided = _within(mean - reach, mean + reach, (-np.inf, np.inf))
    return Claimed(steps, Claim("mean", (law,)), decided)
