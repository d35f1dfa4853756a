"""Exact motion of a linear structure at one set of parameters, to test proofs with.

This file must not be merged with what it judges. It shares no code with `Jet`, the integrators,
`LinearFlow` or the modal models, and needs NumPy and SciPy alone, so that a
fault in one of them does not hide itself.

Method: the exponential of the state matrix from one substep to the next (Van Loan, 1978, for the
load), and its Taylor series within a substep. Neither samples of the record nor substeps need to
coincide with the times asked for. A force adds its own motion from rest; a sine its steady state,
(iΩ − A) X = b, and a free motion that begins against it.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, isqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, expm, solve_triangular

Array = NDArray[np.float64]

MAX_NORM = 2.0
"""Largest norm of the state matrix times a substep; a larger one needs a higher degree."""
TRUNCATION = 1e-18
"""Truncation error of the Taylor series within a substep, as a share of the state; its degree is
24 at most."""
EPSILON = float(np.finfo(float).eps)
CONSTANT_ROUNDING = 64.0
"""Roundings of a value that do not grow with time, in ε: those of the series and of the rows."""
CHUNK = 4096
"""Times whose outputs are evaluated together, which limits the memory."""


class Course(NamedTuple):
    """A force over time: g(t) sin(Ω (t − start) + phase), or g(t) where Ω is 0.

    Args:
        samples: Samples of g, linear between and zero outside, shape (R,).
        step: Time between samples, in s.
        start: Time of the first one, in s.
        is_held: Whether the last one stays on.
        frequency: Ω, in rad/s.
        phase: In rad.
    """

    samples: Array
    step: float
    start: float
    is_held: bool
    frequency: float
    phase: float

    def values(self, times: Array) -> Array:
        """Return the force at times, shape (T,); at a jump its value after the jump."""
        since = times - self.start
        position = since / self.step
        is_sample = np.abs(position - np.rint(position)) < 1e-9
        position = np.where(is_sample, np.rint(position), position)
        value = np.interp(position, np.arange(len(self.samples)), self.samples)
        has_ended = (position >= len(self.samples) - 1) & (not self.is_held)
        value[(position < 0) | has_ended] = 0.0
        sine = np.sin(self.frequency * since + self.phase) if self.frequency else 1.0
        return np.asarray(value * sine)

    def kinks(self, time: float) -> list[tuple[float, float, float]]:
        """Return times since the start where g leaves its line, with its jump and change of slope.

        A kink (t₀, c, r) adds c + r (t − t₀) to g from t₀ on; those after `time` are left out.
        """
        slopes = np.diff(self.samples) / self.step
        change = np.diff(slopes, prepend=0.0, append=0.0)
        jump = np.zeros(len(self.samples))
        jump[0] = self.samples[0]
        if not self.is_held:
            jump[-1] = -self.samples[-1]
        moments = np.arange(len(self.samples)) * self.step
        kinks = np.column_stack([moments, jump, change])
        kinks = kinks[(moments <= time) & ((jump != 0) | (change != 0))]
        return [(float(start), float(level), float(slope)) for start, level, slope in kinks]

    def until(self, time: float) -> Array:
        """Samples that reach up to a time after the start, in s, where the last one is held."""
        more = max(0, ceil(time / self.step) + 1 - len(self.samples)) * self.is_held
        return np.append(self.samples, np.full(more, self.samples[-1]))


@dataclass(frozen=True, eq=False)
class LinearMotion:
    """M q̈ + D q̇ + K q = −M ι a(t) + Σ b f(t), a(t) linear between samples and zero outside.

    Args:
        mass: M, symmetric and positive definite, shape (n, n), in kg.
        damping: D, shape (n, n), in N s/m.
        stiffness: K, shape (n, n), in N/m.
        rows: C of the outputs C [q; q̇], shape (m, 2n).
        start: Initial state [q; q̇], shape (2n,).
        pattern: ι, shape (n,).
        record: Samples of a from t = 0 on, shape (R,), in m/s²; empty for none.
        record_step: Time between samples, in s.
        forces: b of each force, shape (n, H), in N.
        feeds: What a unit of each force adds to the outputs at once, shape (m, H).
        courses: f of each force.
    """

    mass: Array
    damping: Array
    stiffness: Array
    rows: Array
    start: Array
    pattern: Array
    record: Array
    record_step: float
    forces: Array
    feeds: Array
    courses: tuple[Course, ...] = ()

    def outputs(self, times: Array) -> tuple[Array, Array]:
        """Return outputs at times ≥ 0, rising, and bounds of their round-off, (T, m) each.

        Rounded inputs are those of a structure whose M^(−1/2) K M^(−1/2) differs by n ε of its norm
        ω², so that the slowest mode ω_1 turns by up to n ε ω² min(t², t/ω_1) / 2 rad more or less.
        """
        state = _EnergyState.from_motion(self)
        values, rounding = state.response_to_record(
            state.start, state.ground, self.record, self.record_step, times
        )
        for k, course in enumerate(self.courses):
            acts = times >= course.start - 1e-12 * times[-1]
            if not acts.any():
                continue
            since = np.maximum(times[acts] - course.start, 0.0)
            response, response_rounding = state.response_to_force(self.forces[:, k], course, since)
            values[acts] += response
            rounding[acts] += response_rounding
            values += self.feeds[:, k] * course.values(times)[:, None]
        return values, rounding


@dataclass(frozen=True, eq=False)
class _EnergyState:
    """x = [Lᵀ q; Lᵀ q̇/ω] with M = L Lᵀ and ω² the norm of L⁻¹ K L⁻ᵀ.

    In these coordinates the state matrix has the norm of the highest frequency, so that neither
    substeps nor rounding depend on units.

    Args:
        matrix: A of ẋ = A x + b a, shape (2n, 2n), in 1/s.
        lower: L, shape (n, n).
        ground: b of the ground's acceleration, shape (2n,).
        rows: Outputs of x, shape (m, 2n).
        start: x at t = 0.
        lowest: Least frequency, at least 1e-300 rad/s.
        highest: Greatest frequency ω, in rad/s.
        norm: Bound of the norm of A, in 1/s.
    """

    matrix: Array
    lower: Array
    ground: Array
    rows: Array
    start: Array
    lowest: float
    highest: float
    norm: float

    @classmethod
    def from_motion(cls, motion: LinearMotion) -> _EnergyState:
        """Return a motion in states x = [Lᵀ q; Lᵀ q̇/ω], with M = L Lᵀ and ω² = ‖L⁻¹ K L⁻ᵀ‖."""
        n, lower = len(motion.mass), cholesky(motion.mass, lower=True)

        def reduced(matrix: Array) -> Array:
            left = solve_triangular(lower, matrix, lower=True)
            return np.asarray(solve_triangular(lower, left.T, lower=True).T)

        spring, damper = reduced(motion.stiffness), reduced(motion.damping)
        squared = np.abs(np.linalg.eigvalsh(spring))
        omega = float(np.sqrt(squared.max())) or 1.0
        matrix = np.block([[np.zeros((n, n)), omega * np.eye(n)], [-spring / omega, -damper]])
        push = -(lower.T @ motion.pattern) / omega
        inverse = solve_triangular(lower, np.eye(n), lower=True)  # L⁻¹
        q, v = motion.start[:n], motion.start[n:]
        return cls(
            matrix=matrix,
            lower=lower,
            ground=np.concatenate([np.zeros(n), push]),
            rows=np.hstack(
                [motion.rows[:, :n] @ inverse.T, omega * motion.rows[:, n:] @ inverse.T]
            ),
            start=np.concatenate([lower.T @ q, lower.T @ v / omega]),
            lowest=max(float(np.sqrt(squared.min())), 1e-300),
            highest=omega,
            norm=omega + float(np.linalg.norm(damper)),
        )

    def response_to_record(
        self, start: Array, push: Array, record: Array, step: float, times: Array
    ) -> tuple[Array, Array]:
        """Return outputs of ẋ = A x + b a(t) at times and bounds of their round-off, (T, m) each.

        x(0) is `start` and b is `push`, (2n,) each; a has samples (R,) every `step` seconds from
        t = 0 on, and is zero where there are none.
        """
        last = max(float(times.max(initial=0.0)), 1e-300)
        interval = step if len(record) else last
        parts = max(1, ceil(self.norm * interval / MAX_NORM))
        substep = interval / parts
        size = float(np.linalg.norm(push)) or 1.0
        load = size * _substep_loads(record, parts, max(1, ceil(last / substep)))
        flow = self._loaded_flow(substep, np.asarray(push / size))
        exact_step = expm(flow)[: len(start)]  # columns of x, of a and of its increment
        states = _recursion(exact_step[:, :-2], start, load @ exact_step[:, -2:].T)
        degree, scaled = _degree(self.norm * substep), np.asarray(times / substep, float)
        values = _taylor(flow, degree, self.rows, np.hstack([states, load]), scaled)
        return values, self._rounding(np.abs(states).max(0), times)

    def response_to_force(self, force: Array, course: Course, times: Array) -> tuple[Array, Array]:
        """Return outputs from rest under a force b f(t), and their round-off, (T, m) each.

        `times` begin with the force. A sine times g = a + r t answers from one sample to the next
        as its particular motion Im (y + r z t) exp(iΩt) and a free motion that begins against it:
        (iΩ − A) y = b a − r z with (iΩ − A) z = b. Where g changes its line, free motions begin.
        """
        n, zero_state = len(force), np.zeros(len(self.matrix))
        acceleration = solve_triangular(self.lower, force, lower=True) / self.highest
        push, no_record = np.append(np.zeros(n), acceleration), np.zeros(0)
        last = float(times.max(initial=0.0))
        if not course.frequency:
            record = course.until(last)
            return self.response_to_record(zero_state, push, record, course.step, times)
        resolvent = 1j * course.frequency * np.eye(2 * n) - self.matrix
        z = np.linalg.solve(resolvent, push)
        zz, condition = np.linalg.solve(resolvent, z), float(np.linalg.cond(resolvent))
        values, rounding = np.zeros((2, len(times), len(self.rows)))
        for start, level, slope in course.kinks(last):
            acts = times >= start - 1e-12 * last
            since = np.maximum(times[acts] - start, 0.0)
            turn = np.exp(1j * (course.frequency * start + course.phase))
            constant, rising = turn * (level * z - slope * zz), turn * slope * z
            free, free_rounding = self.response_to_record(
                -constant.imag, zero_state, no_record, 0.0, since
            )
            wave = np.exp(1j * course.frequency * since)[:, None]
            steady = (constant + rising * since[:, None]) * wave
            values[acts] += free + steady.imag @ self.rows.T
            size = np.abs(steady).max(0, initial=0.0) + np.abs(level * z) + np.abs(slope * zz)
            rounding[acts] += free_rounding + self._rounding(size, since) * (1 + condition)
        return values, rounding

    def _rounding(self, state: Array, times: Array) -> Array:
        """Return the round-off of outputs of states as large as `state` (2n,), shape (T, m)."""
        turn = self.highest**2 * np.minimum(times**2, times / self.lowest) / 2
        rounding = len(self.lower) * EPSILON * (CONSTANT_ROUNDING + turn)
        return np.asarray(rounding[:, None] * (np.abs(self.rows) @ state))

    def _loaded_flow(self, substep: float, push: Array) -> Array:
        """Return F (2n + 2, 2n + 2) with exp(F) the map of (x, a, rise of a) over a substep.

        ẋ = A x + b a with b = `push` and a linear load a (Van Loan 1978).
        """
        size = len(self.matrix)
        flow = np.zeros((size + 2, size + 2))
        flow[:size, :size] = self.matrix * substep
        flow[:size, size] = push * substep
        flow[size, size + 1] = 1.0
        return flow


def _substep_loads(record: Array, parts: int, count: int) -> Array:
    """Return the load at the start of each substep and its increment, shape (count, 2)."""
    loads = np.zeros((count, 2))
    if len(record) > 1:
        rise = np.repeat(np.diff(record), parts) / parts
        begin = np.repeat(record[:-1], parts) + rise * (np.arange(len(rise)) % parts)
        n_loaded = min(count, len(rise))
        loads[:n_loaded] = np.column_stack([begin, rise])[:n_loaded]
    return loads


def _degree(norm: float) -> int:
    """Return the degree from which terms of exp(A τ), ‖A‖ τ ≤ `norm`, are below `TRUNCATION`.

    The load enters once and its increment twice, which costs two degrees.
    """
    degree, term = 2, 1.0
    while term > TRUNCATION:
        degree += 1
        term *= norm / (degree - 2)
    return degree


def _recursion(step: Array, start: Array, forcing: Array) -> Array:
    """Return the states x_0 … of x_{k+1} = step x_k + forcing_k, x_0 = `start`, (count, 2n).

    In blocks of √count substeps: responses of all blocks from zero at once, then the state at the
    beginning of each block, whose free motion is added.
    """
    count, size = forcing.shape
    length = isqrt(count - 1) + 1
    blocks = -(-count // length)
    filled = np.zeros((blocks * length, size))
    filled[:count] = forcing
    padded = np.reshape(filled, (blocks, length, size))
    from_zero = np.zeros((length + 1, blocks, size))
    for k in range(length):
        from_zero[k + 1] = from_zero[k] @ step.T + padded[:, k]
    block_step = np.linalg.matrix_power(step, length)
    free: Array = np.zeros((blocks, size))  # at the beginnings of blocks
    free[0] = start
    for b in range(1, blocks):
        free[b] = block_step @ free[b - 1] + from_zero[length, b - 1]
    states = np.empty((blocks, length, size))
    for k in range(length):
        states[:, k] = free + from_zero[k]
        free = free @ step.T
    return states.reshape(-1, size)[:count]


def _taylor(flow: Array, degree: int, rows: Array, states: Array, times: Array) -> Array:
    """Return outputs at times (T,), in substeps, by the Taylor series of exp(F τ), shape (T, m).

    F, the `flow`, moves a state with its load and the load's increment, 2n + 2 numbers; `states`
    are those at the beginning of each substep.
    """
    series = [np.hstack([rows, np.zeros((len(rows), 2))])]
    for i in range(1, degree + 1):
        series.append(series[-1] @ flow / i)
    terms, out = np.concatenate(series), []
    for chunk in np.array_split(times, -(-len(times) // CHUNK)):
        substep = np.minimum(chunk.astype(int), len(states) - 1)
        fraction = (chunk - substep)[:, None]
        coefficient = (states[substep] @ terms.T).reshape(len(chunk), degree + 1, len(rows))
        value: Array = coefficient[:, degree]
        for i in reversed(range(degree)):  # Horner's scheme
            value = value * fraction + coefficient[:, i]
        out.append(value)
    return np.concatenate(out)
