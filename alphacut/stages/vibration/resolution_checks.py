"""What is known before envelopes are computed: coarse steps or tolerances, proofs that fail."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from math import acos, ceil, cos, pi

import numpy as np

from alphacut.frame import guard
from alphacut.frame.boxes import UnitFlow, boxes
from alphacut.frame.calculus.numbers import below
from alphacut.frame.certificate.remainder import MOST_PARAMETERS
from alphacut.frame.checks.between_nodes import stray
from alphacut.frame.checks.tolerance import tolerance_guard
from alphacut.frame.exceedance import within_steps
from alphacut.frame.propagation import absolute
from alphacut.frame.structures.linear import frequencies
from alphacut.frame.structures.polynomial_dependence import UnprovedError, degrees
from alphacut.frame.structures.quantities import Output
from alphacut.io.files import say
from alphacut.io.problem import BadInput, Problem
from alphacut.io.units import engineering
from alphacut.stages.vibration.envelope_task import EnvelopeTask
from alphacut.stages.vibration.structure import Structure
from alphacut.stochastic.theta.truncated_normal import Array

MISSED = 0.01  # of a peak, between two nodes
ADDED = 0.03  # of a peak that its bound between nodes adds
WITH_TOLERANCE = ("auto", "modal", "graph-follower", "improved-graph-follower")


def rough(wanted: Structure, task: EnvelopeTask) -> Iterator[Problem]:
    """Remarks on what is coarse about an envelope."""
    yield from coarse_step(wanted, task)
    yield from coarse_tolerance(wanted, task)
    yield from coarse_nodes(wanted, task)
    yield from coarse_outputs(wanted, task)


def shares_of_tolerance(wanted: Structure, task: EnvelopeTask) -> Array:
    """Factor on the tolerance for each output, shape (m,): what its own error is measured by."""
    if wanted.frame is not None:  # bounds of accelerations are found as absolute ones
        wanted = replace(wanted, model=absolute(wanted.frame))
    cuts = boxes(wanted.inputs(task.fuzzy), task.alpha)
    scheme = task.scheme if wanted.linear is not None else task.integrator
    flow = wanted.flow(cuts.names, task.duration, task.step, scheme)
    return UnitFlow(flow, cuts, task.relative and task.certify is None).scale


def wanted_errors(wanted: Structure, task: EnvelopeTask) -> Iterator[str]:
    """A line on the error, or gap, that is wanted of each output; none without a tolerance."""
    if task.method not in WITH_TOLERANCE:
        return
    asked = task.tolerance if task.certify is None else task.certify
    each = ", ".join(
        f"{name} {engineering(float(share * asked), Output(name).unit, digits=2)}"
        for name, share in zip(wanted.outputs, shares_of_tolerance(wanted, task), strict=True)
    )
    yield f"envelope: wanted {'error' if task.certify is None else 'gap'} up to {each}"


def coarse_step(wanted: Structure, task: EnvelopeTask) -> Iterator[Problem]:
    """Step that cannot resolve the fastest mode, with its phase error."""
    if wanted.linear is None or task.scheme == "exact":
        return
    found = guard(wanted.linear, task.step, task.duration)
    if not found.ok:
        yield Problem("envelope.step", found.message.removeprefix("step: "))


def coarse_tolerance(wanted: Structure, task: EnvelopeTask) -> Iterator[Problem]:
    """Tolerance or gap that exceeds a hundredth of an output's peak."""
    if task.method not in WITH_TOLERANCE:
        return
    inputs = wanted.inputs(task.fuzzy)
    scheme = "exact" if wanted.linear is not None else task.integrator
    flow = wanted.flow(tuple(inputs), task.duration, task.step, scheme)
    if task.certify is not None:
        gap = tolerance_guard(UnitFlow(flow, boxes(inputs, (0.0,))), task.certify)
        if not gap.ok:
            what = (
                f"{task.certify:.3g} m lets bounds of {gap.output} be wide by {100 * gap.share:.3g}"
                " % of its peak, more than 1 %"
            )
            less = f"{0.01 * task.certify / gap.share:.2g} m would be 1 %, if it can be proved"
            yield Problem("envelope.certify", f"{what}; {less}: envelope --certify tells")
        return
    found = tolerance_guard(UnitFlow(flow, boxes(inputs, (0.0,)), task.relative), task.tolerance)
    if not found.ok:
        own = "envelope.tolerance" if wanted.linear else "pendulum.tolerance"
        key = "envelope.relative_tolerance" if task.relative else own
        cure = "envelope.relative_tolerance = 0.001"
        told = found.message.replace("a relative tolerance such as 0.001", cure)
        yield Problem(key, told.removeprefix("tolerance: "))


