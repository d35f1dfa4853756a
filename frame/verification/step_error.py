"""Errors of time steps in an envelope, at nodes and between them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Array, Mask
from alphacut.base.errors import FailedError
from alphacut.frame.boxes import UnitFlow
from alphacut.frame.dynamics.flow import Flow, StepError
from alphacut.frame.dynamics.nonlinear import LagrangianFlow
from alphacut.frame.envelope import Envelope
from alphacut.frame.records.history import History
from alphacut.frame.response.straying import load_deviation, load_excess
from alphacut.frame.structures.lagrangian import LagrangianSystem
from alphacut.frame.structures.linear import evaluate, has_matrices
from alphacut.frame.structures.loads import distinct_histories
from alphacut.fuzzy.result import Nature

OPTIMA = 64
"""Points at which bounds are reached that are looked at besides, at most."""
MARGIN = 1.5
"""Factor on the largest error or stray at these, since other points of the box may exceed it."""
DIVERGED = 10.0
"""Error of a scheme, as a multiple of the motion's peak, from which on it has left the motion."""
REFERENCES = 32
"""Points at peaks that are compared with a reference motion, at most."""
COARSE = 0.02
"""Error at such a point, as a fraction of the output's peak, from which on a step is refused:
bounds are then attained by other motions than those they name."""
CHUNK = 16
"""Trajectories that are held at once."""
FLOOR = 0.1
"""Least stray of a step, as a fraction of the largest of all steps."""
RELATIVE = 1e-11
"""Error of a step of the reference motion as a fraction of the state."""


def step_error(flow: UnitFlow) -> Array:
    """Return the estimated time-stepping error of each output up to each node, shape (T, m).

    It is `MARGIN` times the largest error (`Flow.deviations`) at nominal values and corners.

    Raises:
        StepError: The error of an output exceeds `DIVERGED` times its peak.
    """
    if flow.flow.exact:
        return np.zeros((len(flow.time), len(flow.outputs)))
    values, error = flow.flow.deviations(flow.boxes.probes)
    running_error: Array = np.maximum.accumulate(error.max(0), axis=0)
    peaks = np.abs(values).max((0, 1))
    for name, last_error, peak in zip(flow.outputs, running_error[-1], peaks, strict=True):
        if last_error > DIVERGED * peak > 0:
            what = f"step: its error, {last_error:.2g}, passes the peak of {name}, {peak:.2g}"
            raise StepError(what, "take a smaller step")
    return MARGIN * running_error


def with_step_error(bounds: Envelope, flow: UnitFlow, steps: Array) -> Envelope:
    """Return the envelope of a flow's trajectories with the time-stepping error in its errors.

    `steps` (T, m) are from `step_error`. The fact `step_error` is the largest of a displacement.
    """
    if not flow.flow.exact:
        steps = np.maximum(steps, _error_at_optima(bounds, flow.flow))
    has_reference_unit = [unit == flow.units[flow.reference] for unit in flow.units]
    error, basis = bounds.error + steps, bounds.basis
    if steps.any():
        basis = (*basis, f"midpoint steps of {flow.time[1]:g} s")
    facts = {"step_error": float(steps[:, has_reference_unit].max()), **bounds.facts}
    if bounds.nature is not Nature.ATTAINED:  # else how far other motions go is not known
        facts["estimated_error"] = float((error / flow.scale).max())
    return replace(bounds, error=error, basis=basis, facts=facts)


def _error_at_optima(bounds: Envelope, flow: Flow) -> Array:
    """Return the time-stepping error as `step_error` does, at inputs that reach bounds."""
    # Corners alone do not suffice: between them a structure may resonate, which the scheme does at
    # other parameters than the exact motion, or a motion may pass near an unstable equilibrium. Of
    # a system that is not linear the peaks are compared with a method of another kind, too.
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
    """Return the largest distance of motions at points (S, d) from reference motions, (T, m)."""
    named = [dict(zip(flow.names, point, strict=True)) for point in points]
    inputs = [{**flow.system.parameters, **x} for x in named]
    truth = reference_motions(flow.system, inputs, bounds.time)
    error = np.abs(flow.values(points) - truth)
    relative_error = error.max(1) / np.maximum(np.abs(truth).max((0, 1)), 1e-300)
    if (relative_error > COARSE).any():
        worst, output = np.unravel_index(int(relative_error.argmax()), relative_error.shape)
        at = ", ".join(f"{x} = {y:.6g}" for x, y in zip(flow.names, points[worst], strict=True))
        what = f"step: {flow.step:g} s is too coarse where a bound is attained, at {at}: there"
        what += f" {flow.outputs[output]} is off by {error[worst, :, output].max():.3g}"
        raise StepError(what, "take a smaller step, a shorter duration or narrower inputs")
    return np.asarray(error.max(0))


def with_node_deviation(bounds: Envelope, flow: UnitFlow) -> Envelope:
    """Return the envelope with an estimated deviation between nodes, if it has no proved one."""
    if bounds.between is not None:
        return bounds
    corners = flow.boxes.probes
    between = node_deviation(flow.flow, np.vstack([corners, (corners + flow.boxes.nominal) / 2]))
    facts = {**bounds.facts, "between_nodes": float((between / flow.scale).max())}
    return replace(bounds, between=between, facts=facts)


