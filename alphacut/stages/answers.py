"""Stages of the questions of a case: what they are asked about, and their answers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from alphacut.case.analyses import answer_class
from alphacut.case.generated import GeneratedSection
from alphacut.case.limits import AnalysisSection
from alphacut.case.structure import Structure
from alphacut.frame.analyses.answer import Answer
from alphacut.frame.analyses.question import Asked
from alphacut.stages.store import Stage, StageContext, StageResult


def asked_of(
    structure: Structure, fuzzy: Sequence[str], alpha: tuple[float, ...], **response: Any
) -> Asked:
    """Return what questions are asked about.

    Args:
        structure: The structure.
        fuzzy: Names of its fuzzy inputs.
        alpha: α-levels.
        response: Further fields of `Asked`, as the peaks.
    """
    inputs = structure.inputs(fuzzy)
    units = {name: structure.input_unit(name) for name in inputs}
    numbers = structure.numbers
    return Asked(structure.model, inputs, alpha, numbers=numbers, input_units=units, **response)


def stage(key: str, section: AnalysisSection, structure: Structure, asked: Asked) -> Stage[Answer]:
    """Return the stage of the answer to the question of a section with a key."""
    assert isinstance(section, GeneratedSection)  # others have stages of their own
    question = section.question(structure)

    def compute(context: StageContext) -> StageResult[Answer]:
        """Answer the question, reporting progress to the context."""
        return StageResult(question.answer(asked, context.tick))

    # Answers are kept in the units and words of this package, so that its source counts as well.
    packages = ("fuzzy", "frame", "alphacut")
    return Stage(key, [section, asked], packages, answer_class(key), compute)
