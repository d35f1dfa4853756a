"""Error of time stepping and of a reduction in an envelope, and steps too long for the scheme."""

from __future__ import annotations

import warnings
from dataclasses import replace
from functools import singledispatch

import numpy as np

from alphacut.frame.boxes import Boxes, UnitFlow
from alphacut.frame.calculus.jet import Array
from alphacut.frame.calculus.numbers import below
from alphacut.frame.checks.corners import signs
from alphacut.frame.checks.tolerance import LIMIT
from alphacut.frame.dynamics.flow import Flow, LinearFlow, StepError
from alphacut.frame.dynamics.integrators import Exact
from alphacut.frame.dynamics.nonlinear import SCHEMES, LagrangianFlow
from alphacut.frame.envelope import Envelope
from alphacut.frame.reduced.reduction import ReducedStructure
from alphacut.frame.structures.linear import evaluate
from alphacut.frame.structures.modes import state_matrix
from alphacut.frame.structures.quantities import Output

CORNERS = 16
"""Corners of the widest box that are looked at, at most."""
OPTIMA = 64
"""Points at which bounds are reached that are looked at besides, at most."""
MARGIN = 1.5
"""Factor on the largest error at these, since other points of the box may exceed it."""
GROWTH = 1e-6
"""Growth of a motion within a step that counts as rounding."""
DIVERGED = 10.0
"""Error of a scheme, as a multiple of the motion's peak, from which on it has left the motion."""
REDUCED = 2.0
"""Factor on the error of a reduction besides: it is sharper between corners than that of steps."""


def probes(cuts: Boxes) -> Array:
    """The modal parameters and corners of the widest box, shape (S, d), in SI units."""
    points: Array = np.unique(
        np.vstack([cuts.modal, cuts.to_physical(signs(len(cuts.names), CORNERS))]), axis=0
    )
    return points


def step_error(flow: UnitFlow) -> Array:
    """Estimate of the largest time-stepping error so far, from modal values and corners, (T, m).

    Of a linear structure the distance from the exact propagator, of a reduced one from the motion
    of the full structure; else the distance from half the step, extrapolated by the scheme's order.

    Raises:
        StepError: A scheme has left the motion.
    """
    if exact(flow.flow):
        return np.zeros((len(flow.time), len(flow.outputs)))
    values, error = deviations(flow.flow, probes(flow.boxes))
    so_far: Array = np.maximum.accumulate(error.max(0), axis=0)
    peak = np.abs(values).max((0, 1))
    for name, reached, least in zip(flow.outputs, so_far[-1], peak, strict=True):
        if reached > DIVERGED * least > 0:
            raise StepError(
                f"step: its error, {reached:.2g}, passes the peak of {name}, {least:.2g}, many"
                " times; take a smaller step"
            )
    return MARGIN * so_far


def step_error_at_bounds(found: Envelope, flow: UnitFlow, steps: Array) -> Array:
    """Errors of a linear scheme from the points at which bounds are reached besides, (T, m).

    A structure may resonate between the corners, and the scheme at other parameters than the truth.

    Args:
        found: The envelope of the scheme's trajectories.
        flow: These trajectories.
        steps: From `step_error`, shape (T, m).
    """
    linear = isinstance(flow.flow, LinearFlow) and not isinstance(
        flow.flow.system, ReducedStructure
    )
    if exact(flow.flow) or not linear:
        return steps
    at, d = np.stack([found.lower_at, found.upper_at]), len(found.parameters)
    peaks = np.abs([found.lower, found.upper]).argmax(2)[:, :, None, :, None]
    highest = np.take_along_axis(at, peaks, 2).reshape(-1, d)
    others = np.random.default_rng(0).permutation(np.unique(at.reshape(-1, d), axis=0))
    points = np.unique(np.vstack([highest, others[:OPTIMA]]), axis=0)
    _, error = deviations(flow.flow, points)
    return np.asarray(np.maximum(steps, MARGIN * np.maximum.accumulate(error.max(0), axis=0)))


def exact(flow: Flow) -> bool:
    """Whether trajectories have no error but rounding."""
    if not isinstance(flow, LinearFlow) or isinstance(flow.system, ReducedStructure):
        return False
    return isinstance(flow.integrator, Exact)


@singledispatch
def deviations(flow: Flow, points: Array) -> tuple[Array, Array]:
    """More accurate trajectories at `points` (S, d), and the flow's errors, (S, T, m).

    Those of a reduced structure are at its own `judges`, whose modes are kept.
    """
    values = flow.values(points)
    return values, np.zeros_like(values)


@deviations.register
def _(flow: LinearFlow, points: Array) -> tuple[Array, Array]:
    if isinstance(flow.system, ReducedStructure):
        whole, judges = replace(flow, names=tuple(flow.system.parameters)), flow.system.judges
        full = np.array([flow.system.full.trajectories(point, flow.time) for point in judges])
        found = whole.values(np.array([list(point.values()) for point in judges]))
        return full, REDUCED * np.abs(found - full)
    truth = replace(flow, integrator=Exact()).values(points)
    return truth, np.abs(flow.values(points) - truth)


