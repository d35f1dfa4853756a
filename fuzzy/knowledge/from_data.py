"""From measured values to a fuzzy number whose cuts hold what is claimed as often as they say."""

from __future__ import annotations

import re

from alphacut.fuzzy.knowledge.bounded_mean import mean_cuts
from alphacut.fuzzy.knowledge.named_law import Law, law_cuts
from alphacut.fuzzy.knowledge.observations import Bounds, Observations, Values
from alphacut.fuzzy.knowledge.order_statistics import Side, rank_cuts, values_needed
from alphacut.fuzzy.sets.claimed import Claim, Claimed
from alphacut.fuzzy.sets.stepwise import Stepwise

CLAIMS = "'next value', 'mean', 'median' or 'quantile Q' with Q in (0, 1)"


def from_data(
    values: Values,
    claim: str,
    *,
    bounds: Bounds | None = None,
    law: Law | None = None,
    side: Side = "both",
    resolution: float = 0.0,
) -> Claimed:
    """Fuzzy number of measured values: P(claimed quantity in its cut at α) >= 1 − α at every α.

    The probability is over repeated samples.

    For the next value, the median and a quantile this holds for every law, with ties and steps, at
    any number of values, exactly where the law is continuous. Values are taken as drawn
    independently, or at least exchangeably, from one law. What n values decide without bounds: the
    next value from α = 2/(n + 1) on, the median from 2^(1 − n), quantile q from qⁿ + (1 − q)ⁿ.

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
    number, decided = _cuts(data, claim, quantile, law, side)
    ranked = law is None and claim != "mean"
    return Claimed(
        number,
        Claim(claim, _given(data, law, bounds)),
        decided,
        _enough(claim, quantile, side) if ranked and decided else "",
    )


def _cuts(
    data: Observations, claim: str, quantile: float | None, law: Law | None, side: Side
) -> tuple[Stepwise, float]:
    if law is not None:
        return law_cuts(data, law, quantile, side, mean=claim == "mean")
    return (mean_cuts(data, side), 0.0) if claim == "mean" else rank_cuts(data, quantile, side)


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


def _given(data: Observations, law: Law | None, bounds: Bounds | None) -> tuple[str, ...]:
    """Conditions of the claim."""
    drawn = f"{data.count} values drawn alike and independently" + (
        f" from a {law} law" if law else ""
    )
    low, high = data.bounds
    return (drawn,) if bounds is None else (drawn, f"bounds [{low:g}, {high:g}]")


def _enough(claim: str, quantile: float | None, side: Side) -> str:
    counts = ", ".join(
        f"{values_needed(alpha, quantile, side)} values for α = {alpha:g}"
        for alpha in (0.1, 0.05, 0.01)
    )
    return f"; enough without bounds would be {counts}"
