"""Exact motion of a linear structure at one set of parameters, to test proofs with.

This file must not be merged with what it judges. It shares no code with `Jet`, `record_load`,
`transfer_powers`, `LinearFlow` or the modal models, and needs NumPy and SciPy alone, so that a
fault in one of them does not hide itself.

Method: the exponential of the state matrix from one substep to the next (Van Loan, 1978, for the
load), and its Taylor series within a substep. Neither samples of the record nor substeps need to
coincide with the times asked for.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, isqrt

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


@dataclass(frozen=True, eq=False)
class LinearMotion:
    """M q̈ + D q̇ + K q = −M ι a(t) with a(t) linear between samples and zero outside the record.

    Args:
        mass: M, symmetric and positive definite, shape (n, n), in kg.
        damping: D, shape (n, n), in N s/m.
        stiffness: K, shape (n, n), in N/m.
        rows: C of the outputs C [q; q̇], shape (m, 2n).
        start: Initial state [q; q̇], shape (2n,).
        pattern: ι, shape (n,).
        record: Samples of a from t = 0 on, shape (R,), in m/s²; empty for none.
        record_step: Time between samples, in s.
    """

    mass: Array
    damping: Array
    stiffness: Array
    rows: Array
    start: Array
    pattern: Array
    record: Array
    record_step: float

    def outputs(self, times: Array) -> tuple[Array, Array]:
        """Outputs at times from 0 on, and their round-off, both of shape (T, m).

        Round-off: the numbers are those of a structure whose L⁻¹ K L⁻ᵀ differs by n ε of its norm
        ω², as the inputs themselves are rounded, so that the slowest mode ω_1 turns by up to
        n ε ω² min(t², t/ω_1) / 2 rad more or less.
        """
        state, last = _EnergyState.of(self), max(float(times.max()), 1e-300)
        interval = self.record_step if len(self.record) else last
        parts = max(1, ceil(state.norm * interval / MAX_NORM))
        substep = interval / parts
        count = max(1, ceil(last / substep))
        load = state.load_size * _substep_loads(self.record, parts, count)
        flow = state.loaded_flow(substep)
        step = expm(flow)[: len(state.start)]
        states = _recursion(step[:, :-2], state.start, load @ step[:, -2:].T)
        degree = _degree(state.norm * substep)
        loaded = np.hstack([states, load])
        values = _taylor(flow, degree, state.rows, loaded, np.asarray(times / substep, float))
        turn = state.highest**2 * np.minimum(times**2, times / state.lowest) / 2
        size = np.abs(state.rows) @ np.abs(states).max(0)
        rounding = len(self.mass) * EPSILON * (FEW + turn)
        return values, np.asarray(rounding[:, None] * size)


@dataclass(frozen=True, eq=False)
class _EnergyState:
    """x = [Lᵀ q; Lᵀ q̇/ω] with M = L Lᵀ and ω² the norm of L⁻¹ K L⁻ᵀ.

    In these coordinates the state matrix has the norm of the highest frequency, so that neither
    substeps nor rounding depend on units.

    Args:
        matrix: A of ẋ = A x + b a, shape (2n, 2n), in 1/s.
        load: b over its norm, shape (2n,).
        load_size: That norm.
        rows: Outputs of x, shape (m, 2n).
        start: x at t = 0.
        lowest: Least frequency, at least 1e-300 rad/s.
        highest: Greatest frequency ω, in rad/s.
        norm: Bound of the norm of A, in 1/s.
    """

    matrix: Array
    load: Array
    load_size: float
    rows: Array
    start: Array
    lowest: float
    highest: float
    norm: float

    @classmethod
    def of(cls, motion: LinearMotion) -> _EnergyState:
        """The state of a motion."""
        n, lower = len(motion.mass), cholesky(motion.mass, lower=True)

        def reduced(matrix: Array) -> Array:
            left = solve_triangular(lower, matrix, lower=True)
            return np.asarray(solve_triangular(lower, left.T, lower=True).T)

        spring, damper = reduced(motion.stiffness), reduced(motion.damping)
        squared = np.abs(np.linalg.eigvalsh(spring))
        omega = float(np.sqrt(squared.max())) or 1.0
        matrix = np.block([[np.zeros((n, n)), omega * np.eye(n)], [-spring / omega, -damper]])
        push = -(lower.T @ motion.pattern) / omega
        size = float(np.linalg.norm(push)) or 1.0
        back = solve_triangular(lower, np.eye(n), lower=True)  # L⁻¹: q = L⁻ᵀ x
        q, v = motion.start[:n], motion.start[n:]
        return cls(
            matrix,
            np.concatenate([np.zeros(n), push / size]),
            size,
            np.hstack([motion.rows[:, :n] @ back.T, omega * motion.rows[:, n:] @ back.T]),
            np.concatenate([lower.T @ q, lower.T @ v / omega]),
            max(float(np.sqrt(squared.min())), 1e-300),
            omega,
            omega + float(np.linalg.norm(damper)),
        )

    def loaded_flow(self, substep: float) -> Array:
        """Generator of (x, a, increment of a) over a substep, shape (2n + 2, 2n + 2)."""
        size = len(self.matrix)
        flow = np.zeros((size + 2, size + 2))
        flow[:size, :size] = self.matrix * substep
        flow[:size, size] = self.load * substep
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
        place = np.minimum(some.astype(int), len(states) - 1)
        within = (some - place)[:, None]
        coefficient = (states[place] @ terms.T).reshape(len(some), degree + 1, len(rows))
        value: Array = coefficient[:, degree]
        for i in reversed(range(degree)):  # Horner's scheme
            value = value * within + coefficient[:, i]
        out.append(value)
    return np.concatenate(out)
