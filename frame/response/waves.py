"""Responses of one oscillator over tables of frequency and damping, with the tables' proved error.

An oscillator with decay g and frequency ω (σ = −g + iω) answers a unit of its share by

    load       e = −Im(σ^ν ρ) / ω,   ρ(σ; t) = ∫₀ᵗ exp(σ τ) a(t − τ) dτ,
    force      e = Im(σ^ν ρ) / ω, and f(t) besides where ν = 2, of the relative acceleration,
    velocity   e = Im(σ^ν exp(σ t)) / ω,
    start      e = Re(σ^ν exp(σ t)) + (g/ω) Im(σ^ν exp(σ t)),

ν the derivative of the motion that an output takes (ν = 2 under a load of the ground: the absolute
acceleration). All are read off one function G(σ) = σ^ν ρ that is analytic, so one complex
derivative bounds all real ones. Tables stand on ω × q, q = g/ω; within a cell a function strays
from the bilinear one through the corners by at most h_ω²/8 sup|∂²e/∂ω²| + h_q²/8 sup|∂²e/∂q²|,
and these follow from sup |G|, |G'|, |G''|. sup |G''| itself is its largest value at the corners,
and what it strays between them, which |G''''| bounds; that in turn follows from integrals of τⁿ
exp(−g τ) |a|.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import comb, perm

import numpy as np

from alphacut.frame.calculus.rounding import UNIT_ROUNDOFF
from alphacut.frame.response.duhamel import (
    absolute_moments,
    require_in_range,
    responses_at_nodes,
)
from alphacut.frame.structures.loads import History
from alphacut.fuzzy.arrays import Array


@dataclass(frozen=True, eq=False)
class Waves:
    """Responses of oscillators on a grid of W frequencies and Q quotients g/ω at T nodes.

    Args:
        omega: Frequencies, shape (W,), in rad/s.
        quotient: g/ω, shape (Q,).
        value: Responses, shape (T, Q, W).
        error: Bound of their distance from bilinear interpolation, with rounding, shape (T,).
        line_deviation: Bound of their distance from a straight line in the step to each node, (T,).
        largest: Bounds of |G| and |G'| over the grid, shape (2, T).
    """

    omega: Array
    quotient: Array
    value: Array
    error: Array
    line_deviation: Array
    largest: Array


@dataclass(frozen=True, eq=False)
class Grid:
    """A box of ω and q = g/ω with its points."""

    omega: Array
    quotient: Array

    @property
    def sigma(self) -> Array:
        """σ of all points, shape (Q, W)."""
        return np.asarray((-self.quotient[:, None] + 1j) * self.omega)


def spanned(
    omega: tuple[float, float], quotient: tuple[float, float], points: tuple[int, int]
) -> Grid:
    """Grid of `points` equally spaced values over the ranges of ω and γ/ω, widened if empty."""
    q = quotient if quotient[1] > quotient[0] else (quotient[0], quotient[0] + 1e-12)
    w = omega if omega[1] > omega[0] * (1 + 1e-12) else (omega[0], omega[0] * (1 + 1e-9))
    return Grid(
        *(np.asarray(np.linspace(*x, n), float) for x, n in zip((w, q), points, strict=True))
    )


class Oscillators:
    """Analytic functions ρ and exp(σ t) on a grid, from which all responses are read."""

    def __init__(self, grid: Grid, loads: Mapping[str, History], time: Array) -> None:
        self.grid, self.loads, self.time = grid, loads, time
        sigma = grid.sigma.ravel()
        duration = float(time[-1])
        require_in_range(sigma, duration, duration)
        self.free = np.exp(sigma * time[:, None])
        self.free_error = UNIT_ROUNDOFF * (4 + np.abs(sigma) * time[:, None]) * np.abs(self.free)
        decay = float((grid.quotient[:, None] * grid.omega).min())
        fade = np.exp(-decay * time)
        self.free_bounds = np.stack([time**n * fade for n in range(5)])
        self.forced = {
            name: (*responses_at_nodes(sigma, load, time, 2), absolute_moments(decay, load, time))
            for name, load in loads.items()
        }

    def waves(self, source: str, order: int) -> Waves:
        """Table of the oscillators' responses e to a unit amplitude of `source`, with errors.

        With σ = −γ + iω and G = σ^order ρ(σ; t), e is Re G + (γ/ω) Im G for a start, ± Im G / ω
        else. ρ is ∫ exp(σ (t − s)) f(s) ds under a load f, exp(σ t) without one.

        Args:
            source: Name of a load or force, "velocity" or "start".
            order: Derivative of the motion that is read, 0 to 2.

        Returns:
            The responses with bounds of their error, of their deviation from straight lines between
            nodes, and of |G| and |G'|.
        """
        grid = self.grid
        sigma = grid.sigma.ravel()
        if source in self.forced:
            rho, rounding, bounds = self.forced[source]
        else:
            t = self.time[:, None]
            # ρ with two derivatives by σ
            rho, bounds = np.stack([self.free, t * self.free, t * t * self.free]), self.free_bounds
            rounding = self.free_error
        G = _with_power(sigma, rho, order)
        omega, quotient = np.abs(sigma.imag), -sigma.real / sigma.imag
        # of the power and of what is read off
        rounding = np.abs(sigma) ** order * rounding
        rounding += 2 * (order + 3) * UNIT_ROUNDOFF * np.abs(G[0])
        if source == "start":
            value = G[0].real + quotient * G[0].imag
            rounding *= 1 + quotient
        else:
            value = G[0].imag / omega * (-1.0 if source == "load" else 1.0)
            direct = feedthrough(source, self.loads, order, self.time)[:, None]
            value, rounding = value + direct, rounding / omega + 8 * UNIT_ROUNDOFF * np.abs(direct)
        shape = (len(self.time), len(grid.quotient), len(grid.omega))
        error, largest = self._error(np.abs(G).max(-1), bounds, order, start=source == "start")
        error, deviation = error + rounding.max(-1), self._line_deviation(largest[0], source, order)
        return Waves(grid.omega, grid.quotient, value.reshape(shape), error, deviation, largest)

    def _error(
        self, largest: Array, bounds: Array, order: int, *, start: bool
    ) -> tuple[Array, Array]:
        """Bounds of the table's interpolation error, (T,), and of |G| and |G'| over it, (2, T).

        Along ω at constant q = g/ω, dσ = (−q + i) dω; along q, dσ = −ω dq. Between the points |G''|
        strays by what |G''''| bounds, and so on down.

        Args:
            largest: Largest |G|, |G'| and |G''| at the points, shape (3, T); G = σ^order ρ.
            bounds: Bounds of the derivatives of ρ by σ, orders 0 to 4, shape (5, T).
            order: Derivative of the motion that is read.
            start: Whether the response is Re G + q Im G; else Im G / ω.
        """
        g = self.grid
        low, high, q = g.omega[0], g.omega[-1], g.quotient[-1]
        h, k = (np.diff(x).max(initial=0.0) for x in (g.omega, g.quotient))
        stretch = 1 + q**2  # |dσ/dω|²
        fourth = sum(
            comb(4, j) * perm(order, j) * (high * stretch**0.5) ** (order - j) * bounds[4 - j]
            for j in range(order + 1)
        )
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

    def _line_deviation(self, size: Array, source: str, order: int) -> Array:
        """Bounds of how far responses e stray from straight lines in the step to each node, (T,).

        A chord errs by at most h²/8 sup |ë|. Under a load a(t), ρ̇ = σ ρ + a and ρ̈ = σ² ρ + σ a + ȧ;
        where a jumps, ρ̇ does, which adds h/4 of the jump.

        Args:
            size: Bound of |σ^order ρ| at the nodes, shape (T,).
            source: Name of a load or force, "velocity" or "start".
            order: Derivative of the motion that is read.
        """
        g, h = self.grid, np.diff(self.time, prepend=self.time[0])
        low, fast = g.omega[0], float(np.abs(g.sigma).max())
        before = np.append(size[:1], size[:-1])
        if source == "start":
            return np.asarray(h**2 / 8 * fast**2 * before * (1 + g.quotient[-1]))
        if source not in self.loads:
            return np.asarray(h**2 / 8 * fast**2 * before / low)
        load = self.loads[source]
        largest, slope = load.extremes
        power = fast**order
        bend = fast**2 * (before + h * power * largest) + power * (fast * largest + slope)
        kink = np.zeros(len(self.time))
        for at, jump in load.jumps if order else ():
            kinked = (self.time - h <= at * (1 + 1e-9)) & (self.time >= at * (1 - 1e-9))
            kink += np.where(kinked, h / 4 * power * jump, 0.0)
        deviation = (h**2 / 8 * bend + kink) / low
        return np.asarray(
            deviation + (load.line_deviation(self.time) if _has_feedthrough(source, order) else 0.0)
        )


def feedthrough(source: str, loads: Mapping[str, History], order: int, time: Array) -> Array:
    """Direct feedthrough f(t) of a force to accelerations at nodes, shape of `time`, else 0."""
    if not _has_feedthrough(source, order):
        return np.zeros_like(time)
    return loads[source].values(time)


def _has_feedthrough(source: str, order: int) -> bool:
    return order == 2 and source.startswith("force")


def _with_power(sigma: Array, rho: Array, order: int) -> Array:
    """G = σ^order ρ and its first two derivatives by σ, shape (3, T, S), from those of ρ."""
    first = order * sigma ** max(order - 1, 0)
    second = float(order * (order - 1))
    power = sigma**order
    return np.stack(
        [
            power * rho[0],
            first * rho[0] + power * rho[1],
            second * rho[0] + 2 * first * rho[1] + power * rho[2],
        ]
    )
