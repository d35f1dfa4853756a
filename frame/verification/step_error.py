"""Errors of time steps in an envelope, at nodes and between them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from alphacut.frame.boxes import UnitFlow
from alphacut.frame.dynamics.flow import Flow, StepError
from alphacut.frame.dynamics.nonlinear import LagrangianFlow
from alphacut.frame.envelope import Envelope
from alphacut.frame.verification.reference_motion import ReferenceMotion
from alphacut.fuzzy.arrays import Array

OPTIMA = 64
"""Points at which bounds are reached that are looked at besides, at most."""
MARGIN = 1.5
"""Factor on the largest error or stray at these, since other points of the box may exceed it."""
DIVERGED = 10.0
"""Error of a scheme, as a multiple of the motion's peak, from which on it has left the motion."""
REFERENCES = 32
"""Points at peaks that are compared with a reference motion, at most."""
COARSE = 0.02
"""Error at such a point, as a share of the output's peak, from which on a step is refused: bounds
are then attained by other motions than those they name. A tenth of it is enough."""
FINEST = 64
"""Most parts of a step that are tried to find a step which would do."""
AT_ONCE = 16
"""Trajectories that are held at once."""
FLOOR = 0.1
"""Least stray of a step, as a share of the largest of all steps."""


def step_error(flow: UnitFlow) -> Array:
    """Estimate of the largest time-stepping error so far, from nominal values and corners, (T, m).

    Of a linear structure the distance from the exact propagator, else the distance from half the
    step, extrapolated by the scheme's order.

    Raises:
        StepError: A scheme has left the motion.
    """
    if flow.flow.exact:
        return np.zeros((len(flow.time), len(flow.outputs)))
    values, error = flow.flow.deviations(flow.boxes.probes)
    so_far: Array = np.maximum.accumulate(error.max(0), axis=0)
    peak = np.abs(values).max((0, 1))
    for name, reached, least in zip(flow.outputs, so_far[-1], peak, strict=True):
        if reached > DIVERGED * least > 0:
            what = f"step: its error, {reached:.2g}, passes the peak of {name}, {least:.2g}"
            raise StepError(what, "take a smaller step")
    return MARGIN * so_far


def with_step_error(bounds: Envelope, flow: UnitFlow, steps: Array) -> Envelope:
    """The envelope with the time-stepping error in its errors.

    Args:
        bounds: The envelope of the scheme's trajectories.
        flow: These trajectories.
        steps: From `step_error`, shape (T, m).
    """
    if not flow.flow.exact:
        steps = np.maximum(steps, _error_at_optima(bounds, flow.flow))
    alike = [unit == flow.units[flow.reference] for unit in flow.units]
    error, basis = bounds.error + steps, bounds.basis
    if steps.any():
        basis = (*basis, f"{flow.flow.method} steps of {flow.time[1]:g} s")
    facts = {"step_error": float(steps[:, alike].max()), **bounds.facts}
    facts["estimated_error"] = float((error / flow.scale).max())
    return replace(bounds, error=error, basis=basis, facts=facts)


def _error_at_optima(bounds: Envelope, flow: Flow) -> Array:
    """Estimate of the largest time-stepping error so far, from inputs that reach bounds, (T, m).

    Corners alone do not suffice: between them a structure may resonate, which the scheme does at
    other parameters than the exact motion, or a motion may pass near an unstable equilibrium. Of a
    system that is not linear the peaks are compared with a method of another kind, too.

    Raises:
        StepError: The step is too coarse there.
    """
    at, d = np.stack([bounds.lower_at, bounds.upper_at]), len(bounds.inputs)
    peaks = np.abs([bounds.lower, bounds.upper]).argmax(2)[:, :, None, :, None]
    highest = np.unique(np.take_along_axis(at, peaks, 2).reshape(-1, d), axis=0)
    further_points = np.random.default_rng(0).permutation(np.unique(at.reshape(-1, d), axis=0))
    points = np.unique(np.vstack([highest, further_points[:OPTIMA]]), axis=0)
    error = flow.deviations(points)[1].max(0)
    if isinstance(flow, LagrangianFlow):
        error = np.maximum(error, _from_reference(bounds, flow, highest[:REFERENCES]))
    return np.asarray(MARGIN * np.maximum.accumulate(error, axis=0))


