"""Exact motions against proved bounds: a guaranteed envelope tests itself.

Points of the lowest cut are taken in this order: inputs that the envelope names at peaks, nominal
values and corners, inputs named at peaks of higher levels, points of low discrepancy. Each counts
for all levels that hold it. At the time nodes its exact motion must lie inside the bounds, between
them no farther from a straight line than `between`, and where the envelope names these inputs it
must equal the attained bound.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from hashlib import sha256
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from alphacut.base.arrays import Array, Mask
from alphacut.base.errors import FailedError
from alphacut.frame.boxes import Boxes, boxes
from alphacut.frame.envelope import Envelope
from alphacut.frame.structures.linear import LinearSystem, evaluate
from alphacut.frame.structures.loads import distinct_histories
from alphacut.frame.structures.quantities import Output
from alphacut.frame.verification.exact_motion import Course, LinearMotion
from alphacut.fuzzy.result import ROUND_OFF
from alphacut.fuzzy.sets.boxes import quasi_random_points

if TYPE_CHECKING:
    import xarray

MIN_MOTIONS, MAX_MOTIONS = 24, 240
"""Fewest and most motions of a test; more than the most find little that these do not."""
MOTIONS_OF_LEVEL = 67.0
"""Motions for each level, over the number of unknowns 2n: a tenth of a proof's work. A proof takes
2·10⁴ multiplications for a bound, of which a level, node and output have two, and a motion 15 (the
terms of its series) for each node, output, unknown and time of a step."""
TIMES_OF_STEP = 4
"""Times of a step at which motions are compared: its beginning, and times drawn within it."""
MAX_NUMBERS = 1_000_000
"""Most numbers of all matrices, 8 MB; structures beyond are left out, the first one never."""

MATRIX = ("motion", "row", "column")
AXES = {
    "mass": MATRIX,
    "damping": MATRIX,
    "stiffness": MATRIX,
    "rows": ("motion", "output", "state"),
    "start": ("motion", "state"),
    "pattern": ("motion", "row"),
    "forces": ("motion", "row", "load"),
    "feeds": ("motion", "output", "load"),
}
"""Axes of each array of a `LinearMotion`; the record and the courses of forces are those of all."""


class ContradictionError(FailedError):
    """An exact motion contradicts a guaranteed envelope."""


def with_motions_tested(envelope: Envelope, system: LinearSystem) -> Envelope:
    """Return a guaranteed envelope after comparing it with exact motions, which must agree.

    Their number is added as the fact `motions_tested`, and their structures are stored with it.

    Raises:
        ContradictionError: An exact motion leaves proved bounds, strays farther between nodes than
            is proved, or differs from the attained bound that names its inputs.
    """
    cuts = boxes(envelope.inputs, list(envelope.alpha))
    unknowns = structures_at(system, envelope, cuts.lower[:1])[0].rows.shape[1]
    count = int(np.clip(len(cuts.alpha) * MOTIONS_OF_LEVEL / unknowns, MIN_MOTIONS, MAX_MOTIONS))
    points = motion_inputs(envelope, cuts, count)
    motions = structures_at(system, envelope, points)
    Trial(envelope, cuts.lower, cuts.upper).require_agreement(points, motions)
    facts = {**envelope.facts, "motions_tested": len(points)}
    return replace(envelope, facts=facts, tested_structures=variables(points, motions))


def structures_at(system: LinearSystem, envelope: Envelope, points: Array) -> list[LinearMotion]:
    """Return the structure at each of S sets of inputs of an envelope, shape (S, n)."""
    matrices, rows = evaluate(system, tuple(envelope.inputs), points, derivatives=False)
    ground, n = system.ground, matrices.mass.value.shape[-1]
    record, step = (np.zeros(0), 0.0) if ground is None else (ground.samples, ground.step)
    courses = tuple(
        Course(x.samples, x.step, x.start, x.is_held, x.frequency, x.phase)
        for x in distinct_histories(system.loads)
    )
    motions = []
    for s in range(len(points)):
        M, K = matrices.mass.value[s], matrices.stiffness.value[s]
        b, static, impulse = (
            None if jet is None else jet.value[s]
            for jet in (matrices.forces, matrices.static, matrices.impulse)
        )
        q0, v0 = matrices.q0.value[s, :, 0], matrices.v0.value[s, :, 0]
        forces = np.zeros((n, 0)) if b is None else b
        q0 = q0 if static is None else q0 + np.linalg.solve(K, static[:, 0])
        v0 = v0 if impulse is None else v0 + np.linalg.solve(M, impulse[:, 0])
        motions.append(
            LinearMotion(
                mass=M,
                damping=matrices.damping.value[s],
                stiffness=K,
                rows=rows.value[s],
                start=np.append(q0, v0),
                pattern=matrices.rigid[:, 0],
                record=record,
                record_step=step,
                forces=forces,
                feeds=matrices.accelerated @ np.linalg.solve(M, forces),
                courses=courses,
            )
        )
    return motions


def motion_inputs(envelope: Envelope, cuts: Boxes, most: int) -> Array:
    """Return at most `most` distinct finite inputs to test, those at peaks first, (S, n)."""
    at_peaks = [inputs_at_peaks(envelope, level) for level in range(len(envelope.alpha))]
    count = np.arange(4 * most)
    # every second point in the lowest level, the others in all levels in turn
    level = np.where(count % 2, count // 2 % len(envelope.alpha), 0)
    unit = quasi_random_points(len(cuts.names), len(count))
    inside = cuts.lower[level] + (cuts.upper - cuts.lower)[level] * unit
    candidates = np.vstack([at_peaks[0], cuts.probes, *at_peaks[1:], inside])
    return _distinct(candidates[np.isfinite(candidates).all(1)])[:most]


def inputs_at_peaks(envelope: Envelope, level: int) -> Array:
    """Return the distinct inputs that an envelope names at its outputs' peaks, shape (P, n)."""
    outputs = np.arange(len(envelope.outputs))
    high, low = envelope.upper[level].argmax(0), envelope.lower[level].argmin(0)
    named = envelope.upper_at[level, high, outputs], envelope.lower_at[level, low, outputs]
    return _distinct(np.concatenate(named))


