"""Duhamel integrals of modes for many eigenvalues near each other: Taylor series in λ.

R(t; λ) = ∫₀ᵗ exp(λ (t − s)) a(s) ds is ρ of `duhamel`. Here each pair of a node t and an eigenvalue
λ costs a few operations, whatever the length of the load a.

Within a window of the length L that begins at t_w, with x = (λ − midpoint) L and the values F_j of
the integral from t_w on at N points x_j of the circle |x| = r,

    F(x) = Σ_k c_k x^k,    |c_k| ≤ ∫ |a(t − τ)| exp(Re midpoint τ) (τ/L)^k/k! dτ,
    m_i = Σ_j F_j x_j^-i / N = c_i + c_{i+N} r^N + c_{i+2N} r^2N + …,    i < N.

Σ m_i x^i stands for F. The terms k ≥ N are left out, and those of m_i are added, which are not
larger together for |x| ≤ r. The q-th derivative by x, q < N, thus misses that of F by at most

    2 Σ_{k ≥ N} r^(k − q)/(k − q)! ∫ |a| exp(Re midpoint τ) dτ ≤ ε_q ∫ |a| exp(g τ) dτ,
    ε_q = 2 r^n/n! / (1 − r/(n + 1)),    n = N − q,

with any g ≥ Re midpoint, such as an upper bound of Re λ over the box. Errors δF_j of the values
change m_i by δm_i, with Σ_i |δm_i|² r^2i = Σ_j |δF_j|²/N (Parseval). By Cauchy and Schwarz

    |Σ_i i (i − 1) … (i − q + 1) δm_i x^(i − q)| ≤ r^-q √(Σ_i (i … (i − q + 1))²) √(Σ_j |δF_j|²/N).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import ceil, comb, exp, lgamma, log

import numpy as np
from numpy.typing import NDArray

from alphacut.base.arrays import Ints
from alphacut.base.kernels import compiled
from alphacut.frame.calculus.polynomials import Array
from alphacut.frame.calculus.taylor_model import TaylorModel
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.records.history import History
from alphacut.frame.response.duhamel import responses_at_nodes

Complex = NDArray[np.complex128]
REACH = 6.0
"""Largest difference of phases of the eigenvalues in a window, in rad.

