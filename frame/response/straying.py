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
from dataclasses import replace
from math import comb, perm, prod
from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.frame.calculus.rounding import UNIT_ROUNDOFF
from alphacut.frame.records.history import SAME_TIME, History
from alphacut.frame.response.duhamel import absolute_moments, responses_at_nodes

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
    off: Array  # how far the load at both ends is off the line from node to node, (2, P)


class Response(NamedTuple):
    """What an oscillator adds to m outputs, Re κ σ^order ρ, or a load itself, Re κ f."""

    sigma: Array | None  # points −g + iω of a grid over q = g/ω and ω, (Q, W); None of f itself
    load: History | None  # None for ρ = exp(σ t)
    order: int
    # κ at the points, monotone between them along q and ω, (m, Q, W); of f (m, 1, 1)
    coefficient: Array
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
            return np.outer(load_deviation(self.load, time), real)
        omega, order = self.sigma.imag, self.order
        modulus, of_imaginary = line_deviations(self.sigma, self.load, time, (order,))[order]
        size = np.hypot(real, np.abs(kappa.imag).max((1, 2)) + imag)
        imag = np.abs(kappa.imag * omega).max((1, 2)) + omega.max() * imag
        by_parts = np.outer(modulus, real) + np.outer(of_imaginary, imag)
        return np.asarray(np.minimum(np.outer(modulus, size), by_parts))

    def line_deviation_before(self, first: float, last: float) -> Array:
        """Bound of how far it strays from a line in a step before what jumps at its end, (m,)."""
        if self.sigma is not None:
            return np.asarray(self.line_deviation(np.array([first, last]))[1])
        assert self.load is not None
        # shortly before the end the load is within `missed` of its value before the jump, and so
        # is the line from the beginning
        sliver = 4 * SAME_TIME * self.load.step
        missed = 2 * sliver * self.load.extremes[1]
        deviation = load_deviation(self.load, np.array([first, last - sliver]))[1] + missed
        real = np.abs(self.coefficient.real).max((1, 2)) + self.spread[0]
        return np.asarray(deviation * real)

    def off_chords(self, nodes: Array, parts: int) -> tuple[Array, Array]:
        """Its range at nodes less the chords of steps of so many parts, (nodes, m) each."""
        chords = Chords.through(np.arange(0, len(nodes), parts), nodes)
        if self.sigma is None:
            assert self.load is not None
            return self._range_of_load(chords.deviations(self.load.values(nodes)[:, None]))
        fourth = np.append(np.repeat(self._fourth_off_chords(nodes[::parts]), parts), 0.0)
        return self._range_off(chords, nodes, fourth=fourth)

    def change(self, first: float, last: float) -> tuple[Array, Array]:
        """Its range at `last`, before what jumps there, less its value at `first`, (m,) each."""
        nodes = np.array([first, last])
        if self.sigma is None:
            assert self.load is not None
            change = self.load.before(nodes[1:]) - self.load.values(nodes[:1])
            low, high = self._range_of_load(change[:, None])
            return low[0], high[0]
        decay, fast = float(-self.sigma.real.max()), float(np.abs(self.sigma).max())
        fourth = fourth_derivative(self.order, fast, moments_of(decay, self.load, nodes))
        to_first = Chords(np.zeros(2, int), np.zeros(2, int), np.zeros(2))
        low, high = self._range_off(to_first, nodes, fourth=np.append(0.0, fourth.sum()))
        return low[1], high[1]

    def _range_of_load(self, value: Array) -> tuple[Array, Array]:
        """The range of Re κ f for values (N, 1) of the load itself, (N, m) each."""
        middle = value * self.coefficient[:, 0, 0].real
        margin = np.abs(value) * self.spread[0]
        return middle - margin, middle + margin

    def _range_off(self, chords: Chords, nodes: Array, *, fourth: Array) -> tuple[Array, Array]:
        """The range of Re κ G, G = σ^order ρ off chords at nodes (N,), (N, m) each.

        `fourth` (N,) bounds the fourth derivative of G by σ.
        """
        assert self.sigma is not None
        kappa = self.coefficient.reshape(len(self.coefficient), -1)
        sigma = self.sigma.ravel()
        low, high = np.full((2, len(nodes), len(kappa)), np.inf)
        # largest over the grid: of the parts of G = σ^order ρ off the chord, |G″|, rounding
        real, imag, second, rounding = largest = np.zeros((4, len(nodes)))
        for points in _batches(len(nodes), len(sigma)):
            rho, error = responses_of(sigma[points], self.load, nodes)
            error = _error_with_power(sigma[points], rho[0], error, self.order)
            G, _, G2 = with_power(sigma[points], chords.deviations(rho), self.order)
            _raise_to(largest, G.real, G.imag, G2, error)
            for o, x in enumerate(kappa[:, points]):
                value = x.real * G.real - x.imag * G.imag
                low[:, o] = np.minimum(low[:, o], value.min(-1))
                high[:, o] = np.minimum(high[:, o], -value.max(-1))
        # between the points of the grid G strays from what is bilinear by `missed`, κ G by what κ
        # changes in a cell besides, at most what it does along its sides: it is monotone along both
        between = _between_points(self.sigma)
        missed = between * (second + between * fourth) + 2 * chords.with_ends(rounding)
        axes = (np.diff(self.coefficient, axis=axis) for axis in (1, 2))
        change = sum(np.abs(x).max((1, 2), initial=0.0) for x in axes)
        margin = np.outer(missed, np.abs(kappa).max(1)) + np.outer(np.hypot(real, imag), change)
        margin += np.stack([real + missed, imag + missed], 1) @ self.spread
        return low - margin, margin - high

    def _fourth_off_chords(self, time: Array) -> Array:
        """Bound of |G⁗| of what G = σ^order ρ is off chords in each step, (steps,)."""
        # It is h²/8 times that of G's second derivative by time, σ² G + σ^order (σ f + f′), of
        # which what is of f has no fourth derivative by σ; nor has what jumps of f add.
        assert self.sigma is not None
        decay, h = float(-self.sigma.real.max()), np.diff(time)
        moments = moments_of(decay, self.load, time)[:, :-1]
        # then within the step that begins there
        force = self.load.extremes[0] if self.load else 0.0
        for n in reversed(range(5)):
            terms = (comb(n, j) * h ** (n - j) * moments[j] for j in range(n + 1))
            moments[n] = sum(terms) + force * h ** (n + 1) / (n + 1)
        growth, fast = np.exp(max(-decay, 0.0) * h), float(np.abs(self.sigma).max())
        return np.asarray(h**2 / 8 * fourth_derivative(self.order + 2, fast, growth * moments))


