"""Errors of time steps in an envelope, at nodes and between them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from alphacut.frame.boxes import UnitFlow
from alphacut.frame.dynamics.flow import Flow, LinearFlow, StepError
from alphacut.frame.envelope import Envelope
from alphacut.fuzzy.arrays import Array

OPTIMA = 64
"""Points at which bounds are reached that are looked at besides, at most."""
MARGIN = 1.5
"""Factor on the largest error or stray at these, since other points of the box may exceed it."""
DIVERGED = 10.0
"""Error of a scheme, as a multiple of the motion's peak, from which on it has left the motion."""
AT_ONCE = 16
"""Trajectories that are held at once."""
FLOOR = 0.1
"""Least stray of a step, as a share of the largest of all steps."""


def step_error(flow: UnitFlow) -> Array:
    """Estimate of the largest time-stepping error so far, from modal values and corners, (T, m).

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


def with_step_error(of: Envelope, flow: UnitFlow, steps: Array) -> Envelope:
    """The envelope with the time-stepping error in its errors.

    Args:
        of: The envelope of the scheme's trajectories.
        flow: These trajectories.
        steps: From `step_error`, shape (T, m).
    """
    if isinstance(flow.flow, LinearFlow) and not flow.flow.exact:
        steps = np.maximum(steps, _at_bounds(of, flow.flow))
    alike = [unit == flow.units[flow.reference] for unit in flow.units]
    error, basis = of.error + steps, of.basis
    if steps.any():
        basis = (*basis, f"{flow.flow.method} steps of {flow.time[1]:g} s")
    facts = {"step_error": float(steps[:, alike].max()), **of.facts}
    facts["estimated_error"] = float((error / flow.scale).max())
    return replace(of, error=error, basis=basis, facts=facts)


def _at_bounds(of: Envelope, flow: LinearFlow) -> Array:
    """Errors of a linear scheme from some points at which bounds are reached, (T, m).

    A structure may resonate between the corners, and the scheme at other parameters than the truth.
    """
    at, d = np.stack([of.lower_at, of.upper_at]), len(of.inputs)
    peaks = np.abs([of.lower, of.upper]).argmax(2)[:, :, None, :, None]
    highest = np.take_along_axis(at, peaks, 2).reshape(-1, d)
    others = np.random.default_rng(0).permutation(np.unique(at.reshape(-1, d), axis=0))
    _, error = flow.deviations(np.unique(np.vstack([highest, others[:OPTIMA]]), axis=0))
    return np.asarray(MARGIN * np.maximum.accumulate(error.max(0), axis=0))


def with_stray(of: Envelope, flow: UnitFlow) -> Envelope:
    """The envelope with an estimate of what lies between its nodes; a proof is left as it is."""
    if of.between is not None:
        return of
    corners = flow.boxes.probes
    between = stray(flow.flow, np.vstack([corners, (corners + flow.boxes.modal) / 2]))
    facts = {**of.facts, "between_nodes": float((between / flow.scale).max())}
    return replace(of, between=between, facts=facts)


def stray(flow: Flow, points: Array) -> Array:
    """Estimate of how far outputs stray from straight lines between nodes, shape (T, m).

    Row j is that of the step that ends at node j, 0 for the first node.

    Args:
        flow: The trajectories.
        points: Parameters of those that are looked at, shape (S, d), in SI units.
    """
    pieces = np.array_split(points, -(-len(points) // AT_ONCE))
    off = np.max([_off(flow, some) for some in pieces], axis=0)
    # where the trajectories looked at are straight, others are not
    near = [np.roll(off, k, 0) for k in (-1, 0, 1)]
    near.append(np.broadcast_to(FLOOR * off.max(0), off.shape))
    return np.concatenate([np.zeros((1, off.shape[1])), MARGIN * np.max(near, 0)])


def _off(flow: Flow, points: Array) -> Array:
    """Largest distance of trajectories from straight lines in each step, shape (T − 1, m)."""
    finer, parts = flow.finer()
    fine = finer.values(points)
    ends = fine[:, ::parts]
    share = (np.arange(1, parts) / parts)[:, None]
    inner = fine[:, :-1].reshape(len(fine), -1, parts, fine.shape[-1])[:, :, 1:]
    straight = ends[:, :-1, None] * (1 - share) + ends[:, 1:, None] * share
    return np.asarray(np.abs(inner - straight).max((0, 2)))
