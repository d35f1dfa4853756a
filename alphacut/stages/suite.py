"""Stage records: peaks of a structure under each record of a suite, one result a record."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import ceil, pi

import numpy as np

from alphacut.case.motion import EnvelopeSection
from alphacut.case.records import NamedRecording, RecordsSection
from alphacut.case.structure import Structure
from alphacut.frame import Accelerogram
from alphacut.frame.questions.peaks import Peaks, joined, output_of
from alphacut.frame.structures.linear import modal_damping_ratios
from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import RefusedError, require
from alphacut.fuzzy.result import Nature
from alphacut.io.files import Document
from alphacut.questions.question import SuiteMotion
from alphacut.records.recording import arias_shares
from alphacut.records.spectrum import spectral_acceleration
from alphacut.stages.envelope import PEAK_BOUNDS, EnvelopeTask, by_output, peaks_of
from alphacut.stages.store import Stage, StageResult

FREE_PERIODS = 5
"""Natural periods of free motion after a record: by then 5 % damping leaves a fifth."""
PERIODS = np.geomspace(0.05, 4.0, 45)
"""Periods of response spectra, in s."""
NODES = 2
"""Nodes in a step at which peaks are bounded; the error between nodes falls with its square."""
MAX_OFFSET = 0.01
"""Mean of a record as a share of its peak that is said."""
QUANTILES = {"mean": None, "median": 0.5, "84 %": 0.84}
"""Statistics of a suite's peaks; 84 % is one standard deviation of a normal law above the mean."""


@dataclass(frozen=True)
class Nominal:
    """First mode of the structure at its most plausible inputs.

    Args:
        period: T1, in s.
        ratio: Damping ratio of the mode.
    """

    period: float
    ratio: float


@dataclass(frozen=True, eq=False)
class SuiteRecord:
    """A record of the suite as it moves the structure.

    Args:
        name: Name of its file without ending.
        ground: The record, corrected, trimmed and scaled.
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


def nominal_mode(structure: Structure) -> Nominal:
    """First mode at the most plausible inputs.

    Raises:
        RefusedError: The structure is not linear.
    """
    if structure.linear is None:
        what = "with a system that is not linear"
        raise RefusedError("records", what, "linear structures")
    omega, ratios = modal_damping_ratios(structure.linear)
    return Nominal(2 * pi / float(omega[0]), float(ratios[0]))


def suite(
    section: RecordsSection, envelope: EnvelopeSection, structure: Structure
) -> tuple[SuiteRecord, ...]:
    """The records of a suite, in the order of the case."""
    mode = nominal_mode(structure)
    return tuple(_record(section, envelope, recording, mode) for recording in section.recordings)


def _record(
    section: RecordsSection, envelope: EnvelopeSection, named: NamedRecording, mode: Nominal
) -> SuiteRecord:
    """A recording corrected, trimmed and scaled, with the duration of the motion under it."""
    ground = named.recording.accelerogram(baseline=section.baseline, trim=section.trim)
    measures = {
        "PGA": ground.extremes[0],
        "Sa(T1)": spectral_acceleration(ground, mode.period, min(mode.ratio, 0.999)),
        "scale": 1.0,
    }
    wanted = section.scale
    size = measures.get(wanted.measure, 1.0)
    require(
        size > 0,
        f"record {named.name}",
        value="zero throughout",
        allowed="a record that moves something",
    )
    factor = wanted.value / size
    length = (len(ground.acceleration) - 1) * ground.step
    duration = length + FREE_PERIODS * mode.period
    duration = min(envelope.duration, duration)
    steps = max(1, ceil(duration / envelope.step - 1e-9))
    envelope.require_steps(f"envelope.duration of {named.name}", steps * envelope.step)
    shares = arias_shares(ground.acceleration, ground.step)
    end = min(int(duration / ground.step + 1e-9), len(shares) - 1)
    scaled = Accelerogram(ground.step, factor * ground.acceleration)
    sizes = {name: size * (factor if name != "scale" else 1.0) for name, size in measures.items()}
    cut_share = 0.0 if duration >= length else float(1 - shares[end])
    offset = float(ground.samples.mean()) / ground.extremes[0]
    return SuiteRecord(named.name, scaled, steps * envelope.step, sizes, cut_share, offset)


def suite_warnings(records: Sequence[SuiteRecord]) -> Iterator[str]:
    """Sentences on records that are not centred, or are cut."""
    for record in records:
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


def stages(structure: Structure, task: EnvelopeTask, records: Sequence[SuiteRecord]) -> list[Stage]:
    """A stage for each record, the longest first."""
    longest = sorted(records, key=lambda record: -record.duration)
    return [_stage(structure, task, record) for record in longest]


def _stage(structure: Structure, task: EnvelopeTask, record: SuiteRecord) -> Stage:
    moved = with_record(structure, record)
    of_record = replace(task, name=record.name, duration=record.duration)
    inputs = [moved.model, moved.numbers, of_record]
    return Stage(
        stage_name(record),
        inputs,
        ("fuzzy", "frame"),
        partial(of_record.compute_peaks, moved, nodes=NODES),
    )


def stage_name(record: SuiteRecord) -> str:
    """Name of the files of a record's result."""
    return f"record_{record.name}"


