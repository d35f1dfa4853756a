"""Shares of the inputs in the widths of the modulus and of the peaks of a vibration.

The share of an input is the width that is lost when it alone is fixed at its nominal value.
Whatever the case uses, the cell is solved by `auto` (the series where it has a formula) with a
reduced plan. Peaks of a frame are those that exact motions reach, which needs no proof.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from alphacut.base.arrays import Array
from alphacut.case.structure import Structure
from alphacut.frame.dynamics.flow import Flow
from alphacut.frame.dynamics.nonlinear import make_flow
from alphacut.fuzzy import FuzzyNumber, Reduced
from alphacut.fuzzy.propagation import Shares, width_shares
from alphacut.io.provenance import NESTED
from alphacut.stages.cell import CellProblem
from alphacut.stages.envelope import EnvelopeTask, PeakResults
from alphacut.stages.modulus import OUTPUTS, identity, solved
from alphacut.stages.store import Stage, StageContext, StageResult

ShareTable = dict[str, dict[str, float]]
"""Share of each input by result, such as E, then by input."""


def stage(
    campaign: CellProblem | None,
    structure: Structure | None,
    task: EnvelopeTask | None,
    reached: PeakResults,
) -> Stage[ShareTable]:
    """The stage of each input's share in the widths of E, ν and peaks on the lowest level.

    A result of one input has none.
    """

    def compute(_: StageContext) -> StageResult[ShareTable]:
        table: ShareTable = {}
        if campaign is not None and len(campaign.inputs) > 1:
            shares = cell_shares(campaign)
            for k, name in enumerate(("E", "ν")):
                table[name] = dict(zip(shares.names, map(float, shares.share[:, k]), strict=True))
        if structure is not None and task is not None and structure.frame and len(task.fuzzy) > 1:
            shares = peak_shares(structure, task, reached)
            for k, output in enumerate(structure.outputs):
                column = map(float, shares.share[:, k])
                table[f"the peak of {output}"] = dict(zip(shares.names, column, strict=True))
        return StageResult(table)

    of_cell = campaign and [identity(campaign), campaign.inputs, campaign.modulus.alpha]
    inputs = [of_cell, structure and [structure.model, structure.numbers, task, reached]]
    return Stage("shares", inputs, (*NESTED, "alphacut"), ShareTable, compute)


def cell_shares(campaign: CellProblem) -> Shares:
    """Shares of the widths of E and ν, (inputs, 2), by the series where it has a formula."""
    modulus = campaign.modulus.model_copy(update={"method": "auto"})
    problem, alpha = replace(campaign, modulus=modulus), modulus.alpha[:1]

    def bounds(inputs: Mapping[str, FuzzyNumber]) -> tuple[Array, Array]:
        """Lower and upper bounds of E and ν on the lowest level, shape (2,) each."""
        cell_bounds = solved(problem, Reduced(), inputs=inputs, alpha=alpha, progress=False).bounds
        columns = [cell_bounds.column(name) for name in OUTPUTS]
        return cell_bounds.lower[0, columns], cell_bounds.upper[0, columns]

    return width_shares(bounds, campaign.inputs)


def peak_shares(structure: Structure, task: EnvelopeTask, reached: PeakResults) -> Shares:
    """Shares of the width of each output's peak, (inputs, outputs), by the inputs of a study.

    The width is that between the greatest and the least peak that coordinate searches reach on the
    lowest level; they begin at the motions with the `reached` peaks and opposite them. Without a
    group of inputs they begin at what was found with all, moved to the group's nominal values.
    """
    groups = {name: structure.fuzzy_members(name) for name in task.fuzzy}
    inputs, outputs = structure.inputs(task.fuzzy), range(len(structure.outputs))
    flow = make_flow(structure.model, tuple(inputs), task.duration, task.section.step, "exact")
    at = [{**reached[x].reached_at} if x in reached else {} for x in structure.outputs]
    greatest = np.array([[x.get(name, y.nominal) for name, y in inputs.items()] for x in at])
    found: list[Array] = []  # points of greatest and least peaks with all inputs fuzzy

    def bounds(numbers: Mapping[str, FuzzyNumber]) -> tuple[Array, Array]:
        """Least and greatest peak of each output on the lowest level, shape (outputs,) each."""
        cuts = [x.cut(task.section.alpha[0]) for x in numbers.values()]
        nominal = [x.nominal for x in numbers.values()]
        values: Array = np.column_stack([np.array(cuts, float), nominal])
        opposite = values[:, 0] + values[:, 1] - greatest
        starts: Array = np.clip(found or [greatest, opposite], values[:, 0], values[:, 1])
        ends = [
            [peak_by_coordinates(flow, values, starts[side, k], k, sign) for k in outputs]
            for side, sign in enumerate((1.0, -1.0))
        ]
        if not found:
            found.extend(np.array([point for _, point in row]) for row in ends)
        largest, smallest = ([peak for peak, _ in row] for row in ends)
        return np.array(smallest), np.array(largest)

    return width_shares(bounds, inputs, groups=groups)


def peak_by_coordinates(
    flow: Flow, values: Array, point: Array, output: int, sign: float
) -> tuple[float, Array]:
    """Largest `sign` times the peak of an output that steepest ascent reaches, and its inputs.

    Each step moves one input to one of its `values` (inputs, 3); it begins at `point` (inputs,).
    """
    d, best = len(values), -np.inf
    while True:
        tried = np.tile(point, (1 + values.size, 1))
        for k in range(d):
            tried[1 + 3 * k : 4 + 3 * k, k] = values[k]
        tried = np.unique(tried, axis=0)
        peaks = sign * np.abs(flow.values(tried)[..., output]).max(1)
        if peaks.max() <= best:
            return sign * best, point
        best, point = float(peaks.max()), tried[peaks.argmax()]
