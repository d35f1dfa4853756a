"""How far responses of oscillators stray from straight lines between nodes.

In a piece of time of length d, in which the load is a + b τ, the response is

    ρ = A exp(σ τ) − a/σ − b/σ²,   A = ρ + a/σ + b/σ² at its beginning,

of which A exp(σ τ) alone is no line: it strays from its chord by min(|σ|² d²/8, 2) |A| at most. A
load that strays from a line by r within the piece adds 2 d r. How far the ends of pieces lie off
the line from node to node is read off the responses there.
"""

from __future__ import annotations

from math import comb, perm, prod
from typing import NamedTuple

import numpy as np

from alphacut.frame.calculus.kernels import kernel
from alphacut.frame.calculus.rounding import UNIT_ROUNDOFF
from alphacut.frame.response.duhamel import absolute_moments, responses_at_nodes
from alphacut.frame.structures.loads import History
from alphacut.fuzzy.arrays import Array

PHASE = 0.5
"""Phase in rad that a mode or a sine takes in a piece; a piece adds its square to the bound."""
MAX_PARTS = 16
"""Most parts into which a sine divides a piece."""
MAX_ENTRIES = 1_000_000
"""Responses that are held together."""


class Pieces(NamedTuple):
    """Pieces of time in which a load is a line.

    Args:
        time: Their ends, shape (P + 1,), in s; nodes are among them.
        first: The load at the beginning of each, shape (P,).
        last: The load at the end of each.
        bend: Bound of how far it strays from the line between.
    """

    time: Array
    first: Array
    last: Array
    bend: Array