A larger one would need longer series, whose rounding grows like exp(REACH); a smaller one would
need more windows.
"""


class LoadTable:
    """R(t_j; λ) of one mode at T time nodes t_j, for eigenvalues λ near a given one.

    Time is divided into windows so short that phases differ little between eigenvalues within one.
    The part of R that arises in the window of t_j is Σ_i moment[j, i] x^i with x = (λ − midpoint) /
    scale. What the earlier windows leave behind is multiplied by exp(λ (t_j − their end)).

    Args:
        history: The load a.
        time: Equally spaced nodes from 0, shape (T,), in s.
        midpoint: The eigenvalue about which the series are expanded, in 1/s.
        deviation: Largest |λ − midpoint|, in 1/s.

    Attributes:
        truncation: Relative truncation errors of R and of its first three derivatives by λ, shape
            (4,): in a window of the length L the series miss the q-th derivative by at most
            truncation[q] L^q ∫ |a(s)| exp(g (t − s)) ds, the integral being over the window, for
            each g ≥ Re midpoint.

    Raises:
        UnprovedError: Phases differ by more than `REACH` within a step.
    """

    def __init__(self, history: History, time: Array, midpoint: complex, deviation: float) -> None:
        h = time[1] - time[0]
        steps = len(time) - 1
        length = min(steps, int(REACH / max(deviation, 1e-12) / h))
        if length < 1:
            difference = deviation * h
            what = f"phases change by {difference:.3g} rad over the box within a step of {h:.4g} s"
            raise UnprovedError(what, "take a smaller step, or narrower inputs")
        # radius in x of a circle around all eigenvalues; a smaller one would amplify rounding
        radius = max(deviation * length * h, 1.0)
        # tuned: the terms |z|ⁿ/n! fall from n = e |z| on, and what is left out is `truncation`
        order = ceil(2.72 * radius + 18)
        self.midpoint = midpoint
        self.scale = 1 / (length * h)
        self.time = time
        self.ends = np.arange(length, steps, length)
        self.truncation = np.array([2 * _exponential_tail(radius, order - q) for q in range(4)])
        # Taylor coefficients, (T, order), by Cauchy's integral over that circle (a Fourier series)
        rate = midpoint + radius * self.scale * np.exp(2j * np.pi / order * np.arange(order))
        (values,) = responses_at_nodes(rate, history, time, window=length)
        self.moment = np.fft.fft(values, axis=1) / order / radius ** np.arange(order)

    def errors(self, waves: Array) -> Array:
        """Bound what the series miss of R and its first three derivatives by λ, shape (4, T).

        Args:
            waves: Bounds of |∂^r R/∂λ^r|, ∫ τ^r exp(g τ) |a(t − τ)| dτ with an upper bound g of Re
                λ over the eigenvalues and of Re midpoint, in row r, shape (4, T).
        """
        # What the series of a window leave out is multiplied by exp(λ τ) later. The time since the
        # end of the window is less than t − s for each a(s) in it, so that all windows together
        # leave out at most Σ_q binomial(p, q) truncation[q] L^q ∫ (t − s)^(p − q) |a(s)| exp(g (t −
        # s)) ds.
        length = 1 / self.scale
        errors: Array = np.zeros((4, len(self.time)))
        for p in range(4):
            for q in range(p + 1):
                truncated = self.truncation[q] * length**q * waves[p - q]
                errors[p] += comb(p, q) * truncated
        return errors

    def response(self, rate: Array, node: Ints) -> Array:
        """Return R = ∫ exp(λ (t − s)) a(s) ds, dR/dλ, d²R/dλ² for N eigenvalues and nodes.

        Args:
            rate: Eigenvalues λ, shape (N,), in 1/s. They must lie within `deviation` of `midpoint`,
                as given at the construction; this is not checked, and the table's error is not
                known beyond.
            node: Index of the time node t of each one, shape (N,). Equal eigenvalues in a row whose
                nodes rise are the fastest.

        Returns:
            Complex, shape (3, N): R, then its derivatives.
        """
        out: Array = np.empty((3, len(rate)), complex)
        _responses(
            np.ascontiguousarray(rate),
            node,
            self.midpoint,
            self.scale,
            self.moment,
            self.ends,
            self.time,
            out,
        )
        return out


@dataclass(frozen=True, eq=False)
class LoadTables:
    """Tables of one load for all n modes, which are made at first use.

    Args:
        history: The load a.
        time: Time nodes, shape (T,), in s.
        rate: Polynomials of the eigenvalues λ_k over the unit box of the inputs, shape (n,).
        share: Polynomials of what one unit of R_k adds to the m outputs, shape (n, m).
    """

    history: History
    time: Array
    rate: TaylorModel
    share: TaylorModel

    @cached_property
    def tables(self) -> list[LoadTable]:
        """A table for each mode, over all values that its eigenvalue takes in the box."""
        tables = []
        for midpoint, deviation in zip(self.rate.value, self.rate.deviation(), strict=True):
            table = LoadTable(self.history, self.time, complex(midpoint), float(deviation))
            tables.append(table)
        return tables

    def errors(self, waves: Array) -> Array:
        """Bound what the tables miss of R and its first three derivatives by λ, shape (4, T, n).

        Args:
            waves: Bounds of |∂^r R/∂λ^r| at T nodes for n modes, r = 0 … 3, shape (4, T, n).
        """
        of_modes = [table.errors(waves[:, :, k]) for k, table in enumerate(self.tables)]
        return np.stack(of_modes, axis=-1)

    def at_nodes(self, rate: Array) -> Array:
        """Return R at all T nodes for S sets of eigenvalues (S, n): shape (S, T, n).

        It is computed without the tables, and its rounding is not bounded by `errors`.
        """
        (driven,) = responses_at_nodes(rate.ravel(), self.history, self.time, 0)
        return np.moveaxis(driven.reshape(len(self.time), *rate.shape), 0, 1)

    def response(self, rate: Array, node: Ints) -> Array:
        """Return R = ∫ exp(λ (t − s)) a(s) ds, dR/dλ and d²R/dλ² of n modes at N points and nodes.

        Args:
            rate: Eigenvalues λ of the n modes at each point, shape (N, n), in 1/s, within the
                ranges that the tables are made for; this is not checked.
            node: Index of the time node t of each point, shape (N,).

        Returns:
            Complex, shape (3, N, n): R, then its derivatives.

        Raises:
            UnprovedError: At the first call: the eigenvalues differ too much, as phases within a
                step.
            ValueError: `rate` is not of n modes.
        """
        pairs = zip(self.tables, rate.T, strict=True)
        return np.stack([table.response(x, node) for table, x in pairs], -1)


class Direct(LoadTables):
    """The direct feedthrough of a load to outputs, share · a(t), in the form of modal tables.

    R of the first mode is a(t), and R of all others is zero.
    """

    def errors(self, waves: Array) -> Array:
        """Return zeros, shape (4, T, n): a(t) has no error."""
        return np.zeros_like(waves)

    def at_nodes(self, rate: Array) -> Array:
        """Return these R at all T nodes for S sets of eigenvalues: shape (S, T, n)."""
        R: Array = np.zeros((len(rate), len(self.time), rate.shape[1]))
        R[:, :, 0] = self.history.values(self.time)
        return R

    def response(self, rate: Array, node: Ints) -> Array:
        """Return these R at given nodes and their derivatives by λ, zeros: shape (3, N, n)."""
        R: Array = np.zeros((3, *rate.shape), complex)
        R[0, :, 0] = self.history.values(self.time[node])
        return R


def _exponential_tail(radius: float, order: int) -> float:
    """Return an upper bound of Σ_{k ≥ order} radius^k/k! for order + 1 > radius ≥ 1.

    The sum is at most its first term times the geometric series of radius/(order + 1).
    """
    first = exp(order * log(radius) - lgamma(order + 1))
    return (1 + 1e-9) * first / (1 - radius / (order + 1))


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
    """Write R, dR/dλ and d²R/dλ² of N points, an eigenvalue and a node each.

    R at the end of earlier windows is carried from window to window, and from a point to the next
    one if that has the same λ and a node that is not earlier.

    Args:
        rate: Eigenvalues, shape (N,).
        node: Nodes, shape (N,).
        middle: As `LoadTable.midpoint`.
        scale: As in `LoadTable`, as are the next three.
        moment: Taylor coefficients, shape (T, order).
        ends: Last nodes of all windows but the last one.
        time: Time nodes, shape (T,).
        out: Receives the results, shape (3, N).
    """
    R = 0j
    slope = 0j
    curve = 0j
    start = 0
    window = 0
    for p in range(len(rate)):
        # another eigenvalue, or an earlier node: nothing of the last point can be used
        if p == 0 or rate[p] != rate[p - 1] or node[p] < node[p - 1]:
            R = 0j
            slope = 0j
            curve = 0j
            start = 0
            window = 0
        x = (rate[p] - middle) / scale
        while True:
            is_last = window == len(ends) or ends[window] >= node[p]
            end = node[p] if is_last else ends[window]
            tau = time[end] - time[start]
            # Horner's scheme for the value f, the derivative g and half the second one h
            f = 0j
            g = 0j
            h = 0j
            for i in range(moment.shape[1] - 1, -1, -1):
                h = h * x + g
                g = g * x + f
                f = f * x + moment[end, i]
            # What earlier windows left goes on freely: exp(λ τ) R, and its derivatives by λ. The
            # series is one in x = (λ − middle)/scale, so that each derivative divides it by scale.
            propagator = np.exp(rate[p] * tau)
            f += propagator * R
            g = g / scale + propagator * (slope + tau * R)
            h = 2 * h / scale**2 + propagator * (curve + 2 * tau * slope + tau * tau * R)
            if is_last:
                out[0, p] = f
                out[1, p] = g
                out[2, p] = h
                break
            R = f
            slope = g
            curve = h
            start = end
            window = window + 1
