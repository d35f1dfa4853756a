"""Duhamel integral of an oscillator under a load that is linear between its samples.

With σ = −g + iω, g the decay and ω the frequency, the integral is

    ρ(σ; t) = ∫₀ᵗ exp(σ τ) f(t − τ) dτ.

Over a time h in which the load f is linear with slope s and has the value a at the end,

    ρ(t + h) = exp(σ h) ρ(t) + a J₀ − s J₁,    J_n = ∫₀ʰ τⁿ exp(σ τ) dτ

exactly (Clough, Penzien 1993, chapter 7). The derivatives by σ follow likewise. Time nodes lie
anywhere; samples of the load need not be nodes. `_respond` is the one recursion over a load.

With z = σ h and φ_n(z) = ∫₀¹ sⁿ exp(z s) ds, J_n = hⁿ⁺¹ φ_n(z), and integration by parts gives

    φ_n = (exp(z) − n φ_{n−1}) / z.

In each step this recurrence divides the rounding error by |z| and multiplies it by n. So it serves
for |z| ≥ `FROM_RECURRENCE`; below, the power series Σ z^k / (k! (n + 1 + k)) does. For large
negative Re z, exp(z) vanishes and the recurrence gives n! / (−z)ⁿ⁺¹.
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
from alphacut.frame.records.history import History

parallel = kernel(parallel=True)
PARALLEL_LOOP = Lock()
"""Held by a thread inside a parallel loop: not all threading layers of Numba allow two at once."""
FROM_RECURRENCE = 2.0
"""|z| from which the recurrence is used. It amplifies rounding by 3!/2³ there, the series by e²."""
MAX_PHASE = 1e8
"""Largest |σ h|: beyond, the rounding of the phase σ h alone passes 1e-8."""

Orders = Array
"""An empty array whose number of dimensions says how many orders of derivatives are wanted, order 0
included. Numba knows this number when it compiles a kernel, as it knows the length of a tuple."""


class LinearPieces(NamedTuple):
    """A load in I intervals between its samples, and the places of T time nodes in them.

    Args:
        first: The load at the beginning of each interval, shape (I,).
        last: The load at the end of each interval, shape (I,).
        step: Length of an interval, in s.
        interval: Index of the interval of each node, rising, shape (T,).
        offsets: Distinct times from the beginning of an interval to a node in it, shape (P,), in s.
        offset: Index among `offsets` for each node, shape (T,).
    """

    first: Array
    last: Array
    step: float
    interval: Ints
    offsets: Array
    offset: Ints


def linear_pieces(history: History, time: Array) -> LinearPieces:
    """Return a load up to the last node in linear intervals, and the places of nodes in them.

    A sine by which the load may be multiplied is left out. Intervals have the length of the load's
    step. Intervals with a load of zero stand in front of the load's start, so that its first sample
    begins an interval.

    Args:
        history: The load.
        time: Rising nodes ≥ 0, at least one, shape (T,), in s.

    Returns:
        For I intervals the load at the beginning, `first`, and at the end, `last`, of each (I,),
        and the `step` in s; for each node the index of its interval, `interval` (T,), and the index
        `offset` (T,) of its time since that interval began in the list `offsets` (P,) of all such
        times.
    """
    samples = history.samples
    step = history.step
    # so many intervals without load are set in front, up to the load's start
    before = ceil(history.start / step)
    time = time + (before * step - history.start)
    # Two times that are sums and products of given ones differ by a few roundings of the last one.
    same = 4 * UNIT_ROUNDOFF * float(time[-1])
    interval = ((time + same) / step).astype(np.int64)
    count = int(interval[-1]) + 1
    tail = 0.0
    if history.is_held:
        tail = samples[-1]
    first = np.full(before + max(count, len(samples)), tail)
    last = first.copy()
    first[:before] = 0.0
    last[:before] = 0.0
    first[before : before + len(samples) - 1] = samples[:-1]
    last[before : before + len(samples) - 1] = samples[1:]
    # offsets that differ by rounding alone are taken as one
    since: Array = np.maximum(time - interval * step, 0.0)
    order = np.argsort(since, kind="stable")
    is_new = np.diff(since[order], prepend=-np.inf) > same
    offset = np.empty(len(time), np.int64)
    offset[order] = np.cumsum(is_new) - 1
    offsets = since[order][is_new]
    offsets[offsets <= same] = 0.0
    return LinearPieces(first[:count], last[:count], step, interval, offsets, offset)


def absolute_moments(decay: float, history: History, time: Array) -> Array:
    """Return bounds of ∫₀ᵗ τⁿ exp(−decay τ) |f(t − τ)| dτ, n = 0 … 4, at nodes t, (5, T).

    Since |∂ⁿρ/∂σⁿ| of the Duhamel integral ρ = ∫₀ᵗ exp(σ τ) f(t − τ) dτ is at most this where Re σ
    ≤ −decay, they bound ρ and its derivatives for all frequencies.

    Args:
        decay: In 1/s; may be negative.
        history: The load f; a sine by which it may be multiplied counts as 1.
        time: Rising nodes ≥ 0, shape (T,), in s.
    """
    load = linear_pieces(history, time)
    out: Array = np.empty((5, len(time)))
    _absolute_moments(load, load.offsets[load.offset], decay, out)
    return out


@compiled
def _absolute_moments(load: LinearPieces, offset: Array, decay: float, out: Array) -> None:
    """Write bounds of ∫₀ᵗ τⁿ exp(−g τ) |f(t − τ)| dτ, n = 0 … 4, at T time nodes t.

    A time x later than the beginning of an interval, at which the integrals are moments_j, they are
    exp(−g x) Σ_j C(n, j) x^(n − j) moments_j + ∫₀ˣ τⁿ exp(−g τ) |f| dτ. The last integral is at
    most the least of: the area under |f| times xⁿ; the largest |f| times xⁿ⁺¹/(n + 1), both times
    max(exp(−g x), 1); the largest |f| times n!/gⁿ⁺¹, which is looked at where g x > 1.

    Args:
        load: The load f in intervals in which it is linear, with the interval of each node.
        offset: Time of each node since its interval began, shape (T,), in s.
        decay: g, in 1/s.
        out: Overwritten with the bounds, shape (5, T).
    """
    moments = np.zeros(5)
    later = np.empty(5)
    node = 0
    for i in range(load.interval[-1] + 1):
        a = load.first[i]
        slope = (load.last[i] - load.first[i]) / load.step
        is_node = True
        while is_node:  # for each node, then once more for the end of the interval
            is_node = node < len(load.interval) and load.interval[node] == i
            x = load.step
            if is_node:
                x = offset[node]
            b = a + slope * x
            decay_factor = np.exp(-decay * x)
            largest = max(abs(a), abs(b))
            growth = max(decay_factor, 1.0)
            area = x * (abs(a) + abs(b)) / 2
            if a * b < 0:  # a line through zero encloses two triangles, a²/2 and b²/2 over |slope|
                area = x * (a * a + b * b) / (2 * (abs(a) + abs(b)))
            is_long = decay * x > 1
            tail = largest / decay  # not finite where g = 0, and not looked at then
            for n in range(5):
                total = 0.0
                binomial = 1.0
                for j in range(n, -1, -1):
                    total += binomial * x ** (n - j) * moments[j]
                    binomial *= j / (n - j + 1)
                added = min(area * x**n, largest * x ** (n + 1) / (n + 1))
                if is_long:
                    added = min(added, tail)
                    tail = tail * (n + 1) / decay
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
) -> Array:
    """Return ρ(σ; t) = ∫ exp(σ τ) f(t − τ) dτ at time nodes t, with derivatives by σ.

    Args:
        sigma: Exponents σ in 1/s. Without `node`, shape (S,): each is evaluated at all T nodes.
            With `node`, shape (N, S): each row is evaluated at one node.
        history: The load f.
        time: Rising nodes, shape (T,), in s.
        derivatives: Number of derivatives by σ, 0 to 2.
        node: Index of the node of each row of `sigma`, shape (N,).
        window: If given, the integrals begin anew at each `window`-th node, which itself belongs to
            the window before. Otherwise they all begin at t = 0.

    Returns:
        ρ and its derivatives, shape (1 + derivatives, T or N, S).

    Raises:
        UnprovedError: A σ is out of range, as `require_in_range` says.
    """
    times = time
    if node is not None:
        times = time[node]
    if omega := history.frequency:
        # f = g sin θ with θ = Ω t + φ: ρ(σ) = [exp(iθ) ρ_g(σ − iΩ) − exp(−iθ) ρ_g(σ + iΩ)] / 2i
        g = replace(history, frequency=0.0)
        lower: Any = sigma - 1j * omega
        upper: Any = sigma + 1j * omega
        minus = responses_at_nodes(lower, g, time, derivatives, node=node, window=window)
        plus = responses_at_nodes(upper, g, time, derivatives, node=node, window=window)
        t = times[:, None]
        angle = omega * (t - history.start) + history.phase
        phasor = np.exp(1j * angle)
        return np.asarray((phasor * minus - phasor.conj() * plus) / 2j)
    length = len(time)
    longest = float(time[-1])
    if window:
        length = window
        longest = float(time[min(window, len(time) - 1)] - time[0])
        if history.step > longest:
            # exp(σ τ) may grow within an interval of the load, which is therefore divided
            divisions = ceil(history.step / longest)
            samples = history.samples
            places = np.arange((len(samples) - 1) * divisions + 1) / divisions
            resampled = np.interp(places, np.arange(len(samples)), samples)
            history = replace(history, step=history.step / divisions, samples=resampled)
    # a mode that grows is integrated over a window, or over an interval if that is longer
    require_in_range(sigma, history.step, max(history.step, longest))
    out = np.empty((1 + derivatives, len(times), sigma.shape[-1]), complex)
    pieces = linear_pieces(history, time)
    orders = np.zeros((0,) * (1 + derivatives))
    with PARALLEL_LOOP:
        if node is None:
            _respond_at_nodes(sigma, pieces, orders, length, out)
        else:
            _respond_at_given(sigma, pieces, orders, node, out)
    return out


def require_in_range(sigma: Array, step: float, duration: float) -> None:
    """Check that the integrals of exponents σ are computed to rounding.

    Args:
        sigma: Exponents σ in 1/s, of any shape; an empty array passes.
        step: Length of the intervals of the load, in s: |σ| step may be at most `MAX_PHASE` = 1e8.
        duration: Time over which ρ may grow, in s: Re σ duration may be at most 700.

    Raises:
        UnprovedError: An exponent exceeds one of both limits, or is NaN.
    """
    phase = float(np.abs(sigma).max(initial=0.0)) * step
    growth = float(sigma.real.max(initial=-np.inf)) * duration
    max_growth = 700.0  # exp(709.8) is the largest floating-point number
    if not (phase <= MAX_PHASE and growth <= max_growth):
        raise UnprovedError(
            f"a motion turns by {phase:.3g} rad within {step:g} s and grows by exp({growth:.3g})"
            f" within {duration:g} s; allowed: {MAX_PHASE:g} rad, exp({max_growth:g})",
            "take a shorter step of the record, or less stiff members",
        )


@parallel
def _respond_at_nodes(
    sigma: Array, load: LinearPieces, orders: Orders, length: int, out: Array
) -> None:
    """Write ρ = ∫ exp(σ τ) f(t − τ) dτ and derivatives by σ, for S exponents at all T time nodes.

    Args:
        sigma: Exponents, shape (S,).
        load: The load f in linear intervals, with the places of the nodes in them.
        orders: An empty array whose number of dimensions, 1 to 3, is the number of orders of
            derivatives that are written, order 0 included.
        length: Nodes in a window; integrals begin anew after the last node of each window.
        out: Overwritten with ρ and derivatives, shape (orders, T, S).
    """
    for s in prange(len(sigma)):
        factors = _propagators(sigma[s], load.offsets)
        for node in range(0, max(len(load.interval) - 1, 1), length):
            # the node at which a window begins belongs to the one before, except at t = 0
            start = (0, -1)  # the integral begins at the beginning of interval 0
            first = 0
            if node > 0:
                start = (load.interval[node], load.offset[node])  # it begins at this node
                first = node + 1
            inside = slice(first, node + length + 1)
            nodes = load.interval[inside], load.offset[inside]
            rho = out[:, inside, s]
            _respond(sigma[s], load, orders, nodes, load.offsets, factors, start, rho)


@parallel
def _respond_at_given(
    sigma: Array, load: LinearPieces, orders: Orders, node: Ints, out: Array
) -> None:
    """Write ρ = ∫ exp(σ τ) f(t − τ) dτ and derivatives by σ, for rows of exponents at a node each.

    The integrals begin at t = 0, the beginning of interval 0, which the start (0, −1) stands for.

    Args:
        sigma: Exponents, shape (N, S).
        load: The load f in linear intervals, with the places of all time nodes in them.
        orders: An empty array whose number of dimensions, 1 to 3, is the number of orders of
            derivatives that are written, order 0 included.
        node: Index of the time node of each row, shape (N,).
        out: Overwritten with ρ and derivatives, shape (orders, N, S).
    """
    for s in prange(len(sigma)):
        here = slice(node[s], node[s] + 1)
        offsets = load.offsets[load.offset[node[s]] : load.offset[node[s]] + 1]
        nodes = load.interval[here], np.zeros(1, np.int64)
        for k in range(sigma.shape[1]):
            factors = _propagators(sigma[s, k], offsets)
            rho = out[:, s : s + 1, k]
            _respond(sigma[s, k], load, orders, nodes, offsets, factors, (0, -1), rho)


@compiled
def _respond(
    sigma: complex,
    load: LinearPieces,
    orders: Orders,
    nodes: tuple[Ints, Ints],
    offsets: Array,
    factors: tuple[Array, Array],
    start: tuple[int, int],
    out: Array,
) -> None:
    """Write ρ and derivatives for one exponent at N nodes, interval by interval of the load.

    Args:
        sigma: The exponent.
        load: The load.
        orders: Says how many orders of derivatives are written.
        nodes: Interval, and index among `offsets`, of each node.
        offsets: Times from the beginning of an interval to nodes in it, shape (P,).
        factors: `_propagators` of these offsets.
        start: Where the integral begins: an interval, and an index among `offsets` or −1 for the
            beginning of the interval.
        out: Receives ρ and derivatives, shape (orders, N).
    """
    interval, offset = nodes
    turns, integrals = factors
    h = load.step
    E, J = _propagators(sigma, np.array([h]))
    e = E[0]
    J0 = J[0, 0]
    J1 = J[0, 1]
    J2 = J[0, 2]
    J3 = J[0, 3]
    # ρ and its derivatives a time `since` after the beginning of the interval, less what f adds
    # between the beginning and that time
    r0 = r1 = r2 = 0.0 + 0.0j
    node = 0
    since = 0.0
    begin, j = start
    if j >= 0 and offsets[j] > 0:  # ρ is zero there
        since = offsets[j]
        P = integrals[j]
        slope = (load.last[begin] - load.first[begin]) / h
        a = load.first[begin] + slope * since
        r0 = slope * P[1] - a * P[0]
        r1 = slope * P[2] - a * P[1]
        r2 = slope * P[3] - a * P[2]
    # ρ(t + h) = exp(σ h) ρ(t) + a J₀ − slope J₁; derivatives by σ follow from the product rule, in
    # which ∂J_n/∂σ = J_{n+1}
    for i in range(begin, interval[-1] + 1):
        slope = (load.last[i] - load.first[i]) / h
        while node < len(interval) and interval[node] == i:
            j = offset[node]
            x = offsets[j]
            w = turns[j]
            P = integrals[j]
            a = load.first[i] + slope * x
            elapsed = x
            if since > 0:
                elapsed -= since
                w = np.exp(sigma * elapsed)
            out[0, node] = w * r0 + a * P[0] - slope * P[1]
            if orders.ndim > 1:
                out[1, node] = w * (r1 + elapsed * r0) + a * P[1] - slope * P[2]
            if orders.ndim > 2:
                second = r2 + 2 * elapsed * r1 + elapsed * elapsed * r0
                out[2, node] = w * second + a * P[2] - slope * P[3]
            node += 1
        a = load.last[i]
        elapsed = h
        w = e
        if since > 0:
            elapsed -= since
            w = np.exp(sigma * elapsed)
            since = 0.0
        if orders.ndim > 2:
            second = r2 + 2 * elapsed * r1 + elapsed * elapsed * r0
            r2 = w * second + a * J2 - slope * J3
        if orders.ndim > 1:
            r1 = w * (r1 + elapsed * r0) + a * J1 - slope * J2
        r0 = w * r0 + a * J0 - slope * J1


@compiled
def _propagators(sigma: complex, times: Array) -> tuple[Array, Array]:
    """Return the factors of ρ(t + x) = exp(σ x) ρ(t) + a J₀ − slope J₁ for P times x.

    ρ is the Duhamel integral of a load that is linear over x, with this slope and the value a at
    its end, and J_n = ∫₀ˣ τⁿ exp(σ τ) dτ.

    Args:
        sigma: σ, in 1/s.
        times: x, shape (P,), in s.

    Returns:
        The factors exp(σ x), shape (P,), and the integrals J_n, n = 0 … 3, shape (P, 4).
    """
    factors: Array = np.empty(len(times), np.complex128)
    integrals: Array = np.empty((len(times), 4), np.complex128)
    for j in range(len(times)):
        x = times[j]
        factors[j] = np.exp(sigma * x)
        step_integrals(sigma, x, integrals[j])
    return factors, integrals


@compiled
def step_integrals(sigma: complex, h: float, out: Array) -> None:
    """Write J_n = ∫₀ʰ τⁿ exp(σ τ) dτ, n = 0 … 3, to `out`.

    Args:
        sigma: σ, in 1/s: |σ h| ≤ 1e8 and Re σ h ≤ 700, which is not checked here.
        h: In s; at 0 all integrals are 0.
        out: Overwritten, shape (4,).
    """
    z = sigma * h
    if abs(z) < FROM_RECURRENCE:
        # 26 terms of the power series: for |z| ≤ 2 the remainder is below 2²⁶/26! = 2e-19
        for n in range(4):
            # Σ_k z^k / (k! (n + 1 + k)), without the division by |z| of the recurrence
            term = 1.0 + 0.0j
            total = term / (n + 1)
            for k in range(1, 26):
                term *= z / k
                total += term / (n + 1 + k)
            out[n] = total * h ** (n + 1)
        return
    # the recurrence φ_n = (exp(z) − n φ_{n−1}) / z, from φ_0 = (exp(z) − 1) / z
    grown = np.exp(z)
    integral = (grown - 1.0) / z
    out[0] = integral * h
    for n in range(1, 4):
        integral = (grown - n * integral) / z
        out[n] = integral * h ** (n + 1)
