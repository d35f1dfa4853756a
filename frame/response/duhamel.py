"""Duhamel integral of an oscillator under a record that is linear between its samples.

ρ(σ; t) = ∫₀ᵗ exp(σ τ) a(t − τ) dτ is exact over an interval h in which the record runs linearly,
at the slope s, to a₁ (piecewise linear load: Clough, Penzien 1993, chapter 7):

    ρ(t + h) = exp(σ h) ρ(t) + a₁ J₀ − s J₁,   J_n = ∫₀ʰ τⁿ exp(σ τ) dτ,

and so are its derivatives by σ. Nodes lie anywhere, samples need not be nodes. All responses to a
record are walked by the one kernel here: at all nodes for each σ, from rest at the first node or at
each window's beginning, or at a given node for each row of σ. Rounding is bounded beside the values
(running error analysis: Higham 2002, section 3.3).

A load g(t) sin θ(t), θ = Ω (t − start) + phase, is walked as g at two exponents:

    ρ(σ; t) = (exp(iθ(t)) ρ_g(σ − iΩ; t) − exp(−iθ(t)) ρ_g(σ + iΩ; t)) / 2i.
"""

from __future__ import annotations

from collections.abc import Callable
from math import ceil
from threading import Lock
from typing import Any, NamedTuple

import numpy as np
from numba import njit, prange

from alphacut.frame.calculus.rounding import UNIT_ROUNDOFF
from alphacut.frame.response.step_integrals import (
    error_of_integrals,
    require_in_range,
    step_integrals,
)
from alphacut.frame.structures.loads import History
from alphacut.fuzzy.arrays import Array, Rows

PARALLEL_LOOP = Lock()
"""Held by the thread that is in a parallel loop of Numba, which not all its layers share."""
SAME_TIME = 4 * UNIT_ROUNDOFF
"""Distance of two times, as a share of the last node's, that is their rounding alone."""
ERROR_OF_TURN = 8.0
"""Rounding in u of one product exp(σ h) ρ besides |σ h|: 3 of exp, √5 of the product, 2 of sums."""


Orders = tuple[int, ...]
"""As many zeros as derivatives are wanted; a tuple's length is known when a kernel is compiled."""


class Walk(NamedTuple):
    """A record up to the last of some nodes, and where these lie.

    Args:
        first: Load at the beginning of each interval between samples, shape (I,), such as an
            acceleration in m/s².
        last: Load at its end.
        step: Length of an interval, in s.
        interval: Interval in which each node lies, rising, shape (T,).
        phases: Different times from an interval's beginning to a node in it, shape (P,), in s.
        phase: Which of them is each node's, shape (T,).
        time_rounding: Rounding of each node's time since its interval began, shape (T,), in s.
    """

    first: Array
    last: Array
    step: float
    interval: Rows
    phases: Array
    phase: Rows
    time_rounding: Array


def walk(history: History, time: Array) -> Walk:
    """Straight pieces of a load up to the last node, and for each node its piece and place in it.

    A sine by which the load is multiplied is left out.

    Args:
        history: The load.
        time: Nodes, rising, shape (T,), in s.
    """
    samples, step = history.samples, history.step
    before = ceil(history.start / step)  # intervals in which there is no load
    time = time + (before * step - history.start)
    same = SAME_TIME * float(time[-1])
    interval = ((time + same) / step).astype(np.int64)
    count = int(interval[-1]) + 1
    tail = samples[-1] if history.is_held else 0.0
    first, last = np.full((2, before + max(count, len(samples))), tail)
    first[:before] = last[:before] = 0.0
    first[before : before + len(samples) - 1] = samples[:-1]
    last[before : before + len(samples) - 1] = samples[1:]
    since: Array = np.maximum(time - interval * step, 0.0)
    order = np.argsort(since, kind="stable")
    is_new = np.diff(since[order], prepend=-np.inf) > same
    phase = np.empty(len(time), np.int64)
    phase[order] = np.cumsum(is_new) - 1
    phases = since[order][is_new]
    phases[phases <= same] = 0.0
    time_rounding = np.abs(since - phases[phase]) + UNIT_ROUNDOFF * time
    return Walk(first[:count], last[:count], step, interval, phases, phase, time_rounding)


