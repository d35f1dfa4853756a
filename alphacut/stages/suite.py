"""Stage records: peaks under each record of a suite, and over its scales, one result a record."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice, product
from math import ceil, pi
from typing import NamedTuple

import numpy as np
from pydantic import Field

from alphacut.base.arrays import Array
from alphacut.base.errors import RefusedError, require
from alphacut.base.number_text import percent_text
from alphacut.case.limits import FragilitySection
from alphacut.case.loads import RecordsSection
from alphacut.case.motion import EnvelopeSection
from alphacut.case.structure import Structure
from alphacut.frame import Accelerogram
from alphacut.frame.analyses.incremental import IncrementalAnalysis
from alphacut.frame.analyses.peaks import ANY, PEAK_BOUNDS, Peak, Peaks
from alphacut.frame.analyses.spectral import spectral_acceleration
from alphacut.frame.boxes import boxes
from alphacut.frame.dynamics.nonlinear import make_flow
from alphacut.frame.records.recording import Recording, arias_fractions
from alphacut.frame.structures.linear import modal_damping_ratios
from alphacut.frame.structures.quantities import output_of
from alphacut.fuzzy.result import Nature
from alphacut.fuzzy.sets.numbers import enclosed_set
from alphacut.stages.envelope import EnvelopeTask, PeakResults, outputs_of, peak_results, peaks_of
from alphacut.stages.store import Numbers, Stage, StageContext, StageResult, Values

FREE_PERIODS = 5
"""Natural periods of free motion after a record: by then 5 % damping leaves a fifth."""
MAX_CORNERS = 64
"""Corners of each cut whose means over records are computed; more take time, none is a bound."""
NODES = 2
"""Nodes in a step at which peaks are bounded; the error between nodes falls with its square."""
MAX_OFFSET = 0.01
"""Mean of a record as a share of its peak that is said."""
QUANTILES = {"median": 0.5, "84 %": 0.84}
"""Of a suite's peaks; 84 % is one standard deviation of a normal law above the mean."""


class NominalMode(NamedTuple):
    """First mode at the nominal inputs: its period T1 in s, and damping ratio."""

    period: float
    ratio: float


@dataclass(frozen=True, eq=False)
class SuiteRecord:
    """A record of the suite as it moves the structure, corrected and scaled.

    `duration` is that of the motion in s, `cut_share` the share of the Arias intensity after its
    end; `measures` are "PGA" and "Sa(T1)" (`spectral_acceleration`) in m/s², and "scale", 1.
    """

    name: str
    ground: Accelerogram
    duration: float
    measures: Mapping[str, float]
    cut_share: float
    warnings: tuple[str, ...]


def nominal_mode(structure: Structure) -> NominalMode:
    """First mode at the nominal inputs of a linear structure; RefusedError of another one."""
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
    return tuple(_suite_record(section, envelope, x, mode) for x in section.recordings)


def _suite_record(
    section: RecordsSection, envelope: EnvelopeSection, recording: Recording, mode: NominalMode
) -> SuiteRecord:
    ground, name = recording.accelerogram(section.baseline), recording.name
    response = spectral_acceleration(ground, mode.period, min(mode.ratio, 0.999))
    sizes = {"PGA": ground.extremes[0], "Sa(T1)": response}
    is_moving, allowed = min(sizes.values()) > 0, "a record that moves something"
    require(is_moving, f"record {name}", "zero throughout", allowed)
    factor = section.scale.value / sizes.get(section.scale.measure, 1.0)
    length = (len(ground.samples) - 1) * ground.step
    duration = min(envelope.duration, length + FREE_PERIODS * mode.period)
    steps = max(1, ceil(duration / envelope.step - 1e-9))
    envelope.require_steps(f"envelope.duration of {name}", steps * envelope.step)
    shares = arias_fractions(ground.samples, ground.step)
    end = min(int(duration / ground.step + 1e-9), len(shares) - 1)
    cut_share = 0.0 if duration >= length else float(1 - shares[end])
    offset = float(ground.samples.mean()) / ground.extremes[0]
    warnings = [f"of record {name} {doubt}" for doubt in recording.doubts()]
    if abs(offset) > MAX_OFFSET:
        what = f"the mean of record {name} is {percent_text(offset)} of its peak"
        warnings.append(f'{what}; records.baseline = "mean" subtracts it')
    if cut_share > 0:
        what = f"{cut_share:.1%} of the Arias intensity of record {name}"
        warnings.append(f"{what} lies after the end of its motion, {steps * envelope.step:g} s")
    return SuiteRecord(
        name=name,
        ground=Accelerogram(ground.step, factor * ground.samples),
        duration=steps * envelope.step,
        measures={x: factor * size for x, size in sizes.items()} | {"scale": 1.0},
        cut_share=cut_share,
        warnings=tuple(warnings),
    )


