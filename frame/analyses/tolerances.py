"""Tolerances: the largest scale of all supports at which no limit is exceeded.

The supports are scaled about their nominal values. One bisection finds the largest scale whose
envelope excludes that a limit is exceeded. Where the bounds of the envelope leave a doubt, a second
bisection separates scales at which no computed response exceeds a limit from scales at which one
does. Each step computes one envelope on the supports alone.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from alphacut.base.errors import RefusedError, checked_number
from alphacut.base.number_text import MINUS, engineering, rounded_ends
from alphacut.base.progress_bar import Progress
from alphacut.base.quantity import Quantity
from alphacut.frame.analyses.answer import Answer, Row
from alphacut.frame.analyses.limits import Limit, limits_by_name
from alphacut.frame.analyses.peaks import PEAK_ERROR, Peak, Peaks, peaks
from alphacut.frame.analyses.question import Asked, Question
from alphacut.frame.boxes import boxes
from alphacut.frame.methods.auto import Auto
from alphacut.frame.propagation import envelope, require_admissible
from alphacut.frame.structures.model import StructureModel
from alphacut.fuzzy import Crisp, FuzzyNumber, Interval
from alphacut.fuzzy.result import Nature, rounded
from alphacut.fuzzy.sets.numbers import enclosed_set


@dataclass(frozen=True)
class ToleranceQuestion(Question):
    """Largest scale of the supports of the fuzzy inputs at which no limit is exceeded.

    Args:
        limits: Limits of magnitudes, one for each output, in SI units.
        most: largest scale that is tried; 1 is that of the case
    """

    reads_peaks = True
    needs_magnitudes = True
    limits: tuple[Limit, ...]
    most: Annotated[float, Quantity(above=0, maximum=100)] = 2.0

    def require_computable(self, asked: Asked) -> None:
        """Refuse a largest scale of the supports at which an input is inadmissible."""
        require_admissible_scale(asked.model, asked.inputs, self.most)

    def answer(self, asked: Asked, progress: Progress) -> Tolerances:
        """Return the scales up to which no limit is exceeded, from the peaks known at scale 1."""
        return tolerances(
            asked.model,
            asked.inputs,
            self.limits,
            duration=asked.duration,
            step=asked.step,
            most=self.most,
            # The known peaks hold for the lowest α-cut, which is the support only at α = 0.
            at_one=asked.peaks if asked.alpha[0] == 0 else None,
            progress=progress,
        )


@dataclass(frozen=True)
class Support:
    """Support of an input, as it is and scaled so that no limit is exceeded.

    Args:
        nominal: Nominal value, in `unit`.
        unit: SI unit of the input.
        own: Ends of its own support.
        kept: Ends of its support at the scale `Tolerances.kept`.
    """

    nominal: float
    unit: str
    own: tuple[float, float]
    kept: tuple[float, float]


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Tolerances(Answer):
    """Scales of all supports about their nominal values; 1 is the scale of the inputs themselves.

    Args:
        limits: Largest magnitude allowed of each output, in SI units.
        peaks: Peaks on the supports at the scale 1, by output; empty if it was not tried.
        kept: Largest scale tried at which exceeding a limit is excluded; None if this is so at no
            scale, not even at 0.
        clear: Largest scale tried at which no computed response exceeds a limit; None if there is
            none, and for inputs that enclose a set, of which no response is known.
        passed: Smallest scale tried at which a computed response exceeds a limit; None if there is
            none.
        most: Largest scale that was allowed.
        nature: Weakest guarantee of the envelopes on which `kept` rests.
        supports: Support of each input.
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

    def compared(self) -> dict[str, float | str]:
        """Return the largest scale that keeps the limits, if there is one."""
        return {} if self.kept is None else {"scale of tolerances": self.kept}

    def text_rows(self) -> Iterator[Row]:
        """Yield a row on the scale, then a row on the support of each input.

        The columns are the quantity; the scale, or the support, up to which exceeding a limit is
        excluded, rounded inwards ("none" or "–" if there is none); and the guarantee. The last
        column says, for the scale, at which scale a limit is exceeded, and for a support its
        deviations from the nominal value in per cent.
        """
        scale = "none"
        if self.kept is not None:
            scale = f"up to {rounded(self.kept, 'upper', Nature.ATTAINED):.4g}"
            if self.kept == self.most:
                scale += ", the largest tried"
        elif self.passed == 0:
            scale = "none: the nominal inputs exceed a limit"
        yield self._row("scale of all ranges", kept=scale, beside=self._exceeded_text())
        for name, support in self.supports.items():
            text = "–"
            relative = ""
            if self.kept is not None:
                low, high = support.kept
                ends = rounded_ends(low, high, Nature.ATTAINED)
                text = " … ".join(dict.fromkeys(engineering(end, support.unit) for end in ends))
                # A deviation from zero has no percentage.
                relative = f"about {support.nominal:g}"
                if support.nominal:
                    relative = ", ".join(f"{x / support.nominal - 1:+.2%}" for x in support.kept)
            relative = relative.replace("-", MINUS)
            yield self._row(f"tolerance of {name}", kept=text, beside=relative)

    def _row(self, quantity: str, *, kept: str, beside: str) -> Row:
        """Return a row of the table by the titles of its four columns.

        Args:
            quantity: What the row is about.
            kept: Scale or support up to which exceeding a limit is excluded, as text.
            beside: Scale at which a limit is exceeded, or the relative support, as text.
        """
        return {
            "quantity": quantity,
            "no limit exceeded": kept,
            "nature": self.nature,
            "limit exceeded, or relative": beside,
        }

    def _exceeded_text(self) -> str:
        """Return in words at which scale a response is known to exceed a limit.

        The largest scale at which no computed response exceeds a limit is said, too, if there is
        one. For inputs whose box encloses a set, no response is known.
        """
        if self.encloses:
            return "not known"
        if self.passed is None:
            return "none is exceeded"
        exceeded = f"exceeded at {self.passed:.4g}"
        if self.clear is None:
            return exceeded
        return f"no exceedance found up to {self.clear:.4g}, {exceeded}"

    def number_rows(self) -> Iterator[Row]:
        """Yield a row of numbers on the scale, then a row on the support of each input.

        The columns are the quantity and its SI unit; the ends of the support, scaled so far that
        exceeding a limit is still excluded (for the row of the scale the scale alone), None if
        there is no such scale; the ends of the support as it was given (for the scale 1); the
        nominal value; and the guarantee.
        """
        yield {
            "quantity": "scale of all ranges",
            "unit": "",
            "from": None,
            "to": self.kept,
            "from in the case": None,
            "to in the case": 1.0,
            "most plausible": None,
            "nature": self.nature,
        }
        for name, support in self.supports.items():
            kept = (None, None) if self.kept is None else support.kept
            yield {
                "quantity": name,
                "unit": support.unit,
                "from": kept[0],
                "to": kept[1],
                "from in the case": support.own[0],
                "to in the case": support.own[1],
                "most plausible": support.nominal,
                "nature": self.nature,
            }

    def words(self) -> str:
        """Return sentences on how to read the scale."""
        return (
            "All supports are scaled together about the nominal values; 1 is the scale of the case"
            f" itself. Scales up to {self.most:g} were tried, each with an envelope of its own."
        )