def peaks_by_record(
    results: Mapping[str, StageResult], records: Sequence[SuiteRecord], alpha: Sequence[float]
) -> dict[str, Peaks]:
    """Peaks under each record by its name."""
    return {
        record.name: peaks_of(results[stage_name(record)].document["peak"], alpha)
        for record in records
    }


def motion(
    peaks: Mapping[str, Peaks], records: Sequence[SuiteRecord], mode: Nominal
) -> SuiteMotion:
    """Motions under all records, to which questions are put."""
    measures = {record.name: record.measures for record in records}
    return SuiteMotion(mode.period, mode.ratio, measures, peaks)


def worst_peaks(peaks: Mapping[str, Peaks]) -> Peaks:
    """Peaks under whichever record is the worst for each structure.

    The peak of a structure is the largest over the records, so that each end is.
    """
    first = next(iter(peaks.values()))
    bounds = {
        name: np.max([getattr(x, name) for x in peaks.values()], axis=0) for name in PEAK_BOUNDS
    }
    columns = zip(*(x.natures for x in peaks.values()), strict=True)
    return replace(first, natures=tuple(map(Nature.weakest, columns)), **bounds)


def with_means(worst: Peaks, peaks: Mapping[str, Peaks]) -> Peaks:
    """The peaks of any record, and beside them "mean q3", the mean over the records.

    The mean of each structure lies between the means of the least and of the greatest peaks. That a
    structure reaches the mean of greatest peaks is not known, as each record has its own worst one;
    but one of a higher cut has at least the mean of its least peaks, and at most that of its
    greatest.
    """
    plain = [name for name in worst.outputs if name == output_of(name)]
    columns = {f"mean {name}": name for name in plain}
    means = {
        end: np.mean([getattr(x.named(columns), end) for x in peaks.values()], axis=0)
        for end in ("lower", "upper", "error", "least_proved")
    }
    least = np.maximum(means["lower"] - means["error"], means["least_proved"])
    most = means["upper"] + means["error"]
    means["reached"] = np.maximum.accumulate(least[::-1])[::-1]
    means["least_reached"] = np.minimum.accumulate(most[::-1])[::-1]
    mean = replace(worst.named(columns), **means)
    return joined(worst, mean)


def document(peaks: Mapping[str, Peaks], records: Sequence[SuiteRecord], mode: Nominal) -> Document:
    """Measures and peaks of each record, and mean, median and 84 % of each output's peaks."""
    first = next(iter(peaks.values()))
    outputs = {
        name: {
            "proved": statistics(np.stack([x.most(name).upper for x in peaks.values()])),
            "reached": statistics(np.stack([x.most(name).lower for x in peaks.values()])),
        }
        for name in first.outputs
    }
    return {
        "period_s": mode.period,
        "damping_ratio": mode.ratio,
        "alpha": first.alpha,
        "records": {
            record.name: {
                "duration_s": record.duration,
                "cut_share": record.cut_share,
                "measures": dict(record.measures),
                "peak": by_output(peaks[record.name]),
            }
            for record in records
        },
        "statistics": outputs,
        "spectra": {
            "period_s": PERIODS,
            **{record.name: spectrum(record.ground, mode) for record in records},
        },
    }


def spectrum(ground: Accelerogram, mode: Nominal) -> Array:
    """Pseudo-accelerations at `PERIODS` with the nominal damping, in m/s²."""
    ratio = min(mode.ratio, 0.999)
    return np.array([spectral_acceleration(ground, float(x), ratio) for x in PERIODS])


def statistics(values: Array) -> Document:
    """Mean and quantiles over records of values (records, levels), each by level."""
    return {
        name: values.mean(0) if share is None else np.quantile(values, share, axis=0)
        for name, share in QUANTILES.items()
    }
