"""Responses of oscillators over ranges of frequency and damping, with proved bounds.

An oscillator with decay g and frequency ω, σ = −g + iω, responds to a unit of a source by

    load       e = −Im(σ^ν ρ) / ω,   ρ(σ; t) = ∫₀ᵗ exp(σ τ) a(t − τ) dτ,
    force      e = Im(σ^ν ρ) / ω; with ν = 2 without what the force adds to accelerations at once,
    velocity   e = Im(σ^ν exp(σ t)) / ω,
    start      e = Re(σ^ν exp(σ t)) + (g/ω) Im(σ^ν exp(σ t)),

where ν is the order of the derivative by time that an output takes. Under a load of the ground
ν = 2 is the absolute acceleration. All responses are parts of one function G(σ) = σ^ν ρ, which is
analytic, so that bounds of its complex derivatives bound all real ones.

`Oscillators` tabulates G on a grid of ω and q = g/ω. In a cell with sides h_ω and h_q a response
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
from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Array
from alphacut.frame.records.history import History
from alphacut.frame.response.chord_deviation import (
    Grid,
    fourth_derivative,
    line_deviations,
    moments_of,
    responses_of,
    with_power,
)
from alphacut.frame.response.duhamel import require_in_range

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
