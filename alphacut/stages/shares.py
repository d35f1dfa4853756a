"""Shares of the inputs in the widths of the modulus and of the peaks of a vibration.

The share of an input is the width that is lost when it alone is fixed at its modal value. The cheap
exact methods serve for it, whatever the case itself uses: the series and the modal method.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

from alphacut import frame
from alphacut.case.structure import Structure
from alphacut.frame.questions.peaks import peaks
from alphacut.frame.structures.modes import ModalError
from alphacut.fuzzy import Crisp, FuzzyNumber, Reduced
from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.propagation import Shares, width_shares
from alphacut.io.files import Document, say
from alphacut.io.provenance import NESTED
from alphacut.stages.envelope import EnvelopeTask
from alphacut.stages.modulus import OUTPUTS, Campaign
from alphacut.stages.store import Stage, Work

if TYPE_CHECKING:
    import xarray

ACCURACY = 1e-2
"""Relative error of each peak that shares of two digits need."""


def stage(
    campaign: Campaign | None, structure: Structure | None, task: EnvelopeTask | None
) -> Stage:
    """The stage of the shares of a cell's inputs, and of those of the richest study."""
    cell = campaign and [campaign.identity, campaign.inputs, campaign.modulus.alpha]
    motion = structure and [structure.model, structure.numbers, task]
    compute = partial(dataset, campaign, structure, task)
    return Stage("shares", [cell, motion], (*NESTED, "alphacut"), compute)


def dataset(
    campaign: Campaign | None, structure: Structure | None, task: EnvelopeTask | None, work: Work
) -> xarray.Dataset:
    """Shares of every input in the width of E, ν and peaks, where there are two inputs or more."""
    import xarray

    variables: dict[str, Any] = {}
    coordinates: dict[str, Any] = {}
    if campaign is not None and len(campaign.inputs) > 1:
        cell = of_cell(campaign)
        for column, name in enumerate(("modulus_share", "poisson_share")):
            variables[name] = (("cell_input", "alpha"), cell.share[..., column])
        coordinates |= {"cell_input": list(cell.names), "alpha": list(campaign.modulus.alpha)}
    if structure is not None and task is not None and structure.frame and len(task.fuzzy) > 1:
        try:
            peak = of_peaks(structure.frame, structure, task)
        except ModalError as error:
            say(f"no shares of the width of peaks: {error}")
        else:
            variables["peak_share"] = (("input", "output"), peak.share)
            coordinates |= {"input": list(peak.names), "output": list(structure.outputs)}
    return xarray.Dataset(variables, coordinates)


def of_cell(campaign: Campaign) -> Shares:
    """Shares of the cell's inputs in the widths of E and ν, shape (inputs, levels, 2).

    They are by the series where it has a formula.
    """
    modulus = campaign.modulus.model_copy(update={"method": "auto"})
    quick = replace(campaign, modulus=modulus)

    def bounds(inputs: Mapping[str, FuzzyNumber]) -> tuple[Array, Array]:
        of = quick.cuts(inputs, Reduced(), progress=False)
        columns = [of.column(name) for name in OUTPUTS]
        return of.lower[:, columns], of.upper[:, columns]

    return width_shares(bounds, campaign.inputs)


def of_peaks(model: frame.StoreyFrame, structure: Structure, task: EnvelopeTask) -> Shares:
    """Shares of a study's inputs in the width of each output's peak, shape (inputs, outputs).

    Raises:
        ModalError: The modal method cannot treat the structure.
    """
    groups = {name: structure.members(name) for name in task.fuzzy}
    step, few = task.section.step, {}
    if model.ground is not None:
        step = thinned(task.duration, step)
        few = {"tolerance": ACCURACY, "relative": True, "passes": 1}

    def bounds(numbers: Mapping[str, FuzzyNumber]) -> tuple[Array, Array]:
        fuzzy = {name: x for name, x in numbers.items() if not isinstance(x, Crisp)}
        alpha, duration = task.section.alpha[:1], task.duration
        options: dict[str, Any] = {"alpha": alpha, "duration": duration, "step": step, **few}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)
            of = peaks(frame.envelope(model, fuzzy, method="search", progress=False, **options))
        return of.lower[0], of.upper[0]

    return width_shares(bounds, structure.inputs(task.fuzzy), groups=groups)


def thinned(duration: float, step: float) -> float:
    """Multiple of the step that leaves a hundred nodes or some more."""
    steps = round(duration / step)
    return step * max(k for k in range(1, max(1, steps // 100) + 1) if steps % k == 0)


def document(data: xarray.Dataset) -> Document:
    """Shares of the inputs in E and ν at the lowest level, and in each peak."""
    each: dict[str, xarray.DataArray] = {}
    for quantity, variable in (("E", "modulus_share"), ("ν", "poisson_share")):
        if variable in data:
            each[quantity] = data[variable].isel(alpha=0)
    if "peak_share" in data:
        outputs = map(str, data["output"].values)
        each |= {f"the peak of {x}": data["peak_share"].sel(output=x) for x in outputs}
    return {name: _by_input(shares) for name, shares in each.items()}


def _by_input(shares: xarray.DataArray) -> dict[str, float]:
    """Shares by the names on their one axis."""
    names = map(str, shares[shares.dims[0]].values)
    return dict(zip(names, map(float, shares.values), strict=True))
