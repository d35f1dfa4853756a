"""Which input of a case to measure next: how much narrower the answer is if one is known better.

The answer is the width of an output's envelope at the lowest level, its mean over nodes, under a
record a hundred or some more; without a structure it is the width of E. Where the cell gives E, its
own inputs stand in E's place.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from alphacut import frame
from alphacut.case.case import Case
from alphacut.frame.structures.modes import ModalError
from alphacut.frame.structures.quantities import Output
from alphacut.fuzzy import Crisp, FuzzyNumber, Interval
from alphacut.fuzzy.decisions.measure_next import Advice, Answer, advice
from alphacut.fuzzy.knowledge.joint import joined_once
from alphacut.io.files import Document
from alphacut.io.problem import BadInput, Problem
from alphacut.io.progress import Tick
from alphacut.stages.material.campaign import Campaign, campaign
from alphacut.stages.vibration.envelope_task import EnvelopeTask, task_of
from alphacut.stages.vibration.structure import Structure, structure
from alphacut.stages.vibration.studies import left_out
from alphacut.stages.vibration.update import learned
from alphacut.stages.width_shares import cell_range, thinned

TOLERANCE = 1e-3
"""Error of the envelopes, as a share of each output's peak."""
GAINS = ("half", "half_least", "exact", "exact_least")


def measure_next(
    case: Case, handed: FuzzyNumber | None, output: str | None = None, progress: Tick | None = None
) -> tuple[str, float, Advice, list[str]]:
    """The answer's name, gains of knowing each input of [envelope] fuzzy better, and those fixed.

    After the name stands the distance in s of the nodes over which a width is averaged, 0 for E.

    Args:
        case: With a linear structure and [envelope], or with a cell.
        handed: Modulus in Pa that stands in for the cell, if any.
        output: The output; the first if not given.
        progress: Told the share done.

    Raises:
        BadInput: There is no such output, or the structure is not linear.
    """
    cell = campaign(case) if handed is None and "modulus" in case.stages else None
    if "envelope" not in case.stages:
        if cell is None or output is not None:
            raise BadInput.of("stages", "there is no envelope", allowed="stage envelope")
        return "E", 0.0, _advice(lambda x: _moduli(cell, x), cell.inputs, 0.0, progress), []
    # of the cell's modal values, fuzzy so that it may be named as an input
    expected = None if cell is None else _interval(*_ends(cell, cell.inputs))
    wanted, task = structure(case, handed or expected), task_of(case)
    if case.sections.update is not None:
        wanted = learned(case, wanted).structure
    if wanted.linear is None:
        raise BadInput.of("pendulum", "widths are compared for linear structures")
    column = _column(case, wanted, output)
    inputs, of_cell = wanted.inputs(task.fuzzy), dict(cell.inputs) if cell else {}
    if cell is not None and "E" in inputs:
        del inputs["E"]

    def answer(changed: Mapping[str, FuzzyNumber]) -> tuple[float, float]:
        own = {name: changed[name] for name in inputs}
        if cell is not None and of_cell:
            own["E"] = _interval(*_ends(cell, {name: changed[name] for name in of_cell}))
        return _width(wanted, task, own, column, every)

    every = task.step if wanted.linear.ground is None else thinned(task.duration, task.step)
    found = _advice(answer, {**of_cell, **inputs}, task.alpha[0], progress)
    return wanted.outputs[column], every, found, left_out(wanted, [task])


def _ends(cell: Campaign, inputs: Mapping[str, FuzzyNumber]) -> tuple[float, float]:
    lower, upper = cell_range(cell, inputs, (0.0,))
    return float(lower[0, 0]), float(upper[0, 0])  # of E


def _moduli(cell: Campaign, inputs: Mapping[str, FuzzyNumber]) -> tuple[float, float]:
    low, high = _ends(cell, inputs)
    return high - low, 1e-9 * high


def _interval(low: float, high: float) -> FuzzyNumber:
    return Interval(low, high) if high > low else Crisp(low)


def _column(case: Case, wanted: Structure, output: str | None) -> int:
    if output is not None and output not in wanted.outputs:
        problem = Problem("--output", "there is no such output", output, ", ".join(wanted.outputs))
        raise BadInput(replace(problem, file=str(case.path)))
    return 0 if output is None else wanted.outputs.index(output)


def _width(
    wanted: Structure,
    task: EnvelopeTask,
    inputs: Mapping[str, FuzzyNumber],
    column: int,
    every: float,
) -> tuple[float, float]:
    """Mean width of an output's envelope at nodes every so many seconds, and its error."""
    assert wanted.linear is not None
    if all(isinstance(number, Crisp) for number in inputs.values()):
        return 0.0, 0.0
    try:
        found = frame.envelope(
            wanted.linear,
            inputs,
            alpha=(0.0,),
            duration=task.duration,
            step=every,
            method="modal",
            tolerance=TOLERANCE,
            relative=True,
            progress=False,
        )
    except ModalError as unsuited:
        why = str(unsuited).partition(";")[0]
        raise BadInput.of("frame", why, allowed="modes that oscillate, to compare widths") from None
    width = (found.upper - found.lower)[0, :, column].mean()
    error = np.inf if found.error is None else 2 * found.error[0, :, column].mean()
    return float(width), float(error)


def _advice(
    answer: Answer, inputs: Mapping[str, FuzzyNumber], alpha: float, progress: Tick | None
) -> Advice:
    numbers, done = joined_once(dict(inputs)), 0

    def told(changed: Mapping[str, FuzzyNumber]) -> tuple[float, float]:
        nonlocal done
        found = answer(changed)
        done += 1
        if progress:
            progress(min(done / (1 + 6 * len(numbers)), 1.0))
        return found

    return advice(told, numbers, alpha=alpha)


def advice_document(found: Advice, answer: str, fixed: Sequence[str] = ()) -> Document:
    """The advice as it is printed with ``--json``; gains as shares of the width."""
    unit = 1 / found.width if found.width > 0 else 0.0
    return {
        "answer": answer,
        "unit": "Pa" if answer == "E" else Output(answer).unit,
        "width": found.width,
        "error": found.error,
        "alpha": found.alpha,
        "gains": {x.name: {key: unit * getattr(x, key) for key in GAINS} for x in found.gains},
        "fixed": list(fixed),
        "note": found.note,
    }