def line_deviations(
    sigma: Array,
    load: History | None,
    time: Array,
    order: int,
    *,
    is_direct: bool = False,
    at_nodes: tuple[Array, Array, Array] | None = None,
) -> Array:
    """Return how far σ^order ρ, and its imaginary part over ω, stray from lines between nodes.

    Args:
        sigma: Points −g + iω of a grid over q = g/ω and ω that covers the oscillators, (Q, W).
        load: The load; None for ρ = exp(σ t).
        time: Nodes, shape (T,), in s.
        order: Power of σ.
        is_direct: Whether the load itself is added to the latter.
        at_nodes: ρ with two derivatives at the nodes, its rounding, and bounds of its derivatives,
            where they are known.

    Returns:
        Bounds in the step to each node, shape (2, T).
    """
    omega, quotient = sigma[0].imag, -sigma[:, 0].real / sigma[:, 0].imag
    low, fast, decay = float(omega.min()), float(np.abs(sigma).max()), float(-sigma.real.max())
    pieces = _pieces(load, time, fast)
    times, d, node = pieces.time, np.diff(pieces.time), np.searchsorted(pieces.time, time)
    step = np.repeat(np.arange(len(time) - 1), np.diff(node))  # in which each piece lies
    at_node: Array = is_direct * load.values(time) if load else np.zeros(len(time))
    slope = (pieces.last - pieces.first) / d
    tables = at_nodes if len(times) == len(time) else None
    if tables:
        bounds = tables[2]
    elif load is None:
        bounds = np.stack([times**n * np.exp(-decay * times) for n in range(5)])
    else:
        bounds = absolute_moments(decay, load, times)
    ends = []  # of pieces: where in the step, the load that is added, numbers of those at no node
    for first, added in ((0, pieces.first), (1, pieces.last)):
        x = (times[first : len(d) + first] - time[step]) / (time[step + 1] - time[step])
        direct = is_direct * added - (1 - x) * at_node[step] - x * at_node[step + 1]
        ends.append((x, direct, np.flatnonzero((x > 0) & (x < 1))))
    # largest magnitudes over the grid: of F = σ^order A and F″; of H, the responses off the line
    # at both ends, H″, Im H/ω with and without the load
    amplitude, rounding = np.zeros((2, len(d))), np.zeros(len(times))
    off = np.zeros((4, 2, len(d)))
    off[2] = [np.where((x > 0) & (x < 1), 0.0, np.abs(direct)) for x, direct, _ in ends]
    count = -(-3 * len(times) * sigma.size // MAX_ENTRIES)
    for piece in np.array_split(np.arange(sigma.size), 1 if tables else count):
        part = sigma.ravel()[piece]
        if tables:
            rho, error = tables[:2]
        elif load is None:
            rho = np.exp(part * times[:, None]) * times[:, None] ** np.arange(3)[:, None, None]
            error = UNIT_ROUNDOFF * (4 + np.abs(part) * times[:, None]) * np.abs(rho[0])
        else:
            rho, error = responses_at_nodes(part, load, times, 2)
        _largest(part, rho, error, pieces.first, slope, order, amplitude, rounding)
        for k, (x, direct, inner) in enumerate(ends):
            if not len(inner):
                continue
            x, direct = x[inner, None], direct[inner, None]
            left, right = node[step[inner]], node[step[inner] + 1]
            line = (1 - x) * rho[:, left] + x * rho[:, right]
            H = with_power(part, rho[:, inner + k] - line, order)[::2]
            read = H[0].imag / part.imag
            sizes = np.stack([np.abs(H[0]), np.abs(H[1]), np.abs(read + direct), np.abs(read)])
            off[:, k, inner] = np.maximum(off[:, k, inner], sizes.max(2))
    # between the points of the grid F strays from what is bilinear by `between` |F″|
    h, k_step = (float(np.diff(np.sort(x)).max(initial=0.0)) for x in (omega, quotient))
    between = ((1 + quotient.max() ** 2) * h**2 + (omega.max() * k_step) ** 2) / 8
    fourth = sum(
        comb(4, j) * perm(order, j) * fast ** (order - j) * bounds[4 - j] for j in range(order + 1)
    )
    of_line = abs(prod(range(order - 4, order))) * np.abs(pieces.first) * low ** (order - 5)
    of_line += abs(prod(range(order - 5, order - 1))) * np.abs(slope) * low ** (order - 6)
    size = amplitude[0] + between * (amplitude[1] + between * (fourth[:-1] + of_line))
    growth = np.exp(max(-decay, 0.0) * d)
    bent = growth * np.minimum((fast * d) ** 2 / 8, 2.0) * size
    bent += growth * fast**order * 2 * d * pieces.bend
    at_ends = np.zeros((2, 2, len(d)))
    for k, (x, _, _) in enumerate(ends):
        at, is_inner = np.arange(len(d)) + k, (x > 0) & (x < 1)
        chord = np.maximum(fourth[node[step]], fourth[node[step + 1]])
        missed = is_inner * between * (off[1, k] + between * (fourth[at] + chord))
        at_ends[:, k] = off[0, k] + missed, off[2, k] + (missed + is_inner * h * off[3, k]) / low
    bent += 4 * np.max([rounding[:-1], rounding[1:], rounding[node[step]]], axis=0)
    total = np.stack([bent, bent / low + is_direct * pieces.bend]) + at_ends.max(1)
    deviation: Array = np.zeros((2, len(time)))
    deviation[:, 1:] = np.maximum.reduceat(total, node[:-1], axis=1)
    return deviation


@kernel(fastmath={"reassoc", "contract"})
def _largest(
    sigma: Array,
    rho: Array,
    error: Array,
    first: Array,
    slope: Array,
    order: int,
    amplitude: Array,
    rounding: Array,
) -> None:
    """Raise to the largest at S σ: |F|, |F″| of P pieces (2, P); σ^order ρ's rounding (P + 1,)."""
    inverse, inverse_2 = 1 / sigma, 1 / sigma**2
    inverse_3, inverse_4 = inverse * inverse_2, inverse_2 * inverse_2
    power, size = sigma**order, np.abs(sigma) ** order
    power_first, power_second = 2 * order * sigma ** max(order - 1, 0), order * (order - 1.0)
    relative = 2 * (order + 9) * UNIT_ROUNDOFF
    for p in range(len(rounding)):
        largest, largest_second, total, worst = 0.0, 0.0, 0.0, rounding[p]
        a, b = (first[p], slope[p]) if p < len(first) else (0.0, 0.0)
        for s in range(len(sigma)):
            r = rho[0, p, s]
            worst = max(worst, size[s] * (error[p, s] + relative * np.sqrt(r.real**2 + r.imag**2)))
            A = r + a * inverse[s] + b * inverse_2[s]
            A1 = rho[1, p, s] - a * inverse_2[s] - 2 * b * inverse_3[s]
            A2 = rho[2, p, s] + 2 * a * inverse_3[s] + 6 * b * inverse_4[s]
            F = power[s] * A
            F2 = power_second * A + power_first[s] * A1 + power[s] * A2
            square, square_second = F.real**2 + F.imag**2, F2.real**2 + F2.imag**2
            largest, largest_second = max(largest, square), max(largest_second, square_second)
            total += abs(F.real) + abs(F.imag) + abs(F2.real) + abs(F2.imag)
        if not total < np.inf:  # NaN, which a maximum may pass over
            largest = largest_second = worst = np.inf
        rounding[p] = worst
        if p < len(first):
            underflow = 1e-150 if total > 0 else 0.0  # squares of less may be zero
            amplitude[0, p] = max(amplitude[0, p], np.sqrt(largest) + underflow)
            amplitude[1, p] = max(amplitude[1, p], np.sqrt(largest_second) + underflow)


def with_power(sigma: Array, rho: Array, order: int) -> Array:
    """σ^order ρ and its first two derivatives by σ, shape (3, T, S), from those of ρ."""
    power, first = sigma**order, order * sigma ** max(order - 1, 0)
    second = order * (order - 1) * rho[0] + 2 * first * rho[1] + power * rho[2]
    return np.stack([power * rho[0], first * rho[0] + power * rho[1], second])


def _pieces(load: History | None, time: Array, fastest: float) -> Pieces:
    """Pieces between nodes and a load's samples; shorter ones where it is multiplied by a sine."""
    if load is None:
        return Pieces(time, *np.zeros((3, len(time) - 1)))
    samples = load.start + np.arange(len(load.samples)) * load.step
    samples = samples[(samples > time[0]) & (samples < time[-1])]
    later = np.searchsorted(time, samples)
    distance = np.minimum(samples - time[later - 1], time[later] - samples)
    times = np.union1d(time, samples[distance > 1e-9 * load.step])
    if load.frequency:
        phase = np.diff(times) * max(fastest, load.frequency)
        parts = np.clip(np.ceil(phase / PHASE), 1, MAX_PARTS).astype(int)
        part = np.arange(parts.sum()) - np.repeat(np.cumsum(parts) - parts, parts)
        begin, length = np.repeat(times[:-1], parts), np.repeat(np.diff(times) / parts, parts)
        times = np.append(begin + part * length, times[-1])
    d, after, before = np.diff(times), load.envelope(times)[:-1], load.envelope(times, -1.0)[1:]
    # |f″| ≤ Ω² |g| + 2 Ω |g′|
    largest, slope = np.maximum(np.abs(after), np.abs(before)), np.abs(before - after) / d
    bend = d**2 / 8 * load.frequency * (load.frequency * largest + 2 * slope)
    sine = load.wave(times)
    return Pieces(times, after * sine[:-1], before * sine[1:], bend)
