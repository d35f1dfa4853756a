"""Responses of oscillators over ranges of frequency and damping, with proved bounds.

An oscillator with decay g and frequency ω (σ = −g + iω) answers a unit of its share by

    load       e = −Im(σ^ν ρ) / ω,   ρ(σ; t) = ∫₀ᵗ exp(σ τ) a(t − τ) dτ,
    force      e = Im(σ^ν ρ) / ω, and f(t) besides where ν = 2, of the relative acceleration,
    velocity   e = Im(σ^ν exp(σ t)) / ω,
    start      e = Re(σ^ν exp(σ t)) + (g/ω) Im(σ^ν exp(σ t)),

ν the derivative of the motion that an output takes (ν = 2 under a load of the ground: the absolute
acceleration). All are read off one function G(σ) = σ^ν ρ that is analytic, so one complex
derivative bounds all real ones. Tables (`Oscillators`) stand on ω × q, q = g/ω; within a cell a
function strays from the bilinear one through the corners by at most h_ω²/8 sup|∂²e/∂ω²| +
h_q²/8 sup|∂²e/∂q²|, and these follow from sup |G|, |G'|, |G''|. sup |G''| itself is its largest
value at the corners, and what it strays between them, which |G''''| bounds; that in turn follows
from integrals of τⁿ exp(−g τ) |a|.

Of modes that are known by sums alone, ranges of λ^κ e over all frequencies between two are wanted
(`response_ranges`). They are cut into pieces; in each a table bounds the responses, and so does an
integral of |a|.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from alphacut.base.arrays import Array
from alphacut.frame.calculus.rounding import UNIT_ROUNDOFF
from alphacut.frame.records.history import History
from alphacut.frame.response.duhamel import absolute_moments, require_in_range
from alphacut.frame.response.straying import (
    fourth_derivative,
    line_deviations,
    moments_of,
    responses_of,
    with_power,
)

POWERS = (0.0, 0.5, 1.0)
"""Powers κ of λ."""
RATIO = 1.5
"""Greatest over least frequency of a piece."""
STEP = 0.4
"""Distance of a piece's points, as a share of the decay and of the inverse duration."""
MAX_POINTS = (240, 8)
"""Points of a piece along ω, above which the integral alone bounds it, and along g/ω."""


@dataclass(frozen=True, eq=False)
class ModalResponses:
    """Responses of oscillators on a grid of W frequencies and Q quotients g/ω at T nodes."""

    value: Array  # responses, (T, Q, W)
    error: Array  # bound of their distance from bilinear interpolation, with rounding, (T,)
    # bound of their distance from a straight line in the step to each node, (T,)
    line_deviation: Array
    largest: Array  # bounds of |G| and |G'| over the grid, (2, T)


@dataclass(frozen=True, eq=False)
class Grid:
    """A box of ω, shape (W,), and q = g/ω, shape (Q,), with its points."""

    omega: Array
    quotient: Array

    @property
    def sigma(self) -> Array:
        """σ of all points, shape (Q, W)."""
        return np.asarray((-self.quotient[:, None] + 1j) * self.omega)


def grid_over(
    omega: tuple[float, float], quotient: tuple[float, float], points: tuple[int, int]
) -> Grid:
    """Return a grid of equally spaced ω and q = g/ω over their ranges, widened if empty."""
    q = quotient if quotient[1] > quotient[0] else (quotient[0], quotient[0] + 1e-12)
    w = omega if omega[1] > omega[0] * (1 + 1e-12) else (omega[0], omega[0] * (1 + 1e-9))
    axes = (np.linspace(*ends, count) for ends, count in zip((w, q), points, strict=True))
    return Grid(*(np.asarray(axis, float) for axis in axes))