def scale_supports(inputs: Mapping[str, FuzzyNumber], scale: float) -> dict[str, FuzzyNumber]:
    """Return the supports of inputs as intervals, scaled about the nominal values.

    Both distances of the nominal value from the ends of the support are multiplied by the scale. A
    support without width, and each support at the scale 0, becomes a crisp number, the nominal one.

    Args:
        inputs: Fuzzy numbers by name.
        scale: The scale, 0 or more; 1 gives the supports themselves.
    """
    scaled: dict[str, FuzzyNumber] = {}
    for name, number in inputs.items():
        nominal = number.nominal
        low, high = number.support
        scaled[name] = Crisp(nominal)
        if scale > 0 and high > low:
            lower = nominal - scale * (nominal - low)
            upper = nominal + scale * (high - nominal)
            scaled[name] = Interval(lower, upper)
    return scaled


def require_admissible_scale(
    model: StructureModel,
    inputs: Mapping[str, FuzzyNumber],
    most: float,
) -> None:
    """Check that a structure has a response for all values in scaled supports of its inputs.

    Args:
        model: The structure.
        inputs: Fuzzy parameters by name, in SI units.
        most: Factor by which the supports are scaled about the nominal values.

    Raises:
        RefusedError: A scaled support contains values that the input may not have, such as a
            negative stiffness. The message names the scale as the value at fault.
    """
    try:
        require_admissible(model, boxes(scale_supports(inputs, most), [0.0]))
    except RefusedError as error:
        value = f"{most:g} times the supports: {error.key} is {error.value}"
        # The user chose the scale, not the support.
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
    """Return the scales of the supports up to which no magnitude exceeds its limit.

    Args:
        model: The structure with the limited outputs.
        inputs: Fuzzy parameters by name, in SI units.
        limits: Limits of magnitudes, one for each output, in SI units.
        duration: Length of the response, in s.
        step: Distance of the time nodes, in s.
        most: Largest scale that is tried.
        precision: Width of the interval of scales at which a bisection ends, as a fraction of
            `most`.
        error: Error of the peaks that is aimed at, as a fraction of each peak.
        at_one: Known peaks at the scale 1; their first level must be that of the supports.
        progress: Called with the completed fraction.

    Returns:
        Tolerances: `kept`, the largest scale tried at which no limit is exceeded, `passed`, the
        smallest one at which a response exceeds a limit, and the `nature` of the first.

    Raises:
        RefusedError: A limit or a number is out of range, or supports scaled by `most` contain
            inadmissible values.

    Example:
        >>> from alphacut.frame import Limit, StoreyFrame
        >>> from alphacut.fuzzy import Interval
        >>> frame = StoreyFrame(masses=[1e3], stiffness=[4e4], q0=[0.1], outputs=("q1",))
        >>> k1 = Interval(38e3, 42e3)
        >>> found = tolerances(frame, {"k1": k1}, Limit("q1", 0.15), duration=1.0, step=0.05)
        >>> found.kept, str(found.nature)
        (2.0, 'guaranteed')
    """
    checked_number("most", most, positive=True)
    checked_number("precision", precision, positive=True, most=1)
    largest_allowed = {
        name: limit.number for name, limit in limits_by_name(limits, (), magnitudes=True).items()
    }
    model = model.with_outputs(tuple(largest_allowed))
    # A scale beyond 1 may lead to a negative mass or stiffness.
    require_admissible_scale(model, inputs, most)
    # Peaks by the scales that were tried.
    tried: dict[float, Peaks] = {}
    if at_one is not None and most >= 1:
        tried[1.0] = at_one

    def peaks_at(scale: float) -> Peaks:
        """Return the peak of each limited output on the supports of all inputs at a scale.

        Peaks are kept in `tried` by their scale, and are computed only if they are not there: from
        an envelope on the level 0 alone, with an error of `error` of each peak if possible.

        Raises:
            RefusedError: A response does not exist.
            FailedError: No bounds are found, or a time step did not converge.
        """
        if scale not in tried:
            band = envelope(
                model,
                scale_supports(inputs, scale),
                Auto(error, peaks=True),
                duration=duration,
                step=step,
                alpha=[0.0],
                progress=False,
            )
            tried[scale] = peaks(band)
            if progress:
                # Each bisection takes about log2(1/precision) steps.
                progress(min(1.0, len(tried) / (2 + np.log2(1 / precision))))
        return tried[scale]

    def is_excluded(scale: float) -> bool:
        """Whether no response exceeds a limit."""
        found = peaks_at(scale)
        return all(found[x].max_peak_bounds.upper[0] <= y for x, y in largest_allowed.items())

    def is_exceeded(scale: float) -> bool:
        """Whether a known response exceeds a limit."""
        found = peaks_at(scale)
        return any(found[x].max_peak_bounds.lower[0] > y for x, y in largest_allowed.items())

    # The largest scale at which exceeding a limit is excluded, from the largest one that is known.
    # Supports are nested, so that exceedance is excluded at all smaller scales as well.
    width = precision * most
    kept = next((scale for scale in (most, *tried, 0.0) if is_excluded(scale)), 0.0)
    if kept < most and is_excluded(kept):
        # The smallest scale above it that was tried, which is not excluded.
        not_excluded = min(scale for scale in tried if scale > kept)
        kept = _bisected(is_excluded, kept, not_excluded, width)

    # The largest scale at which no known response exceeds a limit, and the next one that was tried.
    # Of inputs that enclose a set, no response is known to belong to the set.
    encloses = enclosed_set(inputs.values())
    clear = None
    passed = np.inf
    if not encloses:
        passed = min(filter(is_exceeded, tried), default=np.inf)
        clear = max((scale for scale in tried if scale < passed), default=None)
    if clear is not None and np.isfinite(passed):
        clear = _bisected(lambda scale: not is_exceeded(scale), clear, passed, width)
        # The bisection has tried further scales.
        passed = min(filter(is_exceeded, tried))

    supports = {}
    for name, scaled in scale_supports(inputs, kept).items():
        own = inputs[name].support
        supports[name] = Support(
            nominal=inputs[name].nominal,
            unit=model.parameter(name).unit,
            own=(own.lower, own.upper),
            kept=(scaled.support.lower, scaled.support.upper),
        )
    peaks_at_one = {}
    if 1.0 in tried:
        peaks_at_one = {name: tried[1.0][name] for name in largest_allowed}
    return Tolerances(
        encloses=encloses,
        limits=largest_allowed,
        peaks=peaks_at_one,
        kept=kept if is_excluded(kept) else None,
        clear=clear,
        passed=passed if np.isfinite(passed) else None,
        most=most,
        nature=Nature.weakest(peaks_at(kept)[name].nature for name in largest_allowed),
        supports=supports,
    )


def _bisected(holds: Callable[[float], bool], lower: float, upper: float, width: float) -> float:
    """Return the largest scale at which a condition holds, to within a width.

    The condition must hold up to some scale and not hold beyond it. It is known at both ends of
    the interval and is called at midpoints only.

    Args:
        holds: The condition, a function of the scale.
        lower: A scale at which it holds.
        upper: A larger scale at which it does not hold.
        width: Width of the interval at which the bisection ends, positive.

    Returns:
        The last scale at which the condition held: `lower` itself if it held at no midpoint.
    """
    # The condition holds at `lower` and does not hold at `upper` throughout.
    while upper - lower > width:
        middle = (lower + upper) / 2
        if holds(middle):
            lower = middle
        else:
            upper = middle
    return lower