@deviations.register
def _(flow: LagrangianFlow, points: Array) -> tuple[Array, Array]:
    fine, gain = flow.halved().values(points)[:, ::2], 2.0 ** SCHEMES[flow.scheme]
    return fine, np.abs(flow.values(points) - fine) * gain / (gain - 1)


def with_step_error(found: Envelope, flow: UnitFlow, scheme: str, steps: Array) -> Envelope:
    """The envelope with the time-stepping error in its facts and errors; certified bounds grow.

    Args:
        found: The envelope of the scheme's trajectories.
        flow: These trajectories.
        scheme: Name of the scheme.
        steps: From `step_error`, shape (T, m).
    """
    alike = [
        Output(name).unit == Output(flow.outputs[flow.reference]).unit for name in flow.outputs
    ]
    facts: dict[str, float | str] = {
        "integrator": scheme,
        "step_error": float(steps[:, alike].max()),
        **found.facts,
    }
    facts |= _dominance(found, flow, steps.max(0))
    error = found.error
    if error is not None and found.inner_lower is None and steps.any():
        error = error + steps
        if "estimated_error" in facts:
            facts["estimated_error"] = float((error / flow.scale).max())
    if found.inner_lower is not None and found.inner_upper is not None and steps.any():
        found = replace(
            found,
            lower=found.lower - steps,
            upper=found.upper + steps,
            inner_lower=found.inner_lower + steps,
            inner_upper=found.inner_upper - steps,
        )
        error = None if error is None else error + 2 * steps
    return replace(found, error=error, facts=facts)


def source(flow: Flow) -> tuple[str, str]:
    """What makes trajectories inexact, and what lessens that."""
    if not isinstance(flow, LinearFlow):
        return "time stepping", "take a smaller step, or a scheme of order 4"
    if isinstance(flow.integrator, Exact):
        return "the reduction to few shapes", "narrower supports may lessen it"
    return "time stepping", "take a smaller step; integrator exact has none"


def _dominance(found: Envelope, flow: UnitFlow, steps: Array) -> dict[str, str]:
    """A fact where time stepping adds more to some output than the search for the bounds."""
    gain = float(found.facts.get("gain", 0.0))
    own = gain * flow.scale if found.error is None else found.error.max((0, 1))
    ratio = np.divide(steps, own, out=np.zeros_like(steps), where=own > 0)
    worst = int(ratio.argmax())
    if ratio[worst] <= 1:
        return {}
    name, unit = flow.outputs[worst], Output(flow.outputs[worst]).unit.replace("SI", "")
    what, cure = source(flow.flow)
    return {
        "dominant_error": (
            f"{what}: {steps[worst]:.2g} {unit} of {name} against {own[worst]:.2g} {unit} of"
            f" the envelope; {cure}"
        )
    }


def warn_of_steps(found: Envelope, flow: UnitFlow, steps: Array) -> None:
    """Warn where trajectories are wrong, by `steps` (m,), by more than a hundredth of a peak."""
    peak = np.maximum(np.abs(found.lower), np.abs(found.upper)).max((0, 1))
    share = np.divide(steps, peak, out=np.zeros_like(steps), where=peak > 0)
    worst = int(share.argmax())
    if share[worst] > LIMIT:
        of = f"{steps[worst]:.2g}, {100 * share[worst]:.2g} % of the peak of {found.outputs[worst]}"
        what, cure = source(flow.flow)
        where = f"step: {found.time[1]:g} s leaves an" if what == "time stepping" else "the"
        warnings.warn(f"{where} error of {what} of {of}; {cure}", stacklevel=3)


def require_stable(flow: Flow, cuts: Boxes) -> None:
    """Refuses a step at which the scheme feeds energy into a linear structure that gains none.

    Raises:
        ValueError: A motion grows at the modal parameters or a corner of the widest box.
    """
    if not isinstance(flow, LinearFlow) or not np.isfinite(flow.integrator.stability_limit):
        return
    points = probes(cuts)
    matrices, _ = evaluate(flow.system, flow.names, points, derivatives=False)
    growth = np.abs(
        np.linalg.eigvals(flow.integrator.step_map(matrices, flow.step).transfer.value)
    ).max(-1)
    rate = np.linalg.eigvals(state_matrix(matrices).value)
    calm = flow.step * rate.real.max(-1) <= GROWTH
    worst = int(np.where(calm, growth, 0.0).argmax())
    if calm[worst] and growth[worst] > 1 + GROWTH:
        fastest = float(np.abs(rate[worst]).max())
        raise ValueError(
            f"step: {flow.step:g} s gives omega_max h = {fastest * flow.step:.3g}, where the scheme"
            f" {flow.integrator.name} is unstable; take at most some"
            f" {below(flow.integrator.stability_limit / fastest)} s, or the integrator exact"
            " or midpoint"
        )
