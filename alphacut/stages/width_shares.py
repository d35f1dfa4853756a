"""Shares of the inputs in the width of the modulus and of the vibration.

The share of an input is the width lost when it alone is fixed at its modal value. For these
additional propagations the cheap exact models
serve, whatever the case itself uses: the series for the cell, the modal method for the frame.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from alphacut import frame
from alphacut.case.case import Case
from alphacut.frame import Envelope
from alphacut.frame.structures.linear import LinearSystem
from alphacut.frame.structures.modes import ModalError
from alphacut.fuzzy import Crisp, FuzzyNumber, Reduced, propagate
from alphacut.fuzzy.width_contributions import Shares, width_shares
from alphacut.io.files import Document, say
from alphacut.io.progress import Tick
from alphacut.stages.material.campaign import Campaign, campaign
from alphacut.stages.pipeline import Results
from alphacut.stages.vibration.envelope_task import EnvelopeTask
from alphacut.stages.vibration.structure import Structure
from alphacut.stages.vibration.studies import Study, studies
from alphacut.stochastic.theta.truncated_normal import Array

if TYPE_CHECKING:
    import xarray


OF_CELL = ("E", "nu")


def modulus_shares(case: Case, progress: Tick | None = None) -> Shares:
    """Shares of the cell's fuzzy inputs in the widths of E and ν, shape (inputs, levels, 2)."""
    wanted = campaign(case)
    return width_shares(
        lambda inputs: cell_range(wanted, inputs, wanted.alpha),
        wanted.inputs,
    )


def cell_range(
    wanted: Campaign, inputs: Mapping[str, FuzzyNumber], alpha: tuple[float, ...]
) -> tuple[Array, Array]:
    """Ends of E and ν on each level, (A, 2), by the series, for other numbers as inputs."""
    fuzzy = {name: number for name, number in inputs.items() if not isinstance(number, Crisp)}
    crisp = {
        **wanted.task.crisp,
        **{name: number.modal for name, number in inputs.items() if name not in fuzzy},
    }
    task = replace(wanted.task, choice=replace(wanted.task.choice, method="series"), crisp=crisp)
    if not fuzzy:
        only = task([{}])[0]
        alone = np.tile([float(np.asarray(only[name])) for name in OF_CELL], (len(alpha), 1))
        return alone, alone
    shared = tuple(name for name in fuzzy if name != "inclusion_modulus") or tuple(fuzzy)
    found = propagate(task, fuzzy, Reduced(), alpha=alpha, shared=shared, progress=False)
    lower, upper = (
        np.stack(ends, axis=1)
        for ends in zip(*(found.bounds(name) for name in OF_CELL), strict=True)
    )
    return lower, upper


def asked(task: EnvelopeTask, model: LinearSystem) -> Document:
    """What `frame.envelope` is called with for shares: they need two digits."""
    common: Document = {"alpha": task.alpha[:1], "duration": task.duration, "method": "search"}
    if model.ground is None:
        return {**common, "step": task.step}
    step = thinned(task.duration, task.step)
    return {**common, "step": step, "tolerance": ACCURACY, "relative": True, "passes": 1}


def envelope_shares(
    results: Results, study: Study, progress: Tick | None = None
) -> tuple[Shares, Array, list[str], list[str]]:
    """Shares of a study's inputs in every output's width, (inputs, times, outputs).

    With them the times, the outputs' names, and notes.

    Raises:
        ModalError: The modal method cannot treat the structure.
    """
    wanted = results.structure
    assert wanted is not None
    assert wanted.linear is not None
    model, inputs = wanted.linear, wanted.inputs(study.task.fuzzy)
    groups = {name: wanted.members(name) for name in study.task.fuzzy}
    axes: list[tuple[Array, list[str]]] = []

    def tick(done: float) -> None:
        if progress:
            progress((len(axes) + done) / (1 + len(groups)))

    rough: list[float] = []

    def bounds(fuzzy: Mapping[str, FuzzyNumber]) -> tuple[Array, Array]:
        left = {name: number for name, number in fuzzy.items() if not isinstance(number, Crisp)}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # told of all shares at once
            found = frame.envelope(model, left, progress=tick, **asked(study.task, model))
        rough.append(missed(found))
        axes.append((found.time, list(found.outputs)))
        return found.lower[0], found.upper[0]

    shares = width_shares(bounds, inputs, groups=groups)
    return shares, *axes[0], [*together(groups), *roughness(max(rough))]


