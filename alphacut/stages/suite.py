"""Stage records: peaks under each record of a suite, and over its scales, one result a record."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

from alphacut.case.limits import FragilitySection
from alphacut.case.loads import RecordsSection
from alphacut.case.motion import EnvelopeSection
from alphacut.case.structure import Structure
from alphacut.frame import Peak, SuitePeaks
from alphacut.frame.analyses.fragility import incremental_analyses, increments_of
from alphacut.frame.analyses.incremental import IncrementalAnalysis, Increments
from alphacut.frame.analyses.limits import limits_by_name
from alphacut.frame.analyses.suites import (
    ScaledRecord,
    record_peaks,
    scaled_records,
    summarised,
)
from alphacut.frame.structures.linear import LinearSystem
from alphacut.frame.structures.storey import yields
from alphacut.stages.envelope import EnvelopeTask
from alphacut.stages.store import Stage, StageContext, StageResult


def suite_records(
    section: RecordsSection, envelope: EnvelopeSection, structure: Structure
) -> tuple[ScaledRecord, ...]:
    """The records of a suite as they move the structure, in the order of the case."""
    records = scaled_records(
        structure.model,
        [recording.accelerogram(section.baseline) for recording in section.recordings],
        duration=envelope.duration,
        step=envelope.step,
        scale=section.scale.value,
        measure=section.scale.measure,
    )
    for record in records:
        envelope.require_steps(f"envelope.duration of {record.name}", record.duration)
    return records


def linear_model(structure: Structure) -> LinearSystem:
    """The model of a structure that records may move; scaled records are refused of others."""
    assert structure.linear is not None
    return structure.linear


def moved_by(structure: Structure, record: ScaledRecord) -> Structure:
    """The structure moved by a record."""
    return replace(structure, model=linear_model(structure).moved_by(record.ground))


def stage(structure: Structure, task: EnvelopeTask, record: ScaledRecord) -> Stage[dict[str, Peak]]:
    """The stage that computes the peaks of a structure under a record."""
    inputs = [structure.model, structure.numbers, record, task]
    compute, work = partial(_peaks, structure, task, record), record.duration
    name, packages = f"record_{record.name}", ("fuzzy", "frame")
    return Stage(name, inputs, packages, dict[str, Peak], compute, work=work)


def _peaks(
    structure: Structure, task: EnvelopeTask, record: ScaledRecord, context: StageContext
) -> StageResult[dict[str, Peak]]:
    peaks = record_peaks(
        linear_model(structure),
        structure.inputs(task.fuzzy),
        record,
        task.limited,
        step=task.section.step,
        alpha=task.section.alpha,
        progress=context.tick,
    )
    return StageResult(peaks)


def suite_peaks(
    structure: Structure,
    task: EnvelopeTask,
    records: Sequence[ScaledRecord],
    peaks: Mapping[str, Mapping[str, Peak]],
) -> SuitePeaks:
    """Worst, mean and statistics over the records, from the peaks under each by its name."""
    return summarised(
        linear_model(structure),
        structure.inputs(task.fuzzy),
        records,
        peaks,
        step=task.section.step,
        alpha=task.section.alpha,
    )


def analyses_of(
    section: FragilitySection,
    structure: Structure,
    task: EnvelopeTask,
    records: Sequence[ScaledRecord],
) -> dict[str, IncrementalAnalysis]:
    """Analyses of a frame that yields by the record's name, over the measure of the section."""
    frame = structure.model
    assert yields(frame)
    return incremental_analyses(
        frame,
        structure.inputs(task.fuzzy),
        records,
        limits_by_name(section.limits_of(structure), ()),
        intensity=section.measure,
        most=section.most,
        step=task.section.step,
        alpha=task.section.alpha,
    )


def incremental_stage(
    section: FragilitySection, structure: Structure, name: str, analysis: IncrementalAnalysis
) -> Stage[Increments]:
    """The stage that moves a frame that yields at scales of the record of a name."""
    limits = limits_by_name(section.limits_of(structure), ())

    def compute(context: StageContext) -> StageResult[Increments]:
        return StageResult(increments_of(analysis, limits, context.tick))

    inputs, work = [analysis, list(limits.values())], analysis.duration
    packages = ("fuzzy", "frame")
    return Stage(f"incremental_{name}", inputs, packages, Increments, compute, work=work)
