"""Fuzzy peaks: the largest magnitude of each output over time, as an interval on each level.

At the time nodes no response leaves the envelope, and each response has at least the magnitude by
which the band of the envelope is away from zero. What responses may add within the time steps is
part of the guaranteed bounds, and of the error of all others.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal, NamedTuple

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.progress_bar import Progress
from alphacut.frame.analyses.gap_causes import missing_guarantee, open_part, wide_gap
from alphacut.frame.boxes import ALPHA
from alphacut.frame.dynamics.yielding import AT_NODES
from alphacut.frame.methods.auto import Auto
from alphacut.frame.numbers import WIDE
from alphacut.frame.propagation import envelope
from alphacut.frame.result import Envelope, within_steps
from alphacut.frame.structures.model import StructureModel
from alphacut.frame.structures.quantities import output_of
from alphacut.frame.threshold import Threshold
from alphacut.fuzzy import FuzzyNumber
from alphacut.fuzzy.result import Bounds, Ends, Nature

PEAK_ERROR = 5e-3
"""Error of the peaks of limited outputs that is aimed at, as a fraction of each peak (tuned: a
larger one saves time and leaves more limits undecided)."""
WIDENING = 0.01
"""Fraction of a peak above which it is reported that a smaller step would narrow its bound (tuned:
a larger one leaves wider bounds without a remark)."""


class WorstCase(NamedTuple):
    """Angle in degrees, from 0 to 360, and time in s at which an attained peak occurs."""

    angle: float
    time: float


@dataclass(frozen=True, eq=False)
class Peak:
    """Bounds of the largest magnitude of an output over time, or of its largest or smallest value.

    All values have the sign of the output. For a smallest value ("min q3") a peak is the farther
    out, the lower it is, and the farthest peak of a cut is bounded by `lower`. Values that are not
    known may be given as NaN; they become infinite with the sign with which they say nothing.

    Args:
        alpha: Levels, rising, shape (levels,). All other arrays have this shape.
        lower: Lower bound of the peaks in each cut: at the time nodes, or at all times if the
            bounds are guaranteed.
        upper: Upper bound of these peaks.
        error: Distance by which peaks may lie outside `lower` and `upper`; 0 for guaranteed bounds.
        reached: Attained value: the farthest peak that a response of the cut is known to have.
        least_lower: Bound of the peaks of all responses of the cut that are the least far out,
            guaranteed if the bounds are.
        least_upper: A peak that some response of the cut is known not to exceed.
        nature: Guarantee of the bounds.
        between_nodes: What responses may add within the time steps to the farthest bound on the
            lowest level. It falls with the square of the time step.
        side: "" for a magnitude, "max" for the largest value, "min" for the smallest value.
        reached_at: Inputs by name, in SI units, of the response that attains the peak on the lowest
            level; empty if none is known.
        encloses: Name of the set of inputs, such as "the learned set", that the box of the cuts
            encloses. If it is given, no response is known to belong to the set.
        cause: Why the bound is not guaranteed though a proof was tried, or why it is more than a
            tenth above the attained value, and what would narrow it; empty otherwise.
        is_to_limits: Whether the bound was sought no closer than limits ask.
        worst: Where the peak is one over all angles of the ground motion, the angle and the time of
            the attained peak on the lowest level; else None.

    Attributes:
        proved: Guaranteed bound: the peak of no response of the cut lies farther out; infinite
            where nothing is guaranteed.
    """

    alpha: Array
    lower: Array
    upper: Array
    error: Array
    reached: Array
    least_lower: Array
    least_upper: Array
    nature: Nature
    between_nodes: float = 0.0
    side: Literal["", "max", "min"] = ""
    reached_at: Mapping[str, float] = field(default_factory=dict)
    encloses: str = ""
    worst: WorstCase | None = None
    cause: str = ""
    is_to_limits: bool = False
    proved: Array = field(init=False)

    def __post_init__(self) -> None:
        """Replace NaN, which stands for an unknown value, and compute `proved`.

        An unknown value becomes infinite with the sign with which it says nothing. For `lower` this
        is -∞, and for `upper` +∞. For a magnitude or a largest value, `reached` and `least_lower`
        become -∞, and `least_upper` +∞; for a smallest value these three have the opposite signs.
        `proved` is the guaranteed bound of the most extreme peak, with the sign of the output.
        """
        far_out = self.outward_sign * np.inf
        values_that_say_nothing = {
            "lower": -np.inf,
            "upper": np.inf,
            "reached": -far_out,
            "least_lower": -far_out,
            "least_upper": far_out,
        }
        for name, unknown in values_that_say_nothing.items():
            values = np.asarray(getattr(self, name), float)
            object.__setattr__(self, name, np.where(np.isnan(values), unknown, values))
        object.__setattr__(self, "proved", self.outward_sign * self.max_peak_bounds.upper + 0.0)

    @property
    def is_least(self) -> bool:
        """Whether it is the smallest value of an output."""
        return self.side == "min"

    @property
    def outward_sign(self) -> float:
        """Sign of the direction in which peaks are farther out, -1 for smallest values, else 1."""
        return -1.0 if self.is_least else 1.0

    @property
    def bound_side(self) -> Literal["lower", "upper"]:
        """The name of the end that bounds the peaks that are farthest out."""
        return "lower" if self.is_least else "upper"

    @property
    def far_end(self) -> Array:
        """Bound of the peaks that are farthest out on each level, shape (levels,)."""
        ends: Array = getattr(self, self.bound_side)
        return ends

    @property
    def outwards(self) -> Peak:
        """The peak itself; for a smallest value of q the largest value of -q."""
        return mirrored(self) if self.is_least else self

    @property
    def _error_or_infinite(self) -> Array:
        """Error of guaranteed or estimated bounds, and +∞ for attained bounds, shape (levels,).

        No peak lies farther outside `lower` and `upper` than this; attained bounds exclude nothing.
        """
        if self.nature is Nature.ATTAINED:
            return np.full_like(self.error, np.inf)
        return self.error

    @property
    def max_peak_bounds(self) -> Ends:
        """Lower and upper bound of the largest peak of each cut, shape (levels,) each.

        For the smallest value of an output q, all peaks are largest values of -q.
        """
        # The peak of -q, a largest value, has the bounds that are wanted.
        if self.is_least:
            return self.outwards.max_peak_bounds
        return Ends(self.reached, self.upper + self._error_or_infinite)

    @property
    def min_peak_bounds(self) -> Ends:
        """Lower and upper bound of the smallest peak in each cut, shape (levels,) each.

        The smallest peak is that of the response with the least extreme peak. For the smallest
        value of an output q, all peaks are largest values of -q. An unknown lower bound is 0 for
        magnitudes and -∞ otherwise, an unknown upper bound is +∞.
        """
        # The peak of -q, a largest value, has the bounds that are wanted.
        if self.is_least:
            return self.outwards.min_peak_bounds
        # Three lower bounds hold: that of all peaks less its error, 0 for a magnitude (-∞ for a
        # value), and a bound that was computed for the smallest peak alone.
        below = self.lower - self._error_or_infinite
        lower_bound = np.maximum(
            np.maximum(below, _least_possible_peak(self.side)), self.least_lower
        )
        # Each cut contains the narrowest one. The smallest peak of a cut is therefore at most the
        # largest peak of the narrowest cut.
        largest_of_narrowest = self.max_peak_bounds.upper[-1:]
        return Ends(lower_bound, np.minimum(largest_of_narrowest, self.least_upper))

    @property
    def is_widened_by_step(self) -> bool:
        """Whether a smaller time step would narrow the bound on the lowest level considerably.

        This is so if what responses may add between the time nodes is more than 1 % of the bound,
        and more than half of its uncertainty. The uncertainty is the distance from the attained
        peak if the bound is guaranteed and such a peak is known, and else the error.
        """
        bound = float(self.far_end[0])
        attained = float(self.reached[0])
        width = float(self.error[0])
        if self.nature is Nature.GUARANTEED and np.isfinite(attained):
            width = abs(bound - attained)
        return self.between_nodes > max(width / 2, WIDENING * abs(bound))

    @property
    def gaps(self) -> Array:
        """Distance between the farthest bound and the attained value as a fraction of the bound.

        The shape is (levels,). It is 0 for a bound of 0, and else NaN where no attained value or
        no finite bound is known.
        """
        attained = np.where(np.isfinite(self.reached), self.reached, np.nan)
        difference = np.abs(self.far_end - attained)
        size = np.abs(self.far_end)
        # A bound of zero is attained, as no magnitude is smaller.
        ratio = np.divide(difference, size, out=np.zeros_like(size), where=size > 0)
        return np.asarray(ratio)

    @property
    def warning(self) -> str:
        """Return a clause on a wide gap or a missing guarantee, with its cause; empty if none."""
        if not self.cause:
            return ""
        if self.nature is not Nature.GUARANTEED:
            return f"not guaranteed: {self.cause}"
        gap = float(self.gaps[0])
        if not gap > WIDE:  # it may have become narrower by another analysis; NaN is unknown
            return ""
        return f"{gap:.0%} of its bound is above what is attained: {self.cause}"


def mirrored(peak: Peak) -> Peak:
    """Return the peak of -q from a signed peak of an output q.

    The largest value ("max") becomes the smallest value ("min") of -q and vice versa. Lower and
    upper bound change their places, and all values their signs; errors and guarantee stay.
    """
    return replace(
        peak,
        side="max" if peak.is_least else "min",
        lower=0.0 - peak.upper,
        upper=0.0 - peak.lower,
        reached=0.0 - peak.reached,
        least_lower=0.0 - peak.least_lower,
        least_upper=0.0 - peak.least_upper,
    )


def _least_possible_peak(side: str) -> float:
    """Return a lower bound of any peak: 0 for a magnitude, -∞ for a largest value."""
    return -np.inf if side else 0.0


Peaks = Mapping[str, Peak]
"""Peaks by name: "q3" for a magnitude, "max q3" and "min q3" for the largest and smallest value."""


def peaks(band: Envelope, names: Sequence[str] = ()) -> dict[str, Peak]:
    """Return the fuzzy peaks of outputs of an envelope by name.

    A fuzzy peak is a range on each level: of the largest magnitude, the largest or the smallest
    value over time that the responses of the α-cut have. It includes what outputs may add between
    the time nodes, as far as that is known.

    Args:
        band: The envelope.
        names: Names of outputs for the peaks of their magnitudes, or names such as "max q3" and
            "min q3" for the largest and the smallest value; if empty, the magnitudes of all
            outputs are taken.

    Raises:
        RefusedError: The envelope has no such output, or the name is that of a mean over records.
    """
    return {name: _peak_of(band, name) for name in names or map(str, band.outputs)}


def _peak_of(band: Envelope, name: str) -> Peak:
    """Return the fuzzy peak with a name, such as "q3" or "min q3", of an envelope."""
    # A mean over records ("mean q3") is no peak of one envelope, and is refused as an output.
    output = name.removeprefix("max ").removeprefix("min ")
    column = band.column(output)
    nature = band.nature_of(output)
    is_guaranteed = nature is Nature.GUARANTEED
    side: Literal["", "max"] = "" if name == output else "max"
    smallest = _least_possible_peak(side)

    # Bounds of |q|, q or -q at the time nodes, shape (levels, times). Guaranteed bounds contain
    # the error.
    ends = _oriented(band.lower[..., column], band.upper[..., column], name)
    attained = _oriented(band.attained.lower[..., column], band.attained.upper[..., column], name)
    error: Array = np.zeros(ends.upper.shape)
    if not is_guaranteed:
        error = band.error[..., column]
    between: Array = np.zeros(len(band.time))
    if band.between is not None:
        between = band.between[:, column]

    # The largest peak of each cut, and bounds of it at the nodes and within the steps.
    upper = ends.upper.max(axis=1)
    lower = ends.lower.max(axis=1)
    bound_at_nodes = ends.upper + error
    # Peaks count at all times, not at the nodes alone.
    bound = within_steps(bound_at_nodes, between).max(axis=1)
    if band.searched_peaks is not None and not side:
        added = np.zeros_like(bound)
        if name.rstrip("0123456789") in AT_NODES:
            added = bound - bound_at_nodes.max(axis=1)
        return _searched_peak(band.searched_peaks, column, added)

    # The smallest peak of each cut. A peak is no smaller than the magnitude at any node.
    below = lower - np.maximum(ends.lower - error, smallest).max(axis=1)
    least_lower = np.full_like(upper, smallest)
    least_upper = np.full_like(upper, np.inf)
    if band.least_peaks is not None and not side:
        least_lower = band.least_peaks.lower[:, column]
        least_upper = band.least_peaks.upper[:, column]

    above = bound - upper
    peak_error = np.maximum(above, below)
    if is_guaranteed:
        # A proof may bound the smallest peak better than the band does.
        lower = np.maximum(lower, least_lower)
        upper = upper + above
        peak_error = np.zeros_like(upper)
    elif nature is Nature.ESTIMATED:
        # The error within the steps raises the peaks only, so that it does not lower this bound.
        least_lower = np.maximum(least_lower, lower - below)

    reached = np.fmax(attained.upper, smallest).max(axis=1)  # NaN where none is known
    if band.encloses:
        reached = np.full_like(upper, -np.inf)
    peak = Peak(
        alpha=np.asarray(band.alpha),
        lower=lower,
        upper=upper,
        error=peak_error,
        reached=reached,
        least_lower=least_lower,
        least_upper=least_upper,
        nature=nature,
        between_nodes=float(bound[0] - bound_at_nodes[0].max()),
        side=side,
        reached_at=_inputs_at_peak(band, column, name),
        encloses=band.encloses,
    )
    return mirrored(peak) if name.startswith("min ") else peak


def _searched_peak(found: Bounds, column: int, between: Array) -> Peak:
    """Return the fuzzy peak of the magnitude of an output that was found by a search of peaks.

    Args:
        found: Bounds of the peaks at the time nodes, with arrays of shape (levels, outputs).
            Responses that were computed attain both ends, and it is not proved that no peak lies
            outside; or the bounds are guaranteed at all times, and responses attain the `inner`
            ones.
        column: Index of the output.
        between: What responses may add to a peak within the time steps, shape (levels,). Its first
            entry, of the lowest level, becomes `between_nodes` of the peak.

    Returns:
        The peak. Its attained values are the upper ends, and the lower ends plus `between` are
        peaks that some response does not exceed. If the box of the inputs only encloses a set,
        nothing counts as attained: then the former are -∞, and the latter +∞.
    """
    lower = found.lower[:, column]
    upper = found.upper[:, column]
    attained = upper
    least_lower = np.zeros_like(lower)
    least_upper = lower + between
    error = found.error[:, column] + between
    if found.inner is not None:
        attained = found.inner.upper[:, column]
        least_lower = lower
        least_upper = found.inner.lower[:, column]
        between = np.zeros_like(between)
        error = np.zeros_like(error)
    attained_at = dict(zip(found.inputs, found.upper_at[0, column].tolist(), strict=True))
    if found.encloses:
        attained = np.full_like(upper, -np.inf)
        least_upper = np.full_like(lower, np.inf)
        attained_at = {}
    return Peak(
        alpha=found.alpha,
        lower=lower,
        upper=upper,
        error=error,
        reached=attained,
        least_lower=least_lower,
        least_upper=least_upper,
        nature=found.natures[column],
        between_nodes=float(between[0]),
        reached_at=attained_at,
        encloses=found.encloses,
    )


def _inputs_at_peak(band: Envelope, column: int, name: str) -> dict[str, float]:
    """Return the inputs of the response with the farthest attained peak on the lowest level.

    For the name of an output the peak is that of its magnitude, with "max " before it the largest
    value over the time nodes, with "min " the smallest value.

    Args:
        band: The envelope.
        column: Index of the output.
        name: Name of the peak, such as "q3", "max q3" or "min q3".

    Returns:
        Inputs by name, in SI units; empty if none are known.
    """
    # A magnitude is largest at the upper end, or at the lower end with its sign changed.
    upper_end = band.attained.upper[0, :, column], band.upper_at[0, :, column]
    lower_end = -band.attained.lower[0, :, column], band.lower_at[0, :, column]
    chosen = [upper_end, lower_end]
    if name.startswith("max "):
        chosen = [upper_end]
    elif name.startswith("min "):
        chosen = [lower_end]
    values = np.array([value for value, _ in chosen])  # (ends, times)
    points = np.array([point for _, point in chosen])  # (ends, times, inputs)
    is_known = np.isfinite(points).all(axis=-1) & np.isfinite(values)
    if not is_known.any():
        return {}
    values = np.where(is_known, values, -np.inf)
    # Unknown values count as -∞, so that the largest known one is found.
    farthest = np.unravel_index(values.argmax(), values.shape)
    return dict(zip(band.inputs, map(float, points[farthest]), strict=True))


def _oriented(low: Array, high: Array, name: str) -> Ends:
    """Return bounds of the function whose largest value is a peak, from bounds of an output q.

    The function is -q if the name begins with "min ", q if it begins with "max ", and else |q|.

    Args:
        low: Lower bounds of q, of any shape.
        high: Upper bounds of q, same shape.
        name: Name of the peak, such as "min q3".
    """
    if name.startswith("min "):
        return Ends(-high, -low)
    if name.startswith("max "):
        return Ends(low, high)
    # |q| is at least the distance of the interval from zero.
    return Ends(np.maximum(np.maximum(low, -high), 0.0), np.maximum(high, -low))


def tightest(first: Peaks, second: Peaks) -> dict[str, Peak]:
    """Return the tightest bounds of peaks from two analyses of the same responses, by name.

    Peaks that only one analysis has are taken from it. If both bounds are guaranteed they are
    intersected, and if both are attained they are united. Otherwise the bounds with the stronger
    guarantee are taken, and of two estimates those with the smaller error. In any case the farther
    one of both attained values is kept.

    Args:
        first: Peaks by name, such as "q3" or "min q3".
        second: Peaks of the other analysis, on the same levels.
    """
    found = {**first, **second}
    for name in first.keys() & second.keys():
        # A smallest value of q is combined as the largest value of -q (`outwards`), and turned back
        # (`mirrored`).
        both = _tighter(first[name].outwards, second[name].outwards)
        found[name] = mirrored(both) if first[name].is_least else both
    return found


def _tighter(first: Peak, second: Peak) -> Peak:
    """Return the combined bounds of two analyses of one peak.

    Two guaranteed ranges are intersected, two attained ones united. Otherwise the bounds with the
    stronger guarantee, or of two estimates those with the smaller largest error, are kept.

    Args:
        first: Bounds of a largest magnitude or of a largest value; not of a smallest value, whose
            peaks lie the farther out the lower they are.
        second: Bounds of the same peak on the same levels.
    """
    both = [first, second]
    # The guarantees are listed from the weakest to the strongest one.
    strength = list(Nature)
    better = max(both, key=lambda peak: (strength.index(peak.nature), -peak.error.max()))
    # What either analysis attains is attained, and bounds of the smallest peak hold together.
    found = with_combined(better, both, np.max, "reached", "least_lower")
    found = with_combined(found, both, np.min, "least_upper")
    natures = {first.nature, second.nature}
    if natures == {Nature.GUARANTEED}:
        # Both guarantees hold, hence their intersection.
        found = with_combined(found, both, np.max, "lower")
        found = with_combined(found, both, np.min, "upper")
    elif natures == {Nature.ATTAINED}:
        # Both ranges are attained, hence their union.
        found = with_combined(found, both, np.min, "lower")
        found = with_combined(found, both, np.max, "upper", "error")
    between_nodes = better.between_nodes
    if len(natures) == 1 and better.nature is not Nature.ESTIMATED:
        between_nodes = min(both, key=lambda peak: peak.upper[0]).between_nodes
    farther = max(both, key=lambda peak: peak.reached[0])
    return replace(found, between_nodes=between_nodes, reached_at=farther.reached_at)


def with_combined(
    peak: Peak, peaks: Sequence[Peak], rule: Callable[..., Array], *names: str
) -> Peak:
    """Return a peak with arrays that are combined from those of several peaks.

    Args:
        peak: Peak whose other fields are kept; it is not changed.
        peaks: The peaks that are combined, one or more.
        rule: NumPy function that combines a list of arrays along `axis=0`, such as `np.max`.
        names: Names of the fields that are combined, arrays of shape (levels,).
    """
    changes: dict[str, Any] = {}
    for name in names:
        changes[name] = rule([getattr(x, name) for x in peaks], axis=0)
    return replace(peak, **changes)


def widest_cause(peaks: Iterable[Peak]) -> str:
    """Return the cause of the gap of the peak with the largest bound, of some not mirrored."""
    return max(peaks, key=lambda peak: float(peak.upper[0])).cause


def largest_peaks(peaks: Mapping[str, Peaks] | Mapping[float, Peaks]) -> dict[str, Peak]:
    """Return bounds of the largest of a structure's peaks over all records, by the peak's name.

    The largest peak does not fall if the peak under some record rises. Its bounds are therefore the
    largest of the bounds under the records, with the weakest of their guarantees. Of the smallest
    value of an output ("min q3") the smallest one over the records is bounded. Under several
    records no structure is known to have small peaks, as each record may have its own one.

    Args:
        peaks: Peaks by the record's name, or by the direction of one record, and by the peak's
            name; at least one record, and the same peaks and levels for each.
    """
    largest: dict[str, Peak] = {}
    for name, first in next(iter(peaks.values())).items():
        of_records = [found[name].outwards for found in peaks.values()]
        farthest = max(of_records, key=lambda peak: float(peak.reached[0]))
        nature = Nature.weakest(peak.nature for peak in of_records)
        # Each array is the largest one of all records; the other fields are those of the record
        # under which the largest peak is attained. Smallest values of q have been turned into
        # largest values of -q (`outwards`), and are turned back at the end (`mirrored`).
        found = with_combined(
            replace(farthest, nature=nature, cause=widest_cause(of_records)), of_records, np.max,
            "lower", "upper", "error", "reached", "least_lower",
        )  # fmt: skip
        if len(of_records) > 1:
            found = replace(found, least_upper=np.full_like(found.reached, np.inf))
        largest[name] = mirrored(found) if first.is_least else found
    return largest


def close_peaks(
    model: StructureModel,
    inputs: Mapping[str, FuzzyNumber],
    names: Sequence[str],
    *,
    duration: float,
    step: float,
    alpha: Sequence[float] = ALPHA,
    error: float = PEAK_ERROR,
    dual_first: bool = False,
    thresholds: Sequence[Threshold] = (),
    progress: Progress | bool | None = None,
) -> dict[str, Peak]:
    """Return fuzzy peaks of a structure, by the method that bounds them most closely.

    The method is chosen by the structure and the number of inputs, and guaranteed bounds are
    preferred.

    Args:
        model: The structure; its own outputs are not used.
        inputs: Fuzzy parameters by name, in SI units.
        names: Names of the peaks: "q3" for the largest magnitude of the output q3, "max q3" and
            "min q3" for its largest and smallest value.
        duration: Length of the simulation, in s.
        step: Distance of the time nodes, in s.
        alpha: Levels, rising within [0, 1].
        error: Error that is aimed at, and need not be reached, as a fraction of each peak.
        dual_first: Whether the dual bound is tried first: it is sooner done, and no better than
            the error.
        thresholds: Limits of some of these peaks where columns yield, see `thresholds_of`. The
            effort goes to the question whether they hold, and bounds are sought no closer.
        progress: Called with the completed fraction; None shows a bar on a terminal, False shows
            nothing.

    Raises:
        RefusedError: The structure has no such output, a value is out of range, a support contains
            inadmissible values, or a response does not exist.
        FailedError: A step is too long, or no bounds are found.
    """
    # Each output once: "q3" and "max q3" belong to the same one.
    outputs = tuple(dict.fromkeys(map(output_of, names)))
    magnitudes = all(name == output_of(name) for name in names)
    band = envelope(
        model.with_outputs(outputs),
        inputs,
        Auto(
            error,
            peaks=True,
            magnitudes=magnitudes,
            dual_first=dual_first,
            thresholds=tuple(thresholds),
        ),
        duration=duration,
        step=step,
        alpha=alpha,
        progress=progress,
    )
    return with_causes(peaks(band, names), model, band)


def with_causes(found: Peaks, model: StructureModel, band: Envelope) -> dict[str, Peak]:
    """Return peaks of an envelope with the causes of wide gaps and of missing guarantees.

    Args:
        found: Peaks by name, such as "q3" or "min q3".
        model: The structure; its own outputs are not used.
        band: The envelope that the peaks were read from.
    """
    peaks_with_causes: dict[str, Peak] = {}
    for name, peak in found.items():
        cause = ""
        gap = float(peak.gaps[0])
        is_to_limits = bool(band.facts.get("sought_to_limits"))
        if peak.nature is not Nature.GUARANTEED:
            cause = missing_guarantee(model, band, output_of(name))
        elif is_to_limits:
            cause = open_part(band)
        elif gap > WIDE:
            between = peak.between_nodes / abs(float(peak.far_end[0]))
            cause = wide_gap(model, band, output_of(name), gap=gap, between=between)
        peaks_with_causes[name] = replace(peak, cause=cause, is_to_limits=is_to_limits)
    return peaks_with_causes


def loose_peaks(peaks: Peaks, names: Sequence[str], gap: float) -> tuple[str, ...]:
    """Return the names of those peaks that are missing or not guaranteed within a gap, in order.

    Args:
        peaks: Known peaks by name.
        names: Names of the peaks of interest.
        gap: Largest distance allowed on any level between the guaranteed bound of the most extreme
            peak and the attained value, as a fraction of the bound. Inputs whose box only encloses
            a set have no attained values, so that a guarantee alone is enough there.
    """

    def is_close(peak: Peak) -> bool:
        is_near = np.abs(peak.far_end - peak.reached) <= gap * np.abs(peak.far_end)
        return peak.nature is Nature.GUARANTEED and bool(is_near.all() or peak.encloses)

    return tuple(name for name in names if name not in peaks or not is_close(peaks[name]))
