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
from numba import prange

from alphacut.frame.calculus.kernels import compiled, kernel
from alphacut.frame.calculus.rounding import UNIT_ROUNDOFF
from alphacut.frame.response.step_integrals import (
    error_of_integrals,
    require_in_range,
    step_integrals,
)
from alphacut.frame.structures.loads import History
from alphacut.fuzzy.arrays import Array, Rows

parallel = kernel(parallel=True)
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
    """Return the straight pieces of a load up to the last node, and where each node lies in them.

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
    """Return upper bounds of ∫₀ᵗ |f(τ)| dτ of a load f at nodes t, shape (T,)."""
    path = walk(history, time)
    sizes = np.cumsum(np.maximum(np.abs(path.first), np.abs(path.last)) * path.step)
    return np.asarray(sizes[path.interval])


def absolute_moments(decay: float, history: History, time: Array) -> Array:
    """Return bounds of ∫₀ᵗ τⁿ exp(−decay τ) |f(t − τ)| dτ at nodes t, n = 0 … 4, shape (5, T)."""
    path = walk(history, time)
    sizes = np.maximum(np.abs(path.first), np.abs(path.last))
    since = path.phases[path.phase] + path.time_rounding
    out: Array = np.empty((5, len(time)))
    _walk_moments(sizes, path.interval, since, decay, path.step, out)
    return out


@compiled
def _walk_moments(
    sizes: Array, interval: Rows, since: Array, decay: float, h: float, out: Array
) -> None:
    """Write bounds of ∫₀ᵗ τⁿ exp(−g τ) |f(t − τ)| dτ at nodes t, n = 0 … 4, to `out` (5, T).

    Args:
        sizes: Bound of |f| in each interval.
        interval: Interval of each node, rising, shape (T,).
        since: Time of each node since its interval began, shape (T,), in s.
        decay: g, in 1/s.
        h: Length of an interval, in s.
        out: Written.
    """
    moments, next_moments, node = np.zeros(5), np.empty(5), 0  # at ends of an interval
    for i in range(interval[-1] + 1):
        while node < len(interval) and interval[node] == i:
            _advance_moments(moments, decay, since[node], sizes[i], out[:, node])
            node += 1
        _advance_moments(moments, decay, h, sizes[i], next_moments)
        moments[:] = next_moments


@compiled
def _advance_moments(moments: Array, decay: float, h: float, size: float, out: Array) -> None:
    """Write bounds of the moments a time h later, under a load with |f| ≤ `size`, to `out` (5,).

    The moments are ∫₀ᵗ τⁿ exp(−g τ) |f(t − τ)| dτ, n = 0 … 4, with g = `decay`.
    """
    fade = np.exp(-decay * h)
    for n in range(5):
        total, binomial = 0.0, 1.0
        for j in range(n, -1, -1):  # Σ C(n, j) h^(n − j) moments_j
            total += binomial * h ** (n - j) * moments[j]
            binomial *= j / (n - j + 1)
        out[n] = fade * total + size * h ** (n + 1) / (n + 1)


def responses_at_nodes(
    sigma: Array, history: History, time: Array, derivatives: int
) -> tuple[Array, Array]:
    """Return ρ(σ; t) = ∫₀ᵗ exp(σ τ) f(t − τ) dτ at all nodes t, with derivatives by σ.

    f is the load `history`, σ (S,) are exponents in 1/s, and there are 0 to 2 derivatives.

    Returns:
        ρ and its derivatives, shape (1 + derivatives, T, S), and bounds of the rounding of ρ,
        shape (T, S).

    Raises:
        UnprovedError: A σ is out of the kernel's range.
    """

    def response_to_g(shifted: Array) -> tuple[Array, Array]:
        require_in_range(shifted, history.step, max(history.step, float(time[-1])))
        out = np.empty((1 + derivatives, len(time), len(sigma)), complex)
        error = np.empty(out.shape[1:])
        with PARALLEL_LOOP:
            _walk_to_all(shifted, walk(history, time), (0,) * derivatives, out, error)
        return out, error

    return _with_sine(response_to_g, sigma, history, time[:, None])


def responses_at_given_nodes(
    sigma: Array, history: History, time: Array, node: Rows, derivatives: int
) -> tuple[Array, Array]:
    """Return ρ(σ; t) = ∫₀ᵗ exp(σ τ) f(t − τ) dτ at one node for each row of σ, with derivatives.

    f is the load `history`, σ (S, n) are exponents in 1/s, `node` (S,) is the index of each row's
    node, and there are 0 to 2 derivatives by σ.

    Returns:
        ρ and its derivatives, shape (1 + derivatives, S, n), and bounds of the rounding of ρ,
        shape (S, n).

    Raises:
        UnprovedError: A σ is out of the kernel's range.
    """

    def response_to_g(shifted: Array) -> tuple[Array, Array]:
        require_in_range(shifted, history.step, max(history.step, float(time[-1])))
        out = np.empty((1 + derivatives, *sigma.shape), complex)
        error = np.empty(sigma.shape)
        with PARALLEL_LOOP:
            _walk_to_given(shifted, walk(history, time), (0,) * derivatives, node, out, error)
        return out, error

    return _with_sine(response_to_g, sigma, history, time[node][:, None])


def responses_in_windows(sigma: Array, history: History, time: Array, length: int) -> Array:
    """Return ∫ exp(σ (t − s)) f(s) ds from the beginning of each node's window to t, shape (T, S).

    t are the nodes, σ (S,) the exponents in 1/s, whose real parts may be positive, and f is the
    load. Windows begin at every `length`-th node, which itself ends the window before.

    Raises:
        UnprovedError: A σ is out of the kernel's range within a window.
    """
    window = float(time[min(length, len(time) - 1)] - time[0])

    def response_to_g(shifted: Array) -> tuple[Array, Array]:
        require_in_range(shifted, history.step, max(history.step, window))
        out = np.zeros((1, len(time), len(sigma)), complex)
        with PARALLEL_LOOP:
            _walk_in_windows(shifted, walk(history, time), length, out)
        return out, np.zeros(out.shape[1:])

    return np.asarray(_with_sine(response_to_g, sigma, history, time[:, None])[0][0])


def _with_sine(
    response_to_g: Callable[[np.ndarray[Any, Any]], tuple[Array, Array]],
    sigma: Array,
    history: History,
    time: Array,
) -> tuple[Array, Array]:
    """Return responses ρ to a load g(t) sin θ(t), and their rounding, from responses ρ_g to g.

    ρ(σ; t) = ∫₀ᵗ exp(σ τ) f(t − τ) dτ for a load f. The sine is a sum of two exponentials:
    ρ(σ) = [exp(iθ) ρ_g(σ − iω) − exp(−iθ) ρ_g(σ + iω)] / 2i, θ = θ(t) of frequency ω. Without a
    sine ρ is ρ_g. |ρ′| ≤ t ∫ |g| exp(Re σ τ) bounds what the rounding of an exponent adds.

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
    derivative_bound = np.exp(np.maximum(sigma.real * time, 0.0)) * history.extremes[0] * time**2
    exponent_rounding = (np.abs(sigma) + rate) * derivative_bound
    rounding = UNIT_ROUNDOFF * ((8 + np.abs(angle)) * size + exponent_rounding)
    return response, (minus_rounding + plus_rounding) / 2 + rounding


