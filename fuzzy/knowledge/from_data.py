"""Fuzzy numbers from measured values, with a claim how often their cuts contain a quantity."""

from __future__ import annotations

import re
from functools import lru_cache
from typing import get_args

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.knowledge.named_law import LEVELS, Law, law_cuts
from alphacut.fuzzy.knowledge.observations import Limits, Observations, Values
from alphacut.fuzzy.knowledge.order_statistics import rank_cuts
from alphacut.fuzzy.refused import require, require_choice
from alphacut.fuzzy.sets.claimed import ClaimedNumber, CoverageClaim
from alphacut.fuzzy.sets.numbers import Stepwise

CLAIMS = "'next value', 'mean', 'median' or 'quantile Q' with Q in (0, 1)"
UNDECIDED = "samples whose censored values decide no cut count as containing it"


def from_data(
    values: Values,
    claim: str,
    *,
    bounds: Limits | None = None,
    law: Law | None = None,
) -> ClaimedNumber:
    """Return the fuzzy number of measured values: P(claimed quantity in its α-cut) >= 1 − α.

    The probability is over repeated samples. Where censored values decide no cut at α and no bound
    stands for it, the sample counts as one whose cut contains the quantity; the claim says so.

    For the next value, the median and a quantile this holds for any law, also with ties and steps,
    and any number of values. The values must be drawn independently, or at least exchangeably, from
    one law. Without bounds n values decide the cuts of the next value from α = 2/(n + 1) on, of the
    median from 2^(1 − n), of the quantile q from qⁿ + (1 − q)ⁿ. Where the law is continuous the
    coverage exceeds 1 − α by 1/(n + 1) at most for the next value, by one binomial probability for
    a quantile.

    Args:
        values: Numbers, or pairs (lower, upper) between which each value is known to lie; an
            infinite end means censored on that side. Ends of rounded values are half a step away.
        claim: "next value", "mean", "median" or "quantile 0.95". A mean needs a law or both bounds.
        bounds: Physically possible values (lower, upper), None where there is no bound. They are
            the ends of cuts that the values do not decide: without them the number has no cut at
            low α.
        law: "normal" or, except for the mean, "log-normal", where the law is known: narrower cuts,
            which rest on it.

    Returns:
        The number, which prints with its claim.

    Raises:
        RefusedError: An argument is wrong, or the values decide nothing.

    Example:
        >>> number = from_data([2.01, 1.96, 2.03, 1.88, 2.10, 1.99, 2.05], "median", bounds=(0, 9))
        >>> number.cut(0.05)
        Cut(lower=1.88, upper=2.1)
    """
    quantile = _quantile(claim)
    if law is not None:
        require_choice("law", law, ("normal",) if claim == "mean" else get_args(Law))
    data = Observations.from_values(values, bounds)
    if law is not None:
        number, decided = law_cuts(data, law, quantile, mean=claim == "mean")
    elif claim == "mean":
        number, decided = mean_cuts(data), 0.0
    else:
        number, decided = rank_cuts(data, quantile)
    return ClaimedNumber(number, CoverageClaim(claim, _conditions(data, law, bounds)), decided)


def _quantile(claim: str) -> float | None:
    """Probability of the claimed quantile; None for the next value and the mean."""
    number = re.fullmatch(r"quantile +(\d*\.\d+(?:e-\d+)?)", str(claim))
    if number and 0 < float(number[1]) < 1:
        return float(number[1])
    require(claim in ("next value", "mean", "median"), "claim", value=repr(claim), allowed=CLAIMS)
    return 0.5 if claim == "median" else None


def _conditions(data: Observations, law: Law | None, bounds: Limits | None) -> tuple[str, ...]:
    """Conditions of the claim, in words."""
    low, high = data.bounds
    conditions = [f"{data.count} values drawn alike and independently"]
    if law:
        conditions[0] += f" from a {law} law"
    if bounds is not None:
        conditions.append(f"bounds [{low:g}, {high:g}]")
    return (*conditions, *((UNDECIDED,) if data.is_censored else ()))


def mean_cuts(data: Observations) -> Stepwise:
    """Return the α-cuts of the mean of any law within physical bounds, at the `LEVELS`.

    Without bounds no cuts hold for all laws: a rare, far value moves the mean and is not seen
    (Bahadur and Savage, Annals of Mathematical Statistics 27, 1956, 1115-1122). With bounds, the
    distribution function lies within a band around that of the values (Smirnov, exact for n
    values), and the mean between the means of the band's edges (Anderson, Bulletin of the
    International Statistical Institute 43, 1969, 249-251).

    Raises:
        RefusedError: A bound is missing.
    """
    low, high = data.bounds
    are_finite, allowed = np.isfinite(data.bounds).all(), "finite ends for a mean of any law"
    cure = "give both, or law='normal'"
    require(are_finite, "bounds", value=data.bounds, allowed=allowed, cure=cure)
    band, fraction = _band_half_width(data.count), np.arange(data.count + 1) / data.count
    lower_sums, upper_sums = (
        np.append(0.0, np.cumsum(row)) / data.count for row in (data.lower, data.upper)
    )
    # the largest fraction `band` of the values moved to the lower bound, or the least to the upper
    lower = low * band + np.interp(1 - band, fraction, lower_sums)
    upper = high * band + upper_sums[-1] - np.interp(band, fraction, upper_sums)
    # within the bounds and nested, despite round-off
    lower = np.maximum.accumulate(np.maximum(lower, low))
    upper = np.minimum.accumulate(np.minimum(upper, high))
    return Stepwise((0.0, *LEVELS), (low, *lower), (high, *upper))


@lru_cache(maxsize=64)
def _band_half_width(n: int) -> Array:
    """Half width of Smirnov's band for n values at each of the `LEVELS`, in [0, 1].

    The distribution function leaves either side of the band with half the level's probability.
    """
    from scipy.stats import ksone

    band: Array = ksone.isf(LEVELS / 2, n)
    return np.clip(band, 0.0, 1.0)
