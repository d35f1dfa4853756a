"""Stage shares: by how much each input widens the modulus and the peaks of a vibration."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

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
    """Return the stage that computes by how much each input widens E, ν and the peaks.

    Args:
        campaign: The cell, for E and ν; None without one.
        structure: The structure, for its peaks; None without one.
        task: The study with the most inputs; None without a structure.
        peaks: Peaks of the study by output. Searches begin at the inputs that attain them.

    Returns:
        Stage of a table by result and input, of the fraction by which the width of the result on
        the lowest level falls if the input is fixed at its nominal value.
    """
    # Peaks are inputs of this stage too: searches begin there, which can change digits of results.
    of_cell = campaign and [identity(campaign), campaign.inputs, campaign.modulus.alpha]
    of_structure = structure and [structure.model, structure.numbers, task, peaks]
    inputs = [of_cell, of_structure]

    def compute(_: StageContext) -> StageResult[ShareTable]:
        """Compute the table.

        Results that depend on a single fuzzy input have no row, and only frames with floors have
        rows of peaks.
        """
        table: ShareTable = {}
        if campaign is not None and len(campaign.inputs) > 1:
            shares = cell_shares(campaign)
            for column, name in enumerate(("E", "ν")):
                fractions = map(float, shares.fraction[:, column])
                table[name] = dict(zip(shares.names, fractions, strict=True))
        if structure is None or task is None:
            return StageResult(table)
        # An input such as "m" stands for m1 … mn: they are fixed together, as the case names them.
        names = structure.with_always_fuzzy(task.fuzzy)
        if structure.model.floors and len(names) > 1:
            table |= sensitivity(
                structure.model,
                structure.inputs(task.fuzzy),
                duration=task.duration,
                step=task.section.step,
                level=task.section.alpha[0],
                groups={name: structure.fuzzy_members(name) for name in names},
                reached_at={name: peak.reached_at for name, peak in peaks.items()},
            ).shares
        return StageResult(table)

    return Stage("shares", inputs, (*NESTED, "alphacut"), ShareTable, compute)


def cell_shares(campaign: CellProblem) -> WidthFractions:
    """Return the fraction of the widths of E and ν that each input of a cell causes.

    It is the reduction of the width when the input is fixed at its nominal value, over the whole
    width, on the lowest level. The cell is solved by the fastest model whatever the case uses,
    since ratios of widths need few digits.

    Args:
        campaign: The cell with its fuzzy inputs, of which there are two at least.

    Returns:
        The names of the inputs, and the fractions, shape (inputs, 2) for E and ν.

    Raises:
        CampaignError: Samples failed.
    """
    # Each input takes a campaign of its own, with the others fuzzy.
    modulus = campaign.modulus.model_copy(update={"method": "auto"})
    problem = replace(campaign, modulus=modulus)
    alpha = modulus.alpha[:1]

    def bounds(inputs: Mapping[str, FuzzyNumber]) -> tuple[Array, Array]:
        """Return the lower and upper bounds of E and ν on the lowest level, shape (2,) each."""
        cell_bounds = solved(problem, Reduced(), inputs=inputs, alpha=alpha, progress=False).bounds
        columns = [cell_bounds.column(name) for name in OUTPUTS]
        return cell_bounds.lower[0, columns], cell_bounds.upper[0, columns]

    return width_fractions(bounds, campaign.inputs)
