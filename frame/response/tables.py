"""Tables of responses of single modes: in series about an eigenvalue, and on grids of ω and g/ω.

`LoadTable` holds Duhamel integrals for many eigenvalues near each other, as Taylor series in λ:
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

with any g ≥ Re midpoint, such as an upper bound of Re λ over the box.

`Oscillators` holds responses over ranges of frequency and damping, with proved bounds. An
oscillator with decay g and frequency ω, σ = −g + iω, responds to a unit of a source by

    load       e = −Im(σ^ν ρ) / ω,   ρ(σ; t) = ∫₀ᵗ exp(σ τ) a(t − τ) dτ,
    force      e = Im(σ^ν ρ) / ω; with ν = 2 without what the force adds to accelerations at once,
    velocity   e = Im(σ^ν exp(σ t)) / ω,
    start      e = Re(σ^ν exp(σ t)) + (g/ω) Im(σ^ν exp(σ t)),

where ν is the order of the derivative by time that an output takes. Under a load of the ground
ν = 2 is the absolute acceleration. All responses are parts of one function G(σ) = σ^ν ρ, which is
analytic, so that bounds of its complex derivatives bound all real ones.

G is tabulated on a grid of ω and q = g/ω. In a cell with sides h_ω and h_q a response
differs from bilinear interpolation between the corners by at most h_ω²/8 sup|∂²e/∂ω²| +
h_q²/8 sup|∂²e/∂q²|. These follow from sup |G|, |G′| and |G″|. The last one is bounded by its
largest value at the corners and by |G⁗|, which integrals of τⁿ exp(−g τ) |a| bound.

`response_ranges` bounds λ^κ e over all frequencies between two, for modes that are known by sums
alone. The range is divided into pieces; in each a table bounds the responses, and so does an
integral of |a|.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import ceil, comb, exp, lgamma, log
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from alphacut.base.arrays import Array, Ints
from alphacut.base.kernels import compiled
from alphacut.frame.calculus.taylor_model import TaylorModel
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.records.history import History
from alphacut.frame.response.chord_deviation import (
    Grid,
    fourth_derivative,
    line_deviations,
    moments_of,
    responses_of,
    with_power,
)
from alphacut.frame.response.duhamel import require_in_range, responses_at_nodes

Numbers = NDArray[Any]
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

    def response(self, rate: Numbers, node: Ints) -> Numbers:
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
        out: Numbers = np.empty((3, len(rate)), complex)
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

    def at_nodes(self, rate: Numbers) -> Numbers:
        """Return R at all T nodes for S sets of eigenvalues (S, n): shape (S, T, n).

        It is computed without the tables, and its rounding is not bounded by `errors`.
        """
        (driven,) = responses_at_nodes(rate.ravel(), self.history, self.time, 0)
        return np.moveaxis(driven.reshape(len(self.time), *rate.shape), 0, 1)

    def response(self, rate: Numbers, node: Ints) -> Numbers:
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

    def at_nodes(self, rate: Numbers) -> Numbers:
        """Return these R at all T nodes for S sets of eigenvalues: shape (S, T, n)."""
        R: Array = np.zeros((len(rate), len(self.time), rate.shape[1]))
        R[:, :, 0] = self.history.values(self.time)
        return R

    def response(self, rate: Numbers, node: Ints) -> Numbers:
        """Return these R at given nodes and their derivatives by λ, zeros: shape (3, N, n)."""
        R: Numbers = np.zeros((3, *rate.shape), complex)
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
    rate: Numbers,
    node: Ints,
    middle: complex,
    scale: float,
    moment: Numbers,
    ends: Ints,
    time: Array,
    out: Numbers,
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


POWERS = (0.0, 1.0)
"""Powers κ of λ in `response_ranges`."""


@dataclass(frozen=True, eq=False)
class Source:
    """What moves oscillators, and how their response e is read from G = σ^ν ρ.

    Args:
        name: Name, for the vector on the unknowns that belongs to it.
        load: History f of ρ = ∫ exp(σ (t − s)) f(s) ds; None for an initial state, ρ = exp(σ t).
        is_displacement: Whether e is Re G + (g/ω) Im G, as after an initial displacement; if not,
            it is sign · Im G/ω.
        sign: −1 for an acceleration a of the ground, which acts as −M ι a; else 1.
    """

    name: str
    load: History | None = None
    is_displacement: bool = False
    sign: float = 1.0

    @classmethod
    def named(cls, name: str, load: History | None = None) -> Source:
        """Return the source with a name of `structures.linear.histories`, "velocity" or "start"."""
        return cls(
            name,
            load,
            is_displacement=name == "start",
            sign=-1.0 if name == "load" else 1.0,
        )

    def read(self, sigma: Array, G: Array) -> Array:
        """Return the responses e of oscillators from G = σ^ν ρ.

        Args:
            sigma: σ = −g + iω of the oscillators, ω > 0, of any shape S.
            G: Complex, shape (…, *S).

        Returns:
            Real numbers of the shape of G.
        """
        if self.is_displacement:
            return np.asarray(G.real - sigma.real / sigma.imag * G.imag)
        return np.asarray(self.sign * G.imag / sigma.imag)


@dataclass(frozen=True, eq=False)
class ModalResponses:
    """Responses of oscillators at T nodes, on a grid of W frequencies and Q quotients g/ω.

    Args:
        value: Responses at the points of the grid, shape (T, Q, W).
        error: Bound of their distance from bilinear interpolation in the grid's cells, shape (T,).
        largest: Bounds of |G| and |G′| over the whole grid, shape (2, T).
    """

    value: Array
    error: Array
    largest: Array


def grid_over(
    omega: tuple[float, float], quotient: tuple[float, float], points: tuple[int, int]
) -> Grid:
    """Return a grid of equally spaced points over ranges of frequency ω and of q = decay/ω.

    A range without width, or with its ends reversed, is replaced by a narrow one that begins at the
    lower end given: its width is 1e-9 of ω, or 1e-12 in q.

    Args:
        omega: Lower and upper end of ω, in rad/s, positive.
        quotient: Lower and upper end of q.
        points: Numbers of points along ω and along q; 2 or more each cover the ranges, 1 gives the
            lower end alone.
    """
    lowest_omega, highest_omega = omega
    if highest_omega <= lowest_omega * (1 + 1e-12):
        highest_omega = lowest_omega * (1 + 1e-9)
    lowest_quotient, highest_quotient = quotient
    if highest_quotient <= lowest_quotient:
        highest_quotient = lowest_quotient + 1e-12
    along_omega, along_quotient = points
    return Grid(
        np.asarray(np.linspace(lowest_omega, highest_omega, along_omega), float),
        np.asarray(np.linspace(lowest_quotient, highest_quotient, along_quotient), float),
    )


def intervals(
    omega: tuple[float, float], quotient: tuple[float, float], time: Array, *, fraction: float
) -> tuple[float, float]:
    """Return numbers of intervals along ω and along q = g/ω that suffice between points of a grid.

    A response changes over a distance in σ = −g + iω of about the decay g, which is the width of
    the peak of the frequency response, or of the inverse duration where that is larger.

    Args:
        omega: Lower and upper end of ω, in rad/s, positive.
        quotient: Lower and upper end of q.
        time: Time nodes, shape (T,), in s.
        fraction: Distance of points as a fraction of this distance.
    """
    low, high = omega
    smallest, largest = quotient
    spacing = fraction * (max(smallest, 0.0) * low + 2 / max(float(time[-1]), 1e-300))
    return (high - low) / spacing, (largest - smallest) * high / spacing


class _Table(NamedTuple):
    """ρ of a source on a grid of S points at T nodes.

    `rho` holds ρ and two derivatives by σ, shape (3, T, S); `bounds` bounds the derivatives of ρ of
    orders 0 to 4 over the grid, shape (5, T).
    """

    rho: Array
    bounds: Array


class Oscillators:
    """Responses of the oscillators of a grid to loads, forces and initial states.

    Args:
        grid: The oscillators.
        time: Time nodes, shape (T,), in s.
        orders: Orders ν of the derivatives by time that are asked for.

    Raises:
        UnprovedError: An oscillator is out of range, as `require_in_range` says.
    """

    def __init__(self, grid: Grid, time: Array, orders: Collection[int]) -> None:
        self.grid = grid
        self.time = time
        self.orders = orders
        self._deviations = dict[History | None, dict[int, Array]]()
        sigma = grid.sigma.ravel()
        duration = float(time[-1])
        require_in_range(sigma, duration, duration)
        self._tables = dict[History | None, _Table]()

    def _table(self, load: History | None) -> _Table:
        """Return the Duhamel integral ρ of a load for the grid's oscillators, made at first use.

        Args:
            load: The load; None for an initial state, ρ = exp(σ t).

        Returns:
            ρ with two derivatives by σ at T nodes and S points, shape (3, T, S), and bounds of its
            derivatives of orders 0 to 4 over the grid (5, T).
        """
        if load not in self._tables:
            bounds = moments_of(self.grid.decay, load, self.time)
            rho = responses_of(self.grid.sigma.ravel(), load, self.time)
            self._tables[load] = _Table(rho, bounds)
        return self._tables[load]

    def responses(self, source: Source, order: int) -> ModalResponses:
        """Return the responses e to a unit of a source, differentiated ν = `order` times by time.

        They are tabulated on a grid of Q quotients q = g/ω and W frequencies ω at T time nodes.

        Args:
            source: The source.
            order: ν, among the orders given at the construction.

        Returns:
            `value` of e at the points, shape (T, Q, W); `error`, a bound of the distance of e from
            bilinear interpolation between them, shape (T,); and `largest`, bounds of |G| and
            |dG/dσ| over the grid, G = σ^ν ρ, shape (2, T).
        """
        grid = self.grid
        is_start = source.is_displacement
        sigma = grid.sigma.ravel()
        table = self._table(source.load)
        G = with_power(sigma, table.rho, order)
        value = source.read(sigma, G[0])
        magnitudes = np.abs(G).max(-1)
        error, largest = self._error(magnitudes, table.bounds, order, start=is_start)
        return ModalResponses(
            value=value.reshape(-1, *grid.sigma.shape),
            error=error,
            largest=largest,
        )

    def _error(
        self, largest: Array, bounds: Array, order: int, *, start: bool
    ) -> tuple[Array, Array]:
        """Return a bound of the interpolation error, and bounds of |G| and |G′| over the grid.

        G = σ^ν ρ is the function of σ = −g + iω that a response is read from, ρ a Duhamel integral
        and ν the order of the derivative by time. Interpolation is bilinear in ω and q = g/ω.

        Args:
            largest: Largest |G|, |G′| and |G″| at the points of the grid, shape (3, T).
            bounds: Bounds of the derivatives of ρ of orders 0 to 4 over the grid, shape (5, T).
            order: ν.
            start: Whether the response is that to a start, Re G + q Im G; else it is Im G/ω.

        Returns:
            The bound, shape (T,), and bounds of |G| and |G′|, shape (2, T).
        """
        low = self.grid.omega[0]
        high = self.grid.omega[-1]
        q = self.grid.quotient[-1]
        h, k = self.grid.distances
        # along ω at constant q, dσ = (−q + i) dω; along q, dσ = −ω dq
        stretch = 1 + q**2  # |dσ/dω|²
        fourth = fourth_derivative(order, high * stretch**0.5, bounds)
        # Every point of a cell is at most √(2 between), half the diagonal, from a corner.
        between = self.grid.between
        second = largest[2] + between * fourth
        first = largest[1] + np.sqrt(2 * between) * second
        zero = largest[0] + between * second
        # second derivatives of the response by ω and by q, by the product rule
        if start:
            along = stretch**1.5 * second
            across = high**2 * (1 + q) * second + 2 * high * first
        else:
            along = stretch * second / low + 2 * stretch**0.5 * first / low**2 + 2 * zero / low**3
            across = high * second
        return np.asarray((h**2 * along + k**2 * across) / 8), np.stack([zero, first])

    def line_deviation(self, source: Source, order: int) -> Array:
        """Return a bound of the distance of responses from their chord in each step, shape (T,).

        The chord is the straight line between the values at both nodes. Row j belongs to the step
        that ends at node j. The bounds of a source are computed for all orders at its first use.

        Args:
            source: The source.
            order: Order of the derivative by time, among those given at the construction.
        """
        if source.load not in self._deviations:
            self._deviations[source.load] = line_deviations(
                self.grid,
                source.load,
                self.time,
                self.orders,
                at_nodes=self._table(source.load),
            )
        of_modulus, of_response = self._deviations[source.load][order]
        if source.is_displacement:
            # |Re G + q Im G| ≤ (1 + q) |G|
            return np.asarray(of_modulus * (1 + self.grid.quotient[-1]))
        return np.asarray(of_response)


@dataclass(frozen=True, eq=False)
class Ranges:
    """Bounds of λ^κ e at nodes, each of shape (powers κ, sources, T).

    Args:
        low: Lower bounds.
        high: Upper bounds.
        line_deviation: Bounds of the distance of λ^κ e from its chord in the step that ends at a
            node.
    """

    low: Array
    high: Array
    line_deviation: Array


def response_ranges(
    omega: tuple[float, float],
    quotient: tuple[float, float],
    time: Array,
    sources: Sequence[Source],
    orders: Sequence[int],
) -> dict[int, Ranges]:
    """Return ranges of λ^κ e over all oscillators with ω and g/ω in given ranges, at time nodes.

    e is the response of an oscillator with σ = −g + iω and λ = |σ|² to a unit of a source,
    differentiated ν times by time.

    Args:
        omega: Smallest and largest frequency ω > 0, in rad/s.
        quotient: Smallest and largest g/ω ≥ 0.
        time: Time nodes, shape (T,), in s.
        sources: The sources.
        orders: Orders ν of the derivatives of e by time, from 0 to 2.

    Returns:
        For each order `low` and `high`, bounds of λ^κ e for κ = 0 and 1, and `line_deviation`,
        bounds of its distance from a straight line in the step before each node, shape (2, sources,
        T) each.

    Raises:
        UnprovedError: An oscillator is out of the range in which responses are computed to
            rounding.
    """
    # frequencies of a piece differ by this factor at most, so that λ^κ changes little in it
    largest_ratio = 1.5
    shape = (len(POWERS), len(sources), len(time))
    found = {
        order: Ranges(np.full(shape, np.inf), np.full(shape, -np.inf), np.zeros(shape))
        for order in orders
    }
    pieces = max(1, int(np.ceil(np.log(omega[1] / omega[0]) / np.log(largest_ratio))))
    ratio = (omega[1] / omega[0] * (1 + 1e-9)) ** (1 / pieces)
    for n in range(pieces):
        piece = (omega[0] * ratio**n, omega[0] * ratio ** (n + 1))
        _widen_by_piece(found, piece, quotient, time=time, sources=sources)
    return found


def _widen_by_piece(
    found: Mapping[int, Ranges],
    omega: tuple[float, float],
    quotient: tuple[float, float],
    *,
    time: Array,
    sources: Sequence[Source],
) -> None:
    """Widen ranges of λ^κ e, in place, to those of the oscillators of a piece of frequencies.

    Args:
        found: By the order of a derivative of the response e by time: `low`, `high` and
            `line_deviation`, bounds of λ^κ e and of its distance from straight lines in steps,
            shape (2 exponents κ, sources, T) each; changed in place.
        omega: Smallest and largest frequency ω of the piece, in rad/s.
        quotient: Smallest and largest g/ω.
        time: Time nodes, shape (T,), in s.
        sources: The sources.

    Raises:
        UnprovedError: An oscillator is out of the range in which responses are computed to
            rounding.
    """
    slowest, fastest = omega
    decay = quotient[0] * slowest  # least g
    largest_sigma = fastest * np.sqrt(1 + quotient[1] ** 2)
    step = np.diff(time, prepend=time[0])
    tables = None
    if any(source.load for source in sources):
        tables = _tables_of_piece(omega, quotient, time=time, orders=found)
    scale = largest_sigma ** (2 * np.array(POWERS)[:, None])  # largest λ^κ
    for s, source in enumerate(sources):
        # bound of |ρ| of any oscillator of the piece
        rho = moments_of(decay, source.load, time)[0]
        # in the step to a node |ρ| grows by at most step · max|f|
        rho_in_step = np.append(rho[:1], rho[:-1])
        if source.load:
            rho_in_step = np.maximum(rho_in_step + step * source.load.extremes[0], rho)
        for order, ranges in found.items():
            # |e| ≤ factor |ρ|, as e is Im(σ^ν ρ)/ω, or Re(σ^ν ρ) + q Im(σ^ν ρ) of a start
            if source.is_displacement:
                factor = largest_sigma**order * (1 + quotient[1])
            else:
                factor = largest_sigma**order * (1 / slowest)
            high = scale * factor * rho
            low = -high
            # A response of at most r in the step is no farther than 2 r from its chord.
            deviation = 2 * scale * factor * rho_in_step
            if tables and source.load:
                table = tables.responses(source, order)
                for row, power in enumerate(POWERS):
                    weights = np.abs(tables.grid.sigma) ** (2 * power)
                    min_bound, max_bound = _bounds_over_cells(table.value, table.error, weights)
                    low[row] = np.maximum(low[row], min_bound)
                    high[row] = np.minimum(high[row], max_bound)
                by_table = tables.line_deviation(source, order)
                deviation = np.minimum(deviation, scale * by_table)
            np.minimum(ranges.low[:, s], low, out=ranges.low[:, s])
            np.maximum(ranges.high[:, s], high, out=ranges.high[:, s])
            np.maximum(ranges.line_deviation[:, s], deviation, out=ranges.line_deviation[:, s])


def _tables_of_piece(
    omega: tuple[float, float],
    quotient: tuple[float, float],
    *,
    time: Array,
    orders: Collection[int],
) -> Oscillators | None:
    """Return tables of the responses of oscillators of a piece of frequencies, or None.

    Args:
        omega: Smallest and largest frequency ω of the piece, in rad/s.
        quotient: Smallest and largest quotient g/ω of decay and frequency.
        time: Time nodes, shape (T,), in s.
        orders: Orders of the derivatives by time that are asked for.

    Returns:
        None where more than 240 points along ω would be needed.
    """
    # With a smaller fraction than .4 points cost memory, with a larger one tables are no better
    # than the integral. More than 240 points along ω, or 8 along q, cost more than the tighter
    # bound is worth. All three numbers are tuned.
    along, across = np.ceil(intervals(omega, quotient, time, fraction=0.4)) + 1
    if along > 240:
        return None
    points = (max(int(along), 2), int(np.clip(across, 2, 8)))
    return Oscillators(grid_over(omega, quotient, points), time, orders)


def _bounds_over_cells(value: Array, error: Array, factor: Array) -> tuple[Array, Array]:
    """Return bounds of factor · (value ± error) over a grid of oscillators, lower and upper, (T,).

    They hold for all oscillators between the points.

    Args:
        value: Values at the points of the grid, bilinear between them, shape (T, Q, W), W ≥ 2:
            times, quotients g/ω, frequencies ω.
        error: Bound of how far the values differ from this interpolation, shape (T,).
        factor: Positive factors, shape (Q, W), monotonic along Q and rising along W.
    """
    # A bilinear function is largest at corners, so strips between neighbouring ω, each over all Q,
    # are bounded by their edges; `low` and `high` become (T, W − 1).
    low = value.min(1) - error[:, None]
    high = value.max(1) + error[:, None]
    low = np.minimum(low[:, 1:], low[:, :-1])
    high = np.maximum(high[:, 1:], high[:, :-1])
    min_factor = factor.min(0)[:-1]
    max_factor = factor.max(0)[1:]
    # A product with a positive factor is smallest at one end of the factor's range, which end
    # depends on the sign of `low`.
    bottom = np.minimum(low * min_factor, low * max_factor)
    top = np.maximum(high * min_factor, high * max_factor)
    return bottom.min(1), top.max(1)
