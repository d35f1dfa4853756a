"""What a run of a case will compute: the pieces of each stage, counted without their work."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import NamedTuple

from alphacut.case.content import Content
from alphacut.stages.cell import CellProblem


class Foreseen(NamedTuple):
    """What a stage of a run will take by one process.

    Args:
        stage: Name of the stage.
        number: Number of its pieces; None where it follows from an earlier stage.
        pieces: What its pieces are.
        seconds: Time of all of them, in s; None where no part of the work was timed.
    """

    stage: str
    number: int | None
    pieces: str
    seconds: float | None = None


def pieces_of(content: Content, petsc: Mapping[str, str]) -> Iterator[Foreseen]:
    """Yield the pieces of each stage of a run, but of the shares of inputs and the figures.

    Args:
        content: The case.
        petsc: PETSc's options without their prefix.

    Raises:
        RefusedError: The model of the cell needs a library that is missing, or the plan does not
            fit.
    """
    if "microstructure" in content.stages and content.microstructure is not None:
        packing = content.microstructure.packing
        if packing is None:
            yield Foreseen("microstructure", 1, "sections")
        else:
            yield Foreseen("microstructure", packing.packings, "packings")
    if "modulus" in content.stages:
        if content.image_cell is not None:
            yield Foreseen("image", len(content.modulus.alpha), "levels")
        elif "microstructure" in content.stages:
            yield Foreseen("modulus", None, "samples")  # of a radius map that is not known yet
        else:
            yield Foreseen("modulus", sample_count(CellProblem.of(content, petsc)), "samples")
    if "response_spectrum" in content.stages and content.response_spectrum is not None:
        yield Foreseen("response_spectrum", len(content.response_spectrum.alpha), "levels")
    section = content.envelope
    if "envelope" not in content.stages or section is None:
        return
    from alphacut.stages.envelope import tasks  # takes time to import

    if content.identify is not None:
        yield Foreseen("identify", 1, "campaigns")
    if content.records is not None:
        count = len(content.records.suite)
        yield Foreseen("records", count, "records")
        if content.incremental_question is not None:
            yield Foreseen("fragility", count, "records")
        if content.floor_spectrum is not None:
            periods = len(content.floor_spectrum.stated_periods)
            yield Foreseen("floor_spectrum", count * periods, "spectra")
        return
    studies = tasks(section, content.study)
    yield Foreseen("envelopes", len(studies), "studies")
    if "probability" in content.questions:
        yield Foreseen("probability", 1, "campaigns")
    if content.floor_spectrum is not None:
        yield Foreseen("floor_spectrum", len(content.floor_spectrum.stated_periods), "periods")
    if "tolerances" in content.questions:
        # Two scales are tried first, then the interval between them is halved until it is a
        # hundredth of what it was.
        yield Foreseen("tolerances", 2 + math.ceil(math.log2(100)), "envelopes")


def sample_count(problem: CellProblem) -> int:
    """Return how many samples the plan of a cell takes.

    The plan is run with a function that returns 1 for all outputs. Plans that add samples where
    results ask for it add none then.

    Args:
        problem: The cell, with its fuzzy inputs, plan and α-levels.

    Raises:
        RefusedError: The model of the cell needs a library that is missing, or the plan does not
            fit.
    """
    from alphacut.fuzzy import propagate  # takes time to import
    from alphacut.rve.fuzzy_cell import FuzzyCell, proved_signs
    from alphacut.stages.modulus import OUTPUTS, PLANS

    cell = FuzzyCell.of(problem.nominal_radius, problem.nominal_phases, problem.inputs)
    # The signs that mechanics proves shorten a plan: they are found from the model as in a run.
    bounds = propagate(
        lambda **_: dict.fromkeys(OUTPUTS, 1.0),
        cell.inputs,
        PLANS[problem.modulus.plan],
        alpha=problem.modulus.alpha,
        knowledge=proved_signs(problem.model(), cell),
        progress=False,
    )
    return bounds.evaluations
