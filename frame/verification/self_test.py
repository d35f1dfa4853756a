"""Exact motions against proved bounds: a guaranteed envelope tests itself.

Points of the lowest cut are taken in this order: inputs that the envelope names at peaks, modal
values, corners, inputs named at peaks of higher levels, points of low discrepancy. Each counts for
all levels that hold it. At the nodes its exact motion must lie inside the bounds, between them no
farther from a straight line than `between`, and where the envelope names these inputs it must equal
the attained bound.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import count, islice, product
from typing import TYPE_CHECKING, Any

import numpy as np

from alphacut.frame.envelope import Envelope
from alphacut.frame.structures.linear import LinearSystem, courses_of_forces, evaluate
from alphacut.frame.structures.loads import History
from alphacut.frame.structures.quantities import Output
from alphacut.frame.verification.exact_motion import Course, LinearMotion
from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import FailedError
from alphacut.fuzzy.result import ROUND_OFF
from alphacut.fuzzy.sets.boxes import quasi_random_points

if TYPE_CHECKING:
    import xarray

LEAST, MOST = 24, 240
"""Fewest and most motions of a test; more than the most find little that these do not."""
SHARE = 0.1
"""Share of the proof's work that the test may take beyond the fewest motions."""
BOUND_WORK = 2e4
"""Multiplications of a proof for one bound (a node, output, side and level), at least: some 20 μs.
A larger number would make more motions."""
TERMS = 15
"""Terms of a motion's series within a substep, about."""
CORNERS = 16
"""Most corners of the lowest cut."""
QUARTERS = 4
"""Parts of a step at whose ends motions are compared."""


Variables = Mapping[str, tuple[tuple[str, ...], Array]]
"""Arrays with the names of their axes."""
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
}
"""Axes of each array of a `LinearMotion`; the record is that of all."""
FORCES = {"forces": ("motion", "row", "load"), "feeds": ("motion", "output", "load")}
"""Axes of what is there where forces act, whose courses are those of all."""


class ContradictionError(FailedError):
    """An exact motion contradicts a guaranteed envelope.

    Args:
        what: The contradiction with its numbers.
        table: Columns by name: time, motion and attained bounds of each output at the nodes.
    """

    def __init__(self, what: str, table: Mapping[str, Array]) -> None:
        self.table = table
        super().__init__(f"the proof is wrong: {what}", "keep the case and report it")

    def __reduce__(self) -> tuple[object, ...]:
        """How a copy is made, in another process, too."""
        what = self.what.removeprefix("the proof is wrong: ")
        return ContradictionError, (what, dict(self.table))


def with_motions_tested(envelope: Envelope, system: LinearSystem) -> Envelope:
    """Return a guaranteed envelope after comparing it with exact motions, which must agree.

    Their number is added as the fact `motions_tested`, and their structures are stored with it.

    Raises:
        ContradictionError: An exact motion leaves proved bounds, strays farther between nodes than
            is proved, or differs from the attained bound that names its inputs.
    """
    trial = Trial(envelope, cuts_of(envelope))
    first_structure = structures_at(system, envelope, trial.cuts[0, :1])[0]
    points = trial.points(trial.motion_count(first_structure.rows.shape[1]))
    motions = structures_at(system, envelope, points)
    trial.require_agreement(points, motions)
    facts = {**envelope.facts, "motions_tested": len(points)}
    return replace(envelope, facts=facts, tested_structures=variables(points, motions))


def structures_at(system: LinearSystem, envelope: Envelope, points: Array) -> list[LinearMotion]:
    """Return the structure at each of S sets of inputs of an envelope, shape (S, n)."""
    matrices, rows = evaluate(system, tuple(envelope.inputs), points, derivatives=False)
    ground, n = system.ground, matrices.mass.value.shape[-1]
    record, step = (np.zeros(0), 0.0) if ground is None else (ground.samples, ground.step)
    courses = tuple(_course(history) for history in courses_of_forces(system))
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


def _course(history: History) -> Course:
    """A history as the exact motion takes it."""
    flags = history.start, history.is_held, history.frequency, history.phase
    return Course(history.samples, history.step, *flags)