def coarse_nodes(wanted: Structure, task: EnvelopeTask) -> Iterator[Problem]:
    """Nodes so far apart that peaks may lie between them by over a hundredth."""
    if wanted.linear is None:
        return
    slowest = float(frequencies(wanted.linear)[0])
    # of a cosine whose peak lies in the middle between two nodes
    missed = 1 - cos(min(pi, slowest * task.step) / 2)
    if missed > MISSED:
        what = (
            f"{task.step:g} s between nodes and a first natural period of {2 * pi / slowest:.3g} s:"
            f" up to {100 * missed:.0f} % of a peak may lie between two nodes; take at most"
            f" {below(2 * acos(1 - MISSED) / slowest)} s"
        )
        yield Problem("envelope.step", what)


def coarse_outputs(wanted: Structure, task: EnvelopeTask) -> Iterator[Problem]:
    """Outputs whose peaks are bounded between nodes some hundredths higher than at them."""
    if wanted.linear is None:
        return
    flow = wanted.flow((), task.duration, task.step, "exact")
    size, nothing = np.abs(flow.values(np.zeros((1, 0)))[0]), np.zeros((1, 0))
    peak = np.maximum(size.max(0), 1e-300)
    added = within_steps(size, stray(flow, nothing)).max(0) / peak - 1
    coarse = [k for k in np.argsort(-added) if added[k] > ADDED and size[:, k].any()]
    if coarse:
        each = ", ".join(f"{flow.outputs[k]} {100 * added[k]:.2g} %" for k in coarse)
        parts = ceil((added[coarse[0]] / ADDED) ** 0.5)  # it falls with the square
        left = f"{task.step / parts:.3g} s leaves some {100 * added[coarse[0]] / parts**2:.2g} %"
        what = f"{task.step:g} s between nodes leaves peaks between them open by some {each}"
        yield Problem("envelope.step", f"{what}; {left}")


def guard_against(wanted: Structure, task: EnvelopeTask, *, strict: bool) -> None:
    """Warn of what is coarse about an envelope.

    Raises:
        BadInput: `strict`, and something is.
    """
    found = list(rough(wanted, task))
    if found and strict:
        raise BadInput(found)
    for problem in found:
        say(f"warning: {problem}")


MANY = 5
"""Inputs from which on a proof may take minutes."""


def too_many(key: str, wanted: Structure, task: EnvelopeTask) -> Iterator[Problem]:
    """The problem that a proof is asked for with too many inputs, by the key that asks."""
    names = wanted.inputs(task.fuzzy)
    if len(names) > MOST_PARAMETERS:
        what = f"proofs are affordable up to {MOST_PARAMETERS} fuzzy inputs, and there are"
        cure = "fewer in [envelope] fuzzy, or no proof: envelopes and peaks need none"
        if key == "decision":
            cure = f"fewer in [envelope] fuzzy, or no [decision]: {BY_PEAKS}"
        yield Problem(key, f"{what} {len(names)}", ", ".join(names), cure)


BY_PEAKS = (
    "peaks.csv, which report --csv writes, then judges a limit: below 'least peak at nodes (bound)'"
    " less its error every motion exceeds it, above 'greatest peak at nodes' and its error every"
    " motion keeps it, which is searched and not proved"
)


def estimated_reason(wanted: Structure, task: EnvelopeTask) -> str:
    """Why bounds will be estimated where no proof is asked for; empty where one will be tried."""
    count = len(wanted.inputs(task.fuzzy))
    if wanted.linear is None or task.certify is not None or task.method != "auto":
        return ""
    if count > MOST_PARAMETERS:
        what = f"proofs are affordable up to {MOST_PARAMETERS} fuzzy inputs, and there are {count}"
        return f"{what}; fewer can be proved"
    if reason := unproved_reason(wanted, task):
        return reason
    if count < MANY:
        return ""
    return (
        f"a proof with {count} fuzzy inputs may take minutes and is then not tried unasked;"
        " envelope.certify asks for one, which with a wide gap may take less time than estimated"
        " bounds, and fewer fuzzy inputs are proved at once"
    )


def unproved_reason(wanted: Structure, task: EnvelopeTask) -> str:
    """Why the bounds of a linear structure will not be guaranteed; empty if that is not known."""
    if wanted.linear is None:
        return ""
    cuts = boxes(wanted.inputs(task.fuzzy), task.alpha)
    ends = {name: (cuts.lower[0, k], cuts.upper[0, k]) for k, name in enumerate(cuts.names)}
    try:
        degrees(wanted.linear, ends)
    except UnprovedError as error:
        return str(error)
    return ""