def impulses(history: History, time: Array) -> Array:
    """Bounds of ∫₀ᵗ |f| at nodes t, shape (T,)."""
    path = walk(history, time)
    sizes = np.cumsum(np.maximum(np.abs(path.first), np.abs(path.last)) * path.step)
    return np.asarray(sizes[path.interval])


def absolute_moments(decay: float, history: History, time: Array) -> Array:
    """Bounds of ∫₀ᵗ τⁿ exp(−g τ) |f(t − τ)| dτ at nodes t, n = 0 … 4, shape (5, T); g = `decay`."""
    path = walk(history, time)
    sizes = np.maximum(np.abs(path.first), np.abs(path.last))
    since = path.phases[path.phase] + path.time_rounding
    out: Array = np.empty((5, len(time)))
    _walk_moments(sizes, path.interval, since, decay, path.step, out)
    return out


@njit(cache=True, nogil=True)
def _walk_moments(
    sizes: Array, interval: Rows, since: Array, decay: float, h: float, out: Array
) -> None:
    """Write the moments of `absolute_moments` to `out` (5, T).

    Args:
        sizes: Bound of |f| in each interval.
        interval: Interval of each node, rising, shape (T,).
        since: Time of each node since its interval began, shape (T,), in s.
        decay: g, in 1/s.
        h: Length of an interval, in s.
        out: Written.
    """
    state, moved, node = np.zeros(5), np.empty(5), 0
    for i in range(interval[-1] + 1):
        while node < len(interval) and interval[node] == i:
            _move_moments(state, decay, since[node], sizes[i], out[:, node])
            node += 1
        _move_moments(state, decay, h, sizes[i], moved)
        state[:] = moved


@njit(cache=True, nogil=True)
def _move_moments(state: Array, decay: float, h: float, size: float, out: Array) -> None:
    """Write to `out` (5,) the moments `state` (5,) a time h later, under a load up to `size`."""
    fade = np.exp(-decay * h)
    for n in range(5):
        total, choices = 0.0, 1.0
        for j in range(n, -1, -1):  # Σ C(n, j) h^(n − j) state_j
            total += choices * h ** (n - j) * state[j]
            choices *= j / (n - j + 1)
        out[n] = fade * total + size * h ** (n + 1) / (n + 1)


def responses_at_nodes(
    sigma: Array, history: History, time: Array, derivatives: int
) -> tuple[Array, Array]:
    """ρ with derivatives by σ at all nodes, shape (1 + derivatives, T, S), for σ (S,).

    Returns:
        The responses, and bounds of the rounding of ρ, shape (T, S).

    Raises:
        UnprovedError: A σ is out of the kernel's range.
    """

    def walked(shifted: Array) -> tuple[Array, Array]:
        require_in_range(shifted, history.step, max(history.step, float(time[-1])))
        out = np.empty((1 + derivatives, len(time), len(sigma)), complex)
        error = np.empty(out.shape[1:])
        with PARALLEL_LOOP:
            _walk_to_all(shifted, walk(history, time), (0,) * derivatives, out, error)
        return out, error

    return _with_sine(walked, sigma, history, time[:, None])


def responses_at_given_nodes(
    sigma: Array, history: History, time: Array, node: Rows, derivatives: int
) -> tuple[Array, Array]:
    """ρ and derivatives by σ, (1 + derivatives, S, n): σ (S, n), each row at its node of `time`.

    Returns:
        The responses, and bounds of the rounding of ρ, shape (S, n).

    Raises:
        UnprovedError: A σ is out of the kernel's range.
    """

    def walked(shifted: Array) -> tuple[Array, Array]:
        require_in_range(shifted, history.step, max(history.step, float(time[-1])))
        out = np.empty((1 + derivatives, *sigma.shape), complex)
        error = np.empty(sigma.shape)
        with PARALLEL_LOOP:
            _walk_to_given(shifted, walk(history, time), (0,) * derivatives, node, out, error)
        return out, error

    return _with_sine(walked, sigma, history, time[node][:, None])


