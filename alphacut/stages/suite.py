"""Stage records: peaks of a structure under each record of a suite, one result a record."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice, product
from math import ceil, pi

import numpy as np

from alphacut.case.loads import NamedRecording, RecordsSection
from alphacut.case.motion import EnvelopeSection
from alphacut.case.structure import Structure
from alphacut.frame import Accelerogram
from alphacut.frame.dynamics.nonlinear import make_flow
from alphacut.frame.questions.peaks import Peaks, joined, output_of
from alphacut.frame.structures.linear import modal_damping_ratios
from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import RefusedError, require
from alphacut.fuzzy.result import Nature
from alphacut.records.recording import arias_shares, spectral_acceleration
from alphacut.stages.envelope import PEAK_BOUNDS, EnvelopeTask, PeakResults
from alphacut.stages.store import Numbers, Stage, Values

FREE_PERIODS = 5
"""Natural periods of free motion after a record: by then 5 % damping leaves a fifth."""
PERIODS: Array = np.array(np.geomspace(0.05, 4.0, 45), float)
"""Periods of response spectra, in s."""
MAX_CORNERS = 64
"""Corners of each cut whose means over records are computed; more take time, none is a bound."""
NODES = 2
"""Nodes in a step at which peaks are bounded; the error between nodes falls with its square."""
MAX_OFFSET = 0.01
"""Mean of a record as a share of its peak that is said."""
QUANTILES = {"mean": None, "median": 0.5, "84 %": 0.84}
"""Statistics of a suite's peaks; 84 % is one standard deviation of a normal law above the mean."""


@dataclass(frozen=True)
class NominalMode:
    """First mode at the most plausible inputs: its period T1 in s, and damping ratio."""

    period: float
    ratio: float


@dataclass(frozen=True, eq=False)
class SuiteRecord:
    """A record of the suite as it moves the structure, corrected and scaled.

    Args:
        duration: Length of the motion, in s.
        measures: "PGA" and "Sa(T1)" of the scaled record, in m/s², and "scale", 1.
        cut_share: Share of the Arias intensity after the end of the motion.
        offset_share: Mean of the record over its peak, after the correction.
    """

    name: str
    ground: Accelerogram
    duration: float
    measures: Mapping[str, float]
    cut_share: float
    offset_share: float
    doubts: tuple[str, ...] = ()


def nominal_mode(structure: Structure) -> NominalMode:
    """First mode at the most plausible inputs of a linear structure."""
    if structure.linear is None:
        what = "with a system that is not linear"
        raise RefusedError("records", what, "linear structures")
    omega, ratios = modal_damping_ratios(structure.linear)
    return NominalMode(2 * pi / float(omega[0]), float(ratios[0]))


def suite_records(
    section: RecordsSection, envelope: EnvelopeSection, structure: Structure
) -> tuple[SuiteRecord, ...]:
    """The records of a suite, in the order of the case."""
    mode = nominal_mode(structure)
    return tuple(_suite_record(section, envelope, named, mode) for named in section.recordings)


def _suite_record(
    section: RecordsSection, envelope: EnvelopeSection, named: NamedRecording, mode: NominalMode
) -> SuiteRecord:
    """A recording after correction and scaling, and the length of the motion under it."""
    ground = named.recording.accelerogram(section.baseline)
    measures = {
        "PGA": ground.extremes[0],
        "Sa(T1)": spectral_acceleration(ground, mode.period, min(mode.ratio, 0.999)),
        "scale": 1.0,
    }
    measure = measures.get(section.scale.measure, 1.0)
    key, allowed = f"record {named.name}", "a record that moves something"
    require(measure > 0, key, value="zero throughout", allowed=allowed)
    factor = section.scale.value / measure
    length = (len(ground.acceleration) - 1) * ground.step
    duration = min(envelope.duration, length + FREE_PERIODS * mode.period)
    steps = max(1, ceil(duration / envelope.step - 1e-9))
    envelope.require_steps(f"envelope.duration of {named.name}", steps * envelope.step)
    shares = arias_shares(ground.acceleration, ground.step)
    end = min(int(duration / ground.step + 1e-9), len(shares) - 1)
    cut_share = 0.0 if duration >= length else float(1 - shares[end])
    offset = float(ground.samples.mean()) / ground.extremes[0]
    scaled = Accelerogram(ground.step, factor * ground.acceleration)
    measures |= {name: factor * measures[name] for name in ("PGA", "Sa(T1)")}
    doubts = tuple(named.recording.doubts())
    return SuiteRecord(
        named.name, scaled, steps * envelope.step, measures, cut_share, offset, doubts
    )