class Chords(NamedTuple):
    """Straight lines from node to node at N times, of which nodes are some, the ends too."""

    before: Ints  # number of the time that is the node before or at it, (N,)
    after: Ints  # the same of the node after it
    fraction: Array  # place between the two, 0 at a node

    @classmethod
    def through(cls, node: Ints, times: Array) -> Chords:
        """Chords through nodes, of which the numbers among the times are given."""
        count = np.diff(node)
        before = np.repeat(node, np.append(count, 1))
        after = np.append(np.repeat(node[1:], count), node[-1])
        length = np.maximum(times[after] - times[before], 1e-300)
        return cls(before, after, (times - times[before]) / length)

    def deviations(self, values: Array) -> Array:
        """Values (…, N, S) less their chords."""
        x = self.fraction[:, None]
        chords = (1 - x) * values[..., self.before, :] + x * values[..., self.after, :]
        return np.asarray(values - chords)

    def with_ends(self, bound: Array) -> Array:
        """Bounds (N,) for values, together with those for their chords."""
        return np.asarray(bound + np.maximum(bound[self.before], bound[self.after]))


def narrowed_straying(
    responses: Sequence[Response], time: Array, bound: Array, unresolved: Array | float = 0.0
) -> Array:
    """Bound of how far Σ responses + unresolved strays from lines in the step to each node, (T, m).

    It begins at a `bound` in which responses count by magnitude; `unresolved` (T, m) always do. A
    motion is off its step's chord by what it strays from chords between nodes that are added within
    the step, and by what these are off the step's chord: their largest value at the added nodes.
    There responses are summed with their signs, so that modes cancel as they do in motions. The
    former falls with the square of the number of parts, which suffices for a motion in the middle
    of the box: what else is wide are the ranges over it.
    """
    middle = [x.in_the_middle() for x in responses]
    off, straying = _off_and_straying(middle, time, MIN_PARTS)
    reached = off.max(0)
    if (bound.max(0) <= TIGHT * reached).all():
        return bound
    is_close = ((off + straying).max(0) <= CLOSE * reached).all()
    parts = MIN_PARTS if is_close else MAX_ADDED_PARTS
    off, straying = _off_and_straying(responses, time, parts)
    narrowed = np.vstack([np.zeros(off.shape[1]), off + straying])
    return np.fmin(bound, narrowed + unresolved)