def responses_in_windows(sigma: Array, history: History, time: Array, length: int) -> Array:
    """The part of ρ at each node that arises in its window, shape (T, S), for σ (S,).

    Windows begin at every `length`-th node, which itself ends the one before. Exponents may grow.

    Raises:
        UnprovedError: A σ is out of the kernel's range within a window.
    """
    window = float(time[min(length, len(time) - 1)] - time[0])

    def walked(shifted: Array) -> tuple[Array, Array]:
        require_in_range(shifted, history.step, max(history.step, window))
        out = np.zeros((1, len(time), len(sigma)), complex)
        with PARALLEL_LOOP:
            _walk_in_windows(shifted, walk(history, time), length, out)
        return out, np.zeros(out.shape[1:])

    return np.asarray(_with_sine(walked, sigma, history, time[:, None])[0][0])


def _with_sine(
    response_to_g: Callable[[np.ndarray[Any, Any]], tuple[Array, Array]],
    sigma: Array,
    history: History,
    time: Array,
) -> tuple[Array, Array]:
    """Responses to a load g(t) sin θ(t), and their rounding, from those to g at two exponents.

    With θ(τ) = θ(t) − ω (t − τ), ρ(σ) = [exp(iθ) ρ_g(σ − iω) − exp(−iθ) ρ_g(σ + iω)] / 2i. A load
    without a sine is passed through. |ρ′| is at most t ∫ |g| exp(Re σ τ), by which rounding of an
    exponent is bounded.

    Args:
        response_to_g: Returns ρ_g with derivatives, and its rounding, for exponents.
        sigma: Exponents σ, in 1/s.
        history: The load.
        time: Nodes t, in s, broadcast with σ.
    """
    rate = history.frequency
    if not rate:
        return response_to_g(sigma)
    angle = rate * (time - history.start) + history.phase
    minus, minus_rounding = response_to_g(sigma - 1j * rate)
    plus, plus_rounding = response_to_g(sigma + 1j * rate)
    phasor = np.exp(1j * angle)
    response = (phasor * minus - phasor.conj() * plus) / 2j
    size = np.abs(minus[0]) + np.abs(plus[0])
    grown = np.exp(np.maximum(sigma.real * time, 0.0)) * history.extremes[0] * time**2
    of_exponent = (np.abs(sigma) + rate) * grown
    rounding = UNIT_ROUNDOFF * ((8 + np.abs(angle)) * size + of_exponent)
    return response, (minus_rounding + plus_rounding) / 2 + rounding


@njit(cache=True, parallel=True)
def _walk_to_all(sigma: Array, walk: Walk, orders: Orders, out: Array, error: Array) -> None:
    """Walks each σ (S,) to all nodes and writes `out` (derivatives, T, S) and `error` (T, S)."""
    for s in prange(len(sigma)):
        nodes = walk.interval, walk.phase, walk.time_rounding
        parts = _phase_factors(sigma[s], walk.phases)
        _walk_along(sigma[s], walk, orders, nodes, parts, (0, 0j), out[:, :, s], error[:, s])


@njit(cache=True, parallel=True)
def _walk_to_given(
    sigma: Array, walk: Walk, orders: Orders, node: Rows, out: Array, error: Array
) -> None:
    """Walks each σ (S, n) to the node of its row and writes `out` (…, S, n) and `error`."""
    for s in prange(len(sigma)):
        here, phase = slice(node[s], node[s] + 1), walk.phase[node[s]]
        nodes = walk.interval[here], np.zeros(1, np.int64), walk.time_rounding[here]
        for k in range(sigma.shape[1]):
            parts = _phase_factors(sigma[s, k], walk.phases[phase : phase + 1])
            end = out[:, s : s + 1, k], error[s : s + 1, k]
            _walk_along(sigma[s, k], walk, orders, nodes, parts, (0, 0j), *end)


@njit(cache=True, parallel=True)
def _walk_in_windows(sigma: Array, walk: Walk, length: int, out: Array) -> None:
    """Walks each σ (S,) to all nodes, from rest at each window's beginning; writes (1, T, S).

    The state at the sample before a beginning is chosen so that it is at rest there.
    """
    for s in prange(len(sigma)):
        parts, error = _phase_factors(sigma[s], walk.phases), np.empty(length)
        for first in range(0, len(walk.interval) - 1, length):
            inside = slice(first + 1, min(first + length + 1, len(walk.interval)))
            begin, x, P = walk.interval[first], parts[0][walk.phase[first]], parts[2]
            slope = (walk.last[begin] - walk.first[begin]) / walk.step
            moved = (walk.first[begin] + slope * x) * P[walk.phase[first], 0]
            moved -= slope * P[walk.phase[first], 1]
            start = begin, -moved / parts[1][walk.phase[first]]
            nodes = walk.interval[inside], walk.phase[inside], walk.time_rounding[inside]
            _walk_along(sigma[s], walk, (), nodes, parts, start, out[:, inside, s], error)


