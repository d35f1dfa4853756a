"""Duhamel integral of an oscillator under a load that is linear between its samples.

Over a time h in which the load f is linear with slope s, a at its end,

    ρ(σ; t) = ∫₀ᵗ exp(σ τ) f(t − τ) dτ,   ρ(t + h) = exp(σ h) ρ(t) + a J₀ − s J₁,
    J_n = ∫₀ʰ τⁿ exp(σ τ) dτ

exactly (piecewise linear load: Clough, Penzien 1993, chapter 7), and derivatives by σ likewise.
Nodes lie anywhere; samples need not be nodes. `_respond` is the one recursion over a load; rounding
is bounded beside the values (running error analysis: Higham 2002, section 3.3).

With z = σ h and φ_n(z) = ∫₀¹ sⁿ exp(z s) ds, J_n = hⁿ⁺¹ φ_n(z), and by parts

    φ_n = (exp(z) − n φ_{n−1}) / z.

This recurrence divides rounding by |z| in each step and multiplies it by n, so that it serves from
|z| = `FROM_RECURRENCE` on; below, the power series Σ z^k / (k! (n + 1 + k)) does. Far to the left
exp(z) is 0 and the recurrence gives n! / (−z)ⁿ⁺¹; to the right the integrals grow like exp(z).
"""

from __future__ import annotations

from dataclasses import replace
from math import ceil
from threading import Lock
from typing import Any, NamedTuple

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.base.kernels import compiled, kernel, prange
from alphacut.frame.calculus.rounding import UNIT_ROUNDOFF
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.records.history import Accelerogram, History

parallel = kernel(parallel=True)
PARALLEL_LOOP = Lock()
"""Held by the thread that is in a parallel loop of Numba, which not all its layers share."""
SAME_TIME = 4 * UNIT_ROUNDOFF
"""Distance of two times, as a share of the last node's, that is their rounding alone."""
SERIES_TERMS = 26
"""Terms of the power series; from |z| ≤ 2 the rest is below 2²⁶/26! = 2e-19."""
FROM_RECURRENCE = 2.0
"""|z| from which the recurrence is used. It loses 3! / 2³ of a digit there, the series exp(2)."""
MAX_PHASE = 1e8
"""|σ h| at most: beyond, rounding of the phase σ h alone passes 1e-8."""
MAX_GROWTH = 700.0
"""Re σ t at most: exp(709.8) is the largest floating-point number."""
ERROR_OF_INTEGRALS = 12.0
"""Error of φ_n at small |z| and Re z ≤ 0 at most, in u / (n + 1); a test reaches 6."""
ERROR_OF_PROPAGATOR = 8.0
"""Rounding in u of one product exp(σ h) ρ besides |σ h|: 3 of exp, √5 of the product, 2 of sums."""

Orders = Array
"""An empty array with as many dimensions as orders of derivatives are wanted, that of ρ included.
Their number is known when a kernel is compiled, as the length of a tuple is, but threads may call a
kernel with an array for the first time; see `KernelThreads`."""


class LinearPieces(NamedTuple):
    """A load up to the last of T nodes, in I intervals between its samples; times in s."""

    first: Array  # load at the beginning of each interval, (I,)
    last: Array  # load at its end, (I,)
    step: float  # length of an interval
    interval: Ints  # in which each node lies, rising, (T,)
    offsets: Array  # distinct times from an interval's beginning to a node in it, (P,)
    offset: Ints  # which of them is each node's, (T,)
    time_rounding: Array  # rounding of each node's time since its interval began, (T,)