def narrowed_at_jumps(responses: Sequence[Response], time: Array, bound: Array) -> Array:
    """Return a bound of how far Σ responses lies beyond its values at the nodes of steps, (T, m).

    It is the `bound` of how far it strays from straight lines, except in steps at whose end a load
    jumps that is added itself. With y₁⁻ the value before the jump, a motion strays within the step
    by some r from the line between y₀ and y₁⁻, and so lies beyond y₀ and y₁ by |y₁⁻ − y₀| + r at
    most; the line from y₀ to y₁ is as far from it as the jump is large.
    """
    loads = [x.load for x in responses if x.sigma is None and x.load is not None]
    jumps = (
        np.any([x.jumps_at(time) for x in loads], axis=0) if loads else np.zeros(len(time), bool)
    )
    narrowed = bound.copy()
    for node in np.flatnonzero(jumps[1:]) + 1:
        first, last = float(time[node - 1]), float(time[node])
        low, high, size, straying = np.zeros((4, bound.shape[1]))
        for response in responses:
            least, greatest = response.change(first, last)
            low, high = low + least, high + greatest
            size += np.maximum(np.abs(least), np.abs(greatest))
            straying += response.line_deviation_before(first, last)
        change = np.maximum(-low, high) + len(responses) * UNIT_ROUNDOFF * size
        narrowed[node] = np.fmin(bound[node], change + straying)
    return narrowed


def _off_and_straying(
    responses: Sequence[Response], time: Array, parts: int
) -> tuple[Array, Array]:
    """Bounds of Σ responses at added nodes off chords, and between these nodes, (steps, m) each."""
    inside = time[:-1, None] + np.diff(time)[:, None] * (np.arange(parts) / parts)
    nodes, shape = np.append(inside, time[-1]), (*inside.shape, -1)
    low, high, size, straying = np.zeros((4, len(nodes), len(responses[0].coefficient)))
    for response in responses:
        least, greatest = response.off_chords(nodes, parts)
        low, high = low + least, high + greatest
        size += np.maximum(np.abs(least), np.abs(greatest))
        straying += response.line_deviation(nodes)
    off = np.maximum(-low, high) + len(responses) * UNIT_ROUNDOFF * size
    return off[:-1].reshape(shape).max(1), straying[1:].reshape(shape).max(1)


def responses_of(sigma: Array, load: History | None, time: Array) -> tuple[Array, Array]:
    """Return ρ with two derivatives by σ, (3, T, S), and bounds of its rounding, (T, S)."""
    if load is not None:
        return responses_at_nodes(sigma, load, time, 2)
    rho = np.exp(sigma * time[:, None]) * time[:, None] ** np.arange(3)[:, None, None]
    return rho, UNIT_ROUNDOFF * (4 + np.abs(sigma) * time[:, None]) * np.abs(rho[0])


def moments_of(decay: float, load: History | None, time: Array) -> Array:
    """Return bounds of ρ's derivatives by σ of order 0 to 4, (5, T); g is at least `decay`."""
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


