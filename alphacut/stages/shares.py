"""Shares of the inputs in the widths of the modulus and of the peaks of a vibration.

The share of an input is the width that is lost when it alone is fixed at its nominal value.
Whatever the case uses, the cell is solved by `auto` (the series where it has a formula) with a
reduced plan; peaks of a frame come from `Auto` to `ACCURACY`, on the lowest level, of a record at
coarser steps.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from alphacut import frame
from alphacut.case.structure import Structure
from alphacut.frame.questions.peaks import peaks
from alphacut.fuzzy import Crisp, FuzzyNumber, Reduced
from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.propagation import Shares, width_shares
from alphacut.fuzzy.result import Nature
from alphacut.io.provenance import NESTED
from alphacut.stages.campaign import OUTPUTS, CellCampaign
from alphacut.stages.envelope import EnvelopeTask
from alphacut.stages.store import Stage, StageContext, StageResult

ShareTable = dict[str, dict[str, float]]
"""Share of each input by result, such as E, then by input."""
ACCURACY = 2e-3
"""Relative error of each peak that shares of two digits need where widths are a fifth of peaks."""


def stage(
    campaign: CellCampaign | None, structure: Structure | None, task: EnvelopeTask | None
) -> Stage[ShareTable]:
    """The stage of the shares of a cell's inputs in its modulus, and of a study's in its peaks."""
    of_cell = campaign and [campaign.identity, campaign.inputs, campaign.modulus.alpha]
    inputs = [of_cell, structure and [structure.model, structure.numbers, task]]
    compute = partial(compute_shares, campaign, structure, task)
    return Stage("shares", inputs, (*NESTED, "alphacut"), ShareTable, compute)


def compute_shares(
    campaign: CellCampaign | None,
    structure: Structure | None,
    task: EnvelopeTask | None,
    context: StageContext,
) -> StageResult[ShareTable]:
    """Computes each input's share in the widths of E, ν and peaks on the lowest level.

    A result of one input has none.
    """
    table: ShareTable = {}
    if campaign is not None and len(campaign.inputs) > 1:
        shares = cell_shares(campaign)
        for k, name in enumerate(("E", "ν")):
            table[name] = dict(zip(shares.names, map(float, shares.share[:, k]), strict=True))
    if structure is not None and task is not None and structure.frame and len(task.fuzzy) > 1:
        shares = peak_shares(structure.frame, structure, task)
        for k, output in enumerate(structure.outputs):
            column = map(float, shares.share[:, k])
            table[f"the peak of {output}"] = dict(zip(shares.names, column, strict=True))
    return StageResult(table)


def cell_shares(campaign: CellCampaign) -> Shares:
    """Shares of the widths of E and ν, (inputs, 2), by the series where it has a formula."""
    modulus = campaign.modulus.model_copy(update={"method": "auto"})
    propagation, alpha = replace(campaign, modulus=modulus).propagation, modulus.alpha[:1]

    def bounds(inputs: Mapping[str, FuzzyNumber]) -> tuple[Array, Array]:
        """Lower and upper bounds of E and ν on the lowest level, shape (2,) each."""
        cell_bounds = propagation(inputs, Reduced(), alpha=alpha, progress=False)
        columns = [cell_bounds.column(name) for name in OUTPUTS]
        return cell_bounds.lower[0, columns], cell_bounds.upper[0, columns]

    return width_shares(bounds, campaign.inputs)


def peak_shares(model: frame.StoreyFrame, structure: Structure, task: EnvelopeTask) -> Shares:
    """Shares of the width of each output's peak, (inputs, outputs), by the inputs of a study."""
    groups, step = {name: structure.fuzzy_members(name) for name in task.fuzzy}, task.section.step
    if model.ground is not None:  # at a multiple of the step that leaves some hundred nodes
        steps = round(task.duration / step)
        step *= max(k for k in range(1, max(1, steps // 100) + 1) if steps % k == 0)

    def bounds(numbers: Mapping[str, FuzzyNumber]) -> tuple[Array, Array]:
        """Least and greatest peak of each output on the lowest level, shape (outputs,) each.

        A guaranteed upper bound is replaced by the peak that is reached, which is nearer the truth.
        """
        fuzzy = {name: x for name, x in numbers.items() if not isinstance(x, Crisp)}
        method = frame.Auto(ACCURACY, peaks=True)
        options: dict[str, Any] = {"alpha": task.section.alpha[:1], "duration": task.duration}
        options |= {"step": step, "method": method, "progress": False}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)
            found = peaks(frame.envelope(model, fuzzy, **options)).values()
        greatest = [x.reached[0] if x.nature is Nature.GUARANTEED else x.upper[0] for x in found]
        return np.array([x.lower[0] for x in found]), np.array(greatest)

    return width_shares(bounds, structure.inputs(task.fuzzy), groups=groups)