def linear_pieces(history: History, time: Array) -> LinearPieces:
    """Return a load, without the sine by which it is multiplied, and the places of nodes in it.

    Nodes `time` rise, shape (T,), in s.
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
    offset = np.empty(len(time), np.int64)
    offset[order] = np.cumsum(is_new) - 1
    offsets = since[order][is_new]
    offsets[offsets <= same] = 0.0
    time_rounding = np.abs(since - offsets[offset]) + UNIT_ROUNDOFF * time
    return LinearPieces(first[:count], last[:count], step, interval, offsets, offset, time_rounding)


def absolute_moments(decay: float, history: History, time: Array) -> Array:
    """Return bounds of ∫₀ᵗ τⁿ exp(−decay τ) |f(t − τ)| dτ at nodes t, n = 0 … 4, shape (5, T)."""
    load = linear_pieces(history, time)
    out: Array = np.empty((5, len(time)))
    _absolute_moments(load, load.offsets[load.offset] + load.time_rounding, decay, out)
    return out


def call_with_load() -> None:
    """Call a kernel once with a load; see `KernelThreads`."""
    absolute_moments(0.0, Accelerogram(1.0, np.zeros(2)), np.ones(1))


@compiled
def _absolute_moments(load: LinearPieces, offset: Array, decay: float, out: Array) -> None:
    """Write bounds of ∫₀ᵗ τⁿ exp(−g τ) |f(t − τ)| dτ at nodes t, n = 0 … 4, to `out` (5, T)."""
    moments, later, node = np.zeros(5), np.empty(5), 0  # at an interval's beginning, x later
    for i in range(load.interval[-1] + 1):
        is_node, a, slope = True, load.first[i], (load.last[i] - load.first[i]) / load.step
        while is_node:  # then once more for the interval's end
            is_node = node < len(load.interval) and load.interval[node] == i
            x = offset[node] if is_node else load.step
            b, decay_factor = a + slope * x, np.exp(-decay * x)
            largest, growth = max(abs(a), abs(b)), max(decay_factor, 1.0)
            area = x * (abs(a) + abs(b)) / 2  # ∫ |f| over x, of two triangles where f crosses zero
            if a * b < 0:
                area = x * (a * a + b * b) / (2 * (abs(a) + abs(b)))
            is_long, tail = decay * x > 1, largest / decay  # ∫ τⁿ exp(−g τ) dτ ≤ n!/gⁿ⁺¹
            for n in range(5):
                total, binomial = 0.0, 1.0
                for j in range(n, -1, -1):  # Σ C(n, j) x^(n − j) moments_j
                    total += binomial * x ** (n - j) * moments[j]
                    binomial *= j / (n - j + 1)
                added = min(area * x**n, largest * x ** (n + 1) / (n + 1))
                if is_long:
                    added, tail = min(added, tail), tail * (n + 1) / decay
                later[n] = decay_factor * total + growth * added
            if is_node:
                out[:, node] = later
                node += 1
        moments[:] = later


def responses_at_nodes(
    sigma: Array,
    history: History,
    time: Array,
    derivatives: int = 0,
    *,
    node: Ints | None = None,
    window: int | None = None,
) -> tuple[Array, Array]:
    """Return ρ(σ; t) = ∫ exp(σ τ) f(t − τ) dτ at nodes t, with derivatives by σ.

    Args:
        sigma: Exponents σ in 1/s, shape (S,), for all T nodes; with `node`, shape (N, S), a row
            for each of N points.
        history: The load f.
        time: Nodes, shape (T,), in s.
        derivatives: 0 to 2.
        node: Index of each point's node, shape (N,).
        window: Integrals begin at each `window`-th node, which itself ends the window before, and
            real parts of σ may be positive; None: all begin at t = 0.

    Returns:
        ρ and its derivatives, shape (1 + derivatives, T or N, S), and bounds of the rounding of
        ρ, shape (T or N, S).

    Raises:
        UnprovedError: A σ is out of the kernel's range.
    """
    times = time if node is None else time[node]
    if omega := history.frequency:
        # f = g sin θ: ρ(σ) = [exp(iθ) ρ_g(σ − iΩ) − exp(−iθ) ρ_g(σ + iΩ)] / 2i
        shifted: list[Any] = [sigma - 1j * omega, sigma + 1j * omega]
        g = replace(history, frequency=0.0)
        (minus, minus_rounding), (plus, plus_rounding) = (
            responses_at_nodes(x, g, time, derivatives, node=node, window=window) for x in shifted
        )
        t = times[:, None]
        angle = omega * (t - history.start) + history.phase
        phasor = np.exp(1j * angle)
        size = np.abs(minus[0]) + np.abs(plus[0])
        # rounding of an exponent changes ρ by |ρ′| ≤ t ∫ |g| exp(Re σ τ) dτ
        slope = np.exp(np.maximum(sigma.real * t, 0.0)) * history.extremes[0] * t**2
        rounding = (8 + np.abs(angle)) * size + (np.abs(sigma) + omega) * slope
        error = (minus_rounding + plus_rounding) / 2 + UNIT_ROUNDOFF * rounding
        return (phasor * minus - phasor.conj() * plus) / 2j, error
    length = window or len(time)
    longest = float(time[min(length, len(time) - 1)] - time[0]) if window else float(time[-1])
    if window and history.step > longest:  # exp(σ τ) grows from an interval's beginning on
        parts, samples = ceil(history.step / longest), history.samples
        places = np.arange((len(samples) - 1) * parts + 1) / parts
        resampled = np.interp(places, np.arange(len(samples)), samples)
        history = replace(history, step=history.step / parts, samples=resampled)
    require_in_range(sigma, history.step, max(history.step, longest))
    out = np.empty((1 + derivatives, len(times), sigma.shape[-1]), complex)
    error, pieces = np.empty(out.shape[1:]), linear_pieces(history, time)
    orders = np.zeros((0,) * (1 + derivatives))
    with PARALLEL_LOOP:
        if node is None:
            _respond_at_nodes(sigma, pieces, orders, length, out, error)
        else:
            _respond_at_given(sigma, pieces, orders, node, out, error)
    return out, error


def require_in_range(sigma: Array, step: float, duration: float) -> None:
    """Raise UnprovedError for exponents σ (1/s) whose responses are not computed to round-off.

    They are integrated over intervals of length `step` and may grow over `duration`, in s.
    """
    phase = float(np.abs(sigma).max(initial=0.0)) * step
    growth = float(sigma.real.max(initial=-np.inf)) * duration
    if not (phase <= MAX_PHASE and growth <= MAX_GROWTH):
        raise UnprovedError(
            f"a motion turns by {phase:.3g} rad within {step:g} s and grows by exp({growth:.3g})"
            f" within {duration:g} s; allowed: {MAX_PHASE:g} rad, exp({MAX_GROWTH:g})",
            "take a shorter step of the record, or less stiff members",
        )


@parallel
def _respond_at_nodes(
    sigma: Array, load: LinearPieces, orders: Orders, length: int, out: Array, error: Array
) -> None:
    """Write ρ(σ; t) at all T nodes, and its first derivatives by σ, to `out` (1 + …, T, S)."""
    for s in prange(len(sigma)):
        factors = _propagators(sigma[s], load.offsets)
        for node in range(0, max(len(load.interval) - 1, 1), length):
            start = (load.interval[node], load.offset[node]) if node else (0, -1)
            inside = slice(node + 1 if node else 0, node + length + 1)
            nodes = load.interval[inside], load.offset[inside], load.time_rounding[inside]
            end = out[:, inside, s], error[inside, s]
            _respond(sigma[s], load, orders, nodes, load.offsets, factors, start, *end)


@parallel
def _respond_at_given(
    sigma: Array, load: LinearPieces, orders: Orders, node: Ints, out: Array, error: Array
) -> None:
    """Write ρ(σ; t) of each row of σ (S, n) at its own node, and derivatives by σ, to `out`."""
    for s in prange(len(sigma)):
        here = slice(node[s], node[s] + 1)
        offsets = load.offsets[load.offset[node[s]] : load.offset[node[s]] + 1]
        nodes = load.interval[here], np.zeros(1, np.int64), load.time_rounding[here]
        for k in range(sigma.shape[1]):
            factors = _propagators(sigma[s, k], offsets)
            end = out[:, s : s + 1, k], error[s : s + 1, k]
            _respond(sigma[s, k], load, orders, nodes, offsets, factors, (0, -1), *end)


@compiled
def _respond(
    sigma: complex,
    load: LinearPieces,
    orders: Orders,
    nodes: tuple[Ints, Ints, Array],
    offsets: Array,
    factors: tuple[Array, Array, Array],
    start: tuple[int, int],
    out: Array,
    error: Array,
) -> None:
    """Write ρ and derivatives at N nodes to `out` (orders.ndim, N), ρ's rounding to `error`."""
    interval, offset, time_rounding = nodes  # `offset`: index among `offsets` (P,), in s
    turns, integrals, roundings = factors  # `_propagators` of the offsets
    h, rate = load.step, abs(sigma.real) + abs(sigma.imag)
    E, J, U = _propagators(sigma, np.array([h]))
    e, J0, J1, J2, J3 = E[0], J[0, 0], J[0, 1], J[0, 2], J[0, 3]
    of_product, of_integrals, decay = U[0, 0], U[0, 1], U[0, 2]
    # ρ and its derivatives at `since` in the interval, apart from what f adds from its beginning on
    r0 = r1 = r2 = 0.0 + 0.0j
    rounding, node, since = 0.0, 0, 0.0
    begin, j = start  # where the integral begins: interval, and index of its offset or −1
    if j >= 0 and offsets[j] > 0:  # ρ is zero at `since`: r takes away what f adds up to there
        since, P = offsets[j], integrals[j]
        slope = (load.last[begin] - load.first[begin]) / h
        a = load.first[begin] + slope * since
        r0, r1, r2 = slope * P[1] - a * P[0], slope * P[2] - a * P[1], slope * P[3] - a * P[2]
        rounding = roundings[j, 1] * (abs(a) + abs(slope) * since / 2)
    for i in range(begin, interval[-1] + 1):
        slope = (load.last[i] - load.first[i]) / h
        while node < len(interval) and interval[node] == i:
            j = offset[node]
            x, w, P, u = offsets[j], turns[j], integrals[j], roundings[j]
            a, elapsed, fading = load.first[i] + slope * x, x, u[2]
            if since > 0:
                elapsed -= since
                w = np.exp(sigma * elapsed)
                fading = abs(w)
            free = w * r0
            value = free + a * P[0] - slope * P[1]
            node_rounding = fading * rounding + u[0] * (abs(free.real) + abs(free.imag))
            node_rounding += u[1] * (abs(a) + abs(slope) * x / 2)
            size = abs(value.real) + abs(value.imag)
            node_rounding += time_rounding[node] * (rate * size + abs(a))  # |dρ/dt| ≤ |σ ρ| + |a|
            out[0, node], error[node] = value, node_rounding
            if orders.ndim > 1:
                out[1, node] = w * (r1 + elapsed * r0) + a * P[1] - slope * P[2]
            if orders.ndim > 2:
                second = r2 + 2 * elapsed * r1 + elapsed * elapsed * r0
                out[2, node] = w * second + a * P[2] - slope * P[3]
            node += 1
        a, elapsed, w, fading = load.last[i], h, e, decay
        if since > 0:
            elapsed -= since
            w = np.exp(sigma * elapsed)
            fading, since = abs(w), 0.0
        if orders.ndim > 2:
            second = r2 + 2 * elapsed * r1 + elapsed * elapsed * r0
            r2 = w * second + a * J2 - slope * J3
        if orders.ndim > 1:
            r1 = w * (r1 + elapsed * r0) + a * J1 - slope * J2
        r0 = w * r0
        rounding = fading * rounding + of_product * (abs(r0.real) + abs(r0.imag))
        rounding += of_integrals * (abs(a) + abs(slope) * h / 2)
        r0 += a * J0 - slope * J1


