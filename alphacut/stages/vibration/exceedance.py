"""Fuzzy peaks, and the fuzzy probability that an output exceeds a limit."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from alphacut.case.case import Case
from alphacut.case.limits import exceeded_limits
from alphacut.frame import Envelope
from alphacut.frame import exceedance as probabilities
from alphacut.frame.boxes import UnitFlow, boxes
from alphacut.frame.exceedance import ANY, FuzzyProbability, peaks, tried_peaks
from alphacut.frame.propagation import absolute
from alphacut.frame.structures.quantities import Output
from alphacut.fuzzy import FuzzyNumber
from alphacut.io.files import Document
from alphacut.io.problem import BadInput
from alphacut.io.progress import Tick
from alphacut.io.units import engineering
from alphacut.stages.vibration.structure import Structure
from alphacut.stochastic.theta.truncated_normal import Array

if TYPE_CHECKING:
    import xarray

    from alphacut.stages.vibration.envelope_task import EnvelopeTask

Sampler = Callable[[np.random.Generator, int], Array]
FACTS = (
    "output", "limit", "fuzzy", "random", "deviation", "between_nodes", "samples", "step",
    "trajectories", "nature",
)  # fmt: skip
NATURE = "inner: attained at the fuzzy points tried, with the sampling deviation given"


def with_peaks(found: Envelope, wanted: Structure, task: EnvelopeTask) -> xarray.Dataset:
    """The envelope's dataset with the fuzzy peak of each output's magnitude.

    ``peak`` (alpha, bound, output) holds bounds of it at the nodes, ``peak_error`` (alpha, output)
    what it may lie outside them by, and ``peak_tried`` (alpha, output) the least one among some
    trajectories.
    """
    of, cuts = peaks(found), boxes(wanted.inputs(task.fuzzy), task.alpha)
    tried = tried_peaks(
        wanted.flow(
            cuts.names, task.duration, task.step, task.scheme if wanted.linear else task.integrator
        ),
        cuts,
    )

    def words(what: str) -> dict[str, str]:
        return {"units": "SI, by output", "long_name": what}

    about = words("largest magnitude at the nodes; the lower end is a bound from below")
    ends = np.stack([of.lower, of.upper], axis=1)
    dataset = found.to_dataset().assign(peak=(("alpha", "bound", "output"), ends, about))
    least = words(
        "least peak at the nodes among trajectories tried; the true one lies between the bound and"
        " this"
    )
    for name, error, side in (("error", of.error, "outside"), ("below", of.below, "below")):
        if error is not None:
            beyond = words(f"what a peak may lie {side} its bounds by")
            dataset = dataset.assign({f"peak_{name}": (("alpha", "output"), error, beyond)})
    worst = reached(found, wanted, task)
    return (
        dataset.assign(peak_tried=(("alpha", "output"), tried, least))
        .assign_coords(bound=["lower", "upper"])
        .assign_attrs({} if worst is None else {"reached": worst})
    )


def reached(found: Envelope, wanted: Structure, task: EnvelopeTask) -> float | None:
    """Largest declared error in the tolerance's measure; None where no error is declared."""
    if found.error is None:
        return None
    return float((found.error.max((0, 1)) / shares_of_tolerance(wanted, task)).max())


