"""Stage of a question to the motion: its answer as JSON in a dataset."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

from alphacut.case.structure import Structure
from alphacut.io.files import Document, as_json
from alphacut.questions.question import Limited, Motion
from alphacut.questions.table import QUESTIONS
from alphacut.stages.envelope import EnvelopeTask
from alphacut.stages.store import Stage, Work

if TYPE_CHECKING:
    import xarray


def stage(key: str, section: Limited, structure: Structure, task: EnvelopeTask) -> Stage:
    """The stage of one question."""
    (one,) = (question for question in QUESTIONS if question.key == key)

    def compute(work: Work) -> xarray.Dataset:
        import xarray

        times = (task.section.alpha, task.duration, task.section.step)
        motion = Motion(structure, task.fuzzy, *times, work.tick)
        return xarray.Dataset(attrs={"document": as_json(one.answer(section, motion))})

    inputs = [section, structure.model, structure.numbers, task.fuzzy, task.section]
    return Stage(key, inputs, ("fuzzy", "frame", "alphacut"), compute)


def document(data: xarray.Dataset) -> Document:
    """The answer, as JSON holds it."""
    answer: Document = json.loads(data.attrs["document"])
    return answer
