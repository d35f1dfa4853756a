"""Stage shares: by how much each input widens the modulus and the peaks of a vibration."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial

from alphacut.base.arrays import Array
from alphacut.case.structure import Structure
from alphacut.frame import Peak, sensitivity
from alphacut.fuzzy import FuzzyNumber, Reduced
from alphacut.fuzzy.propagation import WidthFractions, width_fractions
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
    """Return the stage of how much each input widens E, ν and peaks on the lowest level.

    Args:
        campaign: The cell; None without one.
        structure: The structure; None without one.
        task: The study with the most inputs.
        peaks: Peaks of the study, at which searches begin.
    """
    compute = partial(_fractions_of_widths, campaign, structure, task, peaks)
    of_cell = campaign and [identity(campaign), campaign.inputs, campaign.modulus.alpha]
    of_structure = structure and [structure.model, structure.numbers, task, peaks]
    inputs, packages = [of_cell, of_structure], (*NESTED, "alphacut")
    return Stage("shares", inputs, packages, ShareTable, compute)


def _fractions_of_widths(
    campaign: CellProblem | None,
    structure: Structure | None,
    task: EnvelopeTask | None,
    peaks: Mapping[str, Peak],
    _: StageContext,
) -> StageResult[ShareTable]:
    """Return the table; a result with one input has no row, and only frames have rows of peaks."""
    table: ShareTable = {}
    if campaign is not None and len(campaign.inputs) > 1:
        shares = cell_shares(campaign)
        for column, name in enumerate(("E", "ν")):
            fractions = map(float, shares.fraction[:, column])
            table[name] = dict(zip(shares.names, fractions, strict=True))
    if structure is None or task is None:
        return StageResult(table)
    if structure.model.floors and len(task.fuzzy) > 1:
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


def cell_shares(campaign: CellProblem) -> WidthFractions:
    """Return the fractions of the widths of E and ν that each input causes, shape (inputs, 2).

    Whatever the case uses, the cell is solved by `auto`, which is the series where it has a
    formula, with a reduced plan.
    """
    modulus = campaign.modulus.model_copy(update={"method": "auto"})
    problem, alpha = replace(campaign, modulus=modulus), modulus.alpha[:1]

    def bounds(inputs: Mapping[str, FuzzyNumber]) -> tuple[Array, Array]:
        """Return the lower and upper bounds of E and ν on the lowest level, shape (2,) each."""
        cell_bounds = solved(problem, Reduced(), inputs=inputs, alpha=alpha, progress=False).bounds
        columns = [cell_bounds.column(name) for name in OUTPUTS]
        return cell_bounds.lower[0, columns], cell_bounds.upper[0, columns]

    return width_fractions(bounds, campaign.inputs)
