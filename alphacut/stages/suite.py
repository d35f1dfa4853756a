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
from alphacut.frame.structures.storey import StoreyFrame
from alphacut.stages.envelope import EnvelopeTask
from alphacut.stages.store import Stage, StageContext, StageResult


def suite_records(
    section: RecordsSection, envelope: EnvelopeSection, structure: Structure
) -> tuple[ScaledRecord, ...]:
    """Return the records of a suite as they move the structure, in the order of the case.

    Raises:
        RefusedError: The structure is not linear, or a record lasts no whole number of steps.
    """
    records = scaled_records(
        structure.model,
        [recording.accelerogram(section.baseline) for recording in section.recordings],
        duration=envelope.duration,
        step=envelope.step,
        scale=section.scale.value,
        measure=section.scale.measure,
    )
    # each response ends some periods after its record, at a time of its own
    for record in records:
        envelope.require_steps(f"envelope.duration of {record.name}", record.duration)
    return records


def linear_model(structure: Structure) -> LinearSystem:
    """Return the model of a structure that records move, since `suite_records` refuses others."""
    assert structure.linear is not None
    return structure.linear


def moved_by(structure: Structure, record: ScaledRecord) -> Structure:
    """Return the structure moved by a record in place of its own."""
    return replace(structure, model=linear_model(structure).moved_by(record.ground))


def stage(structure: Structure, task: EnvelopeTask, record: ScaledRecord) -> Stage[dict[str, Peak]]:
    """Return the stage that computes the peaks of a structure under a record."""
    inputs = [structure.model, structure.numbers, record, task]
    compute, packages = partial(_peaks, structure, task, record), ("fuzzy", "frame")
    name = f"record_{record.name}"
    return Stage(name, inputs, packages, dict[str, Peak], compute, work=record.duration)


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
    """Return worst, mean and statistics over the records, from the peaks under each by its name."""
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
    """Return analyses of a frame that yields, over the intensity measure, by the record's name."""
    frame = structure.model
    assert isinstance(frame, StoreyFrame)
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
    """Return the stage that moves a frame that yields by a record at several scales.

    Args:
        section: The question.
        structure: The structure.
        name: Name of the record.
        analysis: Its analysis, of `analyses_of`.
    """
    limits = limits_by_name(section.limits_of(structure), ())

    def compute(context: StageContext) -> StageResult[Increments]:
        return StageResult(increments_of(analysis, limits, context.tick))

    inputs, packages = [analysis, list(limits.values())], ("fuzzy", "frame")
    work = analysis.duration
    return Stage(f"incremental_{name}", inputs, packages, Increments, compute, work=work)