def missed(found: Envelope) -> float:
    """The largest error of an envelope that misses its tolerance, as a share of the peak, or 0."""
    if found.error is None or "reason" not in found.facts:
        return 0.0
    peak = np.maximum(np.abs(found.lower), np.abs(found.upper)).max((0, 1))
    error = found.error.max((0, 1))
    return float(np.divide(error, peak, out=np.zeros_like(error), where=peak > 0).max())


def roughness(worst: float) -> list[str]:
    """A line on shares whose envelopes miss their tolerance."""
    told = f"shares are rough: their envelopes are good to {100 * worst:.2g} % of each peak"
    return [told] if worst > ACCURACY else []


def together(groups: Mapping[str, Sequence[str]]) -> list[str]:
    """A line on each name that stands for several inputs, which its share is of together."""
    several = {name: ", ".join(of) for name, of in groups.items() if len(of) > 1}
    told = "counts as one input in the shares"
    return [f"{name} {told}; {of} by name part it" for name, of in several.items()]


ACCURACY = 1e-2  # wanted error of the envelopes, of each peak: shares need two digits


def explained(wanted: Structure, task: EnvelopeTask) -> list[str]:
    """A line on what the shares of a study cost; none where there are none."""
    if wanted.linear is None or len(task.fuzzy) < 2:
        return []
    given, count = {"inputs": wanted.inputs(task.fuzzy)}, 1 + len(task.fuzzy)
    several = together({name: wanted.members(name) for name in task.fuzzy})
    of = f"all {len(given['inputs'])} inputs fuzzy"
    fixed = f"each of {', '.join(task.fuzzy)} fixed" if several else "each of them fixed"
    each = "".join([f"one with {of} and one with {fixed}", *(f" ({line})" for line in several)])
    cost = "what drives the width, of run"
    return [f"{cost}; {count} envelopes, {each}, which [envelope] shares = false leaves out"]


def dataset(results: Results, progress: Tick | None = None) -> xarray.Dataset:
    """Shares of every input, by level and by time, where there are two or more."""
    import xarray

    variables: dict[str, Any] = {}
    notes: list[str] = []
    coordinates: dict[str, Any] = {}
    if results.modulus is not None and len(results.modulus["parameter"]) > 1:
        parts = 1 if results.structure is None else 2  # its envelopes follow
        cell = modulus_shares(results.case, progress and (lambda done: progress(done / parts)))
        for column, name in enumerate(("modulus_share", "poisson_share")):
            share = cell.share[..., column]
            variables[name] = (("cell_input", "alpha"), share, {"units": "1"})
        coordinates |= {"cell_input": list(cell.names), "alpha": list(results.case.modulus.alpha)}
    study = richest(results)
    if study is not None and of_width(results, study):
        try:
            structure, time, names, notes = envelope_shares(results, study, progress)
        except ModalError as error:
            say(f"no shares of the width over time: {error}")
        else:
            for line in notes:
                say(f"{'' if 'counts as' in line else 'warning: '}{line}")
            variables["share"] = (("input", "time", "output"), structure.share, {"units": "1"})
            units = {"units": "SI, by output"}
            variables["width"] = (("time", "output"), structure.width, units)
            coordinates |= {"input": list(structure.names), "output": names}
            coordinates["time"] = ("time", time, {"units": "s"})
    words = {"study": study.name if study else "", "notes": "\n".join(notes)}
    return xarray.Dataset(variables, coordinates, words)


def of_width(results: Results, study: Study) -> bool:
    """Whether there are shares of a study's width, and they are wanted."""
    several = len(study.task.fuzzy) > 1 and not results.case.sections.pendulum
    return several and results.case.envelope.shares


def thinned(duration: float, step: float) -> float:
    """Multiple of the step that leaves a hundred nodes or some more."""
    steps = round(duration / step)
    return step * max(k for k in range(1, max(1, steps // 100) + 1) if steps % k == 0)


def richest(results: Results) -> Study | None:
    """The study with the most fuzzy inputs; None where nothing vibrates."""
    if results.structure is None:
        return None
    several = studies(results.case)
    return max(several, key=lambda study: (len(study.task.fuzzy), study.task.duration))


def mean_shares(found: xarray.Dataset) -> dict[str, dict[str, float]]:
    """Mean shares for a table: of E at the lowest level, of outputs over time."""
    table: dict[str, dict[str, float]] = {}
    for quantity, variable in (("E", "modulus_share"), ("ν", "poisson_share")):
        if variable in found:
            lowest = found[variable].isel(alpha=0)
            table[quantity] = {
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