def _distinct(points: Array) -> Array:
    _, first = np.unique(points, axis=0, return_index=True)
    return np.asarray(points[np.sort(first)])


class _Tested(NamedTuple):
    """An exact motion at inputs (n,)."""

    point: Array
    values: Array  # outputs at `Trial.times`, (J, m)
    rounding: Array  # their round-off
    jumps: Mask  # whether a force jumps at the end of each step, (T − 1,)


def jumps_at_ends(courses: Sequence[Course], time: Array) -> Mask:
    """Return whether one of the forces jumps at the end of each step between nodes, (T − 1,)."""
    jumps = np.zeros(len(time), bool)
    for course in courses:
        ends = [course.start]
        if not course.is_held:
            ends.append(course.start + (len(course.samples) - 1) * course.step)
        for end in ends:
            jumps |= np.abs(time - end) <= 1e-9 * course.step
    return jumps[1:]


def fractions_of_steps(time: Array, lower: Array, upper: Array) -> Array:
    """Return fractions of each step at which motions are compared, rising from 0.

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
    """Comparison of exact motions with an envelope that is guaranteed, or has proved outer bounds.

    `lower` and `upper` are ends of its inputs on all levels, shape (A, n).
    """

    def __init__(self, envelope: Envelope, lower: Array, upper: Array) -> None:
        self.envelope, self.lower, self.upper = envelope, lower, upper
        time, shape = envelope.time, envelope.lower.shape[1:]
        # fractions of each step at which its motions are compared, (T − 1, TIMES_OF_STEP)
        self.fractions = fractions_of_steps(time, lower, upper)
        inside = time[:-1, None] + np.diff(time)[:, None] * self.fractions
        # nodes and the times between them, (TIMES_OF_STEP (T − 1) + 1,), in s
        self.times = np.append(inside.ravel(), time[-1])
        # what is proved between nodes, (T, m)
        self.between = np.full(shape, np.inf) if envelope.between is None else envelope.between
        # distance of attained bounds from the motion that rounding explains, (m,), and what the
        # motion at named inputs may exceed them by, (T, m)
        self.tolerance = ROUND_OFF * np.maximum(-envelope.lower, envelope.upper).max((0, 1))
        error = envelope.attained_error
        self.slack = self.tolerance + (np.zeros(shape) if error is None else error)

    def require_agreement(self, points: Array, motions: Sequence[LinearMotion]) -> None:
        """Refuse an envelope that exact motions at inputs (S, n) contradict.

        Raises:
            ContradictionError: As `with_motions_tested`.
        """
        for k, motion in enumerate(motions):
            point = points[k]
            jumps = jumps_at_ends(motion.courses, self.envelope.time)
            tested = _Tested(point, *motion.outputs(self.times), jumps)
            near = 4 * np.finfo(float).eps * np.abs(point)  # as inputs are rounded
            inside = (self.lower <= point + near) & (point - near <= self.upper)
            for level in map(int, np.flatnonzero(inside.all(1))):
                self.require_inside(level, tested)
                self.require_attained(level, tested)
            self.require_line_deviation(tested)

    def require_inside(self, level: int, motion: _Tested) -> None:
        """Refuse proved bounds that a motion leaves, at nodes or between them."""
        for sign, node_bound, side in (
            (1.0, self.envelope.proved.upper[level], "above the proved upper"),
            (-1.0, self.envelope.proved.lower[level], "below the proved lower"),
        ):
            bound = sign * _within_steps(sign * node_bound, self.between)
            excess = sign * (motion.values - bound) - motion.rounding
            words = f"{side} bound of α = {self.envelope.alpha[level]:g}"
            self._require(excess, bound, words, motion)

    def require_attained(self, level: int, motion: _Tested) -> None:
        """Refuse attained bounds of a level that name the inputs of a motion and differ from it."""
        envelope = self.envelope
        if envelope.inner is None:
            return
        at_nodes = _Tested(
            motion.point,
            motion.values[::TIMES_OF_STEP],
            motion.rounding[::TIMES_OF_STEP],
            motion.jumps,
        )
        for sign, at, inner, side in (
            (1.0, envelope.upper_at[level], envelope.inner.upper[level], "upper"),
            (-1.0, envelope.lower_at[level], envelope.inner.lower[level], "lower"),
        ):
            outside = sign * (at_nodes.values - inner)
            # inside by the tolerance at most, outside by the slack
            excess = np.maximum(-outside - self.tolerance, outside - self.slack)
            names_point = (at == motion.point).all(-1)
            excess = np.where(names_point, excess - at_nodes.rounding, -np.inf)
            words = f"other than the attained {side} bound of α = {envelope.alpha[level]:g}"
            self._require(excess, inner, words, at_nodes)

    def require_line_deviation(self, motion: _Tested) -> None:
        """Refuse a motion that strays farther from straight lines between nodes than is proved.

        In a step at whose end a force jumps it must not lie farther beyond its values at both ends.
        """
        ends = motion.values[::TIMES_OF_STEP]
        inside = ends[:-1, None] + np.diff(ends, axis=0)[:, None] * self.fractions[..., None]
        line = np.concatenate([inside.reshape(-1, ends.shape[1]), ends[-1:]])
        allowed = self.between[1:] + np.maximum(self.slack[1:], self.slack[:-1])
        allowed = np.append(np.repeat(allowed, TIMES_OF_STEP, axis=0), allowed[-1:], axis=0)
        is_jump = np.append(np.repeat(motion.jumps, TIMES_OF_STEP), False)[:, None]
        low, high = (
            np.append(np.repeat(f(ends[1:], ends[:-1]), TIMES_OF_STEP, axis=0), ends[-1:], axis=0)
            for f in (np.minimum, np.maximum)
        )
        above = motion.values - np.where(is_jump, high, line)
        below = np.where(is_jump, low, line) - motion.values
        excess = np.maximum(above, below) - allowed - 2 * motion.rounding
        self._require(excess, line, "farther than `between` from the straight line at", motion)

    def _require(self, excess: Array, bound: Array, words: str, motion: _Tested) -> None:
        """Refuse a motion whose excess (J, m) over a bound is not ≤ 0; name where it is largest."""
        if bool((excess <= 0).all()):
            return
        worst = np.where(np.isnan(excess), np.inf, excess)
        j, o = np.unravel_index(int(worst.argmax()), worst.shape)
        times = self.times[:: (len(self.times) - 1) // (len(excess) - 1)]
        output, value = self.envelope.outputs[o], motion.values[j, o]
        inputs = zip(self.envelope.inputs, motion.point, strict=True)
        at = ", ".join(f"{name} = {float(x)!r}" for name, x in inputs)
        what = (
            f"the proof is wrong: {output} at t = {times[j]:g} s is {value:.9g}"
            f" {Output(output).unit}, {words} {bound[j, o]:.9g}, by {excess[j, o]:.3g} more than"
            f" rounding and what is declared explain, at {at}"
        )
        raise ContradictionError(what, "keep the case and report it")


def _within_steps(upper: Array, between: Array) -> Array:
    """Return upper bounds at the times of a `Trial`, (J, m), from those at nodes, (T, m)."""
    inside = np.maximum(upper[1:], upper[:-1]) + between[1:]
    parts = [upper[:-1], *[inside] * (TIMES_OF_STEP - 1)]
    return np.append(np.stack(parts, 1).reshape(-1, upper.shape[1]), upper[-1:], axis=0)


def variables(
    points: Array, motions: Sequence[LinearMotion]
) -> dict[str, tuple[tuple[str, ...], Array]]:
    """Return dataset variables with inputs (S, n) and matrices of the first of S structures."""
    # as many as keep three matrices each within the limit
    count = max(1, min(len(motions), MAX_NUMBERS // (3 * motions[0].mass.size)))
    first, courses = motions[0], motions[0].courses
    # of each course the number of samples, and the fields after these
    numbers = np.array([[len(x.samples), *x[1:]] for x in courses], float)
    samples = np.concatenate([np.zeros(0), *(x.samples for x in courses)])
    return {
        "motion_inputs": (("motion", "parameter"), points[:count]),
        **{
            f"motion_{name}": (axes, np.stack([getattr(x, name) for x in motions[:count]]))
            for name, axes in AXES.items()
        },
        "record": (("sample",), first.record),
        "record_step": ((), np.array(first.record_step)),
        "course_samples": (("course_sample",), samples),
        "course_numbers": (("load", "number"), numbers.reshape(len(courses), 6)),
    }


def stored_motions(data: xarray.Dataset) -> tuple[Array, list[LinearMotion]]:
    """Return inputs (S, n) and structures of the tested motions that a dataset holds."""
    values = {str(name): variable.values for name, variable in data.data_vars.items()}
    numbers, points = values["course_numbers"], values["motion_inputs"]
    ends = np.cumsum(numbers[:, 0]).astype(int)[:-1]
    samples = np.split(values["course_samples"], ends)
    courses = tuple(
        Course(x, step, start, bool(is_held), frequency, phase)
        for x, (_, step, start, is_held, frequency, phase) in zip(samples, numbers, strict=False)
    )
    fixed: dict[str, Any] = {
        "record": values["record"],
        "record_step": float(values["record_step"]),
        "courses": courses,
    }
    motions = [
        LinearMotion(**{name: values[f"motion_{name}"][s] for name in AXES}, **fixed)
        for s in range(len(points))
    ]
    return points, motions