def suite_warnings(records: Sequence[SuiteRecord]) -> Iterator[str]:
    """Yields warnings on unusual records, large means, and records that outlast their motion."""
    for record in records:
        for doubt in record.doubts:
            yield f"of record {record.name} {doubt}"
        if abs(record.offset_share) > MAX_OFFSET:
            yield (
                f"the mean of record {record.name} is {record.offset_share:.1%} of its peak;"
                ' records.baseline = "mean" subtracts it'
            )
        if record.cut_share > 0:
            share = f"{record.cut_share:.1%} of the Arias intensity of record {record.name}"
            yield f"{share} lies after the end of its motion, {record.duration:g} s"


def with_record(structure: Structure, record: SuiteRecord) -> Structure:
    """The structure moved by a record."""
    assert structure.linear is not None
    return replace(structure, model=replace(structure.linear, ground=record.ground))


def stages(
    structure: Structure, task: EnvelopeTask, records: Sequence[SuiteRecord]
) -> list[Stage[PeakResults]]:
    """A stage for each record, the longest first."""
    longest = sorted(records, key=lambda record: -record.duration)
    return [_record_stage(structure, task, record) for record in longest]


def _record_stage(
    structure: Structure, task: EnvelopeTask, record: SuiteRecord
) -> Stage[PeakResults]:
    """The stage that computes the peaks of a structure under a record."""
    loaded = with_record(structure, record)
    record_task = replace(task, name=record.name, duration=record.duration)
    inputs = [loaded.model, loaded.numbers, record_task]
    compute = partial(record_task.compute_peaks, loaded, nodes=NODES)
    return Stage(stage_name(record), inputs, ("fuzzy", "frame"), PeakResults, compute)


def stage_name(record: SuiteRecord) -> str:
    """Name of the files of a record's result."""
    return f"record_{record.name}"


def worst_peaks(peaks: Mapping[str, Peaks]) -> Peaks:
    """Bounds of the largest of a structure's peaks over all records.

    The largest peak rises with the peak under each record, so that its bounds are the largest ones.
    """
    first = next(iter(peaks.values()))
    bounds = {
        name: np.max([getattr(x, name) for x in peaks.values()], axis=0) for name in PEAK_BOUNDS
    }
    columns = zip(*(x.natures for x in peaks.values()), strict=True)
    return replace(first, natures=tuple(map(Nature.weakest, columns)), **bounds)


def means_reached(
    structure: Structure, task: EnvelopeTask, records: Sequence[SuiteRecord], outputs: Sequence[str]
) -> Array:
    """Greatest mean over the records of a structure's peaks, of those tried, (levels, outputs).

    Tried are the nominal structure and those at corners of each cut. Peaks are read at nodes, so
    that the structure's own mean is no smaller.
    """
    inputs = structure.inputs(task.fuzzy)
    names, step = tuple(inputs), task.section.step / NODES
    points = [[number.modal for number in inputs.values()]]
    for alpha in task.section.alpha:
        corners = product(*(dict.fromkeys(number.cut(alpha)) for number in inputs.values()))
        points += [list(corner) for corner in islice(corners, MAX_CORNERS)]
    means: Array = np.zeros((len(points), len(outputs)))
    for record in records:
        model = with_record(structure, record).model_with_outputs("records", tuple(outputs))
        flow = make_flow(model, names, record.duration, step, "exact")
        columns = [[*map(str, flow.outputs)].index(output) for output in outputs]
        means += np.abs(flow.values(np.array(points))).max(axis=1)[:, columns] / len(records)
    rows = []
    for alpha in task.section.alpha:
        cuts = np.array([number.cut(alpha) for number in inputs.values()])
        inside = ((np.array(points) >= cuts[:, 0]) & (np.array(points) <= cuts[:, 1])).all(axis=1)
        rows.append(means[inside].max(axis=0, initial=0.0))
    return np.array(rows)


