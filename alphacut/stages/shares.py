"""Shares of the inputs in the widths of the modulus and of the vibration.

The share of an input is the width that is lost when it alone is fixed at its modal value. The cheap
exact methods serve for it, whatever the case itself uses: the series and the modal method.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from alphacut import frame
from alphacut.case.structure import Structure
from alphacut.frame.questions.peaks import peaks
from alphacut.frame.structures.modes import ModalError
from alphacut.fuzzy import Crisp, FuzzyNumber, Reduced, propagate
from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.width_contributions import Shares, width_shares
from alphacut.io.files import say
from alphacut.io.provenance import NESTED
from alphacut.stages.envelope import EnvelopeTask
from alphacut.stages.modulus import Campaign
from alphacut.stages.store import Stage, Work

if TYPE_CHECKING:
    import xarray

ACCURACY = 1e-2
"""Relative error of each peak that shares of two digits need."""
OF_CELL = ("E", "nu")


def stage(
    campaign: Campaign | None, structure: Structure | None, task: EnvelopeTask | None
) -> Stage:
    """The stage of the shares of a cell's inputs, and of those of the richest study."""

    def compute(work: Work) -> xarray.Dataset:
        return dataset(campaign, structure, task)

    cell = campaign and [campaign.task.identity, campaign.inputs, campaign.alpha]
    motion = structure and [structure.model, structure.numbers, task]
    return Stage("shares", [cell, motion], (*NESTED, "alphacut"), compute)


def dataset(
    campaign: Campaign | None, structure: Structure | None, task: EnvelopeTask | None
) -> xarray.Dataset:
    """Shares of every input, by level and by time, where there are two or more."""
    import xarray

    variables: dict[str, Any] = {}
    coordinates: dict[str, Any] = {}
    if campaign is not None and len(campaign.inputs) > 1:
        cell = of_cell(campaign)
        for column, name in enumerate(("modulus_share", "poisson_share")):
            variables[name] = (("cell_input", "alpha"), cell.share[..., column], {"units": "1"})
        coordinates |= {"cell_input": list(cell.names), "alpha": list(campaign.alpha)}
    if structure is not None and task is not None and structure.linear and len(task.fuzzy) > 1:
        try:
            shares, time = of_motion(structure, task)
        except ModalError as error:
            say(f"no shares of the width over time: {error}")
        else:
            variables["share"] = (("input", "time", "output"), shares.share[:, 1:], {"units": "1"})
            variables["peak_share"] = (("input", "output"), shares.share[:, 0], {"units": "1"})
            variables["width"] = (("time", "output"), shares.width[1:], {"units": "SI, by output"})
            coordinates |= {"input": list(shares.names), "output": list(structure.outputs)}
            coordinates["time"] = ("time", time, {"units": "s"})
    return xarray.Dataset(variables, coordinates, {"study": task.name if task else ""})


def of_cell(campaign: Campaign) -> Shares:
    """Shares of the cell's inputs in the widths of E and ν, shape (inputs, levels, 2)."""
    return width_shares(lambda x: _cell_range(campaign, x), campaign.inputs)


def _cell_range(campaign: Campaign, inputs: Mapping[str, FuzzyNumber]) -> tuple[Array, Array]:
    """Ends of E and ν on each level, (A, 2), by the series where it has a formula."""
    fuzzy = {name: number for name, number in inputs.items() if not isinstance(number, Crisp)}
    modal = {name: number.modal for name, number in inputs.items() if name not in fuzzy}
    choice = replace(campaign.task.choice, method="auto", moduli=None)
    task = replace(campaign.task, choice=choice, crisp={**campaign.task.crisp, **modal})
    if not fuzzy:
        one = task([{}])[0]
        values = [float(np.asarray(one[name])) for name in OF_CELL]
        alone = np.tile(values, (len(campaign.alpha), 1))
        return alone, alone
    shared = tuple(name for name in fuzzy if name != "inclusion_modulus") or tuple(fuzzy)
    result = propagate(task, fuzzy, Reduced(), alpha=campaign.alpha, shared=shared, progress=False)
    ends = zip(*(result.bounds(name) for name in OF_CELL), strict=True)
    lower, upper = (np.stack(side, axis=1) for side in ends)
    return lower, upper


def of_motion(structure: Structure, task: EnvelopeTask) -> tuple[Shares, Array]:
    """Shares of a study's inputs in the widths of every output's peak and motion; the times.

    The shares have the shape (inputs, 1 + times, outputs), those of the peak first.

    Raises:
        ModalError: The modal method cannot treat the structure.
    """
    groups = {name: structure.members(name) for name in task.fuzzy}
    model = structure.linear
    assert model is not None
    forced = model.ground is not None
    step = thinned(task.duration, task.section.step) if forced else task.section.step
    few: dict[str, Any] = {"tolerance": ACCURACY, "relative": True, "passes": 1} if forced else {}
    times: list[Array] = []

    def bounds(numbers: Mapping[str, FuzzyNumber]) -> tuple[Array, Array]:
        fuzzy = {name: x for name, x in numbers.items() if not isinstance(x, Crisp)}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)
            result = frame.envelope(
                model,
                fuzzy,
                alpha=task.section.alpha[:1],
                duration=task.duration,
                step=step,
                method="search",
                progress=False,
                **few,
            )
        times.append(result.time)
        of = peaks(result)
        return (
            np.concatenate([of.lower[:1], result.lower[0]]),
            np.concatenate([of.upper[:1], result.upper[0]]),
        )

    inputs = structure.inputs(task.fuzzy)
    return width_shares(bounds, inputs, groups=groups), times[0]


def thinned(duration: float, step: float) -> float:
    """Multiple of the step that leaves a hundred nodes or some more."""
    steps = round(duration / step)
    return step * max(k for k in range(1, max(1, steps // 100) + 1) if steps % k == 0)


def means(data: xarray.Dataset) -> dict[str, dict[str, float]]:
    """Mean shares for a table: of E and ν at the lowest level, of outputs over time."""
    table: dict[str, dict[str, float]] = {}
    for quantity, variable in (("E", "modulus_share"), ("ν", "poisson_share")):
        if variable in data:
            lowest = data[variable].isel(alpha=0)
            names = map(str, data["cell_input"].values)
            table[quantity] = {name: float(lowest.sel(cell_input=name)) for name in names}
    if "share" in data:
        weighted = (data["share"] * data["width"]).sum("time") / data["width"].sum("time")
        for output in map(str, data["output"].values):
            names = map(str, data["input"].values)
            table[output] = {x: float(weighted.sel(input=x, output=output)) for x in names}
    return table


def of_peaks(data: xarray.Dataset) -> dict[str, dict[str, float]]:
    """Shares of the inputs in the width of each output's peak; empty without a motion."""
    if "peak_share" not in data:
        return {}
    names = [*map(str, data["input"].values)]
    each = {str(x): data["peak_share"].sel(output=x).values for x in data["output"].values}
    return {x: dict(zip(names, map(float, shares), strict=True)) for x, shares in each.items()}
