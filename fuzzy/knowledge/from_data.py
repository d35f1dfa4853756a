"""Fuzzy numbers from measured values, with a claim how often their cuts contain a quantity.

The next value, the median and quantiles by ranks (`order_statistics`), the mean by a band, or where
the distribution is known to be normal by Student's t (Hahn and Meeker, Statistical Intervals, 1991,
chapter 4).
"""

from __future__ import annotations

import re
from functools import lru_cache
from typing import Literal

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import checked_number, require
from alphacut.fuzzy.knowledge.order_statistics import Limits, Observations, Values, rank_cuts
from alphacut.fuzzy.sets.claimed import ClaimedNumber, CoverageClaim
from alphacut.fuzzy.sets.numbers import Stepwise

Law = Literal["normal"]
LEVELS = np.unique(
    np.round(np.concatenate([np.geomspace(1e-9, 1, 600), np.linspace(0.0025, 1, 400)]), 12)
)
"""Levels at which the cuts are exact: hundredths and quarters of them among others. Between two of
them the wider cut holds.
"""


def from_data(
    values: Values, claim: str, *, bounds: Limits | None = None, law: Law | None = None
) -> ClaimedNumber:
    """Return the fuzzy number of measured values: P(claimed quantity in its α-cut) >= 1 − α.

    The probability is over repeated samples.

    For the next value, the median and a quantile this holds for any distribution and any number of
    values, drawn independently, or at least exchangeably, from one distribution. Without bounds n
    values decide the cuts from a level α on: 2/(n + 1) for the next value, 2^(1 − n) for the
    median, and qⁿ + (1 − q)ⁿ for the quantile q.

    Args:
        values: The measured numbers, one or more, in any order; equal ones are allowed.
        claim: "next value", "mean", "median" or "quantile 0.95". A mean needs `law` or both
            bounds.
        bounds: Physically possible values (lower, upper), None where there is no bound. They are
            the ends of cuts that the values do not decide: without them the number has no cut at
            low α.
        law: "normal" where the values are known to have a normal distribution, for narrower cuts of
            the mean, which rest on it.

    Returns:
        The cuts with their claim (quantity and conditions), and `decided`, the smallest α at which
        the values or the bounds decide both ends of the cut. Asking for a cut below it raises
        RefusedError. One value without bounds decides the cut at α = 1 alone.

    Raises:
        RefusedError: `claim` or `law` is none of those above; a value is not finite or outside the
            bounds; the lower bound is not below the upper one; there is no value; a mean without
            `law` lacks a bound; or a mean with `law` has fewer than two different values.

    Example:
        >>> number = from_data([2.01, 1.96, 2.03, 1.88, 2.10, 1.99, 2.05], "median", bounds=(0, 9))
        >>> number.cut(0.05)
        Cut(lower=1.88, upper=2.1)
    """
    quantile = _quantile(claim)
    is_allowed = law is None or (law == "normal" and claim == "mean")
    require(is_allowed, "law", value=law, allowed="'normal' for a mean; ranks bound the others")
    data = Observations.from_values(values, bounds)
    # Ranks do not bound a mean: a rare, far value moves it and may not be among the values.
    if claim != "mean":
        number, decided = rank_cuts(data, quantile)
    elif law is None:
        number, decided = mean_cuts(data), 0.0
    else:
        number, decided = student_cuts(data)
    drawn = f"{len(data.values)} values drawn alike and independently"
    if law:
        drawn += f" from a {law} law"
    # The claim rests on what cannot be seen in the values, and so it is stated with it.
    conditions = [drawn]
    if bounds is not None:
        low, high = data.bounds
        conditions.append(f"bounds [{low:g}, {high:g}]")
    return ClaimedNumber(number, CoverageClaim(claim, tuple(conditions)), decided)


def _quantile(claim: str) -> float | None:
    """Return the probability of the quantile that a claim is about; None if it is about none.

    Args:
        claim: "quantile Q" with a number Q that has a decimal point; "median", whose probability is
            0.5; "next value" or "mean", which have none.

    Raises:
        RefusedError: The text is none of these, or Q is not between 0 and 1.
    """
    number = re.fullmatch(r"quantile +(\d*\.\d+(?:e-\d+)?)", str(claim))
    if number and 0 < float(number[1]) < 1:
        return float(number[1])
    allowed = "'next value', 'mean', 'median' or 'quantile Q' with Q in (0, 1)"
    require(claim in ("next value", "mean", "median"), "claim", value=repr(claim), allowed=allowed)
    return 0.5 if claim == "median" else None


