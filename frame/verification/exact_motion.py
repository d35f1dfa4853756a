"""Exact motion of a linear structure at one set of parameters, to test proofs with.

This file must not be merged with what it judges. It shares no code with `Jet`, `record_load`,
`transfer_powers`, `LinearFlow` or the modal models, and needs NumPy and SciPy alone, so that a
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
LEFT = 1e-18
"""What the Taylor series within a substep leaves, as a share of the state; degree 24 at most."""
EPSILON = float(np.finfo(float).eps)
FEW = 64.0
"""Roundings of a value that do not grow with time, in ε: those of the series and of the rows."""
AT_ONCE = 4096
"""Times whose outputs are evaluated together, which limits the memory."""


class Course(NamedTuple):
    """A force over time: g(t) sin(Ω (t − start) + phase), or g(t) where Ω is 0.

    Args:
        samples: Samples of g, linear between and zero outside, shape (R,).
        step: Time between samples, in s.
        start: Time of the first one, in s.
        is_held: Whether the last one stays on; that of a sine, which is 1, does.
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
        """The force at times, after jumps, shape (T,)."""
        since = times - self.start
        position = since / self.step
        position = np.where(
            np.abs(position - np.rint(position)) < 1e-9, np.rint(position), position
        )
        value = np.interp(position, np.arange(len(self.samples)), self.samples)
        value[(position < 0) | ((position >= len(self.samples) - 1) & (not self.is_held))] = 0.0
        sine = np.sin(self.frequency * since + self.phase) if self.frequency else 1.0
        return np.asarray(value * sine)

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
        """Outputs at times from 0 on, and their round-off, both of shape (T, m).

        Round-off: the numbers are those of a structure whose L⁻¹ K L⁻ᵀ differs by n ε of its norm
        ω², as the inputs themselves are rounded, so that the slowest mode ω_1 turns by up to
        n ε ω² min(t², t/ω_1) / 2 rad more or less.
        """
        state = _EnergyState.from_motion(self)
        values, rounding = state.moved(
            state.start, state.ground, self.record, self.record_step, times
        )
        for k, course in enumerate(self.courses):
            acts = times >= course.start - 1e-12 * times[-1]
            if not acts.any():
                continue
            since = np.maximum(times[acts] - course.start, 0.0)
            driven, more = state.driven(self.forces[:, k], course, since)
            values[acts] += driven
            rounding[acts] += more
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
        """Energy-scaled state space of a motion, with M = L Lᵀ."""
        n, lower = len(motion.mass), cholesky(motion.mass, lower=True)

        def reduced(matrix: Array) -> Array:
            left = solve_triangular(lower, matrix, lower=True)
            return np.asarray(solve_triangular(lower, left.T, lower=True).T)

        spring, damper = reduced(motion.stiffness), reduced(motion.damping)
        squared = np.abs(np.linalg.eigvalsh(spring))
        omega = float(np.sqrt(squared.max())) or 1.0
        matrix = np.block([[np.zeros((n, n)), omega * np.eye(n)], [-spring / omega, -damper]])
        push = -(lower.T @ motion.pattern) / omega
        back = solve_triangular(lower, np.eye(n), lower=True)  # L⁻¹: q = L⁻ᵀ x
        q, v = motion.start[:n], motion.start[n:]
        return cls(
            matrix,
            lower,
            np.concatenate([np.zeros(n), push]),
            np.hstack([motion.rows[:, :n] @ back.T, omega * motion.rows[:, n:] @ back.T]),
            np.concatenate([lower.T @ q, lower.T @ v / omega]),
            max(float(np.sqrt(squared.min())), 1e-300),
            omega,
            omega + float(np.linalg.norm(damper)),
        )

    def moved(
        self, start: Array, push: Array, record: Array, step: float, times: Array
    ) -> tuple[Array, Array]:
        """Outputs at times and their round-off, (T, m), from a start and under b a(t)."""
        last = max(float(times.max(initial=0.0)), 1e-300)
        interval = step if len(record) else last
        parts = max(1, ceil(self.norm * interval / MAX_NORM))
        substep = interval / parts
        size = float(np.linalg.norm(push)) or 1.0
        load = size * _substep_loads(record, parts, max(1, ceil(last / substep)))
        flow = self._loaded_flow(substep, np.asarray(push / size))
        exact = expm(flow)[: len(start)]
        states = _recursion(exact[:, :-2], start, load @ exact[:, -2:].T)
        degree, scaled = _degree(self.norm * substep), np.asarray(times / substep, float)
        values = _taylor(flow, degree, self.rows, np.hstack([states, load]), scaled)
        return values, self._rounding(np.abs(states).max(0), times)

    def driven(self, force: Array, course: Course, times: Array) -> tuple[Array, Array]:
        """Outputs at times since a force's start, from rest, and their round-off, (T, m) each."""
        n, nothing = len(force), np.zeros(len(self.matrix))
        pushed = solve_triangular(self.lower, force, lower=True) / self.highest
        push, none = np.append(np.zeros(n), pushed), np.zeros(0)
        if not course.frequency:
            record = course.until(float(times.max(initial=0.0)))
            return self.moved(nothing, push, record, course.step, times)
        resolvent = 1j * course.frequency * np.eye(2 * n) - self.matrix
        steady = np.linalg.solve(resolvent, push) * np.exp(1j * course.phase)
        free, rounding = self.moved(-steady.imag, nothing, none, 0.0, times)
        waves = steady * np.exp(1j * course.frequency * times)[:, None]
        condition = float(np.linalg.cond(resolvent))
        more = self._rounding(np.abs(steady), times)
        return free + waves.imag @ self.rows.T, rounding + more * (1 + condition)

    def _rounding(self, state: Array, times: Array) -> Array:
        """Round-off of outputs of states as large as `state` (2n,), shape (T, m)."""
        turn = self.highest**2 * np.minimum(times**2, times / self.lowest) / 2
        rounding = len(self.lower) * EPSILON * (FEW + turn)
        return np.asarray(rounding[:, None] * (np.abs(self.rows) @ state))

    def _loaded_flow(self, substep: float, push: Array) -> Array:
        """Generator of (x, a, increment of a) over a substep, shape (2n + 2, 2n + 2)."""
        size = len(self.matrix)
        flow = np.zeros((size + 2, size + 2))
        flow[:size, :size] = self.matrix * substep
        flow[:size, size] = push * substep
        flow[size, size + 1] = 1.0
        return flow


