"""Duhamel integral of modes over a box of eigenvalues: Taylor series in λ over windows of time.

R(t; λ) = ∫ exp(λ (t − s)) a(s) ds is ρ of `duhamel`, at one node and λ a point.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from math import ceil, exp, lgamma, log

import numpy as np
from numpy.typing import NDArray

from alphacut.frame.calculus.jet import Array
from alphacut.frame.calculus.kernels import compiled
from alphacut.frame.calculus.polynomial import Polynomial
from alphacut.frame.response.duhamel import responses_at_nodes
from alphacut.frame.structures.loads import History
from alphacut.frame.structures.modes import ModalError
from alphacut.fuzzy.arrays import Rows

Complex = NDArray[np.complex128]
REACH = 6.0
"""Largest change of phase (rad) over the box within a window."""
LEAST_PHASE = 1.0
"""Least radius in rad of the circle that coefficients come from; a smaller one lifts rounding."""
MOST_STEPS = 40_000  # of a table


class LoadTable:
    """R(t_j; λ) = ∫ exp(λ (t_j − s)) a(s) ds of one mode near its λ in the middle of the box.

    Time is cut into windows so short that phases change little over the box within one. The part of
    R that arises in the window of t_j is Σ_i moment[j, i] x^i with x = (λ − middle) / scale; what
    earlier windows leave behind goes on as exp(λ (t_j − their end)). Nodes are added between nodes
    that are too far apart.

    Args:
        history: a, the load.
        time: Nodes, shape (T,), in s.
        middle: λ in the middle of the box.
        spread: What it strays by over the box at most, in 1/s.

    Attributes:
        truncation: Bound of what the series leave out of R, as a share of ∫ |a(s)| exp(Re λ (t −
            s)) ds.

    Raises:
        ModalError: Phases change by thousands over the box within one step.
    """

    def __init__(self, history: History, time: Array, middle: complex, spread: float) -> None:
        stride = max(1, ceil(spread * (time[1] - time[0]) / REACH))
        if stride > max(4, MOST_STEPS // len(time)):
            raise ModalError(
                f"modal: under a record phases change by {stride * REACH:.3g} rad over the box"
                f" within a step of {time[1] - time[0]:.4g} s; take a smaller one"
            )
        time = np.linspace(time[0], time[-1], stride * (len(time) - 1) + 1) if stride > 1 else time
        h, steps = time[1] - time[0], len(time) - 1
        length = min(steps, max(1, int(REACH / max(spread, 1e-12) / h)))
        phase = max(spread * length * h, LEAST_PHASE)
        order = ceil(2.72 * phase + 18)
        self.middle, self.scale, self.time, self.every = middle, 1 / (length * h), time, stride
        self.moment = _moments(history, middle, time, length, phase, order)
        self.ends, self.truncation = np.arange(length, steps, length), 2 * left_out(phase, order)

    def response(self, rate: Array, node: Array) -> Array:
        """Return R, dR/dλ and d²R/dλ² at one node per point, (3, N), for eigenvalues (N,)."""
        table = (self.middle, self.scale, self.moment, self.ends, self.time)
        out: Array = np.empty((3, len(rate)), complex)
        _responses(np.ascontiguousarray(rate), self.every * node, *table, out)
        return out


@dataclass(frozen=True, eq=False)
class LoadTables:
    """Tables of all modes, made when they are first read.

    Args:
        history: a, the load.
        time: Nodes, shape (T,), in s.
        rate: λ_k over the unit box, n polynomials.
        share: What one unit of R_k puts into the outputs, n m polynomials.
    """

    history: History
    time: Array
    rate: Polynomial
    share: Polynomial

    @cached_property
    def tables(self) -> list[LoadTable]:
        """One of each mode."""
        middle, slopes = self.rate.coefficients[0], self.rate.coefficients[1:]
        pairs = zip(middle.tolist(), np.abs(slopes).sum(0).tolist(), strict=True)
        return [LoadTable(self.history, self.time, *pair) for pair in pairs]

    def in_units(self, scale: Array) -> LoadTables:
        """The same for outputs divided by their scale (m,)."""
        return replace(
            self, share=self.share.divided_by(np.tile(scale, self.rate.coefficients.shape[1]))
        )

    @property
    def truncation(self) -> Array:
        """Bound of the series' rest, as a share of ∫ |a(s)| exp(Re λ (t − s)) ds, (n,)."""
        return np.array([table.truncation for table in self.tables])

    @property
    def longest(self) -> int:
        """Nodes of the longest table."""
        return max(len(table.time) for table in self.tables)

    def at_nodes(self, rate: Array) -> Array:
        """R at all nodes, shape (S, T, n), for eigenvalues (S, n)."""
        (driven,), _ = responses_at_nodes(rate.ravel(), self.history, self.time, 0)
        return np.moveaxis(driven.reshape(len(self.time), *rate.shape), 0, 1)

    def response(self, rate: Array, node: Array) -> tuple[Array, Array, Array]:
        """R, dR/dλ and d²R/dλ² at one node per point, each shape (N, n), for eigenvalues (N, n)."""
        pairs = zip(self.tables, rate.T, strict=True)
        R, slope, curve = np.stack([table.response(x, node) for table, x in pairs], -1)
        return R, slope, curve


