"""Exact responses against guaranteed bounds: a guaranteed envelope tests itself.

Points of the lowest α-cut are taken in this order: inputs that the envelope names at peaks, nominal
values and corners, inputs named at peaks of higher levels, points of low discrepancy. Each counts
for all levels whose cut contains it. At the time nodes the exact response must lie inside the
bounds; between them it must be no farther from a straight line than `between`; and where the
envelope names these inputs, it must equal the attained bound.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from hashlib import sha256
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from alphacut.base.arrays import Array, Mask
from alphacut.base.errors import FailedError
from alphacut.frame.boxes import Boxes, boxes
from alphacut.frame.result import Envelope
from alphacut.frame.structures.linear import LinearSystem, evaluate
from alphacut.frame.structures.loads import distinct_histories
from alphacut.frame.structures.quantities import Output
from alphacut.frame.verification.exact_motion import LinearMotion, LoadHistory
from alphacut.fuzzy.result import ROUND_OFF
from alphacut.fuzzy.sets.boxes import quasi_random_points

if TYPE_CHECKING:
    import xarray

TIMES_OF_STEP = 4
"""Times of a step at which responses are compared: its beginning, and times drawn within it; tuned:
more find little that these do not."""

_MATRIX = ("motion", "row", "column")
AXES = {
    "mass": _MATRIX,
    "damping": _MATRIX,
    "stiffness": _MATRIX,
    "rows": ("motion", "output", "state"),
    "start": ("motion", "state"),
    "pattern": ("motion", "row"),
    "forces": ("motion", "row", "load"),
    "feeds": ("motion", "output", "load"),
}
"""Axes of each array of a `LinearMotion` in datasets; record and forces over time are the same for
all."""


class ContradictionError(FailedError):
    """An exact response contradicts a guaranteed envelope."""


def with_motions_tested(
    envelope: Envelope, system: LinearSystem, members: tuple[Array, Array] | None = None
) -> Envelope:
    """Return a guaranteed envelope after comparing it with exact responses, which must agree.

    Their number is added as the fact `motions_tested`, and their structures are stored with it.

    Args:
        envelope: The envelope.
        system: The structure.
        members: If the bounds hold for a part of the cuts alone: inputs in it, shape (S, n), of
            which the first are tested, and for each the highest level whose bounds hold for it.

    Raises:
        ContradictionError: An exact response leaves guaranteed bounds, is farther from a straight
            line between nodes than is guaranteed, or differs from the attained bound that names its
            inputs.
    """
    cuts = boxes(envelope.inputs, list(envelope.alpha))
    states = structures_at(system, cuts.names, cuts.lower[:1])[0].rows.shape[1]
    # A tenth of a proof's work: a proof takes 2·10⁴ multiplications for a bound, of which a level,
    # node and output have two, and a response 15 (the terms of its series) for each node, output,
    # state and time of a step. From 24 to 240 responses are tested; more find little.
    count = int(np.clip(len(cuts.alpha) * 67.0 / states, 24, 240))
    if members is None:
        points = motion_inputs(envelope, cuts, count)
        members = points, np.full(len(points), len(cuts.alpha) - 1.0)
    points, highest = members[0][:count], members[1][:count]
    facts = {**envelope.facts, "motions_tested": len(points)}
    if not len(points):
        return replace(envelope, facts=facts)
    motions = structures_at(system, cuts.names, points)
    Trial(envelope, cuts.lower, cuts.upper).require_agreement(points, motions, highest)
    return replace(envelope, facts=facts, tested_structures=variables(points, motions, highest))


def structures_at(system: LinearSystem, names: Sequence[str], points: Array) -> list[LinearMotion]:
    """Return the matrices of a structure at each of S sets of its inputs.

    Static forces and impulses at t = 0 are contained in the initial state.

    Args:
        system: The structure.
        names: Names of its n inputs; other parameters are nominal.
        points: The inputs, shape (S, n), in SI units.

    Returns:
        S structures with the same loads.

    Raises:
        numpy.linalg.LinAlgError: A mass, or a stiffness under a static force, is singular.
    """
    matrices, rows = evaluate(system, names, points, derivatives=False)
    n = matrices.mass.value.shape[-1]
    record: Array = np.zeros(0)
    record_step = 0.0
    if system.ground is not None:
        record = system.ground.samples
        record_step = system.ground.step
    histories = tuple(
        LoadHistory(x.samples, x.step, x.start, x.is_held, x.frequency, x.phase)
        for x in distinct_histories(system.loads)
    )
    motions = []
    for s in range(len(points)):
        M = matrices.mass.value[s]
        K = matrices.stiffness.value[s]
        displacement = matrices.q0.value[s, :, 0]
        velocity = matrices.v0.value[s, :, 0]
        if matrices.static is not None:
            displacement = displacement + np.linalg.solve(K, matrices.static.value[s, :, 0])
        if matrices.impulse is not None:
            velocity = velocity + np.linalg.solve(M, matrices.impulse.value[s, :, 0])
        forces = np.zeros((n, 0))
        if matrices.forces is not None:
            forces = matrices.forces.value[s]
        motion = LinearMotion(
            mass=M,
            damping=matrices.damping.value[s],
            stiffness=K,
            rows=rows.value[s],
            start=np.append(displacement, velocity),
            pattern=matrices.rigid[:, 0],
            record=record,
            record_step=record_step,
            forces=forces,
            feeds=matrices.accelerated @ np.linalg.solve(M, forces) * matrices.at_once,
            histories=histories,
        )
        motions.append(motion)
    return motions


def motion_inputs(envelope: Envelope, cuts: Boxes, max_count: int) -> Array:
    """Return distinct finite inputs to test an envelope at, those at peaks first, shape (S, n).

    They are, in this order: inputs that the envelope names at peaks of the lowest level, nominal
    values and corners, inputs named at peaks of higher levels, and quasi-random points, half of
    them in the lowest level and the others in all levels in turn.

    Args:
        envelope: The envelope.
        cuts: Boxes of its n inputs on all levels, the widest first.
        max_count: Largest S.
    """
    at_peaks = [inputs_at_peaks(envelope, level) for level in range(len(envelope.alpha))]
    number = np.arange(4 * max_count)
    # Every second point lies in the lowest level, and the others in all levels in turn.
    level = np.where(number % 2, number // 2 % len(envelope.alpha), 0)
    unit = quasi_random_points(len(cuts.names), len(number))
    inside = cuts.lower[level] + (cuts.upper - cuts.lower)[level] * unit
    candidates = np.vstack([at_peaks[0], cuts.probes, *at_peaks[1:], inside])
    is_finite = np.isfinite(candidates).all(axis=1)
    return _distinct(candidates[is_finite])[:max_count]


def inputs_at_peaks(envelope: Envelope, level: int) -> Array:
    """Return the distinct inputs that an envelope names at its outputs' peaks, shape (P, n).

    The peaks are the largest upper and the smallest lower bound over time of each output.

    Args:
        envelope: The envelope.
        level: Row of the α-cut, 0 for the widest.
    """
    outputs = np.arange(len(envelope.outputs))
    highest_nodes = envelope.upper[level].argmax(axis=0)
    lowest_nodes = envelope.lower[level].argmin(axis=0)
    at_highest = envelope.upper_at[level, highest_nodes, outputs]
    at_lowest = envelope.lower_at[level, lowest_nodes, outputs]
    return _distinct(np.concatenate([at_highest, at_lowest]))


def _distinct(points: Array) -> Array:
    """Return the points (S, n) without repetitions, each where it comes first."""
    _, first = np.unique(points, axis=0, return_index=True)
    return np.asarray(points[np.sort(first)])


class _TestedMotion(NamedTuple):
    """An exact response at inputs (n,), at J times."""

    point: Array  # the inputs, (n,), in SI units
    values: Array  # outputs, (J, m)
    rounding: Array  # bounds of their rounding, (J, m)
    jumps: Mask  # whether a force jumps at the end of each step, (T − 1,)


def jumps_at_ends(histories: Sequence[LoadHistory], time: Array) -> Mask:
    """Return whether one of the forces jumps at the end of each step between nodes, shape (T − 1,).

    A force may jump where it begins and, unless it is held, where it ends.

    Args:
        histories: The forces over time.
        time: Time nodes, shape (T,), in s.
    """
    jumps = np.zeros(len(time), bool)
    for history in histories:
        ends = [history.start]
        if not history.is_held:
            ends.append(history.start + (len(history.samples) - 1) * history.step)
        for end in ends:
            jumps |= np.abs(time - end) <= 1e-9 * history.step
    return jumps[1:]


def fractions_of_steps(time: Array, lower: Array, upper: Array) -> Array:
    """Return fractions of each step at which responses are compared, rising from 0.

    They are drawn, so that no load can be zero at all of them as it can be at nodes and quarter
    points. The seed depends on nodes and cuts, so that a test that is repeated has the same bits.

    Args:
        time: Nodes, shape (T,).
        lower: Lower ends of the inputs on all levels, shape (A, n).
        upper: Upper ends, the same shape.

    Returns:
        Fractions in [0, 1), shape (T − 1, TIMES_OF_STEP).
    """
    content = b"".join(np.ascontiguousarray(x, float).tobytes() for x in (time, lower, upper))
    rng = np.random.default_rng(list(sha256(content).digest()))
    fractions = np.sort(rng.random((len(time) - 1, TIMES_OF_STEP)), axis=1)
    fractions[:, 0] = 0.0
    return fractions


class Trial:
    """Comparison of exact responses with an envelope that is guaranteed, or has guaranteed bounds.

    `lower` and `upper` are ends of its inputs on all levels, shape (A, n).
    """

    def __init__(self, envelope: Envelope, lower: Array, upper: Array) -> None:
        self.envelope = envelope
        self.lower = lower
        self.upper = upper
        time = envelope.time
        shape = envelope.lower.shape[1:]
        # fractions of each step at which responses are compared, (T − 1, TIMES_OF_STEP)
        self.fractions = fractions_of_steps(time, lower, upper)
        inside = time[:-1, np.newaxis] + np.diff(time)[:, np.newaxis] * self.fractions
        # nodes and the times between them, (TIMES_OF_STEP (T − 1) + 1,), in s
        self.times = np.append(inside.ravel(), time[-1])
        # what is guaranteed between nodes, (T, m)
        self.between: Array = np.full(shape, np.inf)
        if envelope.between is not None:
            self.between = envelope.between
        # distance of attained bounds from the response that rounding explains, (m,), and what the
        # response at named inputs may exceed them by, (T, m)
        self.tolerance = ROUND_OFF * np.maximum(-envelope.lower, envelope.upper).max(axis=(0, 1))
        self.slack = self.tolerance + np.zeros(shape)
        if envelope.attained_error is not None:
            self.slack = self.tolerance + envelope.attained_error

    def require_agreement(
        self, points: Array, motions: Sequence[LinearMotion], highest: Array | None = None
    ) -> None:
        """Check that exact responses do not contradict the envelope, at nodes or between them.

        A response is compared with the bounds of all levels whose cut contains its inputs, but for
        rounding.

        Args:
            points: Inputs of S structures, shape (S, n), in SI units.
            motions: The structures at these inputs.
            highest: Highest level whose bounds hold for each of them, shape (S,); all unless given.

        Raises:
            ContradictionError: A response leaves guaranteed bounds, is farther from a straight line
                between nodes than is guaranteed, or differs from the attained bound that names its
                inputs.
        """
        for k, motion in enumerate(motions):
            point = points[k]
            jumps = jumps_at_ends(motion.histories, self.envelope.time)
            outputs = motion.outputs(self.times)
            tested = _TestedMotion(point, outputs.values, outputs.rounding, jumps)
            near = 4 * np.finfo(float).eps * np.abs(point)  # as inputs are rounded
            is_inside = (self.lower <= point + near) & (point - near <= self.upper)
            last = len(is_inside) if highest is None else highest[k]
            is_bounded = is_inside.all(axis=1) & (np.arange(len(is_inside)) <= last)
            for level in map(int, np.flatnonzero(is_bounded)):
                self.require_inside(level, tested)
                self.require_attained(level, tested)
            self.require_interpolation_error(tested)

    def require_inside(self, level: int, motion: _TestedMotion) -> None:
        """Check that a response does not leave the guaranteed bounds, at nodes or between them.

        Args:
            level: Row of the α-cut, 0 for the widest, whose bounds are meant.
            motion: The response, at the nodes and at some times within each step.

        Raises:
            ContradictionError: It leaves a bound by more than rounding.
        """
        for sign, node_bound, side in (
            (1.0, self.envelope.proved.upper[level], "above the proved upper"),
            (-1.0, self.envelope.proved.lower[level], "below the proved lower"),
        ):
            bound = sign * _bounds_at_times(sign * node_bound, self.between)
            excess = sign * (motion.values - bound) - motion.rounding
            words = f"{side} bound of α = {self.envelope.alpha[level]:g}"
            self._require(excess, bound, words, motion)

    def require_attained(self, level: int, motion: _TestedMotion) -> None:
        """Check that attained bounds of a level that name the inputs of a response equal it.

        Nothing is checked where the envelope has no attained bounds, or none names these inputs.

        Args:
            level: Row of the α-cut, 0 for the widest.
            motion: The response; only its values at the nodes are compared.

        Raises:
            ContradictionError: One differs by more than the errors that the envelope declares.
        """
        envelope = self.envelope
        if envelope.inner is None:
            return
        at_nodes = motion._replace(
            values=motion.values[::TIMES_OF_STEP], rounding=motion.rounding[::TIMES_OF_STEP]
        )
        for sign, named_inputs, attained, side in (
            (1.0, envelope.upper_at[level], envelope.inner.upper[level], "upper"),
            (-1.0, envelope.lower_at[level], envelope.inner.lower[level], "lower"),
        ):
            outside = sign * (at_nodes.values - attained)
            # inside by the tolerance at most, outside by the slack
            excess = np.maximum(-outside - self.tolerance, outside - self.slack)
            names_point = (named_inputs == motion.point).all(axis=-1)
            excess = np.where(names_point, excess - at_nodes.rounding, -np.inf)
            words = f"other than the attained {side} bound of α = {envelope.alpha[level]:g}"
            self._require(excess, attained, words, at_nodes)

    def require_interpolation_error(self, motion: _TestedMotion) -> None:
        """Check that a response is no farther from straight lines between nodes than is guaranteed.

        In a step at whose end a force jumps it must not lie farther beyond its values at both ends.

        Args:
            motion: The response, at the nodes and at some times within each step.

        Raises:
            ContradictionError: It is farther by more than rounding.
        """
        ends = motion.values[::TIMES_OF_STEP]
        rise = np.diff(ends, axis=0)[:, np.newaxis] * self.fractions[..., np.newaxis]
        inside = ends[:-1, np.newaxis] + rise
        line = np.concatenate([inside.reshape(-1, ends.shape[1]), ends[-1:]])
        of_step = self.between[1:] + np.maximum(self.slack[1:], self.slack[:-1])
        allowed = _at_times(of_step, last=of_step[-1])
        is_jump = np.append(np.repeat(motion.jumps, TIMES_OF_STEP), False)[:, np.newaxis]
        low = _at_times(np.minimum(ends[1:], ends[:-1]), last=ends[-1])
        high = _at_times(np.maximum(ends[1:], ends[:-1]), last=ends[-1])
        above = motion.values - np.where(is_jump, high, line)
        below = np.where(is_jump, low, line) - motion.values
        excess = np.maximum(above, below) - allowed - 2 * motion.rounding
        self._require(excess, line, "farther than `between` from the straight line at", motion)

    def _require(self, excess: Array, bound: Array, words: str, motion: _TestedMotion) -> None:
        """Check that all excesses of a response over a bound are at most 0.

        Args:
            excess: Excesses beyond rounding and declared errors, shape (J, m), at nodes or at all
                times.
            bound: The bound, same shape, for the message.
            words: What the bound is, for the message, such as "above the proved upper bound of α =
                0".
            motion: The response at the same J times.

        Raises:
            ContradictionError: An excess is larger, or NaN. The largest one is named.
        """
        if bool((excess <= 0).all()):
            return
        worst = np.where(np.isnan(excess), np.inf, excess)
        j, o = np.unravel_index(int(worst.argmax()), worst.shape)
        stride = (len(self.times) - 1) // (len(excess) - 1)  # of nodes alone, or of all times
        time = self.times[::stride][j]
        output = self.envelope.outputs[o]
        inputs = zip(self.envelope.inputs, motion.point, strict=True)
        at = ", ".join(f"{name} = {float(x)!r}" for name, x in inputs)
        what = (
            f"the proof is wrong: {output} at t = {time:g} s is {motion.values[j, o]:.9g}"
            f" {Output(output).unit}, {words} {bound[j, o]:.9g}, by {excess[j, o]:.3g} more than"
            f" rounding and what is declared explain, at {at}"
        )
        raise ContradictionError(what, "keep the case and report it")


def _at_times(of_steps: Array, *, last: Array) -> Array:
    """Return values of steps, (T − 1, m), at the times of a `Trial`; at its end `last`, (m,)."""
    return np.vstack([np.repeat(of_steps, TIMES_OF_STEP, axis=0), last])


def _bounds_at_times(upper: Array, between: Array) -> Array:
    """Return upper bounds at the times of a `Trial`, (J, m), from those at nodes, (T, m)."""
    within_step = np.maximum(upper[1:], upper[:-1]) + between[1:]
    bounds = _at_times(within_step, last=upper[-1])
    bounds[::TIMES_OF_STEP] = upper
    return bounds


def variables(
    points: Array, motions: Sequence[LinearMotion], highest: Array
) -> dict[str, tuple[tuple[str, ...], Array]]:
    """Return dataset variables of tested structures: axes and values by name.

    Args:
        points: Inputs of S structures, shape (S, n).
        motions: The structures. The first ones are stored, as many as have a million numbers in
            three matrices each, 8 MB; the first is always stored.
        highest: Highest level whose bounds hold for each of them, shape (S,).
    """
    count = max(1, min(len(motions), 1_000_000 // (3 * motions[0].mass.size)))
    first = motions[0]
    # Of each history the number of samples, and the fields after these.
    numbers = np.array([[len(x.samples), *x[1:]] for x in first.histories], float)
    samples = np.concatenate([np.zeros(0), *(x.samples for x in first.histories)])
    found: dict[str, tuple[tuple[str, ...], Array]] = {
        "motion_inputs": (("motion", "parameter"), points[:count]),
        "motion_highest": (("motion",), highest[:count]),
    }
    for name, axes in AXES.items():
        found[f"motion_{name}"] = axes, np.stack([getattr(x, name) for x in motions[:count]])
    found["record"] = ("sample",), first.record
    found["record_step"] = (), np.array(first.record_step)
    found["course_samples"] = ("course_sample",), samples
    found["course_numbers"] = ("load", "number"), numbers.reshape(len(first.histories), 6)
    return found


def stored_motions(data: xarray.Dataset) -> tuple[Array, list[LinearMotion]]:
    """Return what `variables` has stored: the inputs and structures of tested responses.

    Args:
        data: Dataset with these variables.

    Returns:
        The inputs, shape (S, n), in SI units, and S structures.

    Raises:
        KeyError: The dataset has no tested structures.
    """
    values = {str(name): variable.values for name, variable in data.data_vars.items()}
    points = values["motion_inputs"]
    numbers = values["course_numbers"]
    ends = np.cumsum(numbers[:, 0]).astype(int)[:-1]
    samples = np.split(values["course_samples"], ends)
    histories = []
    for course_samples, (_, step, start, is_held, frequency, phase) in zip(
        samples, numbers, strict=False
    ):
        histories.append(LoadHistory(course_samples, step, start, bool(is_held), frequency, phase))
    motions = []
    for s in range(len(points)):
        arrays = {name: values[f"motion_{name}"][s] for name in AXES}
        motion = LinearMotion(
            **arrays,
            record=values["record"],
            record_step=float(values["record_step"]),
            histories=tuple(histories),
        )
        motions.append(motion)
    return points, motions