@parallel
def _walk_to_all(sigma: Array, walk: Walk, orders: Orders, out: Array, error: Array) -> None:
    """Write ρ of each σ (S,) at all T nodes to `out`, and bounds of its rounding to `error` (T, S).

    ρ(σ; t) = ∫₀ᵗ exp(σ τ) f(t − τ) dτ; `out` (1 + len(orders), T, S) has derivatives by σ, too.
    """
    for s in prange(len(sigma)):
        nodes = walk.interval, walk.phase, walk.time_rounding
        parts = _phase_factors(sigma[s], walk.phases)
        _walk_along(sigma[s], walk, orders, nodes, parts, (0, 0j), out[:, :, s], error[:, s])


@parallel
def _walk_to_given(
    sigma: Array, walk: Walk, orders: Orders, node: Rows, out: Array, error: Array
) -> None:
    """Write ρ of each row of σ (S, n) at the row's node to `out`, its rounding to `error` (S, n).

    ρ(σ; t) = ∫₀ᵗ exp(σ τ) f(t − τ) dτ; `out` (1 + len(orders), S, n) has derivatives by σ, too.
    """
    for s in prange(len(sigma)):
        # the only node of this row, with a table of its one phase
        here, phase = slice(node[s], node[s] + 1), walk.phase[node[s]]
        nodes = walk.interval[here], np.zeros(1, np.int64), walk.time_rounding[here]
        for k in range(sigma.shape[1]):
            parts = _phase_factors(sigma[s, k], walk.phases[phase : phase + 1])
            end = out[:, s : s + 1, k], error[s : s + 1, k]
            _walk_along(sigma[s, k], walk, orders, nodes, parts, (0, 0j), *end)


