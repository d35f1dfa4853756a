"""Response of modes to the ground, as Taylor series in λ over windows of time."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import ceil, exp, lgamma, log

import numpy as np

from alphacut.frame.calculus.jet import Array
from alphacut.frame.calculus.polynomial import Polynomial
from alphacut.frame.dynamics.record_load import load_rule, parts_of
from alphacut.frame.structures.linear import Accelerogram
from alphacut.frame.structures.modes import ModalError

REACH = 6.0
"""Largest change of phase (rad) over the box within a window."""
MOST_STEPS = 40_000  # of a table
FADED = 37.0
"""Exponent at which what is left of a window has fallen below round-off."""
Waves = tuple[Array, Array, Array]


@dataclass(frozen=True, eq=False)
class LoadTable:
    """R_k(t_j; λ) = ∫ exp(λ (t_j − s)) a(s) ds near the middle λ_k of the box.

    Time is cut into windows so short that phases change little over the box within one. The part of
    R that arises in the window of t_j is Σ_i moment[j, k, i] x^i with x = (λ − λ_k) / scale; what
    earlier windows leave behind goes on as exp(λ (t_j − their end)). Far nodes have more between.

    Args:
        middle: λ_k in the middle of the box, shape (n,).
        scale: Length that makes the coefficients of order one, in 1/s.
        moment: Coefficients, shape (T, n, order).
        starts: First node of every window, rising from 0, shape (W,).
        time: Nodes, those between included, shape (T,), in s.
        every: Steps from one of the caller's nodes to the next.
        share: What one unit of R_k puts into the outputs, n m polynomials.
        truncation: Bound of what the series leave out of R, as a share of ∫ |a(s)| exp(Re λ (t −
            s)) ds.
    """

    middle: Array
    scale: float
    moment: Array
    starts: Array
    time: Array
    every: int
    share: Polynomial
    truncation: float

    @classmethod
    def build(
        cls, ground: Accelerogram, time: Array, rate: Polynomial, share: Polynomial
    ) -> LoadTable:
        """The table for modes whose eigenvalues are `rate` over the unit box.

        Raises:
            ModalError: Phases change by thousands over the box within one step.
        """
        middle = rate.coefficients[0]
        spread = float(np.abs(rate.coefficients[1:]).sum(0).max())
        every = max(1, ceil(spread * (time[1] - time[0]) / REACH))
        if every > max(4, MOST_STEPS // len(time)):
            raise ModalError(
                f"modal: under a record phases change by {every * REACH:.3g} rad over the box"
                f" within a step of {time[1] - time[0]:.4g} s; take a smaller one"
            )
        time = np.linspace(time[0], time[-1], every * (len(time) - 1) + 1) if every > 1 else time
        length = min(len(time) - 1, max(1, int(REACH / max(spread, 1e-12) / (time[1] - time[0]))))
        starts = np.arange(0, len(time) - 1, length)
        window = length * (time[1] - time[0])
        order = max(6, ceil(2.72 * spread * window + 18))
        left = left_out(spread * window, order)
        return cls(
            middle,
            1 / window,
            _moments(ground, middle, time, starts, window, spread, order),
            starts,
            time,
            every,
            share,
            left,
        )

    def values(self, unit: Array, rate: Array) -> Array:
        """Response of the outputs at points (S, d) with eigenvalues (S, n), shape (S, T, m)."""
        share = self.share(unit).reshape(*rate.shape, -1)  # (S, n, m)
        powers, h = self._powers(rate), self.time[1] - self.time[0]
        series = np.ascontiguousarray(powers.swapaxes(0, 1))  # (n, S, order)
        out = np.zeros((len(unit), len(self.time), share.shape[-1]))
        left = np.zeros_like(rate)  # what is left of earlier windows at the start of this one
        ends = np.append(self.starts[1:], len(self.time) - 1)
        for start, end in zip(self.starts, ends, strict=True):
            rows, count = slice(start + 1, end + 1), end - start
            own = (series @ self.moment[rows].transpose(1, 2, 0)).transpose(1, 2, 0)  # (S, J, n)
            out[:, rows] = 2 * (own.real @ share.real - own.imag @ share.imag)
            if start:
                first = np.exp(rate * h) * left
                out[:, rows] += decaying(rate, first[..., None] * share, h, count)
            left = np.exp(rate * (count * h)) * left + own[:, -1]
        return out[:, :: self.every]

    def response(self, rate: Array, node: Array) -> Waves:
        """R, dR/dλ and d²R/dλ² at one node per point, each shape (N, n), for eigenvalues (N, n)."""
        from alphacut.frame.modal.window_series import window_series  # Numba takes time to import

        fade = FADED / max(float(-rate.real.max(initial=-np.inf)), 1e-300)
        where = (self.middle, self.scale, self.moment, self.starts[1:], self.time, fade)
        R, slope, curve = window_series(rate, self.every * node, *where)
        return R, slope, curve

    def _powers(self, rate: Array) -> Array:
        """Powers of the scaled deviation, shape (S, n, order)."""
        x = (rate - self.middle) / self.scale
        plain = np.ones((*x.shape, self.moment.shape[-1]), complex)
        for i in range(1, plain.shape[-1]):
            plain[..., i] = plain[..., i - 1] * x
        return plain


@dataclass(frozen=True, eq=False)
class LoadTables:
    """Tables of modes grouped by the spread of their eigenvalues.

    Args:
        share: What one unit of R_k puts into the outputs, n m polynomials.
        tables: One table per group.
        members: Indices of the modes of each group.
    """

    share: Polynomial
    tables: tuple[LoadTable, ...]
    members: tuple[Array, ...]

    @classmethod
    def build(
        cls, ground: Accelerogram, time: Array, rate: Polynomial, share: Polynomial
    ) -> LoadTables:
        """The tables for modes whose eigenvalues are `rate` over the unit box."""
        spread = np.abs(rate.coefficients[1:]).sum(0)
        octave = np.floor(np.log2(np.maximum(spread, 1e-12) / max(spread.max(), 1e-12)))
        members = tuple(np.flatnonzero(octave == o) for o in np.unique(octave))
        columns = share.coefficients.reshape(len(share.index), rate.coefficients.shape[1], -1)
        tables = tuple(
            LoadTable.build(
                ground,
                time,
                Polynomial(rate.index, rate.coefficients[:, own]),
                Polynomial(share.index, columns[:, own].reshape(len(share.index), -1)),
            )
            for own in members
        )
        return cls(share, tables, members)

    def in_units(self, scale: Array) -> LoadTables:
        """The same for outputs divided by their scale (m,)."""
        tables = tuple(replace(table, share=_divided(table.share, scale)) for table in self.tables)
        return LoadTables(_divided(self.share, scale), tables, self.members)

    @property
    def truncation(self) -> Array:
        """Bound of the series' rest, as a share of ∫ |a(s)| exp(Re λ (t − s)) ds, (n,)."""
        out = np.empty(sum(map(len, self.members)))
        for table, own in zip(self.tables, self.members, strict=True):
            out[own] = table.truncation
        return out

    @property
    def starts(self) -> Array:
        """First node of every window of the group that needs most."""
        return max((table.starts for table in self.tables), key=len)

    def values(self, unit: Array, rate: Array) -> Array:
        """As `LoadTable.values`."""
        parts = [
            table.values(unit, rate[:, own])
            for table, own in zip(self.tables, self.members, strict=True)
        ]
        return sum(parts[1:], parts[0])

    def response(self, rate: Array, node: Array) -> Waves:
        """As `LoadTable.response`."""
        R, dR, ddR = (np.empty_like(rate) for _ in range(3))
        for table, own in zip(self.tables, self.members, strict=True):
            R[:, own], dR[:, own], ddR[:, own] = table.response(rate[:, own], node)
        return R, dR, ddR


