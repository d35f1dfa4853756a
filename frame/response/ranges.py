"""Ranges of all responses of oscillators whose frequency and damping lie between two ends.

Of modes that are known by sums alone, the responses times λ^κ are wanted, κ = 0, ½ or 1, at all
frequencies of a range. It is cut into pieces; in each, tables hold the responses with their error,
and what an integral of |a| allows bounds them besides.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from alphacut.frame.response.duhamel import absolute_moments
from alphacut.frame.response.waves import Oscillators, feedthrough, spanned
from alphacut.frame.structures.loads import History
from alphacut.fuzzy.arrays import Array

POWERS = (0.0, 0.5, 1.0)
"""Powers κ of λ."""
RATIO = 1.5
"""Greatest over least frequency of a piece."""
STEP = 0.4
"""Distance of a piece's points, as a share of the decay and of the inverse duration."""
MAX_POINTS = (240, 8)
"""Points of a piece along ω, above which the integral alone bounds it, and along g/ω."""


@dataclass(frozen=True, eq=False)
class Ranges:
    """Bounds of λ^κ e at nodes, each of shape (powers, sources, T).

    Args:
        low: Lower bounds.
        high: Upper bounds.
        line_deviation: Bounds of how far λ^κ e strays from a straight line in the step to a node.
    """

    low: Array
    high: Array
    line_deviation: Array


def response_ranges(
    omega: tuple[float, float],
    quotient: tuple[float, float],
    loads: Mapping[str, History],
    time: Array,
    sources: Sequence[str],
    orders: Sequence[int],
) -> dict[int, Ranges]:
    """Ranges of λ^κ e at nodes `time` (T,), for all oscillators with ω and g/ω in the ranges given.

    e is the response to a source, κ one of `POWERS`. Returned by `orders`, the derivatives of the
    motion that are observed.
    """
    shape = (len(POWERS), len(sources), len(time))
    found = {
        order: Ranges(np.full(shape, np.inf), np.full(shape, -np.inf), np.zeros(shape))
        for order in orders
    }
    for ends in _pieces(omega):
        piece = _Piece(ends, quotient, loads, time)
        for order, ranges in found.items():
            for s, source in enumerate(sources):
                for k, (low, high, deviation) in enumerate(piece.bounds(source, order)):
                    ranges.low[k, s] = np.minimum(ranges.low[k, s], low)
                    ranges.high[k, s] = np.maximum(ranges.high[k, s], high)
                    ranges.line_deviation[k, s] = np.maximum(ranges.line_deviation[k, s], deviation)
    return found


def _pieces(omega: tuple[float, float]) -> Iterator[tuple[float, float]]:
    """Pieces of a range of frequencies, each of the same ratio."""
    number = max(1, int(np.ceil(np.log(omega[1] / omega[0]) / np.log(RATIO))))
    ratio = (omega[1] / omega[0] * (1 + 1e-9)) ** (1 / number)
    for k in range(number):
        yield omega[0] * ratio**k, omega[0] * ratio ** (k + 1)


class _Piece:
    """Responses of oscillators of one piece."""

    def __init__(
        self,
        omega: tuple[float, float],
        quotient: tuple[float, float],
        loads: Mapping[str, History],
        time: Array,
    ) -> None:
        self.omega, self.quotient, self.loads, self.time = omega, quotient, loads, time
        decay = quotient[0] * omega[0]
        self.fade = np.exp(-decay * time)
        self.step = np.diff(time, prepend=time[0])
        self.pushed = {name: absolute_moments(decay, x, time)[0] for name, x in loads.items()}
        self.table: Oscillators | None = None
        if loads:
            reach = STEP * (decay + 2 / max(float(time[-1]), 1e-300))
            points = int(np.ceil((omega[1] - omega[0]) / reach)) + 1
            across = int(np.ceil((quotient[1] - quotient[0]) * omega[1] / reach)) + 1
            if points <= MAX_POINTS[0]:
                points, across = max(points, 2), int(np.clip(across, 2, MAX_POINTS[1]))
                grid = spanned(omega, quotient, (points, across))
                self.table = Oscillators(grid, loads, time)

    def bounds(self, source: str, order: int) -> Iterator[tuple[Array, Array, Array]]:
        """Yield, for each κ in `POWERS`, bounds of λ^κ e at nodes.

        Args:
            source: Name of a load or force, "velocity" or "start".
            order: Derivative of the motion that is read.

        Yields:
            Lower and upper bounds, and the largest distance from a straight line in the step to
            each node, (T,) each.
        """
        size, between = self._sizes(source, order)
        fast = self.omega[1] * np.sqrt(1 + self.quotient[1] ** 2)
        for power in POWERS:
            factor = fast ** (2 * power)
            low, high, deviation = -factor * size, factor * size, 2 * factor * between
            if source in self.loads and self.table is not None:
                wave = self.table.waves(source, order)
                least, most = _of_cells(wave.value, wave.error, self._squared() ** power)
                low, high = np.maximum(low, least), np.minimum(high, most)
                deviation = np.minimum(deviation, factor * wave.line_deviation)
            yield low, high, deviation

    def _squared(self) -> Array:
        """λ at the table's points, shape (Q, W)."""
        assert self.table is not None
        return np.asarray(np.abs(self.table.grid.sigma) ** 2)

    def _sizes(self, source: str, order: int) -> tuple[Array, Array]:
        """Bounds of the response |e| of any oscillator at nodes and in the step to each, (T,) each.

        Args:
            source: Name of a load or force, "velocity" or "start".
            order: Derivative of the motion that is read.
        """
        q, (slow, fast) = self.quotient[1], self.omega
        largest = (fast * np.sqrt(1 + q**2)) ** order
        if source in self.loads:
            pushed, size = self.pushed[source], self.loads[source].extremes[0]
            before = np.append(pushed[:1], pushed[:-1]) + self.step * size
            direct = np.abs(feedthrough(source, self.loads, order, self.time))
            direct_anywhere = size * bool(direct.any())
            most = np.maximum(before, pushed) * largest / slow + direct_anywhere
            return pushed * largest / slow + direct, most
        factor = largest * (1 + q) if source == "start" else largest / slow
        return factor * self.fade, factor * np.append(self.fade[:1], self.fade[:-1])


def _of_cells(value: Array, error: Array, factor: Array) -> tuple[Array, Array]:
    """Lower and upper bound of factor × value over a table, shape (T,) each.

    They are taken over strips between neighbouring ω, each over all Q.

    Args:
        value: Values at the points, shape (T, Q, W).
        error: What bilinear interpolation misses, shape (T,).
        factor: Positive factors, monotone along Q and rising along W, at the points, shape (Q, W).
    """
    low, high = value.min(1) - error[:, None], value.max(1) + error[:, None]  # (T, W)
    low, high = np.minimum(low[:, 1:], low[:, :-1]), np.maximum(high[:, 1:], high[:, :-1])
    least, most = factor.min(0)[:-1], factor.max(0)[1:]
    bottom = np.minimum(low * least, low * most)
    top = np.maximum(high * least, high * most)
    return bottom.min(1), top.max(1)