def cuts_of(envelope: Envelope) -> Array:
    """Lower and upper ends of the inputs on all levels, shape (2, A, n)."""
    numbers = envelope.inputs.values()
    ends = [[number.cut(float(a)) for number in numbers] for a in envelope.alpha]
    return np.moveaxis(np.array(ends, float), -1, 0)


@dataclass(frozen=True, eq=False)
class Trial:
    """Comparison of an envelope with exact motions.

    Args:
        envelope: Bounds, guaranteed or with guaranteed ones outside (`outer`).
        cuts: Lower and upper ends of its inputs on all levels, shape (2, A, n).
    """

    envelope: Envelope
    cuts: Array

    @cached_property
    def times(self) -> Array:
        """Nodes and the quarter points between them, shape (4 (T − 1) + 1,), in s."""
        time = self.envelope.time
        inside = time[:-1, None] + np.diff(time)[:, None] * np.arange(QUARTERS) / QUARTERS
        return np.append(inside.ravel(), time[-1])

    def motion_count(self, unknowns: int) -> int:
        """Return the number of motions of 2n `unknowns` to test, at `SHARE` of the proof's cost."""
        nodes, outputs = self.envelope.lower.shape[1:]
        # in multiplications
        proof_cost = 2 * self.envelope.lower.size * BOUND_WORK
        motion_cost = QUARTERS * nodes * outputs * unknowns * TERMS
        return int(np.clip(SHARE * proof_cost / motion_cost, LEAST, MOST))

    def points(self, most: int) -> Array:
        """Return at most `most` distinct finite inputs to test, those at peaks first, (S, n)."""
        distinct = dict[tuple[float, ...], None]()
        for point in islice(self._candidates(), 4 * most):
            if len(distinct) < most and np.isfinite(point).all():
                distinct[tuple(map(float, point))] = None
        return np.array(list(distinct))

    def named(self) -> Array:
        """Inputs that the envelope names at the peaks of the lowest level, shape (P, n)."""
        return np.array(list(dict.fromkeys(tuple(map(float, x)) for x in self._peak_inputs(0))))

    def _candidates(self) -> Iterator[Array]:
        """Yield inputs (n,) to test in the order of use, without end, some more than once."""
        (low, high), levels = self.cuts, len(self.envelope.alpha)
        yield from self._peak_inputs(0)
        yield np.array([number.modal for number in self.envelope.inputs.values()], float)
        yield from _corners(low[0], high[0])
        for level in range(1, levels):
            yield from self._peak_inputs(level)
        for k in count():
            level = (k // 2) % levels if k % 2 else 0  # every second point in the lowest level
            unit_point = quasi_random_points(low.shape[1], 1, skip=k)[0]
            yield low[level] + (high[level] - low[level]) * unit_point

    def _peak_inputs(self, level: int) -> Iterator[Array]:
        """Yield the inputs (n,) that the envelope names at each output's peaks on a level."""
        envelope = self.envelope
        for o in range(len(envelope.outputs)):
            yield envelope.upper_at[level, envelope.upper[level, :, o].argmax(), o]
            yield envelope.lower_at[level, envelope.lower[level, :, o].argmin(), o]

    def require_agreement(self, points: Array, motions: Sequence[LinearMotion]) -> None:
        """Refuse an envelope that exact motions at inputs (S, n) contradict.

        Raises:
            ContradictionError: A motion leaves the bounds of a level that holds its inputs, does
                not attain a bound that names them, or strays from straight lines between nodes by
                more than `between`.
        """
        for k, motion in enumerate(motions):
            point = points[k]
            check = _Check(self, point, *motion.outputs(self.times))
            near = 4 * np.finfo(float).eps * np.abs(point)  # as inputs are rounded
            inside = (self.cuts[0] <= point + near) & (point - near <= self.cuts[1])
            for level in np.flatnonzero(inside.all(1)):
                check.require_inside(int(level))
                check.require_attained(int(level))
            check.require_line_deviation()


@dataclass(frozen=True, eq=False)
class _Check:
    """An exact motion beside an envelope.

    Args:
        trial: The envelope.
        point: Inputs of the motion, shape (n,).
        values: Its outputs at nodes and quarter points, shape (4 (T − 1) + 1, m).
        rounding: Their round-off.
    """

    trial: Trial
    point: Array
    values: Array
    rounding: Array

    @property
    def envelope(self) -> Envelope:
        """The envelope."""
        return self.trial.envelope

    @cached_property
    def between(self) -> Array:
        """What the envelope proves between nodes, (T, m); infinite where it proves nothing."""
        bounds = self.envelope
        return np.full(bounds.lower.shape[1:], np.inf) if bounds.between is None else bounds.between

    @property
    def tolerance(self) -> Array:
        """Distance of attained bounds from the motion that rounding explains, shape (m,)."""
        envelope = self.envelope
        return np.asarray(ROUND_OFF * np.maximum(-envelope.lower, envelope.upper).max((0, 1)))

    @cached_property
    def slack(self) -> Array:
        """What the motion at named inputs may exceed attained bounds by, shape (T, m)."""
        error = self.envelope.attained_error
        return self.tolerance + (np.zeros_like(self.between) if error is None else error)

    def require_inside(self, level: int) -> None:
        """Refuse proved bounds that the motion leaves, at nodes or between them."""
        for sign, node_bound, words in (
            (1.0, self.envelope.proved.upper[level], "above the proved upper bound"),
            (-1.0, self.envelope.proved.lower[level], "below the proved lower bound"),
        ):
            bound = sign * _within_steps(sign * node_bound, self.between)
            excess = sign * (self.values - bound) - self.rounding
            self._require(excess, bound, f"{words} of α = {self._alpha(level)},")

    def require_attained(self, level: int) -> None:
        """Refuse attained bounds of a level that name these inputs and differ from the motion."""
        envelope = self.envelope
        if envelope.inner is None:
            return
        rounding = self.rounding[::QUARTERS]
        for sign, at, inner, side in (
            (1.0, envelope.upper_at[level], envelope.inner.upper[level], "upper"),
            (-1.0, envelope.lower_at[level], envelope.inner.lower[level], "lower"),
        ):
            outside = sign * (self.values[::QUARTERS] - inner)
            # inside by the tolerance at most, outside by the slack
            excess = np.maximum(-outside - self.tolerance, outside - self.slack) - rounding
            names_point = (at == self.point).all(-1)
            excess = np.where(names_point, excess, -np.inf)
            words = f"other than the attained {side} bound of α = {self._alpha(level)},"
            self._require(excess, inner, words, QUARTERS)

    def require_line_deviation(self) -> None:
        """Refuse a motion that strays farther from straight lines between nodes than is proved."""
        ends, fraction = self.values[::QUARTERS], np.arange(QUARTERS)[:, None] / QUARTERS
        inside = ends[:-1, None] + np.diff(ends, axis=0)[:, None] * fraction
        line = np.concatenate([inside.reshape(-1, ends.shape[1]), ends[-1:]])
        allowed = self.between[1:] + np.maximum(self.slack[1:], self.slack[:-1])
        allowed = np.append(np.repeat(allowed, QUARTERS, axis=0), allowed[-1:], axis=0)
        excess = np.abs(self.values - line) - allowed - 2 * self.rounding
        self._require(excess, line, "farther than `between` from the straight line at")

    def _alpha(self, level: int) -> str:
        return f"{self.envelope.alpha[level]:g}"

    def _require(self, excess: Array, bound: Array, words: str, stride: int = 1) -> None:
        """Refuse a motion whose excess (J, m) over a bound at every `stride`-th time is not ≤ 0.

        Raises:
            ContradictionError: There is one; the message gives the largest.
        """
        if bool((excess <= 0).all()):
            return
        worst = np.where(np.isnan(excess), np.inf, excess)
        j, o = np.unravel_index(int(worst.argmax()), worst.shape)
        env, value = self.envelope, self.values[j * stride, o]
        unit = Output(env.outputs[o]).unit
        inputs = zip(env.inputs, self.point, strict=True)
        at = ", ".join(f"{name} = {float(x)!r}" for name, x in inputs)
        what = (
            f"{env.outputs[o]} at t = {self.trial.times[j * stride]:g} s is {value:.9g} {unit} at"
            f" {at}: {words} {bound[j, o]:.9g}, by {excess[j, o]:.3g} more than rounding and what"
            " is declared explain"
        )
        raise ContradictionError(what, self._table())

    def _table(self) -> dict[str, Array]:
        """Return columns (T,) by name: time, and each output's motion and attained bounds.

        The bounds are those of the lowest level.
        """
        envelope, table = self.envelope, {"time [s]": self.envelope.time}
        for o, name in enumerate(envelope.named):
            table[f"motion of {name}"] = self.values[::QUARTERS, o]
            table[f"attained lower bound of {name}"] = envelope.attained.lower[0, :, o]
            table[f"attained upper bound of {name}"] = envelope.attained.upper[0, :, o]
        return table


def _within_steps(upper: Array, between: Array) -> Array:
    """Return upper bounds at nodes and at the quarter points of steps, shape (4 (T − 1) + 1, m).

    Args:
        upper: Upper bounds at the nodes, shape (T, m).
        between: How far an output may exceed, within the step that ends at a node, the larger of
            the bounds at its ends, shape (T, m); the first row is not used.
    """
    inside = np.maximum(upper[1:], upper[:-1]) + between[1:]
    parts = [upper[:-1], *[inside] * (QUARTERS - 1)]
    return np.append(np.stack(parts, 1).reshape(-1, upper.shape[1]), upper[-1:], axis=0)


def _corners(low: Array, high: Array) -> Iterator[Array]:
    """Yield the corners (d,) of a box; of more than `CORNERS` two opposite and random others."""
    if 2.0 ** len(low) <= CORNERS:
        yield from map(np.array, product(*zip(low, high, strict=True)))
        return
    yield from (low, high)
    for upper in np.random.default_rng(60).integers(0, 2, (CORNERS - 2, len(low))):
        yield np.where(upper, high, low)


def variables(points: Array, motions: Sequence[LinearMotion]) -> Variables:
    """Return dataset variables with inputs (S, n) and matrices of the first of S structures.

    As many are stored as keep three matrices each within `MAX_NUMBERS`.
    """
    count = max(1, min(len(motions), MAX_NUMBERS // (3 * motions[0].mass.size)))
    stored = motions[:count]
    axes = AXES | (FORCES if stored[0].courses else {})
    arrays = {name: np.stack([getattr(x, name) for x in stored]) for name in axes}
    return {
        "motion_inputs": (("motion", "parameter"), points[:count]),
        **{f"motion_{name}": (axes[name], array) for name, array in arrays.items()},
        "record": (("sample",), stored[0].record),
        "record_step": ((), np.array(stored[0].record_step)),
        **_stored_courses(stored[0].courses),
    }


def stored_motions(data: xarray.Dataset) -> tuple[Array, list[LinearMotion]]:
    """Return inputs (S, n) and structures of the tested motions that a dataset holds."""
    points = data["motion_inputs"].values
    record, step = data["record"].values, float(data["record_step"])
    courses = _courses(data)
    m, n = data["motion_rows"].shape[1], data["motion_mass"].shape[1]
    no_forces = {"forces": np.zeros((n, 0)), "feeds": np.zeros((m, 0))}
    axes = AXES | (FORCES if courses else {})
    arrays = [
        no_forces | {name: data[f"motion_{name}"].values[s] for name in axes}
        for s in range(len(points))
    ]
    fixed: dict[str, Any] = {"record": record, "record_step": step, "courses": courses}
    return points, [LinearMotion(**arrays_of_motion, **fixed) for arrays_of_motion in arrays]


def _stored_courses(courses: Sequence[Course]) -> dict[str, tuple[tuple[str, ...], Array]]:
    """Return variables with the samples of all courses, one after the other, and their numbers.

    The numbers of a course are its sample count and its fields after the samples.
    """
    if not courses:
        return {}
    numbers = [[len(x.samples), *x[1:]] for x in courses]
    samples = np.concatenate([x.samples for x in courses])
    return {
        "course_samples": (("course_sample",), samples),
        "course_numbers": (("load", "number"), np.array(numbers, float)),
    }


def _courses(data: xarray.Dataset) -> tuple[Course, ...]:
    """Return the courses of forces that `_stored_courses` wrote to a dataset; none without any."""
    if "course_numbers" not in data:
        return ()
    numbers = data["course_numbers"].values
    ends = np.cumsum(numbers[:, 0]).astype(int)[:-1]
    samples = np.split(data["course_samples"].values, ends)
    return tuple(
        Course(x, step, start, bool(is_held), frequency, phase)
        for x, (_, step, start, is_held, frequency, phase) in zip(samples, numbers, strict=True)
    )