def with_means(worst: Peaks, peaks: Mapping[str, Peaks], reached: Array) -> Peaks:
    """The worst peaks, and beside them "mean q3" …, bounds of the mean over the records.

    The mean of each structure lies between the means of the least and of the greatest peaks. No
    structure may reach the latter, as each record has its own worst one; `reached` has the greatest
    mean that a structure is known to have, of each magnitude, (levels, outputs).
    """
    plain = [name for name in worst.outputs if name == output_of(name)]
    columns = {f"mean {name}": name for name in plain}
    means = {
        end: np.mean([getattr(x.named(columns), end) for x in peaks.values()], axis=0)
        for end in ("lower", "upper", "error", "least_proved")
    }
    least = np.maximum(means["lower"] - means["error"], means["least_proved"])
    most = means["upper"] + means["error"]
    # a structure of any higher cut has at least the mean of that cut's least peaks
    means["reached"] = np.maximum(np.maximum.accumulate(least[::-1])[::-1], reached)
    means["least_reached"] = np.minimum.accumulate(most[::-1])[::-1]
    mean = replace(worst.named(columns), **means)
    return joined(worst, mean)


class RecordResult(Numbers):
    """Peaks under a record, and its measures in m/s² but for "scale", 1."""

    duration_s: float
    cut_share: float
    measures: dict[str, float]
    peak: PeakResults


class Statistics(Numbers):
    """Mean and quantiles over the records by name, on each level: proved, and reached."""

    proved: dict[str, Values]
    reached: dict[str, Values]


class SuiteResult(Numbers):
    """Measures and peaks of each record, statistics of peaks, and response spectra in m/s²."""

    period_s: float
    damping_ratio: float
    alpha: Values
    records: dict[str, RecordResult]
    statistics: dict[str, Statistics]
    spectra: dict[str, Values]
    units: dict[str, str]


def suite_result(
    peaks: Mapping[str, PeakResults],
    records: Sequence[SuiteRecord],
    mode: NominalMode,
    alpha: Sequence[float],
    units: Mapping[str, str],
) -> SuiteResult:
    """Numbers on a suite, from the peaks under each record by its name."""
    first = next(iter(peaks.values()))
    return SuiteResult(
        period_s=mode.period,
        damping_ratio=mode.ratio,
        alpha=np.array(alpha),
        records={
            record.name: RecordResult(
                duration_s=record.duration,
                cut_share=record.cut_share,
                measures=dict(record.measures),
                peak=peaks[record.name],
            )
            for record in records
        },
        statistics={
            name: Statistics(
                proved=statistics([x[name].proved for x in peaks.values()], peak.is_least),
                reached=statistics([x[name].reached for x in peaks.values()], peak.is_least),
            )
            for name, peak in first.items()
        },
        spectra={
            "period_s": PERIODS,
            **{record.name: spectrum(record.ground, mode) for record in records},
        },
        units=dict(units),
    )


def spectrum(ground: Accelerogram, mode: NominalMode) -> Array:
    """Pseudo-accelerations at `PERIODS` with the nominal damping, in m/s²."""
    ratio = min(mode.ratio, 0.999)
    return np.array([spectral_acceleration(ground, float(x), ratio) for x in PERIODS])


def statistics(values: Sequence[Array], is_least: bool) -> dict[str, Array]:
    """Mean and quantiles by name over records of values (levels,); of least values from above."""
    sign = -1.0 if is_least else 1.0
    rows = sign * np.stack(values)
    return {
        name: np.asarray(
            sign * (rows.mean(0) if x is None else np.quantile(rows, x, axis=0)), float
        )
        for name, x in QUANTILES.items()
    }