@parallel
def _walk_in_windows(sigma: Array, walk: Walk, length: int, out: Array) -> None:
    """Write ρ of each σ (S,) at all nodes to `out` (1, T, S), from rest at each window's beginning.

    Windows have `length` nodes. ρ at the sample before a window is chosen so that it is zero at the
    window's beginning: exp(σ x) ρ + a P₀ − slope P₁ = 0 with P_n = ∫₀ˣ τⁿ exp(σ τ) dτ.
    """
    for s in prange(len(sigma)):
        parts, error = _phase_factors(sigma[s], walk.phases), np.empty(length)
        for first in range(0, len(walk.interval) - 1, length):
            inside = slice(first + 1, min(first + length + 1, len(walk.interval)))
            begin, phase = walk.interval[first], walk.phase[first]
            x, turn, P = parts[0][phase], parts[1][phase], parts[2][phase]
            slope = (walk.last[begin] - walk.first[begin]) / walk.step
            forced = (walk.first[begin] + slope * x) * P[0] - slope * P[1]
            start = begin, -forced / turn
            nodes = walk.interval[inside], walk.phase[inside], walk.time_rounding[inside]
            _walk_along(sigma[s], walk, (), nodes, parts, start, out[:, inside, s], error)


@compiled
def _phase_factors(sigma: complex, phases: Array) -> tuple[Array, Array, Array, Array]:
    """Return factors that carry a response from the beginning of an interval to times x in it.

    ρ(t + x) = exp(σ x) ρ(t) + a J₀ − slope J₁, with the load a at t + x. `phases` (P,) are the x.

    Returns:
        The times x; exp(σ x), (P,); J_n = ∫₀ˣ τⁿ exp(σ τ) dτ, n = 0 … 3, (P, 4); rounding relative
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


@compiled
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
    """Write ρ(σ; t) = ∫ exp(σ τ) f(t − τ) dτ and derivatives by σ at N nodes to `out`.

    An interval of length h, at whose end the load is a, advances ρ to exp(σ h) ρ + a J₀ − slope J₁
    with J_n = ∫₀ʰ τⁿ exp(σ τ) dτ; r0, r1 and r2 are ρ and its derivatives at samples.

    Args:
        sigma: σ, in 1/s.
        walk: The load f by intervals.
        orders: As many zeros as derivatives.
        nodes: Interval, index of the time in it, and rounding of that time, shape (N,) each.
        of_phases: Times x in intervals, exp(σ x), integrals and roundings, as of `_phase_factors`.
        start: The first interval, and ρ at its beginning.
        out: Written: ρ and its derivatives, shape (derivatives, N).
        error: Written: bounds of the rounding of ρ, shape (N,).
    """
    interval, phase, time_rounding = nodes
    phases, turns, integrals, rounding = of_phases
    h, rate = walk.step, abs(sigma.real) + abs(sigma.imag)
    J, turn = np.empty(4, np.complex128), np.exp(sigma * h)
    step_integrals(sigma, h, J)
    of_turn, of_integrals = UNIT_ROUNDOFF * (ERROR_OF_TURN + rate * h), error_of_integrals(sigma, h)
    fade = abs(turn)
    begin, r0 = start
    r1 = r2 = 0.0 + 0.0j
    sample_rounding, node = 0.0, 0
    for i in range(begin, interval[-1] + 1):
        slope = (walk.last[i] - walk.first[i]) / h
        while node < len(interval) and interval[node] == i:
            j = phase[node]
            x, w, P = phases[j], turns[j], integrals[j]
            a = walk.first[i] + slope * x
            free = w * r0
            value = free + a * P[0] - slope * P[1]
            node_rounding = rounding[j, 2] * sample_rounding + rounding[j, 0] * (
                abs(free.real) + abs(free.imag)
            )
            node_rounding += rounding[j, 1] * (abs(a) + abs(slope) * x / 2)
            node_rounding += time_rounding[node] * (
                rate * (abs(value.real) + abs(value.imag)) + abs(a)
            )
            out[0, node], error[node] = value, node_rounding
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
        sample_rounding = fade * sample_rounding + of_turn * (abs(r0.real) + abs(r0.imag))
        sample_rounding += of_integrals * (abs(a) + abs(slope) * h / 2)
        r0 += a * J[0] - slope * J[1]
