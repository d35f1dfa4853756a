"""Peaks over a suite of ground motion records, each of which moves the structure by itself."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice, product
from math import ceil, pi
from typing import Any, NamedTuple

import numpy as np

from alphacut.base.arrays import Array, Mask
from alphacut.base.errors import RefusedError, checked_number, require, require_choice
from alphacut.base.number_text import (
    STANDARD_GRAVITY,
    engineering,
    percent_text,
    range_text,
)
from alphacut.base.progress_bar import Progress, nth_subprogress
from alphacut.frame.analyses.angles import TURN, angle_peaks, angle_response, turned_components
from alphacut.frame.analyses.answer import Answer, Row
from alphacut.frame.analyses.limits import Limit, thresholds_of
from alphacut.frame.analyses.peaks import (
    Peak,
    Peaks,
    close_peaks,
    largest_peaks,
    widest_cause,
    with_combined,
)
from alphacut.frame.boxes import ALPHA, Boxes, boxes
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.dynamics.nonlinear import make_flow
from alphacut.frame.dynamics.yielding import YieldingFlow
from alphacut.frame.records.history import Accelerogram
from alphacut.frame.records.recording import arias_fractions
from alphacut.frame.spectra.response_spectrum import rotated_spectra, spectral_acceleration
from alphacut.frame.structures.linear import LinearSystem, has_matrices, nominal_modes
from alphacut.frame.structures.matrix import MatrixStructure
from alphacut.frame.structures.model import StructureModel
from alphacut.frame.structures.quantities import output_of
from alphacut.frame.threshold import Threshold
from alphacut.fuzzy import FuzzyNumber
from alphacut.fuzzy.result import Nature

NODES = 2
"""Time nodes in each step at which peaks are bounded (tuned: the error between the nodes falls with
the square of this number, and the time rises in proportion to it)."""
ROTATED = {"RotD50(T1)": "m/s^2", "RotD100(T1)": "m/s^2"}
"""SI units of the intensity measures of records with two horizontal components alone."""
MEASURES = {"PGA": "m/s^2", "Sa(T1)": "m/s^2", "scale": ""} | ROTATED
"""SI units of the intensity measures of a record, by their names."""
GroundMotion = Accelerogram | Sequence[Accelerogram]
"""A record of one component; or of two horizontal ones, and perhaps the vertical one."""


class NominalMode(NamedTuple):
    """First mode of a structure at the nominal inputs: its period T1, in s, and damping ratio."""

    period: float
    ratio: float


def nominal_mode(model: StructureModel) -> NominalMode:
    """Return period and damping ratio of the first mode of a structure at its own parameters.

    Of a frame whose columns yield it is the mode before they do.

    Raises:
        RefusedError: The structure has no matrices of mass, damping and stiffness, as a general
            Lagrangian system; or its stiffness lets it drift, so that a mode does not oscillate.
    """
    if not has_matrices(model):
        what = "with a system that is not linear"
        raise RefusedError("records", what, "linear structures")
    modes = nominal_modes(model)
    omega = float(modes.frequencies[0])
    allowed = "a positive definite stiffness"
    require(omega > 0, "stiffness", "one that lets the structure drift", allowed)
    return NominalMode(period=2 * pi / omega, ratio=float(modes.damping_ratios[0]))


@dataclass(frozen=True, eq=False)
class RecordPeaks:
    """Peaks of a structure under a record, with facts about the record.

    Args:
        duration_s: Length of the response, in s.
        truncated_fraction: Fraction of the Arias intensity of the record that lies after the end of
            the response.
        measures: Intensity measures of the scaled record: "PGA" and "Sa(T1)" in m/s², the latter
            the pseudo-acceleration with the structure's own damping; and "scale", which is 1. Of
            two horizontal components the larger values, and "RotD50(T1)" and "RotD100(T1)".
        peak: Peaks by name; empty before they are computed.
    """

    duration_s: float
    truncated_fraction: float
    measures: dict[str, float]
    peak: dict[str, Peak]


@dataclass(frozen=True, eq=False)
class ScaledRecord:
    """A record as it moves a structure.

    Args:
        name: Name of the record.
        components: The scaled accelerograms of its components.
        facts: Length of the response and intensity measures, without peaks.
        warnings: Sentences on what is unusual in the record.
        all_angles: Whether both horizontal components are turned by all angles.
    """

    name: str
    components: tuple[Accelerogram, ...]
    facts: RecordPeaks
    warnings: tuple[str, ...]
    all_angles: bool = False

    @property
    def ground(self) -> Accelerogram:
        """The scaled accelerogram of the first component."""
        return self.components[0]

    @property
    def duration(self) -> float:
        """Length of the response, in s."""
        return self.facts.duration_s

    @property
    def measures(self) -> Mapping[str, float]:
        """Intensity measures by name."""
        return self.facts.measures

    def turned(self, angle: float) -> ScaledRecord:
        """Return the record with its two horizontal components turned by an angle in rad."""
        first, second, *vertical = self.components
        horizontal = turned_components(first, second, angle)
        return replace(self, components=(*horizontal, *vertical))


def scaled_records(
    model: StructureModel,
    suite: Sequence[GroundMotion],
    *,
    duration: float,
    step: float,
    scale: float = 1.0,
    measure: str = "",
    all_angles: bool = False,
) -> tuple[ScaledRecord, ...]:
    """Scale the records of a suite, and determine lengths of responses, measures and warnings.

    The measures of a record are its largest ground acceleration "PGA" and "Sa(T1)", the largest
    pseudo-acceleration of an oscillator with period and damping of the structure's first mode. Of
    a record with two horizontal components they are the larger ones of both; further measures are
    then "RotD50(T1)" and "RotD100(T1)", the median and the largest Sa(T1) over all directions.

    Args:
        model: The structure; its first mode is that at its own parameters.
        suite: Records after baseline correction, each an accelerogram, or a sequence of those of
            its components at the same times. Those without a name are called "record 1" and so on
            by their place.
        duration: Longest response, in s; a response ends five natural periods after its record, at
            a whole number of steps.
        step: Distance of the time nodes, in s.
        scale: Factor of every record, or the value in m/s² to which `measure` is scaled. All
            components of a record have the same factor.
        measure: "PGA", "Sa(T1)", "RotD50(T1)" or "RotD100(T1)"; empty if `scale` is a factor.
        all_angles: Whether the horizontal components are to be turned by all angles.

    Returns:
        The scaled records in the order of the suite, with the measures after scaling, but without
        peaks. A warning is given for a record shorter than half the first period, for a mean of
        more than 1 % of the peak, and for a response that ends before its record.

    Raises:
        RefusedError: `measure` is unknown, `duration` or `step` is not positive, there is no
            record, two have the same name, a record is zero throughout, the structure has no
            matrices of mass, damping and stiffness, it may drift, or its first period is above
            1000 s. Or components do not belong to the same times, or `measure` or `all_angles`
            needs two components and a record has one.
    """
    require_choice("measure", measure, ["", "PGA", "Sa(T1)", *ROTATED])
    require(duration > 0, "duration", value=f"{duration:g} s", allowed="above 0 s")
    checked_number("step", step, positive=True)
    records = [(x,) if isinstance(x, Accelerogram) else tuple(x) for x in suite]
    names = record_names(records)
    mode = nominal_mode(model)
    # Towers have periods of about 10 s. A longer one than 1000 s is a mistake in a unit.
    what = f"a first natural period of {mode.period:.4g} s"
    cure = "are the units of mass and stiffness right, as t and MN/m?"
    require(mode.period <= 1000, "structure", what, "periods up to 1000 s", cure)
    scaled = []
    for name, components in zip(names, records, strict=True):
        measures = _measures(components, mode)
        is_moving = min(measures.values()) > 0
        allowed = "a record that moves something"
        require(is_moving, f"record {name}", value="zero throughout", allowed=allowed)
        is_enough = len(components) > 1 or not (all_angles or measure in ROTATED)
        what = "of one component"
        asked = measure or "all angles"
        require(is_enough, f"record {name}", what, f"two or three components, for {asked}")

        # The free vibration after the record is included for five natural periods, in which a
        # damping ratio of 5 % reduces it to a fifth. The small number allows for rounding.
        first = components[0]
        record_length = (len(first.samples) - 1) * first.step
        length = min(duration, record_length + 5 * mode.period)
        # The response ends with a whole step.
        n_steps = max(1, ceil(length / step - 1e-9))
        # Measures are proportional to the record. Without a measure `scale` is the factor.
        factor = scale / measures.get(measure, 1.0)
        scaled_measures = {title: factor * value for title, value in measures.items()}
        warnings = short_record_warnings(f"record {name}", record_length, mode.period)
        grounds: list[Accelerogram] = []
        truncated: list[float] = []
        for component in components:
            fraction = 0.0
            if length < record_length:
                intensity = arias_fractions(component.samples, component.step)
                fraction = 1 - float(intensity[int(length / component.step + 1e-9)])
            truncated.append(fraction)
            of_component = name
            if len(components) > 1:
                of_component = component.name or f"{name}, component {len(grounds) + 1}"
            samples = factor * component.samples
            ground = Accelerogram(component.step, samples, name=component.name or name)
            grounds.append(ground)
            warnings += _warnings(
                of_component,
                component,
                end=n_steps * step,
                truncated_fraction=fraction,
                peak=ground.extremes[0],
            )
        facts = RecordPeaks(
            duration_s=n_steps * step,
            truncated_fraction=max(truncated),
            measures=scaled_measures | {"scale": 1.0},
            peak={},
        )
        scaled.append(ScaledRecord(name, tuple(grounds), facts, tuple(warnings), all_angles))
    return tuple(scaled)


def _measures(components: Sequence[Accelerogram], mode: NominalMode) -> dict[str, float]:
    """Return the intensity measures of a record by name; a third, vertical component counts not.

    Raises:
        RefusedError: Two components do not belong to the same times.
    """
    for other in components[1:]:
        components[0].require_times_of(other)
    horizontal = components[:2]
    # A spectrum is defined for less than critical damping, for which an oscillator oscillates.
    ratio = min(mode.ratio, 0.999)
    measures = {
        "PGA": max(x.extremes[0] for x in horizontal),
        "Sa(T1)": max(spectral_acceleration(x, mode.period, ratio) for x in horizontal),
    }
    if len(horizontal) > 1:
        rotated = rotated_spectra(horizontal[0], horizontal[1], mode.period, ratio)
        measures["RotD50(T1)"] = float(rotated.rotd50)
        measures["RotD100(T1)"] = float(rotated.rotd100)
    return measures


def record_names(records: Sequence[Sequence[Accelerogram]]) -> list[str]:
    """Return the names of records, "record 1" and so on of those without one.

    Several components have the name that "+" makes of theirs, as "x+y".

    Args:
        records: The components of each record.

    Raises:
        RefusedError: There is no record, or two have the same name, by which results are told
            apart.
    """
    require(len(records) > 0, "suite", value=None, allowed="one record or more")
    names = []
    for number, components in enumerate(records, start=1):
        joined = "+".join(component.name for component in components if component.name)
        names.append(joined or f"record {number}")
    repeated = ", ".join(sorted({name for name in names if names.count(name) > 1}))
    require(not repeated, "suite", value=repeated, allowed="a name of its own for each record")
    return names


def short_record_warnings(name: str, length: float, period: float) -> list[str]:
    """Return a sentence if a record is shorter than half the first natural period, both in s.

    Earthquakes last for many periods, so that the step of such a record is mostly wrong. The half
    is tuned: it leaves out tests under single pulses.
    """
    if length >= 0.5 * period:
        return []
    what = f"{name} lasts {length:.4g} s, less than half the first natural period, {period:.4g} s"
    return [f"{what}: is its step right?"]


def _warnings(
    name: str, record: Accelerogram, *, end: float, truncated_fraction: float, peak: float
) -> tuple[str, ...]:
    """Return sentences on what is unusual in a record; none for an ordinary one.

    They are the remarks made when the record was read, the size of its mean if this is more than
    1 % of the peak, and how much of the shaking lies after the end of the response.

    Args:
        name: Name of the record.
        record: The record before scaling; it is not zero throughout.
        end: Length of the response, in s.
        truncated_fraction: Fraction of the Arias intensity of the record after this end.
        peak: Largest magnitude of the scaled record, in m/s^2.
    """
    warnings = [f"of record {name} {remark}" for remark in record.remarks]
    unscaled_peak, _ = record.extremes
    # No earthquake was recorded above some 4 g; a record above that tells itself.
    if peak > 5 * STANDARD_GRAVITY >= unscaled_peak:
        what = f"record {name} is scaled to {peak / STANDARD_GRAVITY:.3g} g"
        warnings.append(f"{what}, more than the ground reaches: is records.scale meant so?")
    mean_fraction = float(record.samples.mean()) / unscaled_peak
    # A larger mean hints at an offset of the instrument, whose displacement grows quadratically.
    if abs(mean_fraction) > 0.01:
        what = f"the mean of record {name} is {percent_text(mean_fraction)} of its peak"
        warnings.append(f'{what}; records.baseline = "mean" subtracts it')
    if truncated_fraction > 0:
        what = f"{truncated_fraction:.1%} of the Arias intensity of record {name}"
        warnings.append(f"{what} lies after the end of its motion, {end:g} s")
    return tuple(warnings)


def record_peaks(
    model: LinearSystem,
    inputs: Mapping[str, FuzzyNumber],
    record: ScaledRecord,
    names: Sequence[str],
    *,
    step: float,
    alpha: Sequence[float],
    thresholds: Sequence[Threshold] = (),
    progress: Progress | bool | None = None,
) -> dict[str, Peak]:
    """Return fuzzy peaks of a structure under a record, by name.

    They are bounded at two time nodes in each step, within 0.5 % of each peak if possible.

    Args:
        model: The structure; the record replaces its own one.
        inputs: Fuzzy parameters by name, in SI units.
        record: The scaled record and the length of its response.
        names: Names of the peaks: "q3" for the largest magnitude of the output q3, "max q3" and
            "min q3" for its largest and smallest value.
        step: Step, in s.
        alpha: Levels, rising within [0, 1].
        thresholds: See `close_peaks`, and `thresholds_under` for those of several records.
        progress: Called with the completed fraction; None shows a bar on a terminal, False shows
            nothing.

    Raises:
        RefusedError: There is no such output, or inputs, levels or the step are not allowed.
        FailedError: No bounds are found, or a time step did not converge.
    """
    motion: dict[str, Any] = {"duration": record.duration, "step": step / NODES, "alpha": alpha}
    moved = model.moved_by(*record.components)
    if record.all_angles:
        return angle_peaks(moved, inputs, names, **motion, progress=progress).peak
    return close_peaks(moved, inputs, names, **motion, thresholds=thresholds, progress=progress)


def thresholds_under(
    model: LinearSystem,
    inputs: Mapping[str, FuzzyNumber],
    records: Sequence[ScaledRecord],
    limits: Sequence[Limit],
    *,
    step: float,
    alpha: Sequence[float],
) -> dict[str, tuple[Threshold, ...]]:
    """Return the questions about limits that are left to the proofs under each record, by its name.

    Exact trajectories at midpoints and corners of all cuts under all records are taken first. If
    one in a cut exceeds a limit under any record, and another keeps it under some record, then the
    largest peak over the records can exceed the limit, and this record does not show that it must:
    nothing is left to be asked of it up to this level.

    A mean over the records keeps its limit if the mean of the bounds does. So each record is asked
    whether its peak keeps a limit of its own, whose mean is the limit of the mean. These limits are
    in proportion to the largest peaks that are known, or to the smallest where all known means
    exceed the limit. A mean for which both is so neither way has its peaks bounded closely.

    Args:
        model: The structure; each record replaces its own one.
        inputs: Fuzzy parameters by name, in SI units.
        records: The scaled records, at least one.
        limits: Limits with one value each, in SI units.
        step: Step, in s.
        alpha: Levels, rising within [0, 1].

    Raises:
        RefusedError: An input is unknown, or a trajectory does not exist.
    """
    from alphacut.frame.methods.yielding_proof import MAX_INPUTS, known_peaks

    asked = thresholds_of(model, limits)
    cuts = boxes(inputs, alpha)
    if not asked or np.count_nonzero(cuts.upper[0] > cuts.lower[0]) > MAX_INPUTS:
        return {record.name: asked for record in records}
    outputs = tuple(dict.fromkeys(threshold.output for threshold in asked))
    tried, is_in_cut = _tried(cuts)
    known = []
    for record in records:
        moved = model.moved_by(*record.components).with_outputs(outputs)
        flow = make_flow(moved, cuts.names, record.duration, step / NODES, "exact")
        assert isinstance(flow, YieldingFlow)  # as there are thresholds
        values, peaks = flow.values_and_peaks(tried)
        columns = {output: k for k, output in enumerate(outputs)}
        known.append([
            known_peaks(x, values[..., columns[x.output]], peaks[:, columns[x.output]])
            for x in asked
        ])  # fmt: skip
    questions = [
        _questions(threshold, limit.number, found, is_in_cut, cuts.alpha)
        for threshold, limit, found in zip(asked, limits, np.swapaxes(known, 0, 1), strict=True)
    ]
    by_record = zip(*questions, strict=True)
    return {record.name: x for record, x in zip(records, by_record, strict=True)}


def _tried(cuts: Boxes) -> tuple[Array, Mask]:
    """Return structures of the cuts, the nominal one, midpoints and corners; and who is in a cut.

    Returns:
        Parameter sets in SI units, shape (structures, parameters), and whether each is in the cut
        of each level, shape (levels, structures).
    """
    points = [cuts.nominal]
    for lower, upper in zip(cuts.lower, cuts.upper, strict=True):
        # At most 64 corners of each cut (tuned: more take time, and none is a bound).
        ends_of_inputs = np.column_stack([lower, upper])
        points += [(lower + upper) / 2, *map(np.array, islice(product(*ends_of_inputs), 64))]
    # Cuts share corners, for example those of crisp inputs.
    tried: Array = np.unique(points, axis=0)
    is_inside = (tried >= cuts.lower[:, np.newaxis]) & (tried <= cuts.upper[:, np.newaxis])
    return tried, np.asarray(is_inside.all(axis=-1))


def _questions(
    threshold: Threshold, limit: float, known: Array, is_in_cut: Mask, alpha: Array
) -> list[Threshold]:
    """Return what is left to be asked about a threshold under each of R records.

    Args:
        threshold: The threshold; without a value the mean over the records is limited.
        limit: Its limit, in SI units.
        known: Bounds of the peaks of known trajectories, the least and the most that they can be,
            shape (R, 2, structures).
        is_in_cut: Whether each structure is in the cut of each level, shape (levels, structures).
        alpha: Levels, rising, shape (levels,).
    """
    is_mean = threshold.value is None
    value = limit if threshold.value is None else threshold.value
    compared = known.mean(axis=0, keepdims=True) if is_mean else known
    is_exceeded = (is_in_cut & (compared[:, 0] > value).any(axis=0)).any(axis=1)
    is_kept = (is_in_cut & (compared[:, 1, np.newaxis] <= value)).any(axis=2)
    answered = np.where(is_exceeded & is_kept, alpha, -1.0).max(axis=1)
    values: list[float | None] = [threshold.value] * len(known)
    is_left = alpha > answered[0]
    if is_mean and is_left.any():
        of_cut = known[:, :, is_in_cut[is_left.argmax()]]
        most = of_cut[:, 0].max(axis=1)
        least = of_cut[:, 1].min(axis=1)
        if most.mean() <= limit:
            values = (most * limit / max(most.mean(), 1e-300)).tolist()
        elif least.mean() > limit:
            values = (least * limit / least.mean()).tolist()
    levels = np.broadcast_to(answered, len(known))
    return [
        replace(threshold, value=x, answered=float(a)) for x, a in zip(values, levels, strict=True)
    ]


def require_proved(peaks: Mapping[str, Peak], record: str, unit_of: Callable[[str], str]) -> None:
    """Refuse peaks that are not guaranteed, where a proof was named as the method.

    Args:
        peaks: Peaks under a record by name.
        record: Name of the record.
        unit_of: Function that returns the SI unit of an output.

    Raises:
        UnprovedError: A peak is not guaranteed. The message has what is known: the peak that a
            structure is known to reach, and the bound as it is estimated.
    """
    for name, peak in peaks.items():
        if peak.nature is Nature.GUARANTEED:
            continue
        unit = unit_of(output_of(name))
        reached = engineering(float(peak.reached[0]), unit)
        estimate = engineering(float(peak.far_end[0]), unit)
        known = f"a structure reaches {reached}, and at most {estimate} is estimated"
        what = f"{name} under {record} is not proved; {known}"
        raise UnprovedError(what, peak.cause or "method auto takes estimates")


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class SuitePeaks(Answer):
    """Peaks over a suite of records.

    Args:
        period_s: First natural period T1 at the nominal inputs, in s.
        damping_ratio: Damping ratio of the first mode.
        alpha: Levels, shape (levels,).
        by_record: Intensity measures and peaks of each record by its name.
        statistics: Mean and quantiles over the records of the guaranteed bounds of their peaks, by
            peak and statistic, shape (levels,) each.
        units: SI units of the outputs.
        peak: Bounds of the largest peak over the records by name, and, with names such as "mean
            q3", bounds of the mean over the records of the peaks of one structure.
        farthest_record: Record under which each of the largest peaks is attained.
    """

    key = "records"
    title = "How far does it move under each record?"
    period_s: float
    damping_ratio: float
    alpha: Array
    by_record: dict[str, RecordPeaks]
    statistics: dict[str, dict[str, Array]]
    units: dict[str, str]
    peak: dict[str, Peak]
    farthest_record: dict[str, str]

    def text_rows(self) -> Iterator[Row]:
        """Yield a row for each of the largest peaks, and for each mean.

        The columns are the name of the peak, its range at the lowest level, the guarantee, the
        attained value, and the record under which it is attained, empty for a mean.
        """
        for name, peak in self.peak.items():
            unit = self.units[output_of(name)]
            ends = range_text(float(peak.lower[0]), float(peak.upper[0]), peak.nature)
            attained = float(peak.reached[0])
            attained_text = "not known"
            if np.isfinite(attained):
                attained_text = engineering(attained, unit)
            yield {
                "peak of": name,
                f"at α = {self.alpha[0]:g}": f"{ends} {unit}".strip(),
                "nature": peak.nature,
                "reached": attained_text,
                "record": self.where(name),
            }

    def where(self, name: str) -> str:
        """Return the record under which a peak is attained, with its angle if all are meant."""
        record = self.farthest_record.get(name, "")
        worst = self.peak[name].worst
        if not record or worst is None:
            return record
        return f"{record}, {worst.angle:.1f}°"

    def number_rows(self) -> Iterator[Row]:
        """Yield a row for each record and peak, and then one for each peak and statistic.

        The columns are the record, its intensity measures in m/s², name and SI unit of the peak,
        the bound of the farthest peak and the attained value on the lowest level, and the
        guarantee; for all angles also that of the attained value in degrees. In the
        rows of "mean", "median" and "84 %" quantile of the bounds
        over all records, measures, attained values and guarantee are None.
        """
        row: dict[str, str | float | Nature | None] = {}
        for name, record in self.by_record.items():
            for peak_name, peak in record.peak.items():
                row = {
                    "record": name,
                    "PGA [m/s^2]": record.measures["PGA"],
                    "Sa(T1) [m/s^2]": record.measures["Sa(T1)"],
                    "output": peak_name,
                    "unit": self.units[output_of(peak_name)],
                    "farthest peak": peak.far_end[0],
                    "peak reached": peak.reached[0],
                    "nature": peak.nature,
                }
                if self.has_angles:
                    row["angle [deg]"] = None if peak.worst is None else peak.worst.angle
                yield row
        for peak_name, statistics in self.statistics.items():
            for statistic, bound in statistics.items():
                # Statistics have no measures and no guarantee of their own.
                yield dict.fromkeys(row) | {
                    "record": f"{statistic} of all",
                    "output": peak_name,
                    "unit": self.units[output_of(peak_name)],
                    "farthest peak": bound[0],
                }

    def words(self) -> str:
        """Return sentences on what the peaks, the means and the angles belong to."""
        text = (
            f"Peaks under {len(self.by_record)} records (T1 = {self.period_s:.4g} s,"
            f" ζ = {self.damping_ratio:.3g}, at the most plausible inputs). A mean is the mean of"
            " the peaks of one structure; its bounds are the means of the bounds under the records."
        )
        if self.has_angles:
            text += f" Each peak is the largest one over all angles of incidence. {TURN}"
        return text

    @property
    def has_angles(self) -> bool:
        """Whether the angles are known at which peaks over all angles of incidence are attained."""
        return any(peak.worst is not None for peak in self.peak.values())


def over_records(
    model: LinearSystem,
    inputs: Mapping[str, FuzzyNumber],
    suite: Sequence[GroundMotion],
    *,
    duration: float,
    step: float,
    alpha: Sequence[float] = ALPHA,
    names: Sequence[str] = (),
    scale: float = 1.0,
    measure: str = "",
    all_angles: bool = False,
    progress: Progress | None = None,
) -> SuitePeaks:
    """Return the peaks of a structure under each record of a suite, the largest and the mean.

    Args:
        model: A linear structure, or a frame that yields. Each record replaces its own record.
        inputs: Fuzzy parameters by name, in SI units.
        suite: Records, see `read_suite`; each an accelerogram, or a sequence of those of its two or
            three components, one for `ground` and each entry of `components` of the structure.
        duration: Longest response, in s; a response ends five natural periods after its record.
        step: Distance of the time nodes, in s; peaks are bounded at two nodes in each step.
        alpha: Levels, rising within [0, 1].
        names: Names of peaks, such as "drift1" for the magnitude, "max q3" or "min q3"; by default
            the magnitudes of all outputs.
        scale: Factor of every record, or the value in m/s² to which `measure` is scaled.
        measure: "PGA" or "Sa(T1)", of two components also "RotD50(T1)" or "RotD100(T1)", the median
            and the largest Sa(T1) over all directions; empty if `scale` is a factor.
        all_angles: Whether the two horizontal components come from all directions, turned together
            by any angle, so that peaks are those of the worst angle; magnitudes alone.
        progress: Called with the completed fraction.

    Returns:
        Bounds of each peak under each record, of the largest over the records, and, for
        magnitudes, of the mean over the records; and quantiles of the guaranteed bounds.

    Raises:
        RefusedError: A record is zero throughout, there is no such output, an argument is out of
            range, or the structure has no matrices of mass, damping and stiffness.
        FailedError: No bounds are found for a record, or a time step did not converge.
    """
    records = scaled_records(
        model,
        suite,
        duration=duration,
        step=step,
        scale=scale,
        measure=measure,
        all_angles=all_angles,
    )
    names = tuple(names) or tuple(map(str, model.outputs))
    return peaks_under(model, inputs, records, names, step=step, alpha=alpha, progress=progress)


def peaks_under(
    model: LinearSystem,
    inputs: Mapping[str, FuzzyNumber],
    records: Sequence[ScaledRecord],
    names: Sequence[str],
    *,
    step: float,
    alpha: Sequence[float],
    progress: Progress | None,
) -> SuitePeaks:
    """Return the peaks with some names under each of some scaled records; see `over_records`."""
    found = {}
    for k, record in enumerate(records):
        tick = nth_subprogress(progress, k, len(records))
        found[record.name] = record_peaks(
            model, inputs, record, names, step=step, alpha=alpha, progress=tick
        )
    return summarised(model, inputs, records, found, step=step, alpha=alpha)


def summarised(
    model: LinearSystem,
    inputs: Mapping[str, FuzzyNumber],
    records: Sequence[ScaledRecord],
    peaks: Mapping[str, Mapping[str, Peak]],
    *,
    step: float,
    alpha: Sequence[float],
) -> SuitePeaks:
    """Return the largest peaks, means and statistics over records, from the peaks under each.

    The statistics of each peak are mean, median and 84 % quantile, over the records, of the
    guaranteed bounds.

    Args:
        model: The structure.
        inputs: Fuzzy parameters by name, in SI units.
        records: The scaled records, at least one.
        peaks: Peaks by the record's name and by the peak's name, in the order of `records`; each
            record has the same peaks.
        step: Step, in s; means are those of peaks at two time nodes in each step.
        alpha: Levels of the peaks.
    """
    largest = largest_peaks(peaks)
    encloses = next(iter(largest.values())).encloses
    farthest: dict[str, str] = {}
    statistics: dict[str, dict[str, Array]] = {}
    for name, peak in largest.items():
        # No record is known to move a structure of the enclosed set farthest.
        if not encloses:
            reached = {record: found[name].outwards.reached[0] for record, found in peaks.items()}
            farthest[name] = max(reached, key=reached.__getitem__)
        bounds = np.stack([found[name].proved for found in peaks.values()])  # (records, levels)
        # 84 % is one standard deviation of a normal distribution above the mean. The quantiles of
        # smallest values are counted from above.
        sign = peak.outward_sign
        statistics[name] = {
            "mean": bounds.mean(axis=0),
            "median": np.median(bounds, axis=0),
            "84 %": sign * np.quantile(sign * bounds, 0.84, axis=0),
        }
    means = mean_peaks(model, inputs, records, peaks, step=step, alpha=alpha)
    mode = nominal_mode(model)
    return SuitePeaks(
        encloses=encloses,
        period_s=mode.period,
        damping_ratio=mode.ratio,
        alpha=np.array(alpha, float),
        by_record={x.name: replace(x.facts, peak=dict(peaks[x.name])) for x in records},
        statistics=statistics,
        units={output_of(name): model.unit_of(output_of(name)) for name in largest},
        peak=largest | means,
        farthest_record=farthest,
    )


def mean_peaks(
    model: LinearSystem,
    inputs: Mapping[str, FuzzyNumber],
    records: Sequence[ScaledRecord],
    peaks: Mapping[str, Peaks],
    *,
    step: float,
    alpha: Sequence[float],
) -> dict[str, Peak]:
    """Return bounds of the mean over the records of a structure's peaks, as "mean q3" and so on.

    The mean of each structure lies between the mean of the smallest and the mean of the largest
    peaks of the cut. No structure may attain the latter, since each record has its own worst
    structure. The attained value is the largest mean of the structures that are tried here: the
    nominal one, midpoints and corners of the cuts. Their peaks are read at the time nodes, so that
    the true mean of such a structure is no smaller.

    The peaks under each record are given by the record's name and by the peak's name; only those of
    magnitudes have means. The other arguments are those of `over_records`.
    """
    magnitudes = tuple(name for name in peaks[records[0].name] if name == output_of(name))
    cuts = boxes(inputs, alpha)
    tried, is_in_cut = _tried(cuts)
    tried_means: Array = np.zeros((len(tried), len(magnitudes)))
    for record in records:
        moved = model.moved_by(*record.components).with_outputs(magnitudes)
        # Exact responses at the same nodes as the bounds.
        motion = {"duration": record.duration, "step": step / NODES}
        if record.all_angles:
            assert isinstance(moved, MatrixStructure)  # whose peaks have been bounded
            values = angle_response(moved, cuts.names, tried, **motion).magnitudes
        else:
            flow = make_flow(moved, cuts.names, record.duration, step / NODES, "exact")
            values = np.abs(flow.values(tried))
        columns = [moved.outputs.index(output) for output in magnitudes]
        tried_means += values.max(axis=1)[:, columns] / len(records)

    found: dict[str, Peak] = {}
    for name, means in zip(magnitudes, tried_means.T, strict=True):
        of_records = [by_name[name] for by_name in peaks.values()]
        mean = with_combined(
            of_records[0], of_records, np.mean, "lower", "upper", "error", "least_lower"
        )
        # Any structure of a cut has at least the mean of the smallest peaks of this cut. Each cut
        # contains all higher ones.
        mean_of_smallest = np.maximum(mean.lower - mean.error, mean.least_lower)
        of_higher_cuts = np.maximum.accumulate(mean_of_smallest[::-1])[::-1]
        # The largest mean of the structures tried that belong to each cut.
        in_cuts = np.where(is_in_cut, means, -np.inf)
        reached = np.maximum(of_higher_cuts, in_cuts.max(axis=1))
        farthest = tried[in_cuts[0].argmax()].tolist()
        reached_at = dict(zip(cuts.names, farthest, strict=True))
        if of_records[0].encloses:
            # No structure of the box is known to belong to the enclosed set.
            reached = np.full_like(reached, -np.inf)
            reached_at = {}
        found[f"mean {name}"] = replace(
            mean,
            nature=Nature.weakest(peak.nature for peak in of_records),
            cause=widest_cause(of_records),
            reached=reached,
            least_upper=np.full_like(reached, np.inf),  # no structure has a known small mean
            reached_at=reached_at,
            worst=None,  # each record has an angle of its own
        )
    return found