class Oscillators:
    """Analytic functions ρ and exp(σ t) on a grid, from which all responses are read.

    Nodes `time` (T,) are in s, and `orders` the derivatives of the motion that are read.
    """

    def __init__(
        self, grid: Grid, loads: Mapping[str, History], time: Array, orders: Collection[int]
    ) -> None:
        self.grid, self.loads, self.time, self.orders = grid, loads, time, orders
        self._deviations = dict[str, dict[int, Array]]()
        sigma, duration = grid.sigma.ravel(), float(time[-1])
        require_in_range(sigma, duration, duration)
        self.decay = float((grid.quotient[:, None] * grid.omega).min())
        self._tables = dict[str, tuple[Array, Array, Array]]()

    def _table(self, source: str) -> tuple[Array, Array, Array]:
        """ρ with two derivatives by σ, its rounding, bounds of its derivatives of order 0 to 4."""
        load = self.loads.get(source)
        name = source if load else ""  # exp(σ t) of velocities and starts
        if name not in self._tables:
            bounds = moments_of(self.decay, load, self.time)
            rho, rounding = responses_of(self.grid.sigma.ravel(), load, self.time)
            self._tables[name] = rho, rounding, bounds
        return self._tables[name]

    def responses(self, source: str, order: int) -> ModalResponses:
        """Return responses to a unit share of a source, read by the derivative ν = `order`.

        `source` is the name of a load or force, "velocity" or "start".
        """
        grid, is_start = self.grid, source == "start"
        sigma = grid.sigma.ravel()
        rho, rounding, bounds = self._table(source)
        G = with_power(sigma, rho, order)
        direct = feedthrough(source, self.loads, order, self.time)
        value, sizes = read_response(source, sigma, G[0]), np.abs(G).max(-1)
        if direct.any():
            value += direct[:, None]
        # of the power and of what is read off, the largest over the grid, (T,)
        rounding = float(np.abs(sigma).max()) ** order * rounding.max(-1)
        rounding += 2 * (order + 3) * UNIT_ROUNDOFF * sizes[0]
        rounding = rounding * (1 + grid.quotient[-1]) if is_start else rounding / grid.omega[0]
        rounding += 8 * UNIT_ROUNDOFF * np.abs(direct)
        error, largest = self._error(sizes, bounds, order, start=is_start)
        error, deviation = error + rounding, self._line_deviation(source, order)
        return ModalResponses(value.reshape(-1, *grid.sigma.shape), error, deviation, largest)

    def _error(
        self, largest: Array, bounds: Array, order: int, *, start: bool
    ) -> tuple[Array, Array]:
        """Bounds of the interpolation error, (T,), and of |G| and |G'| over the grid, (2, T)."""
        # largest (3, T): |G|, |G'|, |G''| at the points; bounds (5, T): of derivatives of ρ by σ.
        # Along ω at constant q = g/ω, dσ = (−q + i) dω; along q, dσ = −ω dq.
        low, high, q = self.grid.omega[0], self.grid.omega[-1], self.grid.quotient[-1]
        h, k = (np.diff(x).max(initial=0.0) for x in (self.grid.omega, self.grid.quotient))
        stretch = 1 + q**2  # |dσ/dω|²
        fourth = fourth_derivative(order, high * stretch**0.5, bounds)
        # half the diagonal of a cell is √(2 between)
        between = (stretch * h**2 + high**2 * k**2) / 8
        second = largest[2] + between * fourth
        first = largest[1] + np.sqrt(2 * between) * second
        zero = largest[0] + between * second
        if start:  # Re G + q Im G
            along = stretch**1.5 * second
            across = high**2 * (1 + q) * second + 2 * high * first
        else:  # Im G / ω
            along = stretch * second / low + 2 * stretch**0.5 * first / low**2 + 2 * zero / low**3
            across = high * second
        return np.asarray((h**2 * along + k**2 * across) / 8), np.stack([zero, first])

    def _line_deviation(self, source: str, order: int) -> Array:
        """Bounds of how far responses stray from a line in the step to each node, (T,)."""
        if source not in self._deviations:
            self._deviations[source] = line_deviations(
                *(self.grid.sigma, self.loads.get(source), self.time, self.orders),
                is_force=is_fed_through(source, 2),
                at_nodes=self._table(source),
            )
        modulus, read = self._deviations[source][order]
        return modulus * (1 + self.grid.quotient[-1]) if source == "start" else read

    def deviation_without_feedthrough(self, source: str, order: int) -> Array:
        """Bounds of how far responses stray from lines, without what forces add at once, (T,)."""
        deviation = self._line_deviation(source, order)
        if not is_fed_through(source, order):
            return deviation
        modulus, _ = self._deviations[source][order]
        return np.asarray(modulus / self.grid.omega[0])  # |Im G/ω| ≤ |G|/ω


def read_response(source: str, sigma: Array, G: Array) -> Array:
    """Response e of oscillators to a source by G = σ^order ρ(σ; t), without feedthrough.

    It is Re G + (g/ω) Im G of a start, g = −Re σ, and Im G/ω of other sources, with the other sign
    for the ground's acceleration, which acts as −M ι a.
    """
    if source == "start":
        return np.asarray(G.real - sigma.real / sigma.imag * G.imag)
    return np.asarray((-1.0 if source == "load" else 1.0) * G.imag / sigma.imag)


def is_fed_through(source: str, order: int) -> bool:
    """Return whether a source adds to a response at once, as a force does to accelerations."""
    return order == 2 and source.startswith("force")