def shares_of_tolerance(wanted: Structure, task: EnvelopeTask) -> Array:
    """Factor on the tolerance for each output, shape (m,)."""
    if wanted.frame is not None:  # bounds of accelerations are of absolute ones
        wanted = replace(wanted, model=absolute(wanted.frame))
    cuts = boxes(wanted.inputs(task.fuzzy), task.alpha)
    scheme = task.scheme if wanted.linear is not None else task.integrator
    flow = wanted.flow(cuts.names, task.duration, task.step, scheme)
    return UnitFlow(flow, cuts, task.relative and task.certify is None).scale


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
            raise BadInput.of(
                "exceedance.random", what, name, problem.allowed, file=str(case.path)
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
    """Fuzzy probabilities that outputs exceed the case's limits in the duration.

    Args:
        case: With the sections exceedance, envelope and a structure.
        wanted: The structure.
        progress: Told the share done.

    Returns:
        Of one limit ``exceedance`` (alpha, bound) and ``curve`` (alpha, bound, limit); of several
        the same with an axis ``event`` in front, see `events`.

    Raises:
        BadInput: The structure has no such output.
    """
    limited, over, limits = case.exceedance, case.envelope, exceeded_limits(case)
    model = wanted.model
    if wanted.frame is not None:
        model = replace(wanted.frame, outputs=tuple(limits))
    if not set(limits) <= set(model.outputs):
        key = "exceedance.limits" if limited.limits else "exceedance.output"
        raise case.refuse(key, "the structure has no such output", ", ".join(wanted.outputs))
    fuzzy, random = split_inputs(case, wanted)
    found = probabilities.exceedances(
        model,
        fuzzy,
        random,
        limits=limits,
        duration=over.duration,
        step=over.step,
        alpha=over.alpha,
        samples=limited.samples,
        rng=np.random.default_rng(limited.seed),
        progress=progress or False,
        integrator=over.integrator if wanted.linear is None and over.integrator else "midpoint",
    )
    facts = {
        "fuzzy": ", ".join(fuzzy),
        "random": ", ".join(random),
        "samples": limited.samples,
        "step": over.step,
        "nature": NATURE,
    }
    each = {name: _dataset(name, of, limits.get(name, 1.0), facts) for name, of in found.items()}
    return next(iter(each.values())) if len(each) == 1 else _joined(each)


def _dataset(
    output: str, found: FuzzyProbability, limit: float, facts: Mapping[str, object]
) -> xarray.Dataset:
    """One probability."""
    import xarray

    about = {"long_name": f"probability that {event_words(output)} exceeds the limit", "units": "1"}
    curve = np.stack([found.curve_lower, found.curve_upper], axis=1)
    return xarray.Dataset(
        {
            "exceedance": (("alpha", "bound"), np.column_stack([found.lower, found.upper]), about),
            "curve": (("alpha", "bound", "limit"), curve, about),
        },
        {
            "alpha": found.alpha,
            "bound": ["lower", "upper"],
            "limit": ("limit", found.limits, {"units": event_unit(output)}),
        },
        {
            **facts,
            "output": output,
            "limit": limit,
            "deviation": found.deviation,
            "between_nodes": float(found.error.max()),
            "trajectories": found.trajectories,
        },
    )


OWN = ("output", "limit", "deviation", "between_nodes")
"""Facts of each event."""


def _joined(each: Mapping[str, xarray.Dataset]) -> xarray.Dataset:
    """Several probabilities as one dataset, each with an axis of limits of its own."""
    import xarray

    parts = list(each.values())
    variables = {
        name: (
            ("event", *axes),
            np.stack([part[name].values for part in parts]),
            parts[0][name].attrs,
        )
        for name, axes in (
            ("exceedance", ("alpha", "bound")),
            ("curve", ("alpha", "bound", "place")),
        )
    }
    limits = np.stack([part["limit"].values for part in parts])
    own = {f"of_{name}": ("event", [part.attrs[name] for part in parts]) for name in OWN}
    common = {name: x for name, x in parts[0].attrs.items() if name not in OWN}
    axes = {name: parts[0][name].values for name in ("alpha", "bound")}
    words = {"units": "SI, by output", "long_name": "limits of the curve"}
    return xarray.Dataset(
        {**variables, "limits": (("event", "place"), limits, words), **own},
        {**axes, "event": list(each)},
        common,
    )


def events(found: xarray.Dataset) -> Iterator[xarray.Dataset]:
    """The probability of each limit, and of any, as a dataset of its own."""
    if "event" not in found.dims:
        yield found
        return
    for index in range(found.sizes["event"]):
        one = found.isel(event=index)
        own = {name: one[f"of_{name}"].values.item() for name in OWN}
        kept = one[["exceedance", "curve"]].drop_vars("event").rename(place="limit")
        units = {"units": event_unit(str(own["output"]))}
        limits = ("limit", one["limits"].values, units)
        yield kept.assign_coords(limit=limits).assign_attrs({**found.attrs, **own})


def event_unit(output: str) -> str:
    """SI unit of an output's limit; shares of their limits where any of several is meant."""
    return "" if output == ANY else Output(output).unit


def event_words(output: str, of: str = "") -> str:
    """What exceeds a limit, ``|drift1|``, or any of several; then `of`, its limit."""
    return "any of them" if output == ANY else f"|{output}|{of}"


def exceedances_document(found: xarray.Dataset) -> Document:
    """The probability as printed with ``--json``; of several limits a list, ``events``."""
    each = [exceedance_document(one) for one in events(found)]
    return each[0] if len(each) == 1 else {"events": each}


def each_event(found: Document) -> list[Document]:
    """The documents of all events from that of `exceedances_document`."""
    several: list[Document] = found.get("events", [found])
    return several


def exceedance_document(found: xarray.Dataset) -> Document:
    """One probability as it is printed with ``--json``; the limit in SI."""
    sides = {str(side): found["exceedance"].sel(bound=side).values for side in ("lower", "upper")}
    return {
        **{name: found.attrs[name] for name in FACTS if name in found.attrs},
        "unit": event_unit(str(found.attrs["output"])),
        "alpha": found["alpha"].values,
        **sides,
    }


def sentence(found: Document) -> str:
    """The probability in words, at the lowest and the highest level."""
    levels = dict.fromkeys((0, len(found["alpha"]) - 1))
    cuts = ", ".join(f"{cut(found, k)} at α = {found['alpha'][k]:g}" for k in levels)
    limit = f" > {engineering(found['limit'], found['unit'])}"
    scatter = f", scatter {found['deviation']:.2g}" if found["random"] else ""
    return f"probability of {event_words(found['output'], limit)}: {cuts}{scatter}"


def nodes(found: Document) -> str:
    """Words on the nodes that a probability is of, and on the motion between, left out of it."""
    if "step" not in found or "between_nodes" not in found:
        return ""
    more = f"the motion between them may add up to {found['between_nodes']:.2g}, estimated"
    return f", at nodes every {found['step']:g} s: {more}"


def cut(found: Document, level: int) -> str:
    """Bounds of a probability on a level; those that say nothing are called undecided."""
    low, high = found["lower"][level], found["upper"][level]
    return "undecided, [0, 1]" if (low, high) == (0, 1) else f"[{low:.3g}, {high:.3g}]"
