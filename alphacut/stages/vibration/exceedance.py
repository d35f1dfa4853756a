"""Fuzzy peaks, and the fuzzy probability that an output exceeds a limit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from alphacut.case.case import Case
from alphacut.case.limits import limit_of
from alphacut.fuzzy import FuzzyNumber
from alphacut.io.files import Document
from alphacut.io.problem import BadInput, Problem
from alphacut.io.progress import Tick
from alphacut.io.units import engineering
from alphacut.stages.vibration.structure import Structure
from alphacut.stochastic.theta.truncated_normal import Array

if TYPE_CHECKING:
    import xarray

    from alphacut.frame import Envelope
    from alphacut.stages.vibration.envelope_task import EnvelopeTask

Sampler = Callable[[np.random.Generator, int], Array]
FACTS = (
    "output",
    "limit",
    "fuzzy",
    "random",
    "deviation",
    "between_nodes",
    "samples",
    "step",
    "trajectories",
    "nature",
)
NATURE = "inner: attained at the fuzzy points tried, with the sampling deviation given"


def with_peaks(found: Envelope, wanted: Structure, task: EnvelopeTask) -> xarray.Dataset:
    """The envelope's dataset with the fuzzy peak of each output's magnitude.

    ``peak`` (alpha, bound, output) holds bounds of it at the nodes, ``peak_error`` (alpha, output)
    what it may lie outside them by, and ``peak_tried`` (alpha, output) the least one among some
    trajectories.
    """
    from alphacut.frame.boxes import boxes
    from alphacut.frame.exceedance import peaks, tried_peaks

    of, cuts = peaks(found), boxes(wanted.inputs(task.fuzzy), task.alpha)
    tried = tried_peaks(
        wanted.flow(
            cuts.names, task.duration, task.step, task.scheme if wanted.linear else task.integrator
        ),
        cuts,
    )
    words = {
        "units": "SI, by output",
        "long_name": "largest magnitude at the nodes; the lower end is a bound from below",
    }
    dataset = found.to_dataset().assign(
        peak=(("alpha", "bound", "output"), np.stack([of.lower, of.upper], axis=1), words)
    )
    least = {
        "units": "SI, by output",
        "long_name": (
            "least peak at the nodes among trajectories tried; the true one lies between the"
            " bound and this"
        ),
    }
    if of.error is not None:
        beyond = {
            "units": "SI, by output",
            "long_name": "what a peak may lie outside its bounds by",
        }
        dataset = dataset.assign(peak_error=(("alpha", "output"), of.error, beyond))
    error = reached(found, wanted, task)
    return (
        dataset.assign(peak_tried=(("alpha", "output"), tried, least))
        .assign_coords(bound=["lower", "upper"])
        .assign_attrs({} if error is None else {"reached": error})
    )


def reached(found: Envelope, wanted: Structure, task: EnvelopeTask) -> float | None:
    """Largest declared error in the tolerance's measure; None where no error is declared."""
    from alphacut.frame.boxes import UnitFlow, boxes

    if found.error is None:
        return None
    cuts = boxes(wanted.inputs(task.fuzzy), task.alpha)
    scheme = task.scheme if wanted.linear is not None else task.integrator
    flow = wanted.flow(cuts.names, task.duration, task.step, scheme)
    scale = UnitFlow(flow, cuts, task.relative and task.certify is None).scale
    return float((found.error.max((0, 1)) / scale).max())


def peak_document(dataset: xarray.Dataset) -> dict[str, dict[str, Array]]:
    """Fuzzy peak of each output by level, in SI: ends, error, and the least one tried."""
    found = {}
    for name in dataset["output"].values:
        found[str(name)] = {
            side: dataset["peak"].sel(bound=side, output=name).values for side in ("lower", "upper")
        }
        for key in ("tried", "error"):
            if f"peak_{key}" in dataset:
                found[str(name)][key] = dataset[f"peak_{key}"].sel(output=name).values
    return found


def shaped_like(number: FuzzyNumber) -> Sampler:
    """Random values with a density proportional to the membership.

    One value from each of `count` equally likely pieces, in random order (a Latin hypercube where
    several inputs are random): means over them scatter less than those of independent draws.
    """
    grid = np.unique(np.concatenate([np.linspace(*number.support, 4001), *number.cuts[1:]]))
    density = number.membership(grid)
    share = np.concatenate([[0.0], np.cumsum(np.diff(grid) * (density[1:] + density[:-1]) / 2)])

    def draw(rng: np.random.Generator, count: int) -> Array:
        pieces = (rng.permutation(count) + rng.random(count)) / count
        values: Array = np.interp(pieces * share[-1], share, grid)
        return values

    return draw