def with_record(structure: Structure, record: SuiteRecord) -> Structure:
    """The structure moved by a record."""
    assert structure.linear is not None
    return replace(structure, model=replace(structure.linear, ground=record.ground))


def stage(structure: Structure, task: EnvelopeTask, record: SuiteRecord) -> Stage[PeakResults]:
    """The stage that computes the peaks of a structure under a record."""
    loaded = with_record(structure, record)
    record_task = replace(task, name=record.name, duration=record.duration)
    inputs = [loaded.model, loaded.numbers, record_task]
    compute = partial(record_task.compute_peaks, loaded, nodes=NODES)
    name, packages = f"record_{record.name}", ("fuzzy", "frame")
    return Stage(name, inputs, packages, PeakResults, compute, work=record.duration)


class IncrementalResult(Numbers):
    """Greatest and least peak over limit of the structures moved, over the measure of a record.

    `demands` has them by limit, and by `ANY` of several, shape (2, levels, measures); null where
    they collapse. At the first measure all structures moved are elastic and keep every limit.
    """

    measure: Values
    demands: dict[str, Values]


def incremental_analyses(
    section: FragilitySection,
    structure: Structure,
    task: EnvelopeTask,
    records: Sequence[SuiteRecord],
) -> dict[str, IncrementalAnalysis]:
    """Analyses of a frame that yields by the record's name, over the measure of the section."""
    assert structure.frame is not None
    outputs = [limit.output for limit in section.limits_by_name.values()]
    limits = [*zip(outputs, section.limits_in_si(structure).values(), strict=True)]
    cuts, found = boxes(structure.inputs(task.fuzzy), task.section.alpha), {}
    for record in records:
        unit_samples = np.asarray(record.ground.samples / record.measures[section.measure])
        frame = replace(structure.frame, ground=Accelerogram(record.ground.step, unit_samples))
        motion = record.duration, task.section.step
        found[record.name] = IncrementalAnalysis(frame, cuts, limits, *motion)
    elastic = max(x.elastic_scales(cuts.nominal[None])[0, 1:].max() for x in found.values())
    greatest = section.most * float(elastic)
    return {name: replace(x, greatest_scale=greatest) for name, x in found.items()}


def incremental_stage(
    section: FragilitySection, name: str, analysis: IncrementalAnalysis
) -> Stage[IncrementalResult]:
    """The stage that moves a frame that yields at scales of the record of a name."""
    names = [*section.limits_by_name, *[ANY] * (len(section.limits) > 1)]
    inputs, packages = [analysis, names], ("fuzzy", "frame")
    compute, work = partial(_incremental_result, analysis, names), analysis.duration
    return Stage(f"incremental_{name}", inputs, packages, IncrementalResult, compute, work=work)


def _incremental_result(
    analysis: IncrementalAnalysis, names: Sequence[str], context: StageContext
) -> StageResult[IncrementalResult]:
    measure, demands = analysis.run(context.tick)  # (2, A, E, X)
    by_limit = {name: demands[:, :, event] for event, name in enumerate(names)}
    return StageResult(IncrementalResult(measure=measure, demands=by_limit))


def worst_peaks(peaks: Mapping[str, Peaks]) -> dict[str, Peak]:
    """Bounds of the largest of a structure's peaks over all records, by the peak's name.

    The largest peak rises with the peak under each record, so that its bounds are the largest ones.
    """
    worst = {}
    for name in next(iter(peaks.values())):
        of_records = [x[name] for x in peaks.values()]
        nature = Nature.weakest(peak.nature for peak in of_records)
        bounds = {x: np.max([getattr(peak, x) for peak in of_records], 0) for x in PEAK_BOUNDS}
        farthest = max(of_records, key=lambda peak: float(peak.reached[0]))
        worst[name] = replace(farthest, nature=nature, **bounds)
    return worst


