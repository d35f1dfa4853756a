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
from alphacut.frame.records.history import History
from alphacut.frame.response.chord_deviation import load_deviation, load_excess
from alphacut.frame.result import Envelope
from alphacut.frame.structures.lagrangian import LagrangianSystem
from alphacut.frame.structures.linear import evaluate, has_matrices
from alphacut.frame.structures.loads import distinct_histories
from alphacut.fuzzy.result import Nature

MARGIN = 1.5
"""Factor on the largest error or distance at some points, since other points of the box may exceed
it; tuned: a larger one would declare larger errors."""


def step_error(flow: UnitFlow) -> Array:
    """Return the estimated time-stepping error of each output up to each time node, shape (T, m).

    It is 1.5 times the largest distance from more accurate trajectories at nominal values and
    corners of the inputs, up to this node; 0 for a flow that is exact but for rounding. It is an
    estimate and not a bound.

    Args:
        flow: The response of a structure as a function of its inputs, with T time nodes and m
            outputs.

    Raises:
        StepError: The error of an output exceeds ten times its peak, if this is not 0, so that the
            scheme has left the trajectory; or a step did not converge.
        RefusedError: A trajectory does not exist, or is not finite.
    """
    if flow.flow.exact:
        return np.zeros((len(flow.time), len(flow.outputs)))
    values, error = flow.flow.deviations(flow.boxes.probes)
    running_error: Array = np.maximum.accumulate(error.max(axis=0), axis=0)
    peaks = np.abs(values).max(axis=(0, 1))
    for name, last_error, peak in zip(flow.outputs, running_error[-1], peaks, strict=True):
        if last_error > 10.0 * peak > 0:
            what = f"step: its error, {last_error:.2g}, passes the peak of {name}, {peak:.2g}"
            raise StepError(what, "take a smaller step")
    return MARGIN * running_error


def with_step_error(bounds: Envelope, flow: UnitFlow, steps: Array) -> Envelope:
    """Return the envelope of time-stepped trajectories with the time-stepping error in its errors.

    The error is the larger one of `steps` and of the estimate at inputs that attain bounds. A new
    envelope is returned; its fact "step_error" is the largest time-stepping error of the outputs in
    the unit of the reference output, the first displacement, and "estimated_error" the largest of
    all errors divided by the scale of tolerances. The latter is left out if the bounds are merely
    attained values.

    Args:
        bounds: Envelope of the trajectories of the scheme.
        flow: The trajectories as functions of the inputs.
        steps: Time-stepping error from `step_error`, shape (T, m).

    Raises:
        StepError: The step is too coarse for a trajectory that attains a bound.
        RefusedError: A trajectory does not exist, or is not finite.
        FailedError: The system is not linear, and the reference method for its peaks does not reach
            the last time.
    """
    if not flow.flow.exact:
        steps = np.maximum(steps, _error_at_optima(bounds, flow.flow))
    error = bounds.error + steps
    basis = bounds.basis
    if steps.any():
        basis = (*basis, f"midpoint steps of {flow.time[1]:g} s")
    has_reference_unit = [unit == flow.units[flow.reference] for unit in flow.units]
    facts = {"step_error": float(steps[:, has_reference_unit].max()), **bounds.facts}
    if bounds.nature is not Nature.ATTAINED:
        # Of attained bounds it is not known how far other trajectories go.
        facts["estimated_error"] = float((error / flow.scale).max())
    return replace(bounds, error=error, basis=basis, facts=facts)