def require_random(case: Case, wanted: Structure) -> None:
    """Refuse inputs that cannot be random.

    Raises:
        BadInput: One is crisp, or unknown.
    """
    for name in case.exceedance.random:
        try:
            wanted.members(name)
        except BadInput as error:
            (problem,) = error.problems
            what = (
                "the modulus that the frame gets is crisp"
                if name == "E" and name in wanted.numbers
                else problem.what
            )
            raise BadInput(
                Problem("exceedance.random", what, name, problem.allowed, file=str(case.path))
            ) from None


def split_inputs(
    case: Case, wanted: Structure
) -> tuple[dict[str, FuzzyNumber], dict[str, Sampler]]:
    """Inputs that stay fuzzy and those that are random; a crisp one stands in for none."""
    random = wanted.inputs(case.exceedance.random)
    fuzzy = {
        name: number
        for name, number in wanted.inputs(case.envelope.fuzzy).items()
        if name not in random
    }
    crisp = {name: number for name, number in wanted.numbers.items() if number.support.width == 0}
    return fuzzy or dict([next(iter(crisp.items()))]), {
        name: shaped_like(number) for name, number in random.items()
    }


def exceedance(case: Case, wanted: Structure, progress: Tick | None = None) -> xarray.Dataset:
    """Fuzzy probability that an output exceeds the case's limit in the duration.

    Args:
        case: With the sections exceedance, envelope and a structure.
        wanted: The structure.
        progress: Told the share done.

    Raises:
        BadInput: The structure has no such output.
    """
    import xarray

    from alphacut.frame import exceedance as probabilities
    from alphacut.frame.outputs import output_unit

    limited, over = case.exceedance, case.envelope
    output = limited.output
    model = wanted.model if wanted.frame is None else replace(wanted.frame, outputs=(output,))
    if output not in model.outputs:
        raise case.refuse(
            "exceedance.output", "the structure has no such output", ", ".join(wanted.outputs)
        )
    fuzzy, random = split_inputs(case, wanted)
    found = probabilities.exceedance(
        model,
        fuzzy,
        random,
        limit=limit_of(case),
        duration=over.duration,
        step=over.step,
        output=model.outputs.index(output),
        alpha=over.alpha,
        samples=limited.samples,
        rng=np.random.default_rng(limited.seed),
        progress=progress,
    )
    about = {"long_name": f"probability that |{output}| exceeds the limit", "units": "1"}
    ends = (("alpha", "bound"), np.column_stack([found.lower, found.upper]), about)
    drawn = {
        "samples": limited.samples,
        "step": over.step,
        "trajectories": found.trajectories,
    }
    facts = {
        "output": output,
        "limit": limit_of(case),
        "deviation": found.deviation,
        "between_nodes": float(found.error.max()),
        "nature": NATURE,
        **drawn,
    }
    names = {"fuzzy": ", ".join(fuzzy), "random": ", ".join(random)}
    curve = (
        ("alpha", "bound", "limit"),
        np.stack([found.curve_lower, found.curve_upper], axis=1),
        about,
    )
    axes = {
        "alpha": found.alpha,
        "bound": ["lower", "upper"],
        "limit": ("limit", found.limits, {"units": output_unit(output)}),
    }
    return xarray.Dataset({"exceedance": ends, "curve": curve}, axes, {**facts, **names})


def exceedance_document(found: xarray.Dataset) -> Document:
    """The probability as it is printed with ``--json``; the limit in SI."""
    from alphacut.frame.outputs import output_unit

    sides = {str(side): found["exceedance"].sel(bound=side).values for side in ("lower", "upper")}
    return {
        **{name: found.attrs[name] for name in FACTS if name in found.attrs},
        "unit": output_unit(found.attrs["output"]),
        "alpha": found["alpha"].values,
        **sides,
    }


def sentence(found: Document) -> str:
    """The probability in words, at the lowest and the highest level."""
    levels = dict.fromkeys((0, len(found["alpha"]) - 1))
    cuts = (
        f"[{found['lower'][k]:.3g}, {found['upper'][k]:.3g}] at α = {found['alpha'][k]:g}"
        for k in levels
    )
    random = f" with random {found['random']}" if found["random"] else ""
    nodes = f", at nodes every {found['step']:g} s" if "step" in found else ""
    if "between_nodes" in found:
        nodes += f", up to {found['between_nodes']:.2g} more with peaks between them"
    drawn = (
        f"{found['samples']} random draws at each fuzzy point tried"
        if "samples" in found
        else "random draws"
    )
    scatter = (
        f": {drawn}; standard deviation up to {found['deviation']:.2g}" if found["random"] else ""
    )
    worth = f" (inner bounds{nodes}{scatter})"
    return (
        f"probability of |{found['output']}| >"
        f" {engineering(found['limit'], found['unit'])}{random}: {', '.join(cuts)}{worth}\n"
    )
