"""Stage records: peaks under each record of a suite, and over its scales, one result a record."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, cast

from alphacut.case.loads import RecordsSection
from alphacut.case.motion import EnvelopeSection
from alphacut.case.structure import Structure
from alphacut.frame import Limit, Peak, ScaledSuite, scale_suite
from alphacut.frame.analyses.fragility import increments_of
from alphacut.frame.analyses.incremental import IncrementalAnalysis, Increments
from alphacut.frame.analyses.suites import (
    ScaledRecord,
    record_peaks,
    require_proved,
    scaled_records,
    thresholds_under,
)
from alphacut.frame.records.components import corrected_components
from alphacut.frame.structures.linear import LinearSystem
from alphacut.frame.threshold import Threshold
from alphacut.stages.envelope import EnvelopeTask
from alphacut.stages.store import Stage, StageContext, StageResult

if TYPE_CHECKING:
    from alphacut.frame.spectra.code_spectrum import SuiteTarget


def suite_records(
    section: RecordsSection, envelope: EnvelopeSection, structure: Structure
) -> tuple[ScaledRecord, ...]:
    """Return the records of a suite as they move the structure, in the order of the case.

    Each is corrected by a baseline, scaled and turned. Its response ends five natural periods after
    the record, but not later than the longest duration.

    Args:
        section: Recordings, baseline correction, the scale or the intensity to be reached, and the
            angle.
        envelope: Longest duration and the time step in s.
        structure: The structure, whose first mode determines "Sa(T1)".

    Raises:
        RefusedError: The structure is not linear, a record is zero throughout, or a response lasts
            no whole number of steps.
    """
    scaled = scaled_suite(section, structure)
    corrected = [corrected_components(x, section.baseline) for x in section.suite]
    records = scaled_records(
        structure.model,
        corrected if scaled is None else scaled.suite,
        duration=envelope.duration,
        step=envelope.step,
        scale=section.scale.value,
        measure=section.scale.measure,
        all_angles=section.has_all_angles,
    )
    # Measures are those of the components as they were recorded.
    if section.angle and not section.has_all_angles:
        records = tuple(record.turned(section.angle) for record in records)
    # Each response ends at a time of its own. The case has been checked for the duration of
    # [envelope] alone, which is the longest.
    for record in records:
        envelope.require_steps(f"envelope.duration of {record.name}", record.duration)
    return records


def scaled_suite(section: RecordsSection, structure: Structure) -> ScaledSuite | None:
    """Return the corrected records scaled to the target spectrum of a case; None without one.

    Args:
        section: Recordings, baseline correction, and the target spectrum.
        structure: The structure, whose first mode determines the range of periods.

    Raises:
        RefusedError: The target does not cover the range, a record is zero throughout, or the
            structure is not linear.
    """
    if section.spectrum is None:
        return None
    spectrum = cast("SuiteTarget", section.spectrum.made)
    return scale_suite(
        # of one component each
        [ground for x in section.suite for ground in corrected_components(x, section.baseline)],
        spectrum.target,
        structure.model,
        fit=spectrum.fit,
        over=spectrum.over,
    )


def linear_model(structure: Structure) -> LinearSystem:
    """Return the model of a structure that records move, since `suite_records` refuses others."""
    assert structure.linear is not None  # also of a frame that yields, whose stiffness is initial
    return structure.linear


def moved_by(structure: Structure, record: ScaledRecord) -> Structure:
    """Return the structure moved by a record in place of its own."""
    return replace(structure, model=linear_model(structure).moved_by(*record.components))


def stages(
    structure: Structure, task: EnvelopeTask, records: Sequence[ScaledRecord]
) -> list[Stage[dict[str, Peak]]]:
    """Return the stages that compute the peaks of a structure, one for each record.

    Their names are "record_NAME" with the names of the records.

    Args:
        structure: The structure with its fuzzy parameters.
        task: Names of the fuzzy inputs and of the peaks, time step and α-levels.
        records: The scaled records.

    Raises:
        RefusedError: An input is unknown or crisp, or a trajectory does not exist.
    """
    section = task.section
    asked = thresholds_under(
        linear_model(structure),
        structure.inputs(task.fuzzy),
        records,
        task.limits,
        step=section.step,
        alpha=section.alpha,
    )
    packages = ("fuzzy", "frame")
    found = []
    for record in records:
        thresholds = asked[record.name]
        inputs = [structure.model, structure.numbers, record, task, thresholds]
        compute = partial(_peaks, structure, task, record, thresholds)
        name = f"record_{record.name}"
        # `work` is the size of a stage compared with the others: the duration of the response.
        stage = Stage(name, inputs, packages, dict[str, Peak], compute, work=record.duration)
        found.append(stage)
    return found


def _peaks(
    structure: Structure,
    task: EnvelopeTask,
    record: ScaledRecord,
    thresholds: Sequence[Threshold],
    context: StageContext,
) -> StageResult[dict[str, Peak]]:
    """Compute the bounds of the peaks of a structure under one record, by name.

    Args:
        structure: A linear structure, or a frame that yields.
        task: Names of the fuzzy inputs and of the peaks, time step and α-levels.
        record: The scaled record, which replaces any other load.
        thresholds: What is asked of the peaks under it.
        context: Its `tick` is called with the completed fraction of the work.

    Raises:
        RefusedError: An input is unknown or crisp.
        FailedError: A response could not be computed.
        UnprovedError: The case names a proof as its method, and a peak is not proved.
    """
    peaks = record_peaks(
        linear_model(structure),
        structure.inputs(task.fuzzy),
        record,
        task.limited,
        step=task.section.step,
        alpha=task.section.alpha,
        thresholds=thresholds,
        progress=context.tick,
    )
    if task.section.method in ("proof", "dual"):
        require_proved(peaks, record.name, structure.unit)
    return StageResult(peaks)


def incremental_stage(
    limits: Mapping[str, Limit], name: str, analysis: IncrementalAnalysis
) -> Stage[Increments]:
    """Return the stage that moves a frame that yields by a record at rising intensities.

    Args:
        limits: The limits by name.
        name: Name of the record. The stage is named "incremental_NAME".
        analysis: The incremental dynamic analysis of the frame under this record, with its fuzzy
            inputs and the same limits.

    Returns:
        Stage of the bounds of the peaks over the intensity, for each limit.
    """

    def compute(context: StageContext) -> StageResult[Increments]:
        """Return the bounds over the intensity for each limit, reporting progress."""
        return StageResult(increments_of(analysis, limits, context.tick))

    # The analysis has the frame, the record and the cuts of the inputs, so that it stands for them.
    inputs = [analysis, list(limits.values())]
    packages = ("fuzzy", "frame")
    work = analysis.duration
    return Stage(f"incremental_{name}", inputs, packages, Increments, compute, work=work)