def _from_reference(bounds: Envelope, flow: LagrangianFlow, points: Array) -> Array:
    """Largest distance of trajectories at points (S, d) from reference motions, (T, m).

    Raises:
        StepError: It passes `COARSE` of an output's peak; the message says which step would do.
    """
    reference, parameters = ReferenceMotion(flow.system), flow.system.parameters
    truth = np.stack(
        [
            reference.outputs(
                {**parameters, **dict(zip(flow.names, point, strict=True))}, bounds.time
            )
            for point in points
        ]
    )
    off = np.abs(flow.values(points) - truth)
    share = off.max(1) / np.maximum(np.abs(truth).max((0, 1)), 1e-300)
    if (share > COARSE).any():
        worst, output = np.unravel_index(int(share.argmax()), share.shape)
        at = ", ".join(f"{x} = {y:.6g}" for x, y in zip(flow.names, points[worst], strict=True))
        what = f"step: {flow.step:g} s is too coarse where a bound is attained, at {at}: there"
        what += f" {flow.outputs[output]} is off by {off[worst, :, output].max():.3g}"
        raise StepError(
            what, _sufficient_step(flow, points[worst : worst + 1], truth[worst : worst + 1])
        )
    return np.asarray(off.max(0))


def _sufficient_step(flow: LagrangianFlow, point: Array, truth: Array) -> str:
    """Cure in words: the largest halved step whose trajectory is within COARSE / 10 of the peaks.

    Args:
        flow: The trajectories by the refused step.
        point: Parameters, shape (1, d), in SI units.
        truth: Reference response there, shape (1, T, m).
    """
    fine, parts = flow, 1
    while parts < FINEST:
        fine, parts = fine.finer()[0], 2 * parts
        off = np.abs(fine.values(point)[:, ::parts] - truth).max(1)
        if (off <= COARSE / 10 * np.abs(truth).max(1)).all():
            return f"a step of {fine.step:g} s would do"
    return f"no step down to {fine.step:g} s would do; take a shorter duration or narrower inputs"


def with_node_deviation(bounds: Envelope, flow: UnitFlow) -> Envelope:
    """The envelope with an estimate of what lies between its nodes; a proof is left as it is."""
    if bounds.between is not None:
        return bounds
    corners = flow.boxes.probes
    between = node_deviation(flow.flow, np.vstack([corners, (corners + flow.boxes.modal) / 2]))
    facts = {**bounds.facts, "between_nodes": float((between / flow.scale).max())}
    return replace(bounds, between=between, facts=facts)


def node_deviation(flow: Flow, points: Array) -> Array:
    """Estimate of how far outputs stray from straight lines between nodes, shape (T, m).

    Row j is that of the step that ends at node j, 0 for the first node.

    Args:
        flow: The trajectories.
        points: Parameters of those that are looked at, shape (S, d), in SI units.
    """
    pieces = np.array_split(points, -(-len(points) // AT_ONCE))
    off = np.max([_chord_deviation(flow, some) for some in pieces], axis=0)
    # where the trajectories looked at are straight, others are not
    near = [np.roll(off, k, 0) for k in (-1, 0, 1)]
    near.append(np.broadcast_to(FLOOR * off.max(0), off.shape))
    return np.concatenate([np.zeros((1, off.shape[1])), MARGIN * np.max(near, 0)])


def _chord_deviation(flow: Flow, points: Array) -> Array:
    """Largest distance of trajectories from straight lines in each step, shape (T − 1, m)."""
    finer, parts = flow.finer()
    fine = finer.values(points)
    ends = fine[:, ::parts]
    share = (np.arange(1, parts) / parts)[:, None]
    inner = fine[:, :-1].reshape(len(fine), -1, parts, fine.shape[-1])[:, :, 1:]
    straight = ends[:, :-1, None] * (1 - share) + ends[:, 1:, None] * share
    return np.asarray(np.abs(inner - straight).max((0, 2)))