@njit(cache=True)
def _phase_factors(sigma: complex, phases: Array) -> tuple[Array, Array, Array, Array]:
    """Factors that carry ρ from the beginning of an interval to each time x in it, `phases` (P,).

    Returns:
        The times; exp(σ x), (P,); J_n = ∫₀ˣ τⁿ exp(σ τ) dτ, n = 0 … 3, (P, 4); rounding relative
        to |ρ|, rounding relative to |a|, and |exp(σ x)|, (P, 3).
    """
    factors: Array = np.empty(len(phases), np.complex128)
    integrals: Array = np.empty((len(phases), 4), np.complex128)
    rounding: Array = np.empty((len(phases), 3))
    rate = abs(sigma.real) + abs(sigma.imag)
    for j in range(len(phases)):
        x = phases[j]
        factors[j] = np.exp(sigma * x)
        step_integrals(sigma, x, integrals[j])
        rounding[j, 0] = UNIT_ROUNDOFF * (ERROR_OF_TURN + rate * x)
        rounding[j, 1], rounding[j, 2] = error_of_integrals(sigma, x), abs(factors[j])
    return phases, factors, integrals, rounding


@njit(cache=True)
def _walk_along(
    sigma: complex,
    walk: Walk,
    orders: Orders,
    nodes: tuple[Rows, Rows, Array],
    of_phases: tuple[Array, Array, Array, Array],
    start: tuple[int, complex],
    out: Array,
    error: Array,
) -> None:
    """Walks one σ over the record, from a state before an interval, to nodes.

    Args:
        sigma: σ.
        walk: The record.
        orders: As many zeros as derivatives.
        nodes: Interval, phase and rounding of each node, shape (N,).
        of_phases: As of `_parts`.
        start: The first interval, and ρ at its beginning.
        out: Written: ρ and its derivatives, shape (derivatives, N).
        error: Written: bounds of the rounding of ρ, shape (N,).
    """
    interval, phase, time_rounding = nodes
    phases, turns, parts, rounding = of_phases
    h, rate = walk.step, abs(sigma.real) + abs(sigma.imag)
    J, turn = np.empty(4, np.complex128), np.exp(sigma * h)
    step_integrals(sigma, h, J)
    of_turn, of_integrals = UNIT_ROUNDOFF * (ERROR_OF_TURN + rate * h), error_of_integrals(sigma, h)
    fade = abs(turn)
    begin, r0 = start
    r1 = r2 = 0.0 + 0.0j
    wrong, node = 0.0, 0
    for i in range(begin, interval[-1] + 1):
        slope = (walk.last[i] - walk.first[i]) / h
        while node < len(interval) and interval[node] == i:
            j = phase[node]
            x, w, P = phases[j], turns[j], parts[j]
            a = walk.first[i] + slope * x
            moved = w * r0
            value = moved + a * P[0] - slope * P[1]
            step_rounding = rounding[j, 2] * wrong + rounding[j, 0] * (
                abs(moved.real) + abs(moved.imag)
            )
            step_rounding += rounding[j, 1] * (abs(a) + abs(slope) * x / 2)
            step_rounding += time_rounding[node] * (
                rate * (abs(value.real) + abs(value.imag)) + abs(a)
            )
            out[0, node], error[node] = value, step_rounding
            if len(orders) > 0:
                out[1, node] = w * (r1 + x * r0) + a * P[1] - slope * P[2]
            if len(orders) > 1:
                out[2, node] = w * (r2 + 2 * x * r1 + x * x * r0) + a * P[2] - slope * P[3]
            node += 1
        a = walk.last[i]
        if len(orders) > 1:
            r2 = turn * (r2 + 2 * h * r1 + h * h * r0) + a * J[2] - slope * J[3]
        if len(orders) > 0:
            r1 = turn * (r1 + h * r0) + a * J[1] - slope * J[2]
        r0 = turn * r0
        wrong = fade * wrong + of_turn * (abs(r0.real) + abs(r0.imag))
        wrong += of_integrals * (abs(a) + abs(slope) * h / 2)
        r0 += a * J[0] - slope * J[1]