def feedthrough(source: str, loads: Mapping[str, History], order: int, time: Array) -> Array:
    """Direct feedthrough f(t) of a force to accelerations at nodes, shape of `time`, else 0."""
    return loads[source].values(time) if is_fed_through(source, order) else np.zeros_like(time)


@dataclass(frozen=True, eq=False)
class Ranges:
    """Bounds of λ^κ e at nodes, each of shape (powers, sources, T)."""

    low: Array  # lower bounds
    high: Array  # upper bounds
    # bounds of how far λ^κ e, without what a force adds at once, strays from a straight line in the
    # step to a node
    line_deviation: Array


def response_ranges(
    omega: tuple[float, float],
    quotient: tuple[float, float],
    loads: Mapping[str, History],
    time: Array,
    sources: Sequence[str],
    orders: Sequence[int],
) -> dict[int, Ranges]:
    """Return ranges of λ^κ e at nodes `time` (T,) over all oscillators with ω and g/ω in ranges.

    e is the response to a source and κ one of `POWERS`; keys are the `orders` of derivatives of the
    motion that are read.
    """
    shape = (len(POWERS), len(sources), len(time))
    found = {
        order: Ranges(np.full(shape, np.inf), np.full(shape, -np.inf), np.zeros(shape))
        for order in orders
    }
    count = max(1, int(np.ceil(np.log(omega[1] / omega[0]) / np.log(RATIO))))
    ratio, step = (omega[1] / omega[0] * (1 + 1e-9)) ** (1 / count), np.diff(time, prepend=time[0])
    for n in range(count):
        slowest, fastest = omega[0] * ratio**n, omega[0] * ratio ** (n + 1)
        decay, largest = quotient[0] * slowest, fastest * np.sqrt(1 + quotient[1] ** 2)  # g, |σ|
        distance = STEP * (decay + 2 / max(float(time[-1]), 1e-300))
        along = int(np.ceil((fastest - slowest) / distance)) + 1
        across = int(np.ceil((quotient[1] - quotient[0]) * fastest / distance)) + 1
        tables: Oscillators | None = None
        if loads and along <= MAX_POINTS[0]:
            points = max(along, 2), int(np.clip(across, 2, MAX_POINTS[1]))
            grid = grid_over((slowest, fastest), quotient, points)
            tables = Oscillators(grid, loads, time, found)
        # of |ρ| of any oscillator
        size = {name: absolute_moments(decay, x, time)[0] for name, x in loads.items()}
        scale = largest ** (2 * np.array(POWERS)[:, None])
        for s, source in enumerate(sources):
            rho = size.get(source, np.exp(-decay * time))
            rho_in_step = np.append(rho[:1], rho[:-1])
            if source in loads:
                rho_in_step = np.maximum(rho_in_step + step * loads[source].extremes[0], rho)
            for order, ranges in found.items():
                factor = largest**order * (1 + quotient[1] if source == "start" else 1 / slowest)
                direct = np.abs(feedthrough(source, loads, order, time))
                high = scale * (factor * rho + direct)
                low = -high
                deviation = 2 * scale * factor * rho_in_step
                if tables and source in loads:
                    table = tables.responses(source, order)
                    powers = [np.abs(tables.grid.sigma) ** (2 * power) for power in POWERS]
                    cells = [_bounds_over_cells(table.value, table.error, x) for x in powers]
                    least, greatest = np.swapaxes(cells, 0, 1)
                    low, high = np.maximum(low, least), np.minimum(high, greatest)
                    by_table = tables.deviation_without_feedthrough(source, order)
                    deviation = np.minimum(deviation, scale * by_table)
                np.minimum(ranges.low[:, s], low, out=ranges.low[:, s])
                np.maximum(ranges.high[:, s], high, out=ranges.high[:, s])
                np.maximum(ranges.line_deviation[:, s], deviation, out=ranges.line_deviation[:, s])
    return found


def _bounds_over_cells(value: Array, error: Array, factor: Array) -> tuple[Array, Array]:
    """Lower and upper bound of factor × value ± error over a table (T, Q, W), shape (T,) each."""
    # positive factors (Q, W), monotone along Q and rising along W
    # over strips between neighbouring ω, each over all Q
    low, high = value.min(1) - error[:, None], value.max(1) + error[:, None]  # (T, W)
    low, high = np.minimum(low[:, 1:], low[:, :-1]), np.maximum(high[:, 1:], high[:, :-1])
    least, greatest = factor.min(0)[:-1], factor.max(0)[1:]
    bottom = np.minimum(low * least, low * greatest)
    top = np.maximum(high * least, high * greatest)
    return bottom.min(1), top.max(1)