def _error_at_optima(bounds: Envelope, flow: Flow) -> Array:
    """Return the estimated time-stepping error at inputs that attain bounds of an envelope, (T, m).

    It is 1.5 times the largest error up to each node. Corners alone do not suffice. Between them a
    structure may resonate, which the scheme does at other parameters than the exact trajectory, or
    a trajectory may pass near an unstable equilibrium. Of a system that is not linear the peaks are
    compared with a method of another kind, too.

    Args:
        bounds: The envelope, which names inputs for each level, time node and output.
        flow: Trajectories by the time-stepping scheme.

    Raises:
        StepError: The step is too coarse at inputs that attain a peak.
        RefusedError: A trajectory does not exist, or is not finite.
        FailedError: The method of another kind does not reach the last time.
    """
    d = len(bounds.inputs)
    inputs = np.stack([bounds.lower_at, bounds.upper_at])  # (2, A, T, m, d)
    peak_nodes = np.abs([bounds.lower, bounds.upper]).argmax(axis=2)
    at_peaks = np.take_along_axis(inputs, peak_nodes[:, :, np.newaxis, :, np.newaxis], axis=2)
    peak_inputs = np.unique(at_peaks.reshape(-1, d), axis=0)
    # Up to 64 of the other inputs are looked at besides, and up to 32 of those at peaks compared
    # with a reference, which limits the time.
    all_inputs = np.unique(inputs.reshape(-1, d), axis=0)
    further_inputs = np.random.default_rng(0).permutation(all_inputs)[:64]
    points = np.unique(np.vstack([peak_inputs, further_inputs]), axis=0)
    error = flow.deviations(points)[1].max(axis=0)
    if isinstance(flow, LagrangianFlow):
        error = np.maximum(error, _distance_from_reference(bounds, flow, peak_inputs[:32]))
    return np.asarray(MARGIN * np.maximum.accumulate(error, axis=0))


def _distance_from_reference(bounds: Envelope, flow: LagrangianFlow, points: Array) -> Array:
    """Return the largest distance of trajectories from those of a reference method, shape (T, m).

    Args:
        bounds: The envelope, for its T time nodes.
        flow: The trajectories by the time-stepping scheme.
        points: Inputs of S ≥ 1 trajectories, shape (S, d), in SI units, in the order of
            `flow.names`.

    Raises:
        StepError: A trajectory is off by more than a fiftieth of the output's peak. Bounds are then
            attained by other trajectories than those they name.
        FailedError: The reference method does not reach the last time.
        RefusedError: A trajectory does not exist, or is not finite.
    """
    inputs = []
    for point in points:
        named = dict(zip(flow.names, point, strict=True))
        inputs.append({**flow.system.parameters, **named})
    truth = reference_motions(flow.system, inputs, bounds.time)
    error = np.abs(flow.values(points) - truth)
    peaks = np.maximum(np.abs(truth).max(axis=(0, 1)), 1e-300)
    relative_error = error.max(axis=1) / peaks
    if (relative_error > 0.02).any():
        worst, output = np.unravel_index(int(relative_error.argmax()), relative_error.shape)
        at = ", ".join(f"{x} = {y:.6g}" for x, y in zip(flow.names, points[worst], strict=True))
        what = f"step: {flow.step:g} s is too coarse where a bound is attained, at {at}: there"
        what += f" {flow.outputs[output]} is off by {error[worst, :, output].max():.3g}"
        raise StepError(what, "take a smaller step, a shorter duration or narrower inputs")
    return np.asarray(error.max(axis=0))


def with_node_deviation(bounds: Envelope, flow: UnitFlow) -> Envelope:
    """Return the envelope with an estimate of how far outputs leave lines between time nodes.

    An envelope that has guaranteed bounds of this, `between`, is returned as it is. The estimate is
    taken at nominal values and corners of the inputs and halfway between these; the fact
    "between_nodes" is its largest value in comparison with the scale of tolerances.

    Args:
        bounds: The envelope.
        flow: Its trajectories as functions of the inputs.

    Raises:
        RefusedError: A trajectory does not exist, or is not finite.
        StepError: A time step of one did not converge.
    """
    if bounds.between is not None:
        return bounds
    corners = flow.boxes.probes
    halfway = (corners + flow.boxes.nominal) / 2
    between = node_deviation(flow.flow, np.vstack([corners, halfway]))
    facts = {**bounds.facts, "between_nodes": float((between / flow.scale).max())}
    return replace(bounds, between=between, facts=facts)


