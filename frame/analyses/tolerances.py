"""Tolerances: the largest scale of all supports at which no limit is exceeded.

Supports are scaled about their nominal values. The scale is halved between one whose envelope
excludes that a limit is exceeded and one whose envelope does not. Where these bounds leave a doubt,
it is halved once more, between a scale at which no motion tried exceeds a limit and one at which a
motion does. Each step is one call of `envelope` on the support alone, and as sure as its nature.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from alphacut.base.errors import RefusedError, checked_number
from alphacut.base.number_text import MINUS, Table, engineering, rounded_ends
from alphacut.base.progress_bar import Progress
from alphacut.frame.analyses.answer import Answer, Record
from alphacut.frame.analyses.limits import Limit, limits_by_name
from alphacut.frame.analyses.peaks import PEAK_ERROR, Peak, Peaks, peaks
from alphacut.frame.boxes import boxes
from alphacut.frame.methods.auto import Auto
from alphacut.frame.propagation import envelope, require_admissible
from alphacut.frame.structures.model import StructureModel
from alphacut.fuzzy import Crisp, FuzzyNumber, Interval
from alphacut.fuzzy.result import Nature, rounded
from alphacut.fuzzy.sets.numbers import enclosed_set


@dataclass(frozen=True)
class Support:
    """Nominal value of an input in its SI `unit`, its own support, and the one that is `kept`.

    No limit is exceeded within the latter, which is that at the scale `Tolerances.kept`.
    """

    nominal: float
    unit: str
    own: tuple[float, float]
    kept: tuple[float, float]


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Tolerances(Answer):
    """Scales of all supports about the nominal values; 1 for those of the inputs.

    Args:
        limits: Largest magnitude allowed of each output, in SI units.
        peaks: Peaks on the supports at scale 1, by output.
        kept: Largest scale tried at which exceeding a limit is excluded; None where it is at none,
            not even at scale 0.
        clear: Largest scale tried at which no computed motion exceeds a limit; None where it is at
            none, and of inputs that enclose a set, of which no motion is known.
        passed: Least scale tried at which a computed motion exceeds a limit; None without one.
        most: Largest scale that was to be tried.
        nature: Weakest guarantee of the envelopes that `kept` rests on.
        supports: Support of each input at scale 1 and at the scale `kept`.
    """

    key = "tolerances"
    title = "How far may tolerances go?"
    limits: dict[str, float]
    peaks: dict[str, Peak]
    kept: float | None
    clear: float | None
    passed: float | None
    most: float
    nature: Nature
    supports: dict[str, Support]

    def table(self) -> Table:
        """Return the scale of all supports, then the one of each input; rounded inwards."""
        scale, exceeded = "none", "none is exceeded"
        if self.kept is not None:
            scale = f"up to {rounded(self.kept, 'upper', Nature.ATTAINED):.4g}"
        if self.passed is not None:
            clear = "" if self.clear is None else f"no exceedance found up to {self.clear:.4g}, "
            exceeded = f"{clear}exceeded at {self.passed:.4g}"
        nature = self.nature_text(self.nature)
        if self.encloses:
            exceeded = "not known"
        rows: list[tuple[str, ...]] = [("scale of all ranges", scale, nature, exceeded)]
        for name, support in self.supports.items():
            text, relative = "–", ""
            if self.kept is not None:
                inside = rounded_ends(*support.kept, Nature.ATTAINED)
                text = " … ".join(dict.fromkeys(engineering(end, support.unit) for end in inside))
                relative = f"about {support.nominal:g}"
                if support.nominal:
                    relative = ", ".join(f"{x / support.nominal - 1:+.2%}" for x in support.kept)
            rows.append((f"tolerance of {name}", text, nature, relative.replace("-", MINUS)))
        head = ("quantity", "no limit exceeded", "nature", "limit exceeded, or relative")
        return Table(head, rows)

    def records(self) -> list[Record]:
        """Return a row of the scale, then one of the range of each input."""
        titles = ["quantity", "unit", "from", "to", "from in the case", "to in the case"]
        titles += ["most plausible", "nature"]
        nature = self.nature_text(self.nature)
        rows: list[Sequence[str | float | None]]
        rows = [("scale of all ranges", "", None, self.kept, None, 1.0, None, nature)]
        for name, support in self.supports.items():
            ends = (None, None) if self.kept is None else support.kept
            numbers = (*ends, *support.own, support.nominal)
            rows.append((name, support.unit, *numbers, nature))
        return [dict(zip(titles, row, strict=True)) for row in rows]

    def words(self) -> str:
        """Return how to read the scale."""
        return (
            "All supports are scaled together about nominal values; 1 is the case as it stands."
            f" Scales up to {self.most:g} were tried, each with an envelope of its own."
        )


def scale_supports(inputs: Mapping[str, FuzzyNumber], scale: float) -> dict[str, FuzzyNumber]:
    """Return inputs as their supports, scaled about nominal values; crisp numbers at scale 0."""
    middles = {name: (number.nominal, number.support) for name, number in inputs.items()}
    return {
        name: Interval(nominal - scale * (nominal - low), nominal + scale * (high - nominal))
        if scale > 0 and high > low
        else Crisp(nominal)
        for name, (nominal, (low, high)) in middles.items()
    }


def require_admissible_scale(
    model: StructureModel,
    inputs: Mapping[str, FuzzyNumber],
    most: float,
) -> None:
    """Refuse a largest scale of the supports at which an input is inadmissible."""
    try:
        require_admissible(model, boxes(scale_supports(inputs, most), [0.0]))
    except RefusedError as error:
        value = f"{most:g} times the supports: {error.key} is {error.value}"
        raise RefusedError("most", value, error.allowed, "a smaller scale") from None


def tolerances(
    model: StructureModel,
    inputs: Mapping[str, FuzzyNumber],
    limits: Limit | Sequence[Limit],
    *,
    duration: float,
    step: float,
    most: float = 2.0,
    precision: float = 0.01,
    error: float = PEAK_ERROR,
    at_one: Peaks | None = None,
    progress: Progress | None = None,
) -> Tolerances:
    """Return scales of the supports up to which no magnitude exceeds its limit.

    Args:
        model: The structure, whose outputs have the limits.
        inputs: Fuzzy parameters, in SI units.
        limits: Limits of magnitudes, one for each output, in SI units.
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
    named = limits_by_name(limits, (), magnitudes=True)
    sizes = {name: limit.number for name, limit in named.items()}
    model = model.with_outputs(tuple(sizes))
    require_admissible_scale(model, inputs, most)
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
        return all(found[x].greatest_bounds.upper[0] <= limit for x, limit in sizes.items())

    def is_exceeded(scale: float) -> bool:
        found = peaks_at(scale)
        return any(found[x].greatest_bounds.lower[0] > limit for x, limit in sizes.items())

    # the largest scale at which exceeding is excluded, from the largest one known
    near, encloses = precision * most, enclosed_set(inputs.values())
    low = next((scale for scale in (most, *tried, 0.0) if is_excluded(scale)), 0.0)
    if low < most and is_excluded(low):
        low = _bisected(is_excluded, low, min(scale for scale in tried if scale > low), near)
    # the same for scales at which a computed motion exceeds a limit
    passed, clear = np.inf, None
    if not encloses:
        passed = min(filter(is_exceeded, tried), default=np.inf)
        clear = max((scale for scale in tried if scale < passed), default=None)
    if clear is not None and passed < np.inf:
        clear = _bisected(lambda scale: not is_exceeded(scale), clear, passed, near)
        passed = min(filter(is_exceeded, tried))
    supports = {
        name: Support(
            nominal=inputs[name].nominal,
            unit=model.parameter(name).unit,
            own=(inputs[name].support.lower, inputs[name].support.upper),
            kept=(number.support.lower, number.support.upper),
        )
        for name, number in scale_supports(inputs, low).items()
    }
    return Tolerances(
        encloses=encloses,
        limits=sizes,
        peaks={name: tried[1.0][name] for name in sizes} if 1.0 in tried else {},
        kept=low if is_excluded(low) else None,
        clear=clear,
        passed=None if np.isinf(passed) else passed,
        most=most,
        nature=Nature.weakest(peaks_at(low)[name].nature for name in sizes),
        supports=supports,
    )


def _bisected(holds: Callable[[float], bool], low: float, high: float, near: float) -> float:
    """Return to within `near` the largest scale at which a condition that `low` fulfils holds."""
    while high - low > near:
        middle = (low + high) / 2
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low