def node_deviation(flow: Flow, points: Array) -> Array:
    """Return the estimated distance of outputs from straight lines between nodes, shape (T, m).

    Row j is that of the step that ends at node j, 0 for the first node. It is `MARGIN` times the
    largest of the step and its neighbours, and of `FLOOR` times that of any step, of trajectories
    at parameters (S, d) in SI units.

    In a step in which a force jumps, so does an acceleration. It is far from the straight line
    then, but hardly beyond its values at both ends: there the distance beyond these is taken.
    """
    finer, parts = flow.finer()
    fraction = (np.arange(1, parts) / parts)[:, None]
    deviation: Array = np.zeros((len(flow.time) - 1, len(flow.outputs)))
    has_jump: Mask = np.zeros(deviation.shape, bool)
    for chunk in np.array_split(points, -(-len(points) // CHUNK)):
        fine = finer.values(chunk)
        ends = fine[:, ::parts]
        inner = fine[:, :-1].reshape(len(fine), -1, parts, fine.shape[-1])[:, :, 1:]
        chord = ends[:, :-1, None] * (1 - fraction) + ends[:, 1:, None] * fraction
        off_chord = np.abs(inner - chord).max((0, 2))
        above = inner.max(2) - np.maximum(ends[:, :-1], ends[:, 1:])
        below = np.minimum(ends[:, :-1], ends[:, 1:]) - inner.min(2)
        beyond_ends = np.maximum(np.maximum(above, below).max(0), 0.0)
        fed = _fed_through(flow, chunk)
        has_jump = has_jump | (fed.jumps[:, :, None] & (fed.amplitude > 0)).any(0)
        off = np.where(has_jump, beyond_ends, off_chord)
        deviation = np.maximum(deviation, off + _fed_between(fed, finer.time, parts))
    # Where these trajectories are straight, others may bend, but a jump is in the same step of all.
    smooth = np.where(has_jump, 0.0, deviation)
    padded = np.pad(smooth, ((1, 1), (0, 0)))
    candidates = [padded[:-2], deviation, padded[2:]]
    candidates.append(np.broadcast_to(FLOOR * smooth.max(0), deviation.shape))
    return np.concatenate([np.zeros((1, deviation.shape[1])), MARGIN * np.max(candidates, 0)])


class _FedThrough(NamedTuple):
    """What H histories of forces add to m accelerations at once."""

    histories: list[History]
    amplitude: Array  # largest magnitude that a unit of each adds, (H, 1, m)
    jumps: Mask  # whether each jumps in a step, or at its end, (H, T − 1)


def _fed_through(flow: Flow, points: Array) -> _FedThrough:
    """Return what forces add to outputs at once, at any of the parameters (S, d)."""
    histories = list[History]()
    amplitude = np.zeros((0, 1, len(flow.outputs)))
    if has_matrices(flow.system):
        matrices, _ = evaluate(flow.system, flow.names, points, derivatives=False)
        if matrices.feeds is not None:
            histories = distinct_histories(flow.system.loads)
            amplitude = np.abs(matrices.feeds.value).max(0).T[:, None]
    jumps = np.zeros((len(histories), len(flow.time) - 1), bool)
    for row, history in zip(jumps, histories, strict=True):
        row[:] = history.jumps_in_steps(flow.time)[1:]
    return _FedThrough(histories, amplitude, jumps)


def _fed_between(fed: _FedThrough, time: Array, parts: int) -> Array:
    """Return what forces add to outputs between finer nodes, (steps, m), `parts` to a step.

    A force may be zero at all of these and not between them.
    """
    steps = (len(time) - 1) // parts
    added = np.zeros((steps, fed.amplitude.shape[-1]))
    for history, amplitude, jumps in zip(*fed, strict=True):
        off_chord, beyond_ends = (
            f(history, time)[1:].reshape(steps, parts).max(1) for f in (load_deviation, load_excess)
        )
        added += np.where(jumps, beyond_ends, off_chord)[:, None] * amplitude
    return added


def reference_motions(
    system: LagrangianSystem, points: Sequence[Mapping[str, float]], times: Array
) -> Array:
    """Return outputs at parameters by name and times from the start, (S, T, m), to test steps with.

    Hamilton's equations in coordinates q and momenta π by Dormand and Prince's method of order 8
    (Hairer, Nørsett, Wanner 1993), with SymPy's own functions: it shares neither scheme nor
    compiled code with the midpoint rule that it judges.

    Raises:
        FailedError: The integration does not reach the last time.
    """
    import sympy
    from scipy.integrate import solve_ivp

    eq, n = system.symbols, system.coordinates
    momenta = sympy.Matrix(sympy.symbols(f"pi:{n}", real=True))
    velocity, (q0, v0) = eq.velocity(momenta), system.start()
    moving = dict(zip(eq.v, velocity, strict=True))
    starting = dict(zip([*eq.q, *eq.v], [*q0, *v0], strict=True))
    arguments = [*eq.q, *momenta, *eq.p.values()]
    rates = sympy.lambdify(arguments, [*velocity, *eq.push.subs(moving)], "math")
    start_at = sympy.lambdify([*eq.p.values()], [*q0, *eq.momentum.subs(starting)], "math")
    observed = [system.output(name, list(velocity)) for name in system.outputs]
    outputs, motions = sympy.lambdify(arguments, observed, "math"), []
    for parameters in points:
        p = [float(parameters[name]) for name in eq.p]
        start = np.array(start_at(*p), float)
        # sizes of the states, for the absolute tolerance
        speed = np.abs(np.array(rates(*start, *p), float))
        size = np.maximum(np.abs(start), speed * float(times[-1]))
        found = solve_ivp(
            lambda _, state, p=p: rates(*state, *p),
            (float(times[0]), float(times[-1])),
            start,
            method="DOP853",
            t_eval=times,
            rtol=RELATIVE,
            atol=RELATIVE * np.where(size > 0, size, size.max() or 1.0),
        )
        if not found.success:
            raise FailedError(f"the reference motion: {found.message}")
        motions.append([outputs(*state, *p) for state in found.y.T])
    return np.array(motions, float)
