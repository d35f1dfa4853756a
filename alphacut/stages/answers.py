"""Stages of the questions of a case: what they are asked about, and their answers."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from alphacut.base.progress_bar import Progress
from alphacut.case.analyses import answer_class
from alphacut.case.structure import Structure
from alphacut.frame.analyses.answer import Answer
from alphacut.frame.analyses.question import Asked
from alphacut.stages.store import Stage, StageContext, StageResult


def asked_of(structure: Structure, fuzzy: Sequence[str], alpha: tuple[float, ...]) -> Asked:
    """Return what questions are asked about, as yet without a response.

    Args:
        structure: The structure.
        fuzzy: Names of its fuzzy inputs.
        alpha: α-levels.
    """
    inputs = structure.inputs(fuzzy)
    units = {name: structure.input_unit(name) for name in inputs}
    numbers = structure.numbers
    return Asked(structure.model, inputs, alpha, numbers=numbers, input_units=units)


def stage(key: str, inputs: object, answer: Callable[[Progress], Answer]) -> Stage[Answer]:
    """Return the stage of an answer with a key, which a function computes from some inputs."""

    def compute(context: StageContext) -> StageResult[Answer]:
        """Return the answer, reporting progress to the context."""
        return StageResult(answer(context.tick))

    # Answers are kept in the units and words of this package, so that its source counts as well.
    return Stage(key, inputs, ("fuzzy", "frame", "alphacut"), answer_class(key), compute)
