"""Exact motion of a linear structure at one set of parameters, to test proofs with.

This file must not be merged with what it judges. It shares no code with `Jet`, the integrators,
`LinearFlow` or the modal models, and needs NumPy and SciPy alone, so that a
fault in one of them does not hide itself.

Method: the exponential of the state matrix, with the load as further states (Van Loan 1978), from
one substep to the next, and its Taylor series within a substep. Neither samples of loads nor
substeps need to coincide with the times asked for.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, expm, solve_triangular

Array = NDArray[np.float64]

MAX_NORM = 2.0
"""Largest norm of the state matrix times a substep; a larger one needs a higher degree."""
TRUNCATION = 1e-18
"""Truncation error of the Taylor series within a substep, as a fraction of the state; its degree is
24 at most."""
EPSILON = float(np.finfo(float).eps)
CONSTANT_ROUNDING = 64.0
"""Roundings of a value that do not grow with time, in ε: those of the series and of the rows."""
CHUNK = 4096
"""Times whose outputs are evaluated together, which limits the memory."""


class Course(NamedTuple):
    """A load over time: g(t) sin(Ω (t − start) + phase), or g(t) where Ω is 0."""

    samples: Array  # of g, linear between and zero outside, shape (R,)
    step: float  # time between samples, in s
    start: float = 0.0  # time of the first one, in s
    is_held: bool = False  # whether the last one stays on
    frequency: float = 0.0  # Ω, in rad/s
    phase: float = 0.0  # in rad

    def values(self, times: Array) -> Array:
        """Return the load at times, shape (T,); at a jump its value after the jump."""
        since = times - self.start
        position = since / self.step
        is_sample = np.abs(position - np.rint(position)) < 1e-9
        position = np.where(is_sample, np.rint(position), position)
        value = np.interp(position, np.arange(len(self.samples)), self.samples)
        has_ended = (position >= len(self.samples) - 1) & (not self.is_held)
        value[(position < 0) | has_ended] = 0.0
        sine = np.sin(self.frequency * since + self.phase) if self.frequency else 1.0
        return np.asarray(value * sine)

    def substep_loads(self, parts: int, count: int) -> Array:
        """Return g sin θ, g cos θ, r sin θ, r cos θ at the start of each substep, (count, 4).

        g rises by r within a substep, of which there are `parts` between two samples; θ is the
        angle of the sine, 90° without one.
        """
        n_held = self.is_held * max(0, -(-count // parts) + 1 - len(self.samples))
        samples = np.append(self.samples, np.full(n_held, self.samples[-1:]))
        line = np.zeros((count, 2))
        if len(samples) > 1:
            rise = np.repeat(np.diff(samples), parts) / parts
            begin = np.repeat(samples[:-1], parts) + rise * (np.arange(len(rise)) % parts)
            n_loaded = min(count, len(rise))
            line[:n_loaded] = np.column_stack([begin, rise])[:n_loaded]
        angle: Array = np.full(count, np.pi / 2)
        if self.frequency:
            angle = self.frequency * self.step / parts * np.arange(count) + self.phase
        wave = np.column_stack([np.sin(angle), np.cos(angle) if self.frequency else 0.0 * angle])
        return np.reshape(line[:, :, None] * wave[:, None], (count, 4))


@dataclass(frozen=True, eq=False)
class LinearMotion:
    """M q̈ + D q̇ + K q = −M ι a(t) + Σ b f(t), a(t) linear between samples and zero outside."""

    mass: Array  # M, symmetric and positive definite, shape (n, n), in kg
    damping: Array  # D, shape (n, n), in N s/m
    stiffness: Array  # K, shape (n, n), in N/m
    rows: Array  # C of the outputs C [q; q̇], shape (m, 2n)
    start: Array  # initial state [q; q̇], shape (2n,)
    pattern: Array  # ι, shape (n,)
    record: Array  # samples of a from t = 0 on, shape (R,), in m/s²; empty for none
    record_step: float  # time between samples, in s
    forces: Array  # b of each force, shape (n, H), in N
    feeds: Array  # what a unit of each force adds to the outputs at once, shape (m, H)
    courses: tuple[Course, ...] = ()  # f of each force

    def outputs(self, times: Array) -> tuple[Array, Array]:
        """Return outputs at times ≥ 0, rising, and bounds of their round-off, (T, m) each.

        Rounded inputs are those of a structure whose M^(−1/2) K M^(−1/2) differs by n ε of its norm
        ω², so that the slowest mode ω_1 turns by up to n ε ω² min(t², t/ω_1) / 2 rad more or less.
        """
        n, lower = len(self.mass), cholesky(self.mass, lower=True)  # M = L Lᵀ

        def reduced(matrix: Array) -> Array:
            left = solve_triangular(lower, matrix, lower=True)
            return np.asarray(solve_triangular(lower, left.T, lower=True).T)

        # In states x = [Lᵀ q; Lᵀ q̇/ω], ω² = ‖L⁻¹ K L⁻ᵀ‖, the state matrix has the norm of the
        # highest frequency, so that neither substeps nor rounding depend on units.
        spring, damper = reduced(self.stiffness), reduced(self.damping)
        squared = np.abs(np.linalg.eigvalsh(spring))
        omega = float(np.sqrt(squared.max())) or 1.0
        lowest = max(float(np.sqrt(squared.min())), 1e-300)
        inverse = solve_triangular(lower, np.eye(n), lower=True)  # L⁻¹
        A = np.block([[np.zeros((n, n)), omega * np.eye(n)], [-spring / omega, -damper]])
        norm = omega + float(np.linalg.norm(damper))  # of A at most
        rows = np.hstack([self.rows[:, :n] @ inverse.T, omega * self.rows[:, n:] @ inverse.T])

        def response(
            start: Array, push: Array, course: Course, times: Array
        ) -> tuple[Array, Array]:
            """Outputs of ẋ = A x + [0; push] f(t), x(0) = start, and their round-off, (T, m)."""
            last = max(float(times.max(initial=0.0)), 1e-300)
            interval, frequency = course.step if len(course.samples) else last, course.frequency
            parts = max(1, ceil(max(norm, frequency) * interval / MAX_NORM))
            substep, size = interval / parts, float(np.linalg.norm(push)) or 1.0
            load = size * course.substep_loads(parts, max(1, ceil(last / substep)))
            flow = np.zeros((2 * n + 4, 2 * n + 4))  # of x and the load's four numbers
            flow[: 2 * n, : 2 * n], flow[n : 2 * n, 2 * n] = A * substep, push / size * substep
            turn = frequency * substep
            flow[2 * n :, 2 * n :] = np.kron(np.eye(2), [[0, turn], [-turn, 0]]) + np.eye(4, k=2)
            exact_step = expm(flow)[: 2 * n]
            states = _recursion(exact_step[:, : 2 * n], start, load @ exact_step[:, 2 * n :].T)
            # degree from which terms of exp(A τ) are below `TRUNCATION`; two degrees are for the
            # rise of the load, which is integrated twice
            degree, term, scaled = 2, 1.0, np.asarray(times / substep)
            while term > TRUNCATION:
                degree += 1
                term *= max(norm, frequency) * substep / (degree - 2)
            values = _taylor(flow, degree, rows, np.hstack([states, load]), scaled)
            phase = omega**2 * np.minimum(times**2, times / lowest) / 2 + frequency * times
            rounding = n * EPSILON * (CONSTANT_ROUNDING + phase)
            return values, rounding[:, None] * (np.abs(rows) @ np.abs(states).max(0))

        start = np.concatenate([lower.T @ self.start[:n], lower.T @ self.start[n:] / omega])
        ground = Course(self.record, self.record_step)
        values, rounding = response(start, -(lower.T @ self.pattern) / omega, ground, times)
        for force, feed, course in zip(self.forces.T, self.feeds.T, self.courses, strict=True):
            acts = times >= course.start - 1e-12 * times[-1]
            if acts.any():
                since = np.maximum(times[acts] - course.start, 0.0)
                by_force = response(0.0 * start, inverse @ force / omega, course, since)
                values[acts] += by_force[0]
                rounding[acts] += by_force[1]
            values += feed * course.values(times)[:, None]
        return values, rounding


def _recursion(step: Array, start: Array, forcing: Array) -> Array:
    """Return the states x_0 … of x_{k+1} = step x_k + forcing_k, x_0 = `start`, (count, 2n)."""
    # recursive doubling (Kogge, Stone 1973): with the states that a span of 2, 4, … substeps before
    # each one adds, those of twice the span follow at once
    states, span = np.vstack([start, forcing[:-1]]), 1
    while span < len(states):
        states[span:] += states[:-span] @ step.T
        step, span = step @ step, 2 * span
    return states


def _taylor(flow: Array, degree: int, rows: Array, states: Array, times: Array) -> Array:
    """Return outputs at times (T,), in substeps, by the Taylor series of exp(F τ), shape (T, m).

    F, the `flow`, moves a state with four numbers of its load, 2n + 4 in all; `states` are those at
    the beginning of each substep.
    """
    series = [np.hstack([rows, np.zeros((len(rows), 4))])]
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