class Direct(LoadTables):
    """What a load adds to outputs at once: share · a(t), as if R of the first mode were a(t)."""

    longest = 1

    @property
    def truncation(self) -> Array:
        """Zero, shape (n,)."""
        return 0.0 * self.factor

    @property
    def factor(self) -> Array:
        """1 for the first mode, else 0, shape (n,)."""
        return np.eye(self.rate.coefficients.shape[1])[0]

    def at_nodes(self, rate: Array) -> Array:
        """A at all nodes, shape (S, T, n)."""
        course = self.history.values(self.time)[:, None] * self.factor
        return np.broadcast_to(course, (len(rate), *course.shape))

    def response(self, rate: Array, node: Array) -> tuple[Array, Array, Array]:
        """A and its derivatives by λ, which are zero, each shape (N, n)."""
        course = self.history.values(self.time[node])[:, None] * self.factor
        return course + 0j * rate, 0.0 * rate, 0.0 * rate


def left_out(phase: float, order: int) -> float:
    """Bound of |exp(x τ) − its series of `order` terms| for |x| τ up to `phase`."""
    return exp(order * log(max(phase, 1e-300)) - lgamma(order + 1) + 2 * phase)


def _moments(
    history: History, middle: complex, time: Array, length: int, phase: float, order: int
) -> Array:
    """Taylor coefficients by λ of R over a node's window, (T, order), by Cauchy's integral."""
    # over a circle of radius `phase` in x = (λ − middle) × window length, at `order` points
    unit_circle = np.exp(2j * np.pi / order * np.arange(order))
    rate = middle + phase * unit_circle / (length * (time[1] - time[0]))
    (values,), _ = responses_at_nodes(rate, history, time, window=length)
    return np.asarray(np.fft.fft(values, axis=1) / order / phase ** np.arange(order))


@compiled
def _responses(
    rate: Complex,
    node: Rows,
    middle: complex,
    scale: float,
    moment: Complex,
    ends: Rows,
    time: Array,
    out: Complex,
) -> None:
    """Write R, dR/dλ and d²R/dλ² at N points, a λ and a node each, to `out` (3, N)."""
    # `ends` are the last nodes of all windows but the last. R at the end of earlier windows is
    # carried from window to window, and from a point to the next one of the same λ at a later node.
    R, slope, curve, start, window = 0j, 0j, 0j, 0, 0
    for p in range(len(rate)):
        if p == 0 or rate[p] != rate[p - 1] or node[p] < node[p - 1]:
            R, slope, curve, start, window = 0j, 0j, 0j, 0, 0
        x = (rate[p] - middle) / scale
        while True:
            is_last = window == len(ends) or ends[window] >= node[p]
            end = node[p] if is_last else ends[window]
            tau = time[end] - time[start]
            f, g, h = 0j, 0j, 0j  # Horner's scheme, twice differentiated
            for i in range(moment.shape[1] - 1, -1, -1):
                h = h * x + g
                g = g * x + f
                f = f * x + moment[end, i]
            propagator = np.exp(rate[p] * tau)
            f += propagator * R
            g = g / scale + propagator * (slope + tau * R)
            h = 2 * h / scale**2 + propagator * (curve + 2 * tau * slope + tau * tau * R)
            if is_last:
                out[0, p], out[1, p], out[2, p] = f, g, h
                break
            R, slope, curve, start, window = f, g, h, end, window + 1
