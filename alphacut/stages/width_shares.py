"""Shares of the inputs in the width of the modulus and of the vibration.

The share of an input is the width lost when it alone is fixed at its modal value. For these
additional propagations the cheap exact models
serve, whatever the case itself uses: the series for the cell, the modal method for the frame.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from alphacut.case.case import Case
from alphacut.fuzzy import Crisp, FuzzyNumber, Reduced, propagate
from alphacut.io.files import say
from alphacut.stages.material.campaign import Campaign, campaign
from alphacut.stages.pipeline import Results, Study
from alphacut.stochastic.theta.truncated_normal import Array

if TYPE_CHECKING:
    import xarray

    from alphacut.fuzzy.width_contributions import Shares


def modulus_shares(case: Case) -> Shares:
    """Shares of the cell's fuzzy inputs in the width of E, shape (inputs, levels)."""
    from alphacut.fuzzy.width_contributions import width_shares

    wanted = campaign(case)
    return width_shares(lambda inputs: cell_range(wanted, inputs, wanted.alpha), wanted.inputs)


def cell_range(
    wanted: Campaign, inputs: Mapping[str, FuzzyNumber], alpha: tuple[float, ...]
) -> tuple[Array, Array]:
    """Ends of E on each level, (A,), by the series, for other numbers as the cell's inputs."""
    fuzzy = {name: number for name, number in inputs.items() if not isinstance(number, Crisp)}
    crisp = {
        **wanted.task.crisp,
        **{name: number.modal for name, number in inputs.items() if name not in fuzzy},
    }
    task = replace(wanted.task, choice=replace(wanted.task.choice, method="series"), crisp=crisp)
    if not fuzzy:
        alone = np.full(len(alpha), float(np.asarray(task([{}])[0]["E"])))
        return alone, alone
    shared = tuple(name for name in fuzzy if name != "inclusion_modulus") or tuple(fuzzy)
    return propagate(task, fuzzy, Reduced(), alpha=alpha, shared=shared).bounds("E")


def envelope_shares(results: Results, study: Study) -> tuple[Shares, Array]:
    """Shares of a study's inputs in every output's width, (inputs, times, outputs).

    Raises:
        ModalError: The modal method cannot treat the structure.
    """
    from alphacut import frame
    from alphacut.fuzzy.width_contributions import width_shares

    wanted = results.structure
    assert wanted is not None
    assert wanted.linear is not None
    model, inputs = wanted.linear, wanted.inputs(study.task.fuzzy)
    step = (
        study.task.step if model.ground is None else thinned(study.task.duration, study.task.step)
    )
    # a share needs two digits
    options: dict[str, Any] = {} if model.ground is None else {"tolerance": 1e-2, "relative": True}
    groups = {name: wanted.members(name) for name in study.task.fuzzy}
    times: list[Array] = []

    def bounds(fuzzy: Mapping[str, FuzzyNumber]) -> tuple[Array, Array]:
        left = {name: number for name, number in fuzzy.items() if not isinstance(number, Crisp)}
        level, task = (study.task.alpha[0],), study.task
        found = frame.envelope(
            model, left, alpha=level, duration=task.duration, step=step, method="modal", **options
        )
        times.append(found.time)
        return found.lower[0], found.upper[0]

    return width_shares(bounds, inputs, groups=groups), times[0]


def dataset(results: Results) -> xarray.Dataset:
    """Shares of every input, by level and by time, where there are two or more."""
    import xarray

    from alphacut.frame.structures.modes import ModalError

    variables: dict[str, Any] = {}
    coordinates: dict[str, Any] = {}
    if results.modulus is not None and len(results.modulus["parameter"]) > 1:
        cell = modulus_shares(results.case)
        variables["modulus_share"] = (("cell_input", "alpha"), cell.share, {"units": "1"})
        coordinates |= {
            "cell_input": list(cell.names),
            "alpha": list(results.case.modulus.alpha),
        }
    study = richest(results)
    if study is not None and len(study.task.fuzzy) > 1 and not results.case.sections.pendulum:
        try:
            structure, time = envelope_shares(results, study)
        except ModalError as error:
            say(f"no shares of the width over time: {error}")
        else:
            variables["share"] = (("input", "time", "output"), structure.share, {"units": "1"})
            variables["width"] = (("time", "output"), structure.width)
            names = [str(name) for name in results.envelopes[study.name]["output"].values]
            coordinates |= {"input": list(structure.names), "time": time, "output": names}
    return xarray.Dataset(variables, coordinates, {"study": study.name if study else ""})


def thinned(duration: float, step: float) -> float:
    """Multiple of the step that leaves some hundreds of nodes."""
    steps = round(duration / step)
    return step * max(k for k in range(1, max(2, steps // 300)) if steps % k == 0)


def richest(results: Results) -> Study | None:
    """The study with the most fuzzy inputs; None without studies."""
    return (
        max(results.studies, key=lambda study: (len(study.task.fuzzy), study.task.duration))
        if results.studies
        else None
    )


def mean_shares(found: xarray.Dataset) -> dict[str, dict[str, float]]:
    """Mean shares for a table: of E at the lowest level, of outputs over time."""
    table: dict[str, dict[str, float]] = {}
    if "modulus_share" in found:
        lowest = found["modulus_share"].isel(alpha=0)
        table["E"] = {
            str(name): float(lowest.sel(cell_input=name)) for name in found["cell_input"].values
        }
    if "share" in found:
        weighted = (found["share"] * found["width"]).sum("time") / found["width"].sum("time")
        for output in found["output"].values:
            table[str(output)] = {
                str(name): float(weighted.sel(input=name, output=output))
                for name in found["input"].values
            }
    return table
