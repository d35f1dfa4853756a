"""Interpolation errors of responses between time nodes: their distance from chords, bounded.

The chord of a step is the straight line between the values at its two nodes. In a segment of time
of length d, in which the load is a + b τ, the response of an oscillator is

    ρ = A exp(σ τ) − a/σ − b/σ²,   A = ρ + a/σ + b/σ² at its beginning.

Only A exp(σ τ) is curved; it differs from its chord by at most min(|σ|² d²/8, 2) |A|. A load that
differs from a line by at most r within the segment adds at most 2 d r. The distances of the ends of
the segments from the chord of the whole step are computed from the responses there.

These bounds add modes by magnitude.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from math import comb, perm, prod
from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.frame.records.history import History
from alphacut.frame.response.duhamel import absolute_moments, responses_at_nodes


@dataclass(frozen=True, eq=False)
class Grid:
    """Points of a box of frequencies ω, shape (W,), in rad/s, and quotients q = g/ω, shape (Q,)."""

    omega: Array  # rising
    quotient: Array  # rising

    @property
    def sigma(self) -> Array:
        """σ = −g + iω at all points, shape (Q, W)."""
        return np.asarray((-self.quotient[:, None] + 1j) * self.omega)

    @property
    def decay(self) -> float:
        """The smallest decay g."""
        return float((self.quotient[:, None] * self.omega).min())

    @property
    def distances(self) -> tuple[float, float]:
        """The largest distances of neighbouring points, h along ω and k along q; 0 for one."""
        h = np.diff(self.omega).max(initial=0.0)
        return float(h), float(np.diff(self.quotient).max(initial=0.0))

    @property
    def between(self) -> float:
        """Factor b: a function F of σ differs from interpolation by at most b sup|F″|.

        The interpolation is bilinear in q and ω between the points. Along an axis of length h it
        errs by h²/8 times the second derivative along it. Since σ = (−q + i) ω is linear in ω and
        in q, this is |F″| |dσ/dω|² = |F″| (1 + q²), and |F″| |dσ/dq|² = |F″| ω²; the error along
        both axes is at most the sum.
        """
        h, k = self.distances
        return float(((1 + self.quotient[-1] ** 2) * h**2 + (self.omega[-1] * k) ** 2) / 8)


class Pieces(NamedTuple):
    """P segments of time in which a load is, but for a bound, a straight line.

    Args:
        time: Ends of the segments, shape (P + 1,), in s; all time nodes are among them.
        first: The load at the beginning of each segment, shape (P,).
        last: The load at the end of each segment, shape (P,).
        bend: Bound of the distance of the load from that line, shape (P,).
        off: The load at the beginning and at the end of each segment, less the chord of the load in
            the step between two time nodes, shape (2, P).
    """

    time: Array
    first: Array
    last: Array
    bend: Array
    off: Array


class Chords(NamedTuple):
    """Chords between neighbouring time nodes, at N times among which the nodes are.

    Args:
        before: Index of the node at or before each time, among the N times, shape (N,).
        after: Index of the next node, shape (N,).
        fraction: Where each time lies between these two nodes, 0 at a node, shape (N,).
    """

    before: Ints
    after: Ints
    fraction: Array

    @classmethod
    def through(cls, node: Ints, times: Array) -> Chords:
        """Return the chords, straight lines between neighbouring time nodes, at N times.

        Args:
            node: Indices of the nodes among the times, rising; the first is 0 and the last N − 1.
            times: Rising, shape (N,), in s.

        Returns:
            For each time the index `before` of the node at or before it, `after` of the next node
            (of the last one itself at the last node), and `fraction`, its place between both, 0 at
            a node, shape (N,) each.
        """
        count = np.diff(node)
        before = np.repeat(node, np.append(count, 1))
        after = np.append(np.repeat(node[1:], count), node[-1])
        length = np.maximum(times[after] - times[before], 1e-300)
        return cls(before, after, (times - times[before]) / length)

    def deviations(self, values: Array) -> Array:
        """Return values at the N times, shape (…, N, S), less their chords."""
        x = self.fraction[:, None]
        chords = (1 - x) * values[..., self.before, :] + x * values[..., self.after, :]
        return np.asarray(values - chords)

    def with_ends(self, bound: Array) -> Array:
        """Return bounds for values less chords from bounds (N,) for the values alone."""
        return np.asarray(bound + np.maximum(bound[self.before], bound[self.after]))


def responses_of(sigma: Array, load: History | None, time: Array) -> Array:
    """Return the Duhamel integral ρ = ∫₀ᵗ exp(σ τ) f(t − τ) dτ with two derivatives by σ.

    Args:
        sigma: Exponents σ = −decay + i frequency, shape (S,), in 1/s.
        load: The load f; None for a unit impulse at t = 0, ρ = exp(σ t).
        time: Time nodes t ≥ 0, rising, shape (T,), in s.

    Returns:
        ρ, dρ/dσ and d²ρ/dσ², shape (3, T, S).

    Raises:
        UnprovedError: An exponent turns too far within a sample interval of the load, or grows too
            much.
    """
    if load is not None:
        return responses_at_nodes(sigma, load, time, 2)
    # ∂ⁿ exp(σ t)/∂σⁿ = tⁿ exp(σ t)
    return np.exp(sigma * time[:, None]) * time[:, None] ** np.arange(3)[:, None, None]


def moments_of(decay: float, load: History | None, time: Array) -> Array:
    """Return bounds of |∂ⁿρ/∂σⁿ|, n = 0 … 4, for all oscillators of a least decay, shape (5, T).

    ρ = ∫₀ᵗ exp(σ τ) f(t − τ) dτ is the Duhamel integral, σ = −g + i frequency. The bounds are ∫₀ᵗ
    τⁿ exp(−decay τ) |f(t − τ)| dτ, and tⁿ exp(−decay t) without a load.

    Args:
        decay: Smallest decay g, in 1/s; may be negative.
        load: The load f; None for a unit impulse at t = 0, ρ = exp(σ t).
        time: Time nodes t ≥ 0, rising, shape (T,), in s.
    """
    if load is not None:
        return absolute_moments(decay, load, time)
    return np.stack([time**n * np.exp(-decay * time) for n in range(5)])


def fourth_derivative(order: int, fast: float, moments: Array) -> Array:
    """Return bounds of the fourth derivative of σ^order ρ by σ, shape (T,), by Leibniz' rule.

    Args:
        order: Power of σ, 0 or more.
        fast: Bound of |σ|, in 1/s.
        moments: Bounds of the derivatives of ρ by σ of orders 0 to 4 at T times, shape (5, T).
    """
    # Σ_j C(4, j) (σ^order)^(j) ρ^(4 − j), where the j-th derivative of the power is
    # order!/(order − j)! σ^(order − j), and zero for j > order.
    total = 0.0
    for j in range(order + 1):
        of_power = comb(4, j) * perm(order, j) * fast ** (order - j)
        total = total + of_power * moments[4 - j]
    return np.asarray(total)


def _fourth_off_chords(
    order: int, decay: float, fast: float, load: History | None, moments: Array, h: Array
) -> Array:
    """Return bounds of |∂⁴/∂σ⁴| of G = σ^order ρ less its chord in each step, shape (steps,).

    It is at most h²/8 times that of the second derivative of G by time, σ² G + σ^order (σ f +
    f′), in a step of length h. The terms with the load f are polynomials of degree below 4 in
    σ, and so is what jumps of f add.

    Args:
        order: Power of σ, from 0 to 2.
        decay: Smallest decay −Re σ, in 1/s; may be negative.
        fast: Bound of |σ|, in 1/s.
        load: The load f; None for ρ = exp(σ t).
        moments: `moments_of` ρ at the beginnings of the steps, shape (5, steps).
        h: Lengths of the steps, shape (steps,), in s.
    """
    force = load.extremes[0] if load else 0.0
    # A time h later each τ of the moments ∫ τⁿ |f| has become τ + h, of which the binomial theorem
    # gives the powers, and the force in the step has added at most max |f| ∫₀ʰ τⁿ dτ.
    within = []
    for n in range(5):
        carried = sum(comb(n, j) * h ** (n - j) * moments[j] for j in range(n + 1))
        within.append(carried + force * h ** (n + 1) / (n + 1))
    growth = np.exp(max(-decay, 0.0) * h)
    return np.asarray(h**2 / 8 * fourth_derivative(order + 2, fast, growth * np.array(within)))


def _batches(nodes: int, points: int) -> list[slice]:
    """Return slices of points of σ whose responses at all nodes fit in a million numbers."""
    # A complex number takes 16 bytes, and a response has two derivatives: 16 MB, which is tuned to
    # limit the memory.
    max_entries = 1_000_000
    size = max(max_entries // (3 * nodes), 1)
    return [slice(first, first + size) for first in range(0, points, size)]


def line_deviations(
    grid: Grid,
    load: History | None,
    time: Array,
    orders: Collection[int],
    *,
    at_nodes: tuple[Array, Array] | None = None,
) -> dict[int, Array]:
    """Return bounds of the distance of σ^order ρ, and of its imaginary part over ω, from chords.

    Args:
        grid: Covers the oscillators.
        load: The load; None for ρ = exp(σ t).
        time: Time nodes, shape (T,), in s.
        orders: Powers of σ.
        at_nodes: ρ with two derivatives, and bounds of its derivatives, where they are known: (3,
            T, S) and (5, T).

    Returns:
        For each order bounds in the step that ends at each node, shape (2, T): of the modulus, then
        of the imaginary part over ω.
    """
    sigma = grid.sigma.ravel()
    low = float(grid.omega[0])
    fast = float(np.abs(sigma).max())
    decay = grid.decay
    pieces = _pieces(load, time, fast)
    times = pieces.time
    d = np.diff(times)
    node = np.searchsorted(times, time)
    slope = (pieces.last - pieces.first) / d
    chords = Chords.through(node, times)
    is_inside = chords.fraction > 0
    if len(times) != len(time):
        at_nodes = None  # other times are needed as well
    if at_nodes is None:
        bounds = moments_of(decay, load, times)
    else:
        bounds = at_nodes[1]

    # Largest magnitudes over the grid: |F| and |F″| of F = σ^order A at the beginnings of segments,
    # and of H, which is σ^order ρ less the chord of the step: |H|, |H″| and |Im H/ω|.
    amplitudes = {order: np.zeros((2, len(d))) for order in orders}
    off = {order: np.zeros((3, len(times))) for order in orders}
    for batch in _batches(len(times), sigma.size):
        points = sigma[batch]
        if at_nodes is None:
            rho = responses_of(points, load, times)
        else:
            rho = at_nodes[0][..., batch]
        A = rho[:, :-1]
        if load is not None:
            A = A + _of_line(points, pieces.first, slope)
        for order in orders:
            F, _, F2 = with_power(points, A, order)
            _raise_to(amplitudes[order], F, F2)
        if not is_inside.any():
            continue
        off_chords = chords.deviations(rho)
        for order in orders:
            H, _, H2 = with_power(points, off_chords, order)
            _raise_to(off[order], H, H2, H.imag / points.imag)

    # between the points of the grid F differs from bilinear interpolation by `between` |F″|
    h_omega, _ = grid.distances
    between = grid.between
    growth = np.exp(max(-decay, 0.0) * d)
    found = dict[int, Array]()
    for order in orders:
        # fourth derivatives by σ of σ^order ρ and of σ^order (a/σ + b/σ²)
        fourth = fourth_derivative(order, fast, bounds)
        of_line = abs(prod(range(order - 4, order))) * np.abs(pieces.first) * low ** (order - 5)
        of_line += abs(prod(range(order - 5, order - 1))) * np.abs(slope) * low ** (order - 6)
        amplitude, second = amplitudes[order]
        amplitude = amplitude + between * (second + between * (fourth[:-1] + of_line))
        # within a segment: A exp(σ τ), and the load's distance from a line
        curved = growth * np.minimum((fast * d) ** 2 / 8, 2.0) * amplitude
        curved += growth * fast**order * 2 * d * pieces.bend
        # at the ends of segments: H, and its imaginary part
        modulus, second, imaginary = off[order]
        of_steps = _fourth_off_chords(order, decay, fast, load, bounds[:, node[:-1]], np.diff(time))
        of_chords = np.append(np.repeat(of_steps, np.diff(node)), 0.0)
        fourth_off = np.minimum(chords.with_ends(fourth), of_chords)
        missed = is_inside * between * (second + between * fourth_off)
        imaginary_at_ends = imaginary + (missed + is_inside * h_omega * imaginary) / low
        at_ends = modulus + missed
        of_modulus = curved + np.maximum(at_ends[:-1], at_ends[1:])
        of_imaginary = curved / low + np.maximum(imaginary_at_ends[:-1], imaginary_at_ends[1:])
        # the largest bound of the segments of each step
        total = np.stack([of_modulus, of_imaginary])
        found[order] = np.zeros((2, len(time)))
        found[order][:, 1:] = np.maximum.reduceat(total, node[:-1], axis=1)
    return found


def load_deviation(load: History, time: Array) -> Array:
    """Return bounds of the distance of a load from its chord in the step to each node, shape (T,).

    The chord is the straight line between the values at both nodes of the step. The first entry is
    0, and bounds up to 1e-12 of the largest load are rounding and become 0.

    Args:
        load: The load, linear between its samples and perhaps multiplied by a sine.
        time: Time nodes, rising, shape (T,), in s.
    """
    # without its sine, the load is farthest from a chord at one of its samples
    g = replace(load, frequency=0.0)
    pieces = _pieces(g, time, 0.0)
    off = np.abs(pieces.off).max(0)
    bound = np.zeros(len(time))
    bound[1:] = np.maximum.reduceat(off, np.searchsorted(pieces.time, time[:-1]))
    if load.frequency:
        # of a line times the sine: h²/8 max|f″| in a step of length h
        values = g.values(time)
        phase = load.frequency * np.diff(time)
        size = np.maximum(np.abs(values[1:]), np.abs(values[:-1]))
        rise = np.abs(np.diff(values))
        bound[1:] += np.minimum(phase**2 / 8 * size + phase / 4 * rise, 2 * size)
    return np.where(bound > 1e-12 * load.extremes[0], bound, 0.0)


def load_excess(load: History, time: Array) -> Array:
    """Return bounds of how far a load exceeds both its values at the ends of each step, shape (T,).

    Row j belongs to the step that ends at node j, and row 0 is 0. Excess is above the larger or
    below the smaller of both values; a jump from one of these values to the other exceeds neither.

    Args:
        load: The load, linear between its samples and perhaps multiplied by a sine.
        time: Time nodes, rising, shape (T,), in s, T ≥ 2.
    """
    pieces = _pieces(load, time, 0.0)
    first = np.searchsorted(pieces.time, time[:-1])
    high = np.maximum(pieces.first, pieces.last) + pieces.bend
    low = np.minimum(pieces.first, pieces.last) - pieces.bend
    value = load.values(time)
    # the largest and the least value in each step, over all its segments
    above = np.maximum.reduceat(high, first) - np.maximum(value[1:], value[:-1])
    below = np.minimum(value[1:], value[:-1]) - np.minimum.reduceat(low, first)
    return np.append(0.0, np.maximum(np.maximum(above, below), 0.0))


def _of_line(sigma: Array, first: Array, slope: Array) -> Array:
    """Return a/σ + b/σ² with its first two derivatives by σ, shape (3, P, S).

    Under a load a + b τ, −(a/σ + b/σ²) is the part of an oscillator's response that follows the
    load.

    Args:
        sigma: Exponents, shape (S,), none of them 0.
        first: a of P segments of time, shape (P,).
        slope: b of P segments, shape (P,).
    """
    # (1/σ^m)′ = −m/σ^(m + 1)
    by_order = [
        [1 / sigma, 1 / sigma**2],
        [-1 * (1 / sigma**2), -2 * (1 / sigma**3)],
        [2 * (1 / sigma**3), 6 * (1 / sigma**4)],
    ]
    return np.asarray(np.stack([first, slope], 1) @ np.array(by_order))


def _raise_to(largest: Array, *values: Array) -> None:
    """Raise rows of `largest`, in place, to the largest magnitude of each of the values over S.

    `largest` has shape (values, T), each value (T, S).
    """
    for row, value in enumerate(values):
        largest[row] = np.maximum(largest[row], np.abs(value).max(-1))


def with_power(sigma: Array, rho: Array, order: int) -> Array:
    """Return σ^order ρ and its first two derivatives by σ, shape (3, T, S).

    Args:
        sigma: Exponents, shape (S,).
        rho: ρ and its first two derivatives by σ, shape (3, T, S). Returned itself if `order` is 0.
        order: 0, 1 or 2, a derivative by time; the second derivative is wrong for higher ones.
    """
    if order == 0:
        return rho
    # The product rule, with the derivatives n σ^(n − 1) and n (n − 1) σ^(n − 2) of σ^n, of which
    # the last one is 0 for n = 1 and 2 for n = 2.
    power = sigma**order
    first = order * sigma ** max(order - 1, 0)
    second = order * (order - 1) * rho[0] + 2 * first * rho[1] + power * rho[2]
    return np.stack([power * rho[0], first * rho[0] + power * rho[1], second])


def _pieces(load: History | None, time: Array, fastest: float) -> Pieces:
    """Return the segments between time nodes and samples in which a load is nearly linear.

    Segments of a load that is multiplied by a sine are divided so that neither the sine nor an
    oscillator turns by more than .5 rad in one, but into 16 at most: a segment adds the square of
    this phase to the bounds. Nodes and samples that coincide but for rounding are one end.

    Args:
        load: The load; None gives one segment for each step, with a load of zero.
        time: Time nodes, rising, shape (T,), in s.
        fastest: Largest |σ| of the oscillators, in 1/s.

    Returns:
        For P segments: `time`, their ends (P + 1,), all nodes among them; the load at the
        beginning, `first`, and at the end, `last`, of each (P,); `bend`, a bound of its distance
        from the line between these (P,); and `off`, the load at the beginning and at the end of
        each less the chord of the load in the step between two nodes (2, P).
    """
    if load is None:
        zeros = np.zeros((2, len(time) - 1))
        return Pieces(time, zeros[0], zeros[0], zeros[0], off=zeros)
    samples = load.start + np.arange(len(load.samples)) * load.step
    samples = samples[(samples > time[0]) & (samples < time[-1])]
    # samples that lie on a node but for rounding make no segment
    later = np.searchsorted(time, samples)  # all samples lie between two nodes
    distance = np.minimum(samples - time[later - 1], time[later] - samples)
    times = np.union1d(time, samples[distance > 1e-9 * load.step])
    if load.frequency:
        phase = np.diff(times) * max(fastest, load.frequency)
        divisions = np.clip(np.ceil(phase / 0.5), 1, 16).astype(int)
        edges_before = np.append(0, np.cumsum(divisions))
        times = np.interp(np.arange(divisions.sum() + 1), edges_before, times)
    d = np.diff(times)
    # the load without its sine, at both ends of each segment: after a jump, and before one (−1)
    after = load.envelope(times)[:-1]
    before = load.envelope(times, -1.0)[1:]
    # f = g sin(Ω t + φ) with linear g differs from its chord by d²/8 max|f″|, and
    # |f″| ≤ Ω² |g| + 2 Ω |g′|
    largest = np.maximum(np.abs(after), np.abs(before))
    slope = np.abs(before - after) / d
    bend = d**2 / 8 * load.frequency * (load.frequency * largest + 2 * slope)
    sine = load.wave(times)
    first = after * sine[:-1]
    last = before * sine[1:]
    line = np.interp(times, time, load.values(time))
    return Pieces(times, first, last, bend, np.stack([first - line[:-1], last - line[1:]]))
