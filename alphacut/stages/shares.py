"""Stage shares: by how much each input widens the modulus and the peaks of a vibration."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from alphacut.base.arrays import Array
from alphacut.case.structure import Structure
from alphacut.frame import Peak, sensitivity
from alphacut.fuzzy import FuzzyNumber, Reduced
from alphacut.fuzzy.propagation import Shares, width_shares
from alphacut.io.provenance import NESTED
from alphacut.stages.cell import CellProblem
from alphacut.stages.envelope import EnvelopeTask
from alphacut.stages.modulus import OUTPUTS, identity, solved
from alphacut.stages.store import Stage, StageContext, StageResult

ShareTable = dict[str, dict[str, float]]
"""Fraction of the width of each result, such as E, by which an input widens it."""


def stage(
    campaign: CellProblem | None,
    structure: Structure | None,
    task: EnvelopeTask | None,
    peaks: Mapping[str, Peak],
) -> Stage[ShareTable]:
    """The stage of each input's share in the widths of E, ν and peaks on the lowest level.

    A result of one input has none. `peaks` are those of the study, at which searches begin.
    """

    def compute(_: StageContext) -> StageResult[ShareTable]:
        table: ShareTable = {}
        if campaign is not None and len(campaign.inputs) > 1:
            shares = cell_shares(campaign)
            for k, name in enumerate(("E", "ν")):
                table[name] = dict(zip(shares.names, map(float, shares.share[:, k]), strict=True))
        has_floors = structure is not None and structure.model.floors > 0
        if structure is not None and task is not None and has_floors and len(task.fuzzy) > 1:
            table |= sensitivity(
                structure.model,
                structure.inputs(task.fuzzy),
                duration=task.duration,
                step=task.section.step,
                level=task.section.alpha[0],
                groups={name: structure.fuzzy_members(name) for name in task.fuzzy},
                reached_at={name: peak.reached_at for name, peak in peaks.items()},
            ).shares
        return StageResult(table)

    of_cell = campaign and [identity(campaign), campaign.inputs, campaign.modulus.alpha]
    inputs = [of_cell, structure and [structure.model, structure.numbers, task, peaks]]
    return Stage("shares", inputs, (*NESTED, "alphacut"), ShareTable, compute)


def cell_shares(campaign: CellProblem) -> Shares:
    """Shares of the widths of E and ν, (inputs, 2), by the series where it has a formula.

    Whatever the case uses, the cell is solved by `auto` with a reduced plan.
    """
    modulus = campaign.modulus.model_copy(update={"method": "auto"})
    problem, alpha = replace(campaign, modulus=modulus), modulus.alpha[:1]

    def bounds(inputs: Mapping[str, FuzzyNumber]) -> tuple[Array, Array]:
        """Lower and upper bounds of E and ν on the lowest level, shape (2,) each."""
        cell_bounds = solved(problem, Reduced(), inputs=inputs, alpha=alpha, progress=False).bounds
        columns = [cell_bounds.column(name) for name in OUTPUTS]
        return cell_bounds.lower[0, columns], cell_bounds.upper[0, columns]

    return width_shares(bounds, campaign.inputs)
