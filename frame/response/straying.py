"""How far responses of oscillators stray from straight lines between nodes.

In a piece of time of length d, in which the load is a + b τ, the response is

    ρ = A exp(σ τ) − a/σ − b/σ²,   A = ρ + a/σ + b/σ² at its beginning,

of which A exp(σ τ) alone is no line: it strays from its chord by min(|σ|² d²/8, 2) |A| at most. A
load that strays from a line by r within the piece adds 2 d r. How far the ends of pieces lie off
the line from node to node is read off the responses there.

These bounds count modes by magnitude. Where motions of modes cancel, nodes are added within steps,
at which responses are summed with their signs (`narrowed_straying`).
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from math import comb, perm, prod
from typing import NamedTuple

import numpy as np

from alphacut.frame.calculus.rounding import UNIT_ROUNDOFF
from alphacut.frame.response.duhamel import absolute_moments, responses_at_nodes
from alphacut.frame.structures.loads import History
from alphacut.fuzzy.arrays import Array, Ints
from alphacut.fuzzy.kernels import kernel

compiled_fast = kernel(fastmath={"reassoc", "contract"})
PHASE = 0.5
"""Phase in rad that a mode or a sine takes in a piece; a piece adds its square to the bound."""
MAX_PARTS = 16
"""Most parts into which a sine divides a piece."""
MIN_PARTS, MAX_ADDED_PARTS = 4, 16
"""Parts into which nodes that are added divide a step; more where few leave the bound wide."""
TIGHT, CLOSE = 2.5, 1.25
"""Bound over what a motion strays at which no nodes are added, and at which few suffice."""
MAX_ENTRIES = 1_000_000
"""Responses that are held together."""


class Pieces(NamedTuple):
    """P pieces of time in which a load is a line."""

    time: Array  # their ends, (P + 1,), in s; nodes are among them
    first: Array  # the load at the beginning of each, (P,)
    last: Array  # the load at the end of each
    bend: Array  # bound of how far it strays from the line between


class Response(NamedTuple):
    """What an oscillator adds to m outputs, Re κ σ^order ρ, or a load itself, Re κ f."""

    sigma: Array | None  # points −g + iω of a grid over q = g/ω and ω, (Q, W); None of f itself
    load: History | None  # None for ρ = exp(σ t)
    order: int
    coefficient: Array  # κ at the points, (m, Q, W); of f (m, 1, 1)
    spread: Array  # bounds of how far Re κ and Im κ are from that, (2, m)

    def in_the_middle(self) -> Response:
        """The response at one point of the grid."""
        q, w = (n // 2 for n in self.coefficient.shape[1:])
        point = slice(q, q + 1), slice(w, w + 1)
        sigma = None if self.sigma is None else self.sigma[point]
        coefficient = self.coefficient[:, *point]
        return self._replace(sigma=sigma, coefficient=coefficient, spread=0 * self.spread)

    def line_deviation(self, time: Array) -> Array:
        """Bound of how far it strays from straight lines in the step to each node, (T, m)."""
        kappa, (real, imag) = self.coefficient, self.spread
        real = np.abs(kappa.real).max((1, 2)) + real
        if self.sigma is None:
            assert self.load is not None
            return np.outer(self.load.line_deviation(time), real)
        omega, order = self.sigma.imag, self.order
        modulus, of_imaginary = line_deviations(self.sigma, self.load, time, (order,))[order]
        size = np.hypot(real, np.abs(kappa.imag).max((1, 2)) + imag)
        imag = np.abs(kappa.imag * omega).max((1, 2)) + omega.max() * imag
        by_parts = np.outer(modulus, real) + np.outer(of_imaginary, imag)
        return np.minimum(np.outer(modulus, size), by_parts)

    def off_chords(self, nodes: Array, parts: int) -> tuple[Array, Array]:
        """Its range less the step's chord at nodes but the last, (steps, parts, m) each."""
        kappa, order = self.coefficient.reshape(len(self.coefficient), -1), self.order
        if self.sigma is None:
            assert self.load is not None
            off = _off_chords(self.load.values(nodes)[:, None], nodes, parts)
            value, margin = off * kappa[:, 0].real, np.abs(off) * self.spread[0]
            return value - margin, value + margin
        sigma, shape = self.sigma.ravel(), ((len(nodes) - 1) // parts, parts)
        low, high = np.full((2, *shape, len(kappa)), np.inf)
        # largest over the grid: of the parts of G = σ^order ρ off the chord, |G″|, rounding
        real, imag, second, rounding = np.zeros((4, *shape))
        for points in np.array_split(np.arange(len(sigma)), _batches(len(nodes), len(sigma))):
            rho, error = responses_of(sigma[points], self.load, nodes)
            error += (order + 16) * UNIT_ROUNDOFF * np.abs(rho[0])
            error = 2 * np.abs(sigma[points]) ** order * error
            rounding = np.maximum(rounding, _with_ends(error.max(-1), parts))
            G, _, G2 = with_power(sigma[points], _off_chords(rho, nodes, parts), order)
            real = np.maximum(real, np.abs(G.real).max(-1))
            imag = np.maximum(imag, np.abs(G.imag).max(-1))
            second = np.maximum(second, np.abs(G2).max(-1))
            for o, x in enumerate(kappa[:, points]):
                value = x.real * G.real - x.imag * G.imag
                low[..., o] = np.minimum(low[..., o], value.min(-1))
                high[..., o] = np.minimum(high[..., o], -value.max(-1))
        # between the points of the grid G strays from what is bilinear by `missed`, κ G by what κ
        # changes in a cell besides
        between = _between_points(self.sigma)
        missed = between * (second + between * self._fourth_off_chords(nodes[::parts])) + rounding
        axes = (np.diff(self.coefficient, axis=axis) for axis in (1, 2))
        change = sum(np.abs(x).max((1, 2), initial=0.0) for x in axes)
        margin = np.multiply.outer(missed, np.abs(kappa).max(1))
        margin += np.multiply.outer(np.hypot(real, imag), change)
        margin += np.multiply.outer(real + missed, self.spread[0])
        margin += np.multiply.outer(imag + missed, self.spread[1])
        return low - margin, margin - high

    def _fourth_off_chords(self, time: Array) -> Array:
        """Bound of |G⁗| of what G = σ^order ρ is off chords in each step, (steps, 1)."""
        # It is h²/8 times that of G's second derivative by time, σ² G + σ^order (σ f + f′), of
        # which what is of f has no fourth derivative by σ; nor has what jumps of f add.
        assert self.sigma is not None
        decay, h = float(-self.sigma.real.max()), np.diff(time)
        moments = moments_of(decay, self.load, time)[
            :, :-1
        ]  # then within the step that begins there
        force = self.load.extremes[0] if self.load else 0.0
        for n in reversed(range(5)):
            terms = (comb(n, j) * h ** (n - j) * moments[j] for j in range(n + 1))
            moments[n] = sum(terms) + force * h ** (n + 1) / (n + 1)
        growth, fast = np.exp(max(-decay, 0.0) * h), float(np.abs(self.sigma).max())
        fourth = fourth_derivative(self.order + 2, fast, growth * moments)
        return (h**2 / 8 * fourth)[:, None]


def narrowed_straying(
    responses: Sequence[Response], time: Array, bound: Array, others: Array | float = 0.0
) -> Array:
    """Bound of how far Σ responses + others strays from lines in the step to each node, (T, m).

    It begins at a `bound` in which responses count by magnitude; `others` (T, m) always do. A
    motion is off its step's chord by what it strays from chords between nodes that are added within
    the step, and by what these are off the step's chord: their largest value at the added nodes.
    There responses are summed with their signs, so that modes cancel as they do in motions. The
    former falls with the square of the number of parts, which suffices for a motion in the middle
    of the box: what else is wide are the ranges over it.
    """
    middle = [x.in_the_middle() for x in responses]
    by_magnitude = np.sum([x.line_deviation(time) for x in middle], axis=0).max(0)
    off, straying = _off_and_straying(middle, time, MIN_PARTS)
    reached = off.max(0)
    if (by_magnitude <= TIGHT * reached).all():
        return bound
    is_close = ((off + straying).max(0) <= CLOSE * reached).all()
    parts = MIN_PARTS if is_close else MAX_ADDED_PARTS
    off, straying = _off_and_straying(responses, time, parts)
    narrowed = np.vstack([np.zeros(off.shape[1]), off + straying])
    return np.fmin(bound, narrowed + others)


def _off_and_straying(
    responses: Sequence[Response], time: Array, parts: int
) -> tuple[Array, Array]:
    """Bounds of Σ responses at added nodes off chords, and between these nodes, (steps, m) each."""
    inside = time[:-1, None] + np.diff(time)[:, None] * (np.arange(parts) / parts)
    nodes, m = np.append(inside, time[-1]), len(responses[0].coefficient)
    low, high, size = np.zeros((3, *inside.shape, m))
    straying = np.zeros((len(nodes), m))
    for response in responses:
        least, greatest = response.off_chords(nodes, parts)
        low, high = low + least, high + greatest
        size += np.maximum(np.abs(least), np.abs(greatest))
        straying += response.line_deviation(nodes)
    off = np.maximum(-low, high) + len(responses) * UNIT_ROUNDOFF * size
    return off.max(1), straying[1:].reshape(*inside.shape, m).max(1)


def _off_chords(values: Array, nodes: Array, parts: int) -> Array:
    """Values (…, nodes, S) less the chords of steps of so many parts, (…, steps, parts, S)."""
    ends, time = values[..., ::parts, None, :], nodes[::parts]
    x = (nodes[:-1].reshape(-1, parts) - time[:-1, None]) / np.diff(time)[:, None]
    inside = values[..., :-1, :].reshape(*values.shape[:-2], *x.shape, -1)
    x = x[..., None]
    return np.asarray(inside - (1 - x) * ends[..., :-1, :, :] - x * ends[..., 1:, :, :])


def _with_ends(bound: Array, parts: int) -> Array:
    """Bound at nodes (N,) and the greater one at the ends of their step, (steps, parts)."""
    ends = bound[::parts]
    return np.asarray(bound[:-1].reshape(-1, parts) + np.maximum(ends[1:], ends[:-1])[:, None])


def responses_of(sigma: Array, load: History | None, time: Array) -> tuple[Array, Array]:
    """Return ρ with two derivatives by σ, (3, T, S), and bounds of its rounding, (T, S)."""
    if load is not None:
        return responses_at_nodes(sigma, load, time, 2)
    rho = np.exp(sigma * time[:, None]) * time[:, None] ** np.arange(3)[:, None, None]
    return rho, UNIT_ROUNDOFF * (4 + np.abs(sigma) * time[:, None]) * np.abs(rho[0])


def moments_of(decay: float, load: History | None, time: Array, *, is_needed: bool = True) -> Array:
    """Return bounds of ρ's derivatives by σ of order 0 to 4, (5, T); g is at least `decay`."""
    if not is_needed:
        return np.zeros((5, len(time)))
    if load is not None:
        return absolute_moments(decay, load, time)
    return np.stack([time**n * np.exp(-decay * time) for n in range(5)])


def fourth_derivative(order: int, fast: float, moments: Array) -> Array:
    """Return a bound of |(σ^order ρ)⁗|, (T,), from bounds of |σ| and of ρ's derivatives (5, T)."""
    terms = (comb(4, j) * perm(order, j) * fast ** (order - j) for j in range(order + 1))
    return np.asarray(sum(factor * moments[4 - j] for j, factor in enumerate(terms)))


def _between_points(sigma: Array) -> float:
    """What a function of σ strays from bilinear interpolation on a grid (Q, W), over |F″|."""
    omega, quotient = sigma[0].imag, -sigma[:, 0].real / sigma[:, 0].imag
    h, k_step = (float(np.diff(np.sort(x)).max(initial=0.0)) for x in (omega, quotient))
    return float(((1 + quotient.max() ** 2) * h**2 + (omega.max() * k_step) ** 2) / 8)


def _batches(nodes: int, points: int) -> int:
    """Numbers of batches into which points of σ are divided, so that their responses fit."""
    return -(-3 * nodes * points // MAX_ENTRIES)


def line_deviations(
    sigma: Array,
    load: History | None,
    time: Array,
    orders: Collection[int],
    *,
    is_force: bool = False,
    at_nodes: tuple[Array, Array, Array] | None = None,
) -> dict[int, Array]:
    """Return how far σ^order ρ, and its imaginary part over ω, stray from lines between nodes.

    Args:
        sigma: Points −g + iω of a grid over q = g/ω and ω that covers the oscillators, (Q, W).
        load: The load; None for ρ = exp(σ t).
        time: Nodes, shape (T,), in s.
        orders: Powers of σ; the result has for each bounds in the step to each node, (2, T).
        is_force: Whether the load itself is added to the imaginary part of order 2.
        at_nodes: ρ with two derivatives, its rounding, bounds of its derivatives, where known.
    """
    omega = sigma[0].imag
    low, fast, decay = float(omega.min()), float(np.abs(sigma).max()), float(-sigma.real.max())
    pieces = _pieces(load, time, fast)
    times, d, node = pieces.time, np.diff(pieces.time), np.searchsorted(pieces.time, time)
    slope = (pieces.last - pieces.first) / d
    # of each end of a piece: the nodes around it, and its place between them, 0 at a node
    left = np.repeat(node, np.diff(node, append=node[-1] + 1))
    right = np.append(np.repeat(node[1:], np.diff(node)), node[-1])
    fraction = (times - times[left]) / np.maximum(times[right] - times[left], 1e-300)
    # how far the load lies off the line between nodes, before and after each end
    off_line = np.stack([np.append(0.0, pieces.last), np.append(pieces.first, 0.0)])
    off_line -= np.interp(times, time, load.values(time) if load else np.zeros(len(time)))
    off_line[0, 0] = off_line[1, -1] = 0.0
    tables = at_nodes if len(times) == len(time) else None
    bounds = tables[2] if tables else moments_of(decay, load, times, is_needed=sigma.size > 1)
    # for each order the largest magnitudes over the grid: of F = σ^order A and F″; rounding; of H,
    # the responses off the line at ends, H″, Im H/ω, and that with the load before and after
    added = {order: off_line * (is_force and order == 2) for order in orders}
    largest = {
        order: (np.zeros((2, len(d))), np.zeros(len(times)), np.zeros((5, len(times))))
        for order in orders
    }
    for order in orders:
        largest[order][2][3:] = np.where(fraction > 0, 0.0, np.abs(added[order]))
    count = 1 if tables else _batches(len(times), sigma.size)
    for part in np.array_split(sigma.ravel(), count):
        rho, error = tables[:2] if tables else responses_of(part, load, times)
        for order, (amplitude, rounding, off) in largest.items():
            _raise_amplitudes(part, rho, error, pieces.first, slope, order, amplitude, rounding)
            _raise_ends(part, rho, (left, right, fraction), added[order], order, off)
    # between the points of the grid F strays from what is bilinear by `between` |F″|
    h, between = float(np.diff(np.sort(omega)).max(initial=0.0)), _between_points(sigma)
    growth, inside = np.exp(max(-decay, 0.0) * d), fraction > 0
    found = dict[int, Array]()
    for order, (amplitude, rounding, off) in largest.items():
        fourth = fourth_derivative(order, fast, bounds)
        of_line = abs(prod(range(order - 4, order))) * np.abs(pieces.first) * low ** (order - 5)
        of_line += abs(prod(range(order - 5, order - 1))) * np.abs(slope) * low ** (order - 6)
        size = amplitude[0] + between * (amplitude[1] + between * (fourth[:-1] + of_line))
        bent = growth * np.minimum((fast * d) ** 2 / 8, 2.0) * size
        bent += growth * fast**order * 2 * d * pieces.bend
        chord = np.maximum(fourth[left], fourth[right])
        missed = inside * between * (off[1] + between * (fourth + chord))
        at_ends = off[[0, 3, 4]]
        at_ends[0] += missed
        at_ends[1:] += (missed + inside * h * off[2]) / low
        error = np.max([rounding, rounding[left], rounding[right]], axis=0)
        bent += 4 * np.maximum(error[:-1], error[1:])
        total = np.stack([bent, bent / low + added[order].any() * pieces.bend])
        total[0] += np.maximum(at_ends[0, :-1], at_ends[0, 1:])
        total[1] += np.maximum(at_ends[2, :-1], at_ends[1, 1:])
        found[order] = np.zeros((2, len(time)))
        found[order][:, 1:] = np.maximum.reduceat(total, node[:-1], axis=1)
    return found


@compiled_fast
def _raise_amplitudes(
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


@compiled_fast
def _raise_ends(
    sigma: Array,
    rho: Array,
    around: tuple[Ints, Ints, Array],
    added: Array,
    order: int,
    off: Array,
) -> None:
    """Raise to the largest at S σ of ends between nodes: |H|, |H″|, |Im H/ω|, with load (5, P + 1).

    H is σ^order ρ less the line through it at the nodes around an end; `added` is the load, off
    its own line, before and after the end, shape (2, P + 1).
    """
    left, right, fraction = around
    power = sigma**order
    power_first, power_second = order * sigma ** max(order - 1, 0), order * (order - 1.0)
    for p in range(len(fraction)):
        x, i, j = fraction[p], left[p], right[p]
        if x == 0:
            continue
        largest, largest_second, total = 0.0, 0.0, 0.0
        for s in range(len(sigma)):
            r, r1, r2 = rho[0, p, s], rho[1, p, s], rho[2, p, s]
            r -= (1 - x) * rho[0, i, s] + x * rho[0, j, s]
            r1 -= (1 - x) * rho[1, i, s] + x * rho[1, j, s]
            r2 -= (1 - x) * rho[2, i, s] + x * rho[2, j, s]
            H = power[s] * r
            H2 = power_second * r + 2 * power_first[s] * r1 + power[s] * r2
            read = H.imag / sigma[s].imag
            largest = max(largest, H.real**2 + H.imag**2)
            largest_second = max(largest_second, H2.real**2 + H2.imag**2)
            off[2, p] = max(off[2, p], abs(read))
            off[3, p] = max(off[3, p], abs(read + added[0, p]))
            off[4, p] = max(off[4, p], abs(read + added[1, p]))
            total += abs(H.real) + abs(H.imag) + abs(H2.real) + abs(H2.imag)
        if not total < np.inf:  # NaN, which a maximum may pass over
            largest = largest_second = off[2, p] = off[3, p] = off[4, p] = np.inf
        underflow = 1e-150 if total > 0 else 0.0  # squares of less may be zero
        off[0, p] = max(off[0, p], np.sqrt(largest) + underflow)
        off[1, p] = max(off[1, p], np.sqrt(largest_second) + underflow)


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
