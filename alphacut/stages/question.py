"""Stage of a question to the motion: its answer as JSON in a dataset."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from alphacut.case.structure import Structure
from alphacut.io.files import as_json
from alphacut.questions.question import Motion, Question
from alphacut.stages.envelope import EnvelopeTask
from alphacut.stages.store import Stage, Work

if TYPE_CHECKING:
    import xarray


def stage(section: Question, structure: Structure, task: EnvelopeTask) -> Stage:
    """The stage of one question."""
    inputs = [section, structure.model, structure.numbers, task.fuzzy, task.section]
    compute = partial(dataset, section, structure, task)
    return Stage(section.key, inputs, ("fuzzy", "frame", "alphacut"), compute)


def dataset(
    section: Question, structure: Structure, task: EnvelopeTask, work: Work
) -> xarray.Dataset:
    """The answer as JSON among the attributes."""
    import xarray

    times = (task.section.alpha, task.duration, task.section.step)
    motion = Motion(structure, task.fuzzy, *times, work.tick)
    return xarray.Dataset(attrs={"document": as_json(section.answer(motion))})