def _batches(nodes: int, points: int) -> list[slice]:
    """Batches of points of σ whose responses at the nodes fit."""
    size = max(MAX_ENTRIES // (3 * nodes), 1)
    return [slice(first, first + size) for first in range(0, points, size)]


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
        is_force: Whether the load itself is added to the imaginary part of order 2, as a force adds
            to a relative acceleration at once.
        at_nodes: ρ with two derivatives, its rounding, bounds of its derivatives, where known.
    """
    omega, fast, decay = sigma[0].imag, float(np.abs(sigma).max()), float(-sigma.real.max())
    low = float(omega.min())
    pieces = _pieces(load, time, fast)
    times, d, node = pieces.time, np.diff(pieces.time), np.searchsorted(pieces.time, time)
    slope = (pieces.last - pieces.first) / d
    chords = Chords.through(node, times)
    # how far the load is off the line between nodes, before and after each end
    off_line = np.stack([np.append(0.0, pieces.off[1]), np.append(pieces.off[0], 0.0)])
    tables = at_nodes if len(times) == len(time) else None
    bounds = tables[2] if tables else moments_of(decay, load, times)
    # for each order the largest over the grid: of A exp(σ τ)'s F = σ^order A and F″; rounding; of
    # H, σ^order ρ off chords: |H|, |H″|, |Im H/ω|, and that with the load before and after
    # the load itself strays from lines by `pieces.bend` even where it is on them at all these ends
    is_added = {order: is_force and order == 2 for order in orders}
    added = {order: off_line if is_added[order] else 0.0 * off_line for order in orders}
    inside = chords.fraction > 0
    amplitude, rounding, off = (
        {order: np.zeros((count, n)) for order in orders}
        for count, n in ((2, len(d)), (1, len(times)), (5, len(times)))
    )
    for order in orders:
        off[order][3:] = np.where(inside, 0.0, np.abs(added[order]))
    for batch in _batches(len(times), sigma.size):
        points = sigma.ravel()[batch]
        rho, error = (
            (x[..., batch] for x in tables[:2]) if tables else responses_of(points, load, times)
        )
        A = rho[:, :-1] if load is None else rho[:, :-1] + _of_line(points, pieces.first, slope)
        for order in orders:
            F, _, F2 = with_power(points, A, order)
            _raise_to(amplitude[order], F, F2)
            _raise_to(rounding[order], _error_with_power(points, rho[0], error, order))
        off_chords = chords.deviations(rho) if inside.any() else rho[:0]
        for order in orders if inside.any() else ():
            H, _, H2 = with_power(points, off_chords, order)
            read, (before, after) = H.imag / points.imag, added[order][..., None]
            _raise_to(off[order], H, H2, read, read + before, read + after)
    # between the points of the grid F strays from what is bilinear by `between` |F″|
    h, between = float(np.diff(np.sort(omega)).max(initial=0.0)), _between_points(sigma)
    growth = np.exp(max(-decay, 0.0) * d)
    found = dict[int, Array]()
    for order in orders:
        fourth = fourth_derivative(order, fast, bounds)
        of_line = abs(prod(range(order - 4, order))) * np.abs(pieces.first) * low ** (order - 5)
        of_line += abs(prod(range(order - 5, order - 1))) * np.abs(slope) * low ** (order - 6)
        first, second = amplitude[order]
        size = first + between * (second + between * (fourth[:-1] + of_line))
        bent = growth * np.minimum((fast * d) ** 2 / 8, 2.0) * size
        bent += growth * fast**order * 2 * d * pieces.bend
        size_off, second, read, *with_load = off[order]
        missed = inside * between * (second + between * chords.with_ends(fourth))
        missed_read = (missed + inside * h * read) / low
        (error,) = rounding[order]
        error = np.maximum(error, chords.with_ends(error) - error)
        bent += 4 * np.maximum(error[:-1], error[1:])
        bend_of_load = pieces.bend if is_added[order] else 0.0 * pieces.bend
        total = np.stack([bent, bent / low + bend_of_load])
        before, after = (x + missed_read for x in with_load)
        total[0] += np.maximum((size_off + missed)[:-1], (size_off + missed)[1:])
        total[1] += np.maximum(after[:-1], before[1:])
        found[order] = np.zeros((2, len(time)))
        found[order][:, 1:] = np.maximum.reduceat(total, node[:-1], axis=1)
    return found


def load_deviation(load: History, time: Array) -> Array:
    """Return how far a load strays from lines in the step to each node at most, shape (T,)."""
    g = replace(load, frequency=0.0)  # without the sine it strays most at a sample
    pieces, bound = _pieces(g, time, 0.0), np.zeros(len(time))
    off = np.abs(pieces.off).max(0)
    bound[1:] = np.maximum.reduceat(off, np.searchsorted(pieces.time, time[:-1]))
    if load.frequency:  # h²/8 |f″| of a line times the sine, in steps of length h
        values, phase = g.values(time), load.frequency * np.diff(time)
        size, rise = np.maximum(np.abs(values[1:]), np.abs(values[:-1])), np.abs(np.diff(values))
        bound[1:] += np.minimum(phase**2 / 8 * size + phase / 4 * rise, 2 * size)
    return np.where(bound > 1e-12 * load.extremes[0], bound, 0.0)


def load_excess(load: History, time: Array) -> Array:
    """Bound of how far a load lies beyond both its values at the ends of the step to each node.

    It is zero where the load jumps from the one to the other: shape (T,), 0 at the first node.
    """
    pieces = _pieces(load, time, 0.0)
    first = np.searchsorted(pieces.time, time[:-1])
    high = np.maximum(pieces.first, pieces.last) + pieces.bend
    low = np.minimum(pieces.first, pieces.last) - pieces.bend
    value = load.values(time)
    above = np.maximum.reduceat(high, first) - np.maximum(value[1:], value[:-1])
    below = np.minimum(value[1:], value[:-1]) - np.minimum.reduceat(low, first)
    return np.append(0.0, np.maximum(np.maximum(above, below), 0.0))


def _of_line(sigma: Array, first: Array, slope: Array) -> Array:
    """a/σ + b/σ² of P pieces, with its first two derivatives by σ, (3, P, S)."""
    inverse = [1 / sigma, 1 / sigma**2, 1 / sigma**3, 1 / sigma**4]
    a, b = (1, -1, 2), (1, -2, 6)
    terms = [[a[k] * inverse[k], b[k] * inverse[k + 1]] for k in range(3)]
    return np.asarray(np.stack([first, slope], 1) @ np.array(terms))


def _error_with_power(sigma: Array, rho: Array, error: Array, order: int) -> Array:
    """Bound of rounding of σ^order ρ, (T, S), from that of ρ."""
    relative = 2 * (order + 9) * UNIT_ROUNDOFF
    return np.asarray(np.abs(sigma) ** order * (error + relative * np.abs(rho)))


def _raise_to(largest: Array, *values: Array) -> None:
    """Raise rows (T,) to the largest magnitude of each of the values (T, S)."""
    for row, value in enumerate(values):
        largest[row] = np.maximum(largest[row], np.abs(value).max(-1))


def with_power(sigma: Array, rho: Array, order: int) -> Array:
    """σ^order ρ and its first two derivatives by σ, shape (3, T, S), from those of ρ."""
    if not order:
        return rho
    power, first = sigma**order, order * sigma ** max(order - 1, 0)
    second = order * (order - 1) * rho[0] + 2 * first * rho[1] + power * rho[2]
    return np.stack([power * rho[0], first * rho[0] + power * rho[1], second])


def _pieces(load: History | None, time: Array, fastest: float) -> Pieces:
    """Pieces between nodes and a load's samples; shorter ones where it is multiplied by a sine."""
    if load is None:
        zeros = np.zeros((2, len(time) - 1))
        return Pieces(time, zeros[0], zeros[0], zeros[0], off=zeros)
    samples = load.start + np.arange(len(load.samples)) * load.step
    samples = samples[(samples > time[0]) & (samples < time[-1])]
    later = np.searchsorted(time, samples)
    distance = np.minimum(samples - time[later - 1], time[later] - samples)
    times = np.union1d(time, samples[distance > 1e-9 * load.step])
    if load.frequency:
        phase = np.diff(times) * max(fastest, load.frequency)
        parts = np.clip(np.ceil(phase / PHASE), 1, MAX_PARTS).astype(int)
        times = np.interp(np.arange(parts.sum() + 1), np.append(0, np.cumsum(parts)), times)
    d, after, before = np.diff(times), load.envelope(times)[:-1], load.envelope(times, -1.0)[1:]
    # |f″| ≤ Ω² |g| + 2 Ω |g′|
    largest, slope = np.maximum(np.abs(after), np.abs(before)), np.abs(before - after) / d
    bend = d**2 / 8 * load.frequency * (load.frequency * largest + 2 * slope)
    sine, line = load.wave(times), np.interp(times, time, load.values(time))
    first, last = after * sine[:-1], before * sine[1:]
    return Pieces(times, first, last, bend, np.stack([first - line[:-1], last - line[1:]]))