def with_means(
    worst: Peaks,
    peaks: Mapping[str, Peaks],
    structure: Structure,
    task: EnvelopeTask,
    records: Sequence[SuiteRecord],
) -> dict[str, Peak]:
    """The worst peaks, and beside them "mean q3" …, bounds of the mean over the records.

    The mean of each structure lies between the means of the least and of the greatest peaks. No
    structure may reach the latter, as each record has its own worst one. What is reached is the
    greatest mean of those tried: of the nominal structure and those at corners of each cut. Their
    peaks are read at time nodes, so that the structure's own mean is no smaller.
    """
    magnitudes = tuple(name for name in worst if name == output_of(name))
    cuts = boxes(structure.inputs(task.fuzzy), task.section.alpha)
    ends = (zip(low, high, strict=True) for low, high in zip(cuts.lower, cuts.upper, strict=True))
    corners = (corner for pairs in ends for corner in islice(product(*pairs), MAX_CORNERS))
    points = np.unique([cuts.nominal, *corners], axis=0)
    inside = ((points >= cuts.lower[:, None]) & (points <= cuts.upper[:, None])).all(axis=-1)
    tried_means: Array = np.zeros((len(points), len(magnitudes)))
    for record in records:
        model = with_record(structure, record).model_with_outputs("records", magnitudes)
        step = task.section.step / NODES
        flow = make_flow(model, cuts.names, record.duration, step, "exact")
        columns = [[*map(str, flow.outputs)].index(output) for output in magnitudes]
        tried_means += np.abs(flow.values(points)).max(axis=1)[:, columns] / len(records)
    found = dict(worst)
    is_box = bool(enclosed_set(structure.inputs(task.fuzzy).values()))
    for name, tried in zip(magnitudes, tried_means.T, strict=True):
        means = {
            bound: np.mean([getattr(x[name], bound) for x in peaks.values()], axis=0)
            for bound in ("lower", "upper", "error", "least_lower")
        }
        in_cuts = np.where(inside, tried, -np.inf)  # (levels, points)
        mean_minima = np.maximum(means["lower"] - means["error"], means["least_lower"])
        # a structure of any higher cut has at least the mean of that cut's least peaks
        minima_of_higher_cuts = np.maximum.accumulate(mean_minima[::-1])[::-1]
        means["reached"] = np.maximum(minima_of_higher_cuts, in_cuts.max(axis=1))
        means["least_upper"] = np.full_like(mean_minima, np.inf)  # nothing bounds one structure's
        reached_at = dict(zip(cuts.names, points[in_cuts[0].argmax()].tolist(), strict=True))
        if is_box:  # of whose points none is known to belong to the enclosed set
            means["reached"], reached_at = np.full_like(mean_minima, -np.inf), {}
        found[f"mean {name}"] = replace(worst[name], reached_at=reached_at, **means)
    return found


class RecordResult(Numbers):
    """Peaks under a record, and its measures in m/s² but for "scale", 1."""

    duration_s: float
    cut_share: float
    measures: dict[str, float]
    peak: PeakResults


class Statistics(Numbers):
    """Mean and quantiles over the records of the proved bounds of their peaks, on each level."""

    proved: dict[str, Values]


class SuiteResult(Numbers):
    """Measures and peaks of each record, and statistics of the peaks.

    `peak` has the largest peaks over the records, each reached under `farthest_record`, and the
    means.
    """

    period_s: float
    damping_ratio: float
    alpha: Values
    records: dict[str, RecordResult]
    statistics: dict[str, Statistics]
    units: dict[str, str]
    peak: PeakResults = Field(default={})
    farthest_record: dict[str, str] = Field(default={})


def suite_result(
    results: Mapping[str, PeakResults],
    records: Sequence[SuiteRecord],
    structure: Structure,
    task: EnvelopeTask,
) -> SuiteResult:
    """Numbers on a suite, from the results under each record by its name."""
    alpha, mode = task.section.alpha, nominal_mode(structure)
    peaks = {name: peaks_of(result, alpha) for name, result in results.items()}
    worst = with_means(worst_peaks(peaks), peaks, structure, task, records)
    # of a mean there is no such record
    farthest = {
        x: max(peaks, key=lambda y: float(peaks[y][x].reached[0]))
        for x in results[records[0].name]
        if not worst[x].encloses
    }
    statistics = {}
    for name, peak in results[records[0].name].items():
        sign = -1.0 if peak.is_least else 1.0  # quantiles of least values are counted from above
        bounds = np.stack([x[name].proved for x in results.values()])  # (records, levels)
        proved = {"mean": bounds.mean(axis=0)}
        for quantile, share in QUANTILES.items():
            proved[quantile] = sign * np.quantile(sign * bounds, share, axis=0)
        statistics[name] = Statistics(proved=proved)
    return SuiteResult(
        period_s=mode.period,
        damping_ratio=mode.ratio,
        alpha=np.array(alpha),
        records={
            record.name: RecordResult(
                duration_s=record.duration,
                cut_share=record.cut_share,
                measures=dict(record.measures),
                peak=results[record.name],
            )
            for record in records
        },
        statistics=statistics,
        units={name: structure.unit(name) for name in outputs_of(task.limited)},
        peak=peak_results(worst),
        farthest_record=farthest,
    )
