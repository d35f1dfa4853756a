"""Duhamel integral of modes over a box of eigenvalues: Taylor series in λ over windows of time.

R(t; λ) = ∫ exp(λ (t − s)) a(s) ds is ρ of `duhamel`, at one node and λ a point.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import ceil, exp, lgamma, log

import numpy as np
from numpy.typing import NDArray

from alphacut.base.arrays import Ints
from alphacut.base.kernels import compiled
from alphacut.frame.calculus.jet import Array
from alphacut.frame.calculus.taylor_model import TaylorModel
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.records.history import History
from alphacut.frame.response.duhamel import responses_at_nodes

Complex = NDArray[np.complex128]
REACH = 6.0
"""Largest change of phase (rad) over the box within a window."""
MIN_PHASE = 1.0
"""Least radius in rad of the circle that coefficients come from; a smaller one lifts rounding."""


class LoadTable:
    """R(t_j; λ) = ∫ exp(λ (t_j − s)) a(s) ds of one mode near its λ in the middle of the box.

    Time is cut into windows so short that phases change little over the box within one. The part of
    R that arises in the window of t_j is Σ_i moment[j, i] x^i with x = (λ − middle) / scale; what
    earlier windows leave behind goes on as exp(λ (t_j − their end)).

    The load is a, and λ strays from `middle` by `spread` in 1/s at most. What the series leave out
    of R is at most `truncation` times ∫ |a(s)| exp(Re λ (t − s)) ds.

    Raises:
        UnprovedError: Phases change by more than `REACH` over the box within a step.
    """

    def __init__(self, history: History, time: Array, middle: complex, spread: float) -> None:
        h, steps = time[1] - time[0], len(time) - 1
        length = min(steps, int(REACH / max(spread, 1e-12) / h))
        if length < 1:
            what = f"phases change by {spread * h:.3g} rad over the box within a step of {h:.4g} s"
            raise UnprovedError(what, "take a smaller step, or narrower inputs")
        phase = max(spread * length * h, MIN_PHASE)
        order = ceil(2.72 * phase + 18)
        self.middle, self.scale, self.time = middle, 1 / (length * h), time
        self.ends = np.arange(length, steps, length)
        # |exp(z) − its series of n terms| ≤ |z|ⁿ/n! exp(2 |z|) for z = x τ, |z| up to `phase`
        self.truncation = 2 * exp(order * log(phase) - lgamma(order + 1) + 2 * phase)
        # Taylor coefficients, (T, order), by Cauchy's integral over a circle of radius `phase` in x
        rate = middle + phase * self.scale * np.exp(2j * np.pi / order * np.arange(order))
        (values,), _ = responses_at_nodes(rate, history, time, window=length)
        self.moment = np.fft.fft(values, axis=1) / order / phase ** np.arange(order)

    def response(self, rate: Array, node: Ints) -> Array:
        """Return R, dR/dλ and d²R/dλ² at one node per point, (3, N), for eigenvalues (N,)."""
        table = (self.middle, self.scale, self.moment, self.ends, self.time)
        out: Array = np.empty((3, len(rate)), complex)
        _responses(np.ascontiguousarray(rate), node, *table, out)
        return out


@dataclass(frozen=True, eq=False)
class LoadTables:
    """Tables of all modes, made when they are first read."""

    history: History  # a, the load
    time: Array  # nodes, (T,), in s
    rate: TaylorModel  # λ_k over the unit box, polynomials, (n,)
    share: TaylorModel  # what one unit of R_k puts into the outputs, polynomials, (n, m)

    @cached_property
    def tables(self) -> list[LoadTable]:
        """One of each mode."""
        pairs = zip(self.rate.value, self.rate.deviation(), strict=True)
        return [LoadTable(self.history, self.time, complex(x), float(y)) for x, y in pairs]

    @property
    def truncation(self) -> Array:
        """Bound of the series' rest, as a share of ∫ |a(s)| exp(Re λ (t − s)) ds, (n,)."""
        return np.array([table.truncation for table in self.tables])

    def at_nodes(self, rate: Array) -> Array:
        """R at all nodes, shape (S, T, n), for eigenvalues (S, n)."""
        (driven,), _ = responses_at_nodes(rate.ravel(), self.history, self.time, 0)
        return np.moveaxis(driven.reshape(len(self.time), *rate.shape), 0, 1)

    def response(self, rate: Array, node: Ints) -> Array:
        """R, dR/dλ and d²R/dλ² at one node per point, shape (3, N, n), for eigenvalues (N, n)."""
        pairs = zip(self.tables, rate.T, strict=True)
        return np.stack([table.response(x, node) for table, x in pairs], -1)


class Direct(LoadTables):
    """What a load adds to outputs at once: share · a(t), as if R of the first mode were a(t)."""

    @property
    def truncation(self) -> Array:
        """Zero, shape (n,)."""
        return np.zeros(self.rate.shape)

    def at_nodes(self, rate: Array) -> Array:
        """A at all nodes, shape (S, T, n)."""
        R: Array = np.zeros((len(rate), len(self.time), rate.shape[1]))
        R[:, :, 0] = self.history.values(self.time)
        return R

    def response(self, rate: Array, node: Ints) -> Array:
        """A and its derivatives by λ, which are zero, shape (3, N, n)."""
        R: Array = np.zeros((3, *rate.shape), complex)
        R[0, :, 0] = self.history.values(self.time[node])
        return R


@compiled
def _responses(
    rate: Complex,
    node: Ints,
    middle: complex,
    scale: float,
    moment: Complex,
    ends: Ints,
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