@compiled
def _propagators(sigma: complex, times: Array) -> tuple[Array, Array, Array]:
    """Return factors of ρ(t + x) = exp(σ x) ρ(t) + a J₀ − slope J₁ for P times x.

    They are exp(σ x), (P,); J_n, n = 0 … 3, (P, 4); and (P, 3): rounding relative to |exp(σ x) ρ|,
    rounding relative to |a|, and the decay factor |exp(σ x)|.
    """
    factors: Array = np.empty(len(times), np.complex128)
    integrals: Array = np.empty((len(times), 4), np.complex128)
    rounding: Array = np.empty((len(times), 3))
    rate = abs(sigma.real) + abs(sigma.imag)
    for j in range(len(times)):
        x = times[j]
        factors[j] = np.exp(sigma * x)
        step_integrals(sigma, x, integrals[j])
        rounding[j, 0] = UNIT_ROUNDOFF * (ERROR_OF_PROPAGATOR + rate * x)
        rounding[j, 1], rounding[j, 2] = error_of_integrals(sigma, x), abs(factors[j])
    return factors, integrals, rounding


@compiled
def step_integrals(sigma: complex, h: float, out: Array) -> None:
    """Write J_n = ∫₀ʰ τⁿ exp(σ τ) dτ, n = 0 … 3, to `out` (4,); see `require_in_range` for σ h."""
    z = sigma * h
    if abs(z) < FROM_RECURRENCE:
        for n in range(4):
            term = 1.0 + 0.0j
            total = term / (n + 1)
            for k in range(1, SERIES_TERMS):
                term *= z / k
                total += term / (n + 1 + k)
            out[n] = total * h ** (n + 1)
        return
    grown = np.exp(z)
    integral = (grown - 1.0) / z
    out[0] = integral * h
    for n in range(1, 4):
        integral = (grown - n * integral) / z
        out[n] = integral * h ** (n + 1)


@compiled
def error_of_integrals(sigma: complex, h: float) -> float:
    """Return a bound of the rounding of J₀ and of 2 J₁ / h, in s."""
    size, growth = abs(sigma) * h, sigma.real * h
    factor = 1.0
    if size >= FROM_RECURRENCE:
        # rounding of exp(z), whose phase is rounded by u |z|, and of the sums, both over |z|
        factor = min(1.0, np.exp(min(growth, 0.0)) / 4 + 4 / size)
    return ERROR_OF_INTEGRALS * UNIT_ROUNDOFF * h * factor * np.exp(max(growth, 0.0))