def _substep_loads(record: Array, parts: int, count: int) -> Array:
    """Acceleration at the beginning of each substep and its increment there, shape (count, 2)."""
    loads = np.zeros((count, 2))
    if len(record) > 1:
        rise = np.repeat(np.diff(record), parts) / parts
        begin = np.repeat(record[:-1], parts) + rise * (np.arange(len(rise)) % parts)
        some = min(count, len(rise))
        loads[:some] = np.column_stack([begin, rise])[:some]
    return loads


def _degree(norm: float) -> int:
    """Degree of the Taylor series of exp(A τ), ‖A‖ τ ≤ `norm`, that leaves less than `LEFT`.

    The load enters once and its increment twice, which costs two degrees.
    """
    degree, term = 2, 1.0
    while term > LEFT:
        degree += 1
        term *= norm / (degree - 2)
    return degree


def _recursion(step: Array, start: Array, forcing: Array) -> Array:
    """States x_k of x_{k+1} = step x_k + forcing_k, shape (count, 2n).

    Blocks of √count substeps are summed side by side from zero, then joined.
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
    across = np.linalg.matrix_power(step, length)
    first: Array = np.zeros((blocks, size))
    first[0] = start
    for b in range(1, blocks):
        first[b] = across @ first[b - 1] + from_zero[length, b - 1]
    states = np.empty((blocks, length, size))
    for k in range(length):
        states[:, k] = first + from_zero[k]
        first = first @ step.T
    return states.reshape(-1, size)[:count]


def _taylor(flow: Array, degree: int, rows: Array, states: Array, times: Array) -> Array:
    """Outputs at times in substeps, from the loaded states where substeps begin, shape (T, m)."""
    series = [np.hstack([rows, np.zeros((len(rows), 2))])]
    for i in range(1, degree + 1):
        series.append(series[-1] @ flow / i)
    terms, out = np.concatenate(series), []
    for some in np.array_split(times, -(-len(times) // AT_ONCE)):
        piece = np.minimum(some.astype(int), len(states) - 1)
        within = (some - piece)[:, None]
        coefficient = (states[piece] @ terms.T).reshape(len(some), degree + 1, len(rows))
        value: Array = coefficient[:, degree]
        for i in reversed(range(degree)):  # Horner's scheme
            value = value * within + coefficient[:, i]
        out.append(value)
    return np.concatenate(out)