def mean_cuts(data: Observations) -> Stepwise:
    """Return the α-cuts of the mean of any distribution within physical bounds.

    P(mean in its cut at α) ≥ 1 − α. Without bounds no cuts hold for all distributions: a rare, far
    value moves the mean and is not seen (Bahadur and Savage, Annals of Mathematical Statistics 27,
    1956, 1115-1122). With bounds, the distribution function lies within a band around that of the
    values (Smirnov, exact for n values), and the mean between the means of the band's edges
    (Anderson, Bulletin of the International Statistical Institute 43, 1969, 249-251).

    Args:
        data: The sorted values, one or more, and their physical bounds, infinite for none.

    Returns:
        Cuts within the bounds, which are the cut at α = 0. They are exact at the 999 levels
        `LEVELS` from 1e-9 to 1; between two levels the cut of the lower one, the wider one, holds.

    Raises:
        RefusedError: A bound is missing.
    """
    low, high = data.bounds
    require(
        np.isfinite(data.bounds).all(),
        "bounds",
        value=data.bounds,
        allowed="finite ends for a mean of any law",
        cure="give both, or law='normal'",
    )
    n = len(data.values)
    band = _band_half_width(n)
    fractions = np.arange(n + 1) / n
    partial_means = np.append(0.0, np.cumsum(data.values)) / n
    # At one edge of the band the fraction `band` of the values, the largest ones, is moved to the
    # lower bound; at the other edge the smallest ones are moved to the upper bound. The remaining
    # values keep their places. Their part of the mean follows from `partial_means`, which at the
    # fraction k/n is the sum of the k smallest values over n.
    lower = low * band + np.interp(1 - band, fractions, partial_means)
    upper = high * band + partial_means[-1] - np.interp(band, fractions, partial_means)
    # Rounding must not lead out of the bounds, nor out of the cut at the next lower level.
    lower = np.maximum.accumulate(np.maximum(lower, low))
    upper = np.minimum.accumulate(np.minimum(upper, high))
    return _stepwise_at_levels(low, high, lower=lower, upper=upper)


def _stepwise_at_levels(low: float, high: float, *, lower: Array, upper: Array) -> Stepwise:
    """Return the number with the cut [low, high] at α = 0 and given cuts at the 999 `LEVELS`.

    The levels rise from 1e-9 to 1. Each cut holds up to the next level.

    Args:
        low: Lower end of the support.
        high: Upper end of the support.
        lower: Lower ends at the `LEVELS`, rising, from `low` on, shape (levels,).
        upper: Upper ends, falling, from `high` on, shape (levels,).
    """
    levels = tuple(np.append(0.0, LEVELS))
    return Stepwise(levels, tuple(np.append(low, lower)), tuple(np.append(high, upper)))


@lru_cache(maxsize=64)
def _band_half_width(n: int) -> Array:
    """Return the half width of Smirnov's band at each of the 999 levels α of `LEVELS`.

    With P ≥ 1 − α the following holds at all x: the probability that a quantity is at most x, and
    the fraction of n independent values of it that are at most x, differ by up to the half width.

    Returns:
        Half widths in [0, 1], falling with α, shape (levels,). They are cached and must not be
        changed.
    """
    from scipy.stats import ksone

    # The distribution function leaves the band at either side with at most α/2 (Smirnov's one-sided
    # statistic), hence at one of both with at most α, by Bonferroni's inequality.
    band: Array = ksone.isf(LEVELS / 2, n)
    return np.clip(band, 0.0, 1.0)


