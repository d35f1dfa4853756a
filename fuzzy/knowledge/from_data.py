"""From measured values to a fuzzy number whose cuts hold what is claimed as often as they say."""

from __future__ import annotations

import re
from functools import lru_cache

import numpy as np

from alphacut.fuzzy.knowledge.named_law import LEVELS, Law, law_cuts
from alphacut.fuzzy.knowledge.observations import Bounds, Observations, Values
from alphacut.fuzzy.knowledge.order_statistics import Side, rank_cuts, values_needed
from alphacut.fuzzy.sets.claimed import Claim, Claimed
from alphacut.fuzzy.sets.numbers import Array
from alphacut.fuzzy.sets.stepwise import Stepwise

CLAIMS = "'next value', 'mean', 'median' or 'quantile Q' with Q in (0, 1)"
LEAST_SHARE = 1e-9
"""Least share drawn, so that levels stay apart in floating point; it only widens cuts."""


def from_data(
    values: Values,
    claim: str,
    *,
    bounds: Bounds | None = None,
    law: Law | None = None,
    side: Side = "both",
    resolution: float = 0.0,
    rng: np.random.Generator | int | None = None,
) -> Claimed:
    """Fuzzy number of measured values: P(claimed quantity in its cut at α) >= 1 − α at every α.

    The probability is over repeated samples.

    For the next value, the median and a quantile this holds for every law, with ties and steps, at
    any number of values. Values are taken as drawn independently, or at least exchangeably, from
    one law. What n values decide without bounds: the next value from α = 2/(n + 1) on, the median
    from 2^(1 − n), quantile q from qⁿ + (1 − q)ⁿ.

    Where the law is continuous the cuts hold more than 1 − α by one step of the ranks at most: by
    1/(n + 1) for the next value, by one binomial probability for a quantile (five values, median:
    up to 0.31). With `rng` they hold 1 − α exactly, and are narrower.

    Args:
        values: Numbers, or pairs (lower, upper) of what each value is known to lie between; an
            infinite end means censored on that side.
        claim: "next value", "mean", "median" or "quantile 0.95". A mean needs a law or both bounds.
        bounds: Physically possible values (lower, upper), None where there is no bound. They fill
            in what the values do not decide: without them the number has no cut at low α, and none
            at 0.
        law: "normal" or "log-normal", where that is known: narrower cuts, which rest on it.
        side: "both" ends from the values, or an "upper" or "lower" limit only; the other end is
            then the bound, which is needed.
        resolution: Step to which the values were rounded.
        rng: Random generator, or its seed, for exact coverage of the next value, the median or a
            quantile: one number drawn from it, apart from the values, decides where between two
            levels the cut changes. Over repeated samples each needs a draw of its own.

    Raises:
        ValueError: An argument is wrong, or the values decide nothing.
    """
    quantile = _quantile(claim)
    if law not in (None, "normal", "log-normal"):
        raise ValueError(f"the law is {law!r}; it must be 'normal' or 'log-normal', or left out")
    if side not in ("both", "lower", "upper"):
        raise ValueError(f"the side is {side!r}; it must be 'both', 'lower' or 'upper'")
    data = Observations.of(values, bounds, resolution)
    _require_fixed_end(data, side)
    ranked = law is None and claim != "mean"
    share = _share(rng, ranked)
    number, decided = _cuts(data, claim, quantile, law, side, share)
    return Claimed(
        number,
        Claim(claim, _given(data, law, bounds, drawn=rng is not None)),
        decided,
        _enough(claim, quantile, side) if ranked and decided else "",
    )


def _cuts(
    data: Observations,
    claim: str,
    quantile: float | None,
    law: Law | None,
    side: Side,
    share: float,
) -> tuple[Stepwise, float]:
    if law is not None:
        return law_cuts(data, law, quantile, side, mean=claim == "mean")
    if claim == "mean":
        return mean_cuts(data, side), 0.0
    return rank_cuts(data, quantile, side, share)


def _share(rng: np.random.Generator | int | None, ranked: bool) -> float:
    """Share of the way to the next level at which a cut changes: 1 without a generator."""
    if rng is None:
        return 1.0
    if not ranked:
        raise ValueError(
            "rng is given, but a mean or a named law leaves nothing to draw: leave rng out, or"
            " claim the next value, the median or a quantile without a law"
        )
    try:
        return max(1.0 - float(np.random.default_rng(rng).random()), LEAST_SHARE)
    except (TypeError, ValueError) as wrong:
        raise ValueError(
            f"rng is {rng!r}; it must be a NumPy random generator or a whole number >= 0"
        ) from wrong


def _quantile(claim: str) -> float | None:
    """Probability of the claimed quantile; None for the next value and the mean."""
    match = re.fullmatch(r"quantile\s+([0-9.eE+-]+)", claim) if isinstance(claim, str) else None
    if match:
        try:
            probability = float(match[1])
        except ValueError:
            probability = 0.0
        if 0 < probability < 1:
            return probability
    elif claim in ("next value", "mean", "median"):
        return 0.5 if claim == "median" else None
    raise ValueError(f"the claim is {claim!r}; it must be {CLAIMS}")


def _require_fixed_end(data: Observations, side: Side) -> None:
    missing = {"upper": data.bounds[0] == -float("inf"), "lower": data.bounds[1] == float("inf")}
    if missing.get(side):
        other = {"upper": "lower", "lower": "upper"}[side]
        raise ValueError(
            f"the claim has side={side!r}, a limit from one side; the other end needs the"
            f" {other} physical bound: give bounds="
        )


def _given(
    data: Observations, law: Law | None, bounds: Bounds | None, *, drawn: bool
) -> tuple[str, ...]:
    """Conditions of the claim."""
    low, high = data.bounds
    return (
        f"{data.count} values drawn alike and independently"
        + (f" from a {law} law" if law else ""),
        *(() if bounds is None else (f"bounds [{low:g}, {high:g}]",)),
        *(("a random number drawn apart from them",) if drawn else ()),
    )


def _enough(claim: str, quantile: float | None, side: Side) -> str:
    counts = ", ".join(
        f"{values_needed(alpha, quantile, side)} values for α = {alpha:g}"
        for alpha in (0.1, 0.05, 0.01)
    )
    return f"; enough without bounds would be {counts}"


def mean_cuts(data: Observations, side: Side) -> Stepwise:
    """Cuts of the mean of a law within physical bounds, without which none hold for all laws.

    A rare, far value moves the mean and is not seen (Bahadur and Savage, Annals of Mathematical
    Statistics 27, 1956, 1115-1122). With bounds, the distribution function lies within a band
    around that of the values (Smirnov, exact for n values), and the mean between the means of the
    band's edges (Anderson, Bulletin of the International Statistical Institute 43, 1969, 249-251).

    Raises:
        ValueError: A bound is missing.
    """
    low, high = data.bounds
    if not np.isfinite(data.bounds).all():
        raise ValueError(
            "no number of values decides a mean without a law or bounds (Bahadur and Savage): give"
            " bounds=(lower, upper), what is physically possible, or law='normal' or 'log-normal'"
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
