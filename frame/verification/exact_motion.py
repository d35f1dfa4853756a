"""Exact response of a linear structure at one set of parameters, to test proofs with.

This file must not be merged with what it judges. It shares no code with `Jet`, the integrators,
`LinearFlow` or the modal models, and needs NumPy and SciPy alone, so that a fault in one of them
does not hide itself.

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


class LoadHistory(NamedTuple):
    """A load over time: g(t) sin(Ω (t − start) + phase), or g(t) where Ω is 0."""

    samples: Array  # of g, linear between and zero outside, shape (R,)
    step: float  # time between samples, in s
    start: float = 0.0  # time of the first one, in s
    is_held: bool = False  # whether the last one stays on
    frequency: float = 0.0  # Ω, in rad/s
    phase: float = 0.0  # in rad

    def values(self, times: Array) -> Array:
        """Return the load g(t) sin(Ω (t − start) + phase), or g(t) if Ω is 0, at times, (T,).

        g is linear between its samples and zero before the first one. After the last one it keeps
        its value if `is_held`, and is zero otherwise. At the first sample that sample is returned,
        at the last one 0 unless `is_held`. Without samples NumPy raises ValueError.

        Args:
            times: In s, shape (T,), in any order.
        """
        since = times - self.start
        position = since / self.step
        # Times of samples are hit exactly, so that jumps are on the right side.
        is_sample = np.abs(position - np.rint(position)) < 1e-9
        position = np.where(is_sample, np.rint(position), position)
        value = np.interp(position, np.arange(len(self.samples)), self.samples)
        has_ended = (position >= len(self.samples) - 1) & (not self.is_held)
        value[(position < 0) | has_ended] = 0.0
        if self.frequency:
            value = value * np.sin(self.frequency * since + self.phase)
        return np.asarray(value)

    def substep_loads(self, substeps: int, count: int) -> Array:
        """Return the load at the start of each substep as four numbers, shape (count, 4).

        They are g sin θ, g cos θ, r sin θ and r cos θ: g rises by r within a substep, and θ = Ω (t
        − start) + phase is the angle of the sine, 90° where there is no sine. Time begins at the
        first sample. After the last sample g and r are zero, or g stays and r is zero if the last
        sample is held. A history without samples, which cannot be held, gives zeros.

        Args:
            substeps: Number of equal substeps between two samples.
            count: Number of all substeps.
        """
        samples = self.samples
        if self.is_held:
            n_held = max(0, -(-count // substeps) + 1 - len(samples))
            samples = np.append(samples, np.full(n_held, samples[-1:]))
        line = np.zeros((count, 2))  # g and r
        if len(samples) > 1:
            rise = np.repeat(np.diff(samples), substeps) / substeps
            begin = np.repeat(samples[:-1], substeps) + rise * (np.arange(len(rise)) % substeps)
            n_loaded = min(count, len(rise))
            line[:n_loaded] = np.column_stack([begin, rise])[:n_loaded]
        wave: Array = np.tile([1.0, 0.0], (count, 1))  # sin θ and cos θ
        if self.frequency:
            angle = self.frequency * self.step / substeps * np.arange(count) + self.phase
            wave = np.column_stack([np.sin(angle), np.cos(angle)])
        return np.reshape(line[:, :, np.newaxis] * wave[:, np.newaxis], (count, 4))


class RoundedOutputs(NamedTuple):
    """Outputs at T times and bounds of their rounding, shape (T, m) each."""

    values: Array
    rounding: Array


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
    histories: tuple[LoadHistory, ...] = ()  # f of each force

    def outputs(self, times: Array) -> RoundedOutputs:
        """Return the outputs of M q̈ + D q̇ + K q = −M ι a(t) + Σ b f(t), exact but for rounding.

        The response to the initial state and the ground comes first; then that to each force, which
        acts from its start on, on a structure at rest, is added, together with what the force adds
        to outputs at once.

        Args:
            times: Times ≥ 0, rising, at least one, shape (T,), in s.

        Returns:
            `values` and bounds of their rounding, `rounding`, shape (T, m) each, in the units of
            the outputs.

        Raises:
            numpy.linalg.LinAlgError: The mass matrix is not positive definite.
        """
        n = len(self.mass)
        lower = cholesky(self.mass, lower=True)  # M = L Lᵀ
        inverse = solve_triangular(lower, np.eye(n), lower=True)  # L⁻¹
        system = _ScaledSystem.of_matrices(lower, self.damping, self.stiffness, self.rows)
        omega = system.omega
        start = np.concatenate([lower.T @ self.start[:n], lower.T @ self.start[n:] / omega])
        ground = LoadHistory(self.record, self.record_step)
        values, rounding = system.outputs(start, -(lower.T @ self.pattern) / omega, ground, times)
        # A force acts from its start on, on a structure at rest. Responses add up.
        for force, feed, history in zip(self.forces.T, self.feeds.T, self.histories, strict=True):
            acts = times >= history.start - 1e-12 * times[-1]
            if acts.any():
                since = np.maximum(times[acts] - history.start, 0.0)
                by_force = system.outputs(0.0 * start, inverse @ force / omega, history, since)
                values[acts] += by_force.values
                rounding[acts] += by_force.rounding
            values += feed * history.values(times)[:, np.newaxis]
        return RoundedOutputs(values, rounding)


@dataclass(frozen=True, eq=False)
class _ScaledSystem:
    """ẋ = A x + [0; push] f(t) in the states x = [Lᵀ q; Lᵀ q̇/ω], with M = L Lᵀ, ω² = ‖L⁻¹ K L⁻ᵀ‖.

    In these states the state matrix A has the norm of the highest frequency, so that neither
    substeps nor rounding depend on units.
    """

    matrix: Array  # A, shape (2n, 2n), in 1/s
    rows: Array  # rows of the outputs on these states, shape (m, 2n)
    omega: float  # ω, in rad/s
    lowest: float  # lowest undamped frequency, in rad/s
    norm: float  # bound of ‖A‖

    @classmethod
    def of_matrices(
        cls, lower: Array, damping: Array, stiffness: Array, rows: Array
    ) -> _ScaledSystem:
        """Return a structure as ẋ = A x in the states x = [Lᵀ q; Lᵀ q̇/ω], where L Lᵀ is its mass.

        In these states A has about the norm of the highest frequency ω = √‖L⁻¹ K L⁻ᵀ‖. If the
        stiffness is zero, ω is 1.

        Args:
            lower: Cholesky factor L of the mass, lower triangular, shape (n, n).
            damping: D, shape (n, n), in N s/m.
            stiffness: K, symmetric, shape (n, n), in N/m.
            rows: Rows of the outputs on [q; q̇], shape (m, 2n).

        Returns:
            A, the rows on x, ω, the lowest undamped frequency in rad/s, and a bound of ‖A‖.
        """
        n = len(lower)

        def reduced(matrix: Array) -> Array:
            """Return L⁻¹ X L⁻ᵀ of a matrix X, shape (n, n)."""
            left = solve_triangular(lower, matrix, lower=True)
            return np.asarray(solve_triangular(lower, left.T, lower=True).T)

        spring = reduced(stiffness)
        damper = reduced(damping)
        squared = np.abs(np.linalg.eigvalsh(spring))
        omega = float(np.sqrt(squared.max())) or 1.0
        inverse = solve_triangular(lower, np.eye(n), lower=True)
        return cls(
            matrix=np.block([[np.zeros((n, n)), omega * np.eye(n)], [-spring / omega, -damper]]),
            rows=np.hstack([rows[:, :n] @ inverse.T, omega * rows[:, n:] @ inverse.T]),
            omega=omega,
            lowest=max(float(np.sqrt(squared.min())), 1e-300),
            norm=omega + float(np.linalg.norm(damper)),
        )

    def outputs(
        self, start: Array, push: Array, history: LoadHistory, times: Array
    ) -> RoundedOutputs:
        """Return outputs of ẋ = A x + [0; push] f(t), x(0) = `start`, and bounds of rounding.

        Rounded matrices are those of a structure whose L⁻¹ K L⁻ᵀ differs by n ε of its norm ω², so
        that the phase of the slowest mode ω_1 is off by up to n ε ω² min(t², t/ω_1) / 2 rad.

        Args:
            start: Initial state, shape (2n,).
            push: What a unit of the load adds to the second half of ẋ, shape (n,).
            history: The load f, which begins at t = 0 here whatever its `start`; without samples it
                is zero.
            times: Times ≥ 0, rising, shape (T,), in s.

        Returns:
            `values` and `rounding`, shape (T, m) each.
        """
        n = len(push)
        last = max(float(times.max(initial=0.0)), 1e-300)
        interval = history.step if len(history.samples) else last
        # The norm of A times a substep is at most 2; a larger one needs a higher degree.
        fastest = max(self.norm, history.frequency)
        substeps = max(1, ceil(fastest * interval / 2.0))
        substep = interval / substeps
        scale = float(np.linalg.norm(push)) or 1.0
        load = scale * history.substep_loads(substeps, max(1, ceil(last / substep)))

        # The matrix of the states and the four numbers of the load, times a substep.
        flow = np.zeros((2 * n + 4, 2 * n + 4))
        flow[: 2 * n, : 2 * n] = self.matrix * substep
        flow[n : 2 * n, 2 * n] = push / scale * substep
        turn = history.frequency * substep
        # d/dt of g sin θ, g cos θ, r sin θ and r cos θ, where g rises by r
        flow[2 * n :, 2 * n :] = [
            [0, turn, 1, 0],
            [-turn, 0, 0, 1],
            [0, 0, 0, turn],
            [0, 0, -turn, 0],
        ]
        exact_step = expm(flow)[: 2 * n]
        states = _recursion(exact_step[:, : 2 * n], start, load @ exact_step[:, 2 * n :].T)

        # Degree from which terms of exp(A τ) are below 1e-18 of the state, 24 at most. Two degrees
        # are for the rise of the load, which is integrated twice.
        degree = 2
        term = 1.0
        while term > 1e-18:
            degree += 1
            term *= fastest * substep / (degree - 2)
        all_states = np.hstack([states, load])
        values = _taylor(flow, degree, self.rows, all_states, np.asarray(times / substep))

        # 64 roundings of the series and of the rows do not grow with time.
        slow_phase = self.omega**2 * np.minimum(times**2, times / self.lowest) / 2
        phase = slow_phase + history.frequency * times
        rounding = n * np.finfo(float).eps * (64.0 + phase)
        magnitude = np.abs(self.rows) @ np.abs(states).max(axis=0)
        return RoundedOutputs(values, rounding[:, np.newaxis] * magnitude)


def _recursion(step: Array, start: Array, forcing: Array) -> Array:
    """Return the states of x_{k+1} = A x_k + f_k, with x_0 = `start`, for k = 0 … count − 1.

    It is recursive doubling (Kogge, Stone 1973): each pass doubles the number of earlier forcings
    that a state contains, so that log2(count) passes suffice.

    Args:
        step: A, shape (2n, 2n).
        start: x_0, shape (2n,).
        forcing: f_k, shape (count, 2n), count ≥ 1; the last row would lead beyond the end and is
            not used. Not changed.

    Returns:
        Shape (count, 2n).
    """
    states = np.vstack([start, forcing[:-1]])
    span = 1
    while span < len(states):
        states[span:] += states[:-span] @ step.T
        step = step @ step
        span *= 2
    return states


def _taylor(flow: Array, degree: int, rows: Array, states: Array, times: Array) -> Array:
    """Return outputs by the Taylor series of exp(F τ) within substeps, shape (T, m).

    Args:
        flow: F times a substep, shape (2n + 4, 2n + 4), of the 2n states and of four numbers of the
            load, g sin θ, g cos θ, r sin θ and r cos θ.
        degree: Degree of the series.
        rows: Rows of the outputs on the states, shape (m, 2n).
        states: States and numbers of the load at the beginning of each substep, shape (count, 2n +
            4).
        times: Times in substeps, at least one, shape (T,); those after the last substep continue
            its series.
    """
    series = [np.hstack([rows, np.zeros((len(rows), 4))])]
    for i in range(1, degree + 1):
        series.append(series[-1] @ flow / i)
    terms = np.concatenate(series)
    out = []
    for chunk in np.array_split(times, -(-len(times) // 4096)):  # which limits the memory
        substep = np.minimum(chunk.astype(int), len(states) - 1)
        fraction = (chunk - substep)[:, np.newaxis]
        coefficient = (states[substep] @ terms.T).reshape(len(chunk), degree + 1, len(rows))
        value: Array = coefficient[:, degree]
        for i in reversed(range(degree)):  # Horner's scheme
            value = value * fraction + coefficient[:, i]
        out.append(value)
    return np.concatenate(out)