def student_cuts(data: Observations) -> tuple[Stepwise, float]:
    """Return the α-cuts of the mean of a normal distribution by Student's t, within its bounds.

    P(mean in its cut at α) ≥ 1 − α, where the cut is mean ± t s/√n of the n values, with their
    standard deviation s and the (1 − α/2)-quantile t of Student's distribution with n − 1 degrees
    of freedom, clipped to the bounds.

    Args:
        data: The sorted values and their physical bounds, infinite for none.

    Returns:
        The cuts, and the level from which they hold. They are exact at the 999 levels `LEVELS` from
        1e-9 to 1; in between the next wider one stands. They hold from 0 on with two bounds, else
        from the lowest of the `LEVELS`, whose cut is repeated below.

    Raises:
        RefusedError: There are fewer than two values, or all are equal.
    """
    values = data.values
    require(
        values[0] < values[-1],
        "values of a normal law",
        value=f"{len(values)} from {values[0]:g} to {values[-1]:g}",
        allowed="two or more, unlike",
        cure="give bounds=(lower, upper) in place of a law, or measure more",
    )
    # The squares of deviations below 1e-162 would be rounded to 0, and the cuts to a point. Powers
    # of two scale without rounding, so that the digits of all other values stay.
    exponent = np.frexp(np.abs(values).max())[1]
    deviation = np.ldexp(np.ldexp(values, -exponent).std(ddof=1), exponent)
    half_width = _student_factors(len(values)) * deviation  # the factors are t/√n at the `LEVELS`
    return _clip_cuts(values.mean() - half_width, values.mean() + half_width, data.bounds)


@lru_cache(maxsize=64)
def _student_factors(n: int) -> Array:
    """Return t/√n of Student's interval mean ± (t/√n) · deviation for n values, at the `LEVELS`."""
    from scipy.stats import t

    return np.asarray(np.maximum(t.isf(LEVELS / 2, n - 1), 0.0) / np.sqrt(n))


def _clip_cuts(lower: Array, upper: Array, bounds: tuple[float, float]) -> tuple[Stepwise, float]:
    """Clip α-cuts to physical bounds, and make them nested.

    Args:
        lower: Lower ends at the 999 levels `LEVELS`, from 1e-9 to 1, shape (levels,). At low
            levels they may be −inf; the last one is finite.
        upper: Upper ends in the same order; they may be inf where the lower ends are −inf.
        bounds: Lower and upper physical bound; −inf and inf where there is none.

    Returns:
        The clipped cuts, and the level from which they hold. With two finite bounds the cut at
        α = 0 is the interval between them, and the level is 0. Otherwise the level is the lowest of
        the `LEVELS` whose cut is finite; the number repeats this cut at all lower levels.
    """
    low, high = bounds
    upper = np.minimum.accumulate(np.clip(upper, low, high))
    lower = np.maximum.accumulate(np.clip(lower, low, high))
    # Rounding may let the two ends cross at the top.
    lower = np.minimum(lower, upper[-1])  # at α = 1 both are one point, to rounding
    # With both bounds every cut is decided, the support by the bounds themselves.
    if np.isfinite(bounds).all():
        return _stepwise_at_levels(low, high, lower=lower, upper=upper), 0.0
    first = int((np.isfinite(lower) & np.isfinite(upper)).argmax())
    lower[:first] = lower[first]
    upper[:first] = upper[first]
    cuts = _stepwise_at_levels(lower[first], upper[first], lower=lower, upper=upper)
    return cuts, float(LEVELS[first])


def from_scatter(mean: float, deviation: float, count: int) -> ClaimedNumber:
    """Return the fuzzy number of a mean, from values of a normal distribution of known deviation.

    P(true mean in the cut at α) ≥ 1 − α, where the cut is mean ± z deviation/√count with the
    (1 − α/2)-quantile z of the standard normal distribution. It holds from α = 1e-9 on; asking for
    a cut at a lower level raises RefusedError.

    Args:
        mean: Mean of the values.
        deviation: Standard deviation of a single value, greater than 0.
        count: Number of values, 1 or more.

    Raises:
        RefusedError: An argument is not a finite number, or not greater than 0 where it must be.
    """
    from scipy.stats import norm

    checked_number("mean", mean)
    checked_number("deviation", deviation, positive=True)
    checked_number("count", count, positive=True, whole=True)
    half_width = deviation / np.sqrt(count) * np.maximum(norm.isf(LEVELS / 2), 0.0)
    condition = f"{count} values drawn alike and independently from a normal law of known deviation"
    cuts, decided = _clip_cuts(mean - half_width, mean + half_width, (-np.inf, np.inf))
    return ClaimedNumber(cuts, CoverageClaim("mean", (condition,)), decided)