def decaying(rate: Array, share: Array, step: float, count: int) -> Array:
    """2 Re Σ_k share_k exp(λ_k j step), j = 0 … count − 1, by fewer exponentials than nodes.

    Args:
        rate: λ, shape (S, n).
        share: Shape (S, n, m).
        step: Of the nodes, in s.
        count: Number of nodes.

    Returns:
        Shape (S, count, m).
    """
    size = ceil(count**0.5)
    blocks, (points, n, m) = ceil(count / size), share.shape
    fast = np.exp(rate[:, None, :] * (np.arange(size) * step)[None, :, None])
    slow = np.exp(rate[:, None, :] * (np.arange(blocks) * size * step)[None, :, None])
    right = (fast[:, :, :, None] * share[:, None]).transpose(0, 2, 1, 3).reshape(points, n, -1)
    out = 2 * (slow.real @ right.real - slow.imag @ right.imag)
    return np.asarray(out.reshape(points, blocks * size, m)[:, :count])


def left_out(phase: float, order: int) -> float:
    """Bound of |exp(x τ) − its series of `order` terms| for |x| τ up to `phase`."""
    return exp(order * log(max(phase, 1e-300)) - lgamma(order + 1) + 2 * phase)


def _divided(share: Polynomial, scale: Array) -> Polynomial:
    columns = share.coefficients.reshape(len(share.index), -1, len(scale)) / scale
    return Polynomial(share.index, columns.reshape(share.coefficients.shape))


def _moments(
    ground: Accelerogram,
    middle: Array,
    time: Array,
    starts: Array,
    window: float,
    reach: float,
    order: int,
) -> Array:
    """Taylor coefficients of the window's own part of R_k, shape (T, n, order).

    Per step: ∫ of exp((λ + x/window) τ) a over the step as a truncated series in x, by a rule that
    takes the record as it is; from node to node the series is multiplied by that of exp((λ +
    x/window) h). A node that ends one window starts the next from nothing. `reach` bounds what
    |x|/window adds to |λ|, in 1/s.
    """
    h, steps = time[1] - time[0], len(time) - 1
    rule = load_rule(ground, h, steps, parts_of(float(np.abs(middle).max()) + reach, h))
    factorial = np.cumprod(np.concatenate([[1.0], np.arange(1, order)]))
    series = (rule.tau[:, None] / window) ** np.arange(order) / factorial  # (Q, order)
    kernel = np.exp(middle * rule.tau[:, None])  # (Q, n)
    pushed = rule.weight @ (kernel[:, :, None] * series[:, None]).reshape(len(rule.tau), -1)
    pushed = pushed.reshape(steps, len(middle), order)
    # (n, order)
    advance = np.exp(middle * h)[:, None] * (h / window) ** np.arange(order) / factorial
    # truncated product with `advance` as a matrix
    product = np.zeros((len(middle), order, order), complex)
    for i in range(order):
        product[:, i, i:] = advance[:, : order - i]
    out = np.zeros((len(time), len(middle), order), complex)
    fresh = {int(start) for start in starts}
    for j in range(1, len(time)):
        carried = 0.0 if j - 1 in fresh else (out[j - 1][:, None] @ product)[:, 0]
        out[j] = carried + pushed[j - 1]
    return out