def node_deviation(flow: Flow, points: Array) -> Array:
    """Estimate the distance of outputs from straight lines between time nodes.

    It is 1.5 times the largest distance in the step and both its neighbours, or a tenth of the
    largest distance in any step if that is more: where some trajectories are straight, others may
    bend.

    In a step in which a force jumps, so does an acceleration. It is far from the straight line
    then, but hardly beyond its values at both ends: there the distance beyond these is taken.

    Args:
        flow: The trajectories, with T ≥ 2 nodes and m outputs.
        points: Parameters of some of them, shape (S, d), S ≥ 1, in SI units.

    Returns:
        Shape (T, m), in the units of the outputs. Row j belongs to the step that ends at node j;
        the first one is 0.

    Raises:
        RefusedError: A trajectory does not exist, or is not finite.
        StepError: A time step of one did not converge.
    """
    finer, substeps = flow.finer()
    deviation: Array = np.zeros((len(flow.time) - 1, len(flow.outputs)))
    has_jump: Mask = np.zeros(deviation.shape, bool)
    for chunk in np.array_split(points, -(-len(points) // 16)):  # which limits the memory
        distances = _distances_within_steps(finer.values(chunk), substeps)
        fed = _fed_through(flow, chunk)
        jumps = (fed.jumps[:, :, np.newaxis] & (fed.amplitude > 0)).any(axis=0)
        has_jump = has_jump | jumps
        distance = np.where(has_jump, distances.beyond_ends, distances.from_chord)
        deviation = np.maximum(deviation, distance + _fed_between(fed, finer.time, substeps))
    # A jump is in the same step of all trajectories, so that neighbours do not share it.
    smooth = np.where(has_jump, 0.0, deviation)
    padded = np.pad(smooth, ((1, 1), (0, 0)))
    least = np.broadcast_to(0.1 * smooth.max(axis=0), deviation.shape)
    largest = np.max([padded[:-2], deviation, padded[2:], least], axis=0)
    return np.concatenate([np.zeros((1, deviation.shape[1])), MARGIN * largest])


class _Distances(NamedTuple):
    """Largest distances of some trajectories within each step between nodes."""

    from_chord: Array  # from the straight line through both ends, (T − 1, m)
    beyond_ends: Array  # above the larger or below the smaller value of both ends, (T − 1, m)


def _distances_within_steps(fine: Array, substeps: int) -> _Distances:
    """Return the largest distances of trajectories from what their values at nodes say.

    Args:
        fine: Trajectories at finer nodes, shape (S, (T − 1) substeps + 1, m); every `substeps`-th
            is a time node.
        substeps: Finer steps in a step between two of T nodes, at least 2.

    Returns:
        Over all S trajectories and finer nodes inside a step, shape (T − 1, m) each: `from_chord`,
        the distance from the straight line through both ends; and `beyond_ends`, how far they lie
        above the larger or below the smaller of the values at both ends, 0 at least.
    """
    ends = fine[:, ::substeps]
    begin = ends[:, :-1]
    end = ends[:, 1:]
    in_steps = fine[:, :-1].reshape(len(fine), -1, substeps, fine.shape[-1])
    inner = in_steps[:, :, 1:]  # (S, T − 1, substeps − 1, m)
    fraction = (np.arange(1, substeps) / substeps)[:, np.newaxis]
    chord = begin[:, :, np.newaxis] * (1 - fraction) + end[:, :, np.newaxis] * fraction
    above = inner.max(axis=2) - np.maximum(begin, end)
    below = np.minimum(begin, end) - inner.min(axis=2)
    beyond_ends = np.maximum(above, below).max(axis=0)
    return _Distances(
        from_chord=np.abs(inner - chord).max(axis=(0, 2)),
        beyond_ends=np.maximum(beyond_ends, 0.0),
    )


class _FedThrough(NamedTuple):
    """What H histories of forces add to m accelerations at once."""

    histories: list[History]
    amplitude: Array  # largest magnitude that a unit of each adds, (H, 1, m)
    jumps: Mask  # whether each jumps in a step, or at its end, (H, T − 1)


def _fed_through(flow: Flow, points: Array) -> _FedThrough:
    """Return what forces add to accelerations at once, at any of some parameter sets.

    Args:
        flow: The trajectories, with T time nodes and m outputs.
        points: Parameter sets, shape (S, d), in SI units.

    Returns:
        `histories` of the H distinct loads; `amplitude`, the largest magnitude over the sets that a
        unit of each adds to each output, shape (H, 1, m); and `jumps`, whether each jumps within a
        step or at its end, shape (H, T − 1). H is 0 where the system has no matrices or no output
        takes a force at once.
    """
    histories = list[History]()
    amplitude = np.zeros((0, 1, len(flow.outputs)))
    if has_matrices(flow.system):
        matrices, _ = evaluate(flow.system, flow.names, points, derivatives=False)
        if matrices.feeds is not None:
            histories = distinct_histories(flow.system.loads)
            amplitude = np.abs(matrices.feeds.value).max(axis=0).T[:, np.newaxis]
    jumps = np.zeros((len(histories), len(flow.time) - 1), bool)
    for row, history in zip(jumps, histories, strict=True):
        row[:] = history.jumps_in_steps(flow.time)[1:]
    return _FedThrough(histories, amplitude, jumps)


def _fed_between(fed: _FedThrough, time: Array, substeps: int) -> Array:
    """Return what forces add to outputs between finer time nodes, shape (steps, m).

    A force may be zero at all of these and not between them. Where a force jumps in a step, the
    excess over its values at both ends is taken; in other steps, its distance from a straight line.

    Args:
        fed: Histories of the forces, the magnitudes that a unit of each adds to outputs, shape
            (forces, 1, m), and in which steps each jumps, shape (forces, steps).
        time: Finer nodes, shape (steps · substeps + 1,), in s.
        substeps: Number of finer steps in a step.
    """
    steps = (len(time) - 1) // substeps
    added = np.zeros((steps, fed.amplitude.shape[-1]))
    of_forces = zip(fed.histories, fed.amplitude, fed.jumps, strict=True)
    for history, amplitude, jumps in of_forces:
        from_chord = load_deviation(history, time)[1:].reshape(steps, substeps).max(axis=1)
        beyond_ends = load_excess(history, time)[1:].reshape(steps, substeps).max(axis=1)
        distance = np.where(jumps, beyond_ends, from_chord)
        added += distance[:, np.newaxis] * amplitude
    return added


def reference_motions(
    system: LagrangianSystem, points: Sequence[Mapping[str, float]], times: Array
) -> Array:
    """Return outputs of trajectories by a reference method, to test time steps with.

    Hamilton's equations in coordinates q and momenta π are integrated by Dormand and Prince's
    method of order 8 (Hairer, Nørsett, Wanner 1993), with SymPy's own functions: it shares neither
    scheme nor compiled code with the midpoint rule that it judges. Steps have a relative tolerance
    of 1e-11.

    Args:
        system: The system, given by its Lagrangian.
        points: Values of all parameters by name, in SI units, for each of S trajectories.
        times: Times from the start on, rising, shape (T,), in s.

    Returns:
        Shape (S, T, m), in the order of `system.outputs`.

    Raises:
        FailedError: The integration does not reach the last time.
        KeyError: A parameter of the system is missing in `points`.
    """
    import sympy
    from scipy.integrate import solve_ivp

    relative_tolerance = 1e-11  # of a step, as a fraction of the state; far below any step's error
    eq = system.symbols
    momenta = sympy.Matrix(sympy.symbols(f"pi:{system.coordinates}", real=True))
    velocity = eq.velocity(momenta)
    initial_q, initial_v = system.start()
    moving = dict(zip(eq.v, velocity, strict=True))
    starting = dict(zip(eq.q, initial_q, strict=True)) | dict(zip(eq.v, initial_v, strict=True))
    state_symbols = list(eq.q) + list(momenta)
    symbols = [state_symbols, list(eq.p.values())]
    state_rates = list(velocity) + list(eq.push.subs(moving))
    rates = sympy.lambdify(symbols, state_rates, "math")
    initial_state = list(initial_q) + list(eq.momentum.subs(starting))
    start_at = sympy.lambdify(symbols[1:], initial_state, "math")
    observed = [system.output(name, list(velocity)) for name in system.outputs]
    outputs = sympy.lambdify(symbols, observed, "math")
    trajectories = []
    for parameters in points:
        p = [float(parameters[name]) for name in eq.p]
        start = np.array(start_at(p), float)
        # Magnitudes of the states, for the absolute tolerance: of the start, or of its rate.
        speed = np.abs(np.array(rates(start, p), float))
        magnitude = np.maximum(np.abs(start), speed * float(times[-1]))
        magnitude = np.where(magnitude > 0, magnitude, magnitude.max() or 1.0)
        found = solve_ivp(
            lambda _, state, p=p: rates(state, p),
            (float(times[0]), float(times[-1])),
            start,
            method="DOP853",
            t_eval=times,
            rtol=relative_tolerance,
            atol=relative_tolerance * magnitude,
        )
        if not found.success:
            raise FailedError(f"the reference motion: {found.message}")
        trajectories.append([outputs(state, p) for state in found.y.T])
    return np.array(trajectories, float)
