"""Tolerances: the largest scale of all supports at which no limit is exceeded.

Supports are scaled about their nominal values. The scale is halved between one whose envelope
excludes that a limit is exceeded and one whose envelope does not. Where these bounds leave a doubt,
it is halved once more, between a scale at which no motion tried exceeds a limit and one at which a
motion does. Each step is one call of `envelope` on the support alone, and as sure as its nature.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from alphacut.base.errors import checked_number
from alphacut.base.progress_bar import Progress
from alphacut.frame.analyses.peaks import Peaks, peaks, require_limits
from alphacut.frame.methods.auto import Auto
from alphacut.frame.propagation import envelope
from alphacut.frame.structures.lagrangian import LagrangianSystem
from alphacut.frame.structures.linear import LinearSystem
from alphacut.fuzzy import Crisp, FuzzyNumber, Interval
from alphacut.fuzzy.result import Nature
from alphacut.fuzzy.sets.numbers import enclosed_set


@dataclass(frozen=True)
class Tolerances:
    """Scales of the supports about the nominal values; 1 for those of the inputs.

    Args:
        admissible: Largest scale tried at which exceeding a limit is excluded; None where it is at
            none, not even at scale 0.
        clear: Largest scale tried at which no computed motion exceeds a limit; None where it is at
            none, and of inputs that enclose a set, of which no motion is known.
        passed: Least scale tried at which a computed motion exceeds a limit; infinite without one.
        supports: Supports at the scale `admissible`, by input, in SI units.
        nature: Weakest nature of the envelopes that `admissible` rests on.
    """

    admissible: float | None
    clear: float | None
    passed: float
    supports: Mapping[str, tuple[float, float]]
    nature: Nature


def scale_supports(inputs: Mapping[str, FuzzyNumber], scale: float) -> dict[str, FuzzyNumber]:
    """Return inputs as their supports, scaled about nominal values; crisp numbers at scale 0."""
    middles = {name: (number.nominal, number.support) for name, number in inputs.items()}
    return {
        name: Interval(nominal - scale * (nominal - low), nominal + scale * (high - nominal))
        if scale > 0 and high > low
        else Crisp(nominal)
        for name, (nominal, (low, high)) in middles.items()
    }


def tolerances(
    model: LinearSystem | LagrangianSystem,
    inputs: Mapping[str, FuzzyNumber],
    limits: Mapping[str, float],
    *,
    duration: float,
    step: float,
    most: float = 2.0,
    precision: float = 0.01,
    error: float = 1e-3,
    at_one: Peaks | None = None,
    progress: Progress | None = None,
) -> Tolerances:
    """Return scales of the supports up to which no magnitude exceeds its limit.

    Args:
        model: The structure, whose outputs have the limits.
        inputs: Fuzzy parameters, in SI units.
        limits: Largest magnitude allowed by output, in SI units.
        duration: Length of the motion, in s.
        step: Distance of nodes, in s.
        most: Largest scale that is tried.
        precision: Width of the interval of a scale at which its bisection ends, over `most`.
        error: Error of the peaks that is aimed at, as a fraction of each.
        at_one: Peaks on the supports at scale 1, on their first level, where these are known.
        progress: Called with the completed fraction.

    Raises:
        RefusedError: A limit or a number is out of range, or supports at scale `most` reach values
            that are not allowed.
    """
    checked_number("most", most, positive=True)
    checked_number("precision", precision, positive=True, most=1)
    require_limits(limits, model.outputs)
    tried = {1.0: at_one} if at_one is not None and most >= 1 else {}  # peaks by scale

    motion: dict[str, Any] = {"duration": duration, "step": step, "alpha": [0.0]}

    def peaks_at(scale: float) -> Peaks:
        if scale not in tried:
            scaled, method = scale_supports(inputs, scale), Auto(error, peaks=True)
            tried[scale] = peaks(envelope(model, scaled, method, **motion, progress=False))
            if progress:
                progress(min(1.0, len(tried) / (2 + np.log2(1 / precision))))
        return tried[scale]

    def is_excluded(scale: float) -> bool:
        found = peaks_at(scale)
        return all(found[x].greatest_bounds.upper[0] <= limit for x, limit in limits.items())

    def is_exceeded(scale: float) -> bool:
        found = peaks_at(scale)
        return any(found[x].greatest_bounds.lower[0] > limit for x, limit in limits.items())

    # the largest scale at which exceeding is excluded, from the largest one known
    near, is_box = precision * most, bool(enclosed_set(inputs.values()))
    low = next((scale for scale in (most, *tried, 0.0) if is_excluded(scale)), 0.0)
    if low < most and is_excluded(low):
        low = _bisected(is_excluded, low, min(scale for scale in tried if scale > low), near)
    # the same for scales at which a computed motion exceeds a limit
    passed, clear = np.inf, None
    if not is_box:
        passed = min(filter(is_exceeded, tried), default=np.inf)
        clear = max((scale for scale in tried if scale < passed), default=None)
    if clear is not None and passed < np.inf:
        clear = _bisected(lambda scale: not is_exceeded(scale), clear, passed, near)
        passed = min(filter(is_exceeded, tried))
    return Tolerances(
        admissible=low if is_excluded(low) else None,
        clear=clear,
        passed=passed,
        supports={name: number.support for name, number in scale_supports(inputs, low).items()},
        nature=Nature.weakest(peaks_at(low)[name].nature for name in limits),
    )


def _bisected(holds: Callable[[float], bool], low: float, high: float, near: float) -> float:
    """Return to within `near` the largest scale at which a condition that `low` fulfils holds."""
    while high - low > near:
        middle = (low + high) / 2
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low
