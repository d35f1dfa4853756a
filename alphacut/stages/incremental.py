"""Stage incremental: demands of a frame that yields over scales of a record, for its fragility."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from alphacut.case.limits import FragilitySection
from alphacut.case.structure import Structure
from alphacut.frame import Accelerogram
from alphacut.frame.questions.incremental import ALL, SOME, IncrementalAnalysis
from alphacut.frame.questions.peaks import ANY
from alphacut.stages.envelope import EnvelopeTask
from alphacut.stages.store import CutsResult, Numbers, Stage, StageContext, StageResult, Values
from alphacut.stages.suite import SuiteRecord


class IncrementalResult(Numbers):
    """Least and greatest peak over limit of the structures moved, over the measure of a record.

    `demand` has them by limit, and by `ANY` of several, shape (levels, measures); null where they
    collapse. Below the first measure all structures moved are elastic and keep every limit.
    """

    measure: Values
    demand: dict[str, CutsResult]
    motions: int


def analyses(
    section: FragilitySection,
    structure: Structure,
    task: EnvelopeTask,
    records: Sequence[SuiteRecord],
) -> tuple[list[IncrementalAnalysis], float]:
    """The analysis of each record, whose scales are its measure, and the greatest measure."""
    assert structure.frame is not None
    outputs = [limit.output for limit in section.limits_by_name.values()]
    limits = [*zip(outputs, section.limits_in_si(structure).values(), strict=True)]
    inputs, motion, found = structure.inputs(task.fuzzy), task.section, []
    for record in records:
        unit_samples = np.asarray(record.ground.samples / record.measures[section.measure])
        frame = replace(structure.frame, ground=Accelerogram(record.ground.step, unit_samples))
        timing = record.duration, motion.step, motion.alpha
        found.append(IncrementalAnalysis(frame, inputs, limits, *timing))
    elastic = (x.elastic_scales(x.cuts.nominal[None])[0, 1:].max() for x in found)
    return found, section.most * float(max(elastic))


def stages(
    section: FragilitySection,
    structure: Structure,
    task: EnvelopeTask,
    records: Sequence[SuiteRecord],
) -> list[Stage[IncrementalResult]]:
    """The stage of each record, in their order."""
    names = [*section.limits_by_name, *[ANY] * (len(section.limits) > 1)]
    of_records, greatest = analyses(section, structure, task, records)
    return [
        Stage(
            name=f"incremental_{record.name}",
            inputs=[analysis, greatest, names],
            packages=("fuzzy", "frame"),
            kind=IncrementalResult,
            compute=partial(_compute, analysis, greatest, names),
            work=record.duration,
        )
        for record, analysis in zip(records, of_records, strict=True)
    ]


def _compute(
    analysis: IncrementalAnalysis, greatest: float, names: Sequence[str], context: StageContext
) -> StageResult[IncrementalResult]:
    found = analysis.run(greatest, context.tick)
    demand = {
        name: CutsResult(lower=found.demands[ALL, :, event], upper=found.demands[SOME, :, event])
        for event, name in enumerate(names)
    }
    numbers = IncrementalResult(measure=found.scales, demand=demand, motions=found.motions)
    return StageResult(numbers)


def foreseen(
    section: FragilitySection,
    structure: Structure,
    task: EnvelopeTask,
    records: Sequence[SuiteRecord],
) -> str:
    """How many motions the fragility takes, and how long by one process."""
    of_records, greatest = analyses(section, structure, task, records)
    motions, seconds = np.sum([analysis.foresee(greatest) for analysis in of_records], axis=0)
    words = f"{motions:,.0f} motions under {len(records)} records, {seconds:.0f} s by one process"
    return f"fragility: about {words}"
