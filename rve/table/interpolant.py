"""Chebyshev interpolant of the moduli over radius and modulus, with its error.

The variables are u = √(1 − r²), which takes the sting out of nearly touching particles (polynomials
in r² need three times the degree), and t = ln(E_i / E_m), in which a stiffness is analytic in the
strip |Im t| < π. What is interpolated is the logarithm of each modulus over that of Mori and
Tanaka: it is of the second order in the particle's area, and absolute errors of the interpolant are
relative errors of the modulus.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.polynomial import chebyshev

from alphacut.rve.bounds import mori_tanaka
from alphacut.rve.cell import Phase, square_voigt
from alphacut.stochastic.theta.truncated_normal import Array

_SLACK = 1e-9
_TINY = 1e-300
# least share of the largest error: C11 + C12 hardly depends on the arrangement, and errors of
# C11 − C12 and C33 leave their ratio in part
_SHARED = np.array([0.1, 1.0, 1.0, 0.1])


@dataclass(frozen=True)
class TableRange:
    """Range of a table.

    Args:
        matrix: Material outside the particle.
        poisson: Poisson's ratio of the particle.
        radii: Least and greatest radius, inside (0, 1).
        moduli: Least and greatest Young's modulus of the particle, in Pa.

    Raises:
        ValueError: A range is out of order or out of bounds.
    """

    matrix: Phase
    poisson: float
    radii: tuple[float, float]
    moduli: tuple[float, float]

    def __post_init__(self) -> None:
        if not 0 < self.radii[0] <= self.radii[1] < 1:
            raise ValueError(
                f"the table's radii are {self.radii}; they need 0 < least <= greatest < 1, in"
                " halves of the cell's side"
            )
        if not 0 < self.moduli[0] <= self.moduli[1] < np.inf:
            raise ValueError(
                f"the table's moduli are {self.moduli} Pa; they need 0 < least <= greatest, both"
                " finite"
            )
        Phase(self.moduli[0], self.poisson)

    def _ends(self) -> Array:
        """The variables u and t at the two ends, shape (2, 2)."""
        return np.stack([_touch(np.array(self.radii)), self._contrast(np.array(self.moduli))])

    def _contrast(self, modulus: Array) -> Array:
        return np.asarray(np.log(modulus / self.matrix.modulus))

    def coordinates(self, radius: Array, modulus: Array) -> tuple[Array, Array]:
        """Chebyshev coordinates in [−1, 1] of radii and moduli, same shapes.

        Raises:
            ValueError: A radius or modulus lies outside the table.
        """
        for what, values, (low, high), unit in (
            ("radius", radius, self.radii, ""),
            ("modulus", modulus, self.moduli, " Pa"),
        ):
            outside = values[(values < low * (1 - _SLACK)) | (values > high * (1 + _SLACK))]
            if outside.size:
                raise ValueError(
                    f"the table is asked for a {what} of {outside[0]:g}{unit}; it covers {low:g} to"
                    f" {high:g}{unit}: widen it"
                )
        ends = self._ends()
        return _unit(_touch(radius), ends[0]), _unit(self._contrast(modulus), ends[1])

    def nodes(self, counts: tuple[int, int]) -> tuple[Array, Array]:
        """Radii and moduli at the first Leja points of either direction."""
        (u0, u1), (t0, t1) = self._ends()
        u, t = (
            a + (b - a) * (1 + leja(n)) / 2
            for (a, b), n in zip(((u0, u1), (t0, t1)), counts, strict=True)
        )
        radii = np.clip(np.sqrt((1 - u) * (1 + u)), *self.radii)
        radii[:2] = self.radii[:-3:-1] if counts[0] > 1 else radii
        return radii, np.clip(self.matrix.modulus * np.exp(t), *self.moduli)

    def dilute(self, radius: Array, modulus: Array) -> Array:
        """C11 + C12, C11 − C12 and C33 by Mori and Tanaka in Pa, shape (n, m, 3)."""
        share, phases = np.pi / 4 * radius**2, [Phase(float(e), self.poisson) for e in modulus]
        return np.stack([mori_tanaka(share, self.matrix, phase) for phase in phases], axis=1)


def _touch(radius: Array) -> Array:
    return np.asarray(np.sqrt((1 - radius) * (1 + radius)))


def _unit(values: Array, ends: Array) -> Array:
    width = ends[1] - ends[0]
    return (
        np.clip(2 * (values - ends[0]) / width - 1, -1, 1)
        if abs(width) > 1e-13
        else np.zeros_like(values)
    )


def leja(count: int) -> Array:
    """The first `count` points of the R-Leja sequence; nested, Lobatto's at 2^k + 1.

    Their Lebesgue constant grows no faster than their number (Calvi & Phung 2011), so degrees can
    be raised one by one with every value kept.
    """
    if count == 1:
        return np.zeros(1)
    angles = [0.0, np.pi, np.pi / 2]
    while len(angles) < count:
        half = angles[(len(angles) + 1) // 2] / 2
        angles += [half, half + np.pi]
    return np.cos(angles[:count])


@cache
def lebesgue(count: int) -> float:
    """Lebesgue constant of the first `count` points of `leja`."""
    points = leja(count)
    apart = points[:, None] - points + np.eye(count)
    grid = np.cos(np.pi * (np.arange(40 * count) + 0.382) / (40 * count))
    terms = 1 / (np.prod(apart, axis=1) * (grid[:, None] - points))
    return float((np.abs(terms).sum(axis=1) / np.abs(terms.sum(axis=1))).max())


def coefficients(values: Array) -> Array:
    """Chebyshev coefficients of `values` (n_r, n_E, …) at the Leja points, same shape."""
    for axis in (0, 1):
        count = values.shape[axis]
        basis = chebyshev.chebvander(leja(count), count - 1)
        values = np.moveaxis(np.tensordot(np.linalg.inv(basis), values, axes=(1, axis)), 0, axis)
    return values


def tail(coefficients: Array, axis: int, *, noise: Array | float = 0.0) -> Array:
    """Declared interpolation errors of the three moduli and of the ratio along `axis`, shape (4,).

    The geometric series that the last coefficients begin, as often as interpolation may be worse
    than the polynomial that leaves it: one and the Lebesgue constant of the points. Coefficients
    change signs, so that one modulus may show none where another does: each counts at least a share
    of the largest.

    Args:
        coefficients: Of the three logarithms, shape (n_r, n_E, 3).
        axis: 0 or 1.
        noise: Error of the values themselves: where the last coefficients are no larger, they tell
            of nothing else, and count once.
    """
    ratio = coefficients[..., 1:2] - coefficients[..., 2:3]
    both = np.concatenate([coefficients, ratio], axis=-1)
    size = np.abs(np.moveaxis(both, axis, 0)).sum(axis=1)
    if len(size) == 1:
        return np.zeros(size.shape[1])
    if len(size) == 2:  # the constant tells nothing of a decay
        last, fade = size[-1], np.full(size.shape[1], 0.7)
    elif len(size) < 7:
        last, fade = size[-1], size[-1] / np.maximum(size[-2], _TINY)
    else:
        last = size[-3:].max(axis=0)
        fade = np.cbrt(last / np.maximum(size[-6:-3].max(axis=0), _TINY))
    fade = np.clip(fade, 0.3, 0.8)
    found = np.where(last <= noise, last, (1 + lebesgue(len(size))) * last * fade / (1 - fade))
    return np.asarray(np.maximum(found, found[:3].max() * _SHARED))


@dataclass(frozen=True)
class Table:
    """The interpolant.

    Args:
        span: What it covers.
        coefficients: Over u and t, of the logarithms of C11 + C12, C11 − C12 and C33 over those of
            `TableRange.dilute`, shape (n_r, n_E, 3).
        space: Declared relative errors of the three moduli that it interpolates, and of the ratio
            of the last two, at some radii: radius and errors, shape (5, k).
        mesh_size: Of the planar cells behind it; 0 for the series.
        unknowns: Of their linear systems.
        systems: Number of linear systems solved to build it.
        seconds: What building it took.
    """

    span: TableRange
    coefficients: Array
    space: Array
    mesh_size: float
    unknowns: int
    systems: int
    seconds: float

    @property
    def interpolation(self) -> Array:
        """Declared relative errors of interpolation, of the moduli and the ratio, shape (4,)."""
        noise = self.space[1:].max(axis=1)
        return tail(self.coefficients, 0, noise=noise) + tail(self.coefficients, 1, noise=noise)

    def space_error(self, radius: Array) -> Array:
        """Declared relative errors of moduli and ratio at n radii, shape (n, 4)."""
        places, errors = self.space[0], np.log(self.space[1:])
        return np.asarray(
            np.exp(np.stack([np.interp(radius, places, one) for one in errors], axis=-1))
        )

    def moduli(self, radius: Array, modulus: Array) -> Array:
        """C11 + C12, C11 − C12 and C33 in Pa at n radii times m moduli, shape (n, m, 3).

        Raises:
            ValueError: A radius or modulus lies outside the table.
        """
        at_r, at_e = self.span.coordinates(radius, modulus)
        rows = chebyshev.chebvander(at_r, self.coefficients.shape[0] - 1)
        columns = np.ascontiguousarray(chebyshev.chebvander(at_e, self.coefficients.shape[1] - 1))
        # one by one: same bits in any company
        scales = [
            np.exp(rows @ np.tensordot(column, self.coefficients, axes=(0, 1)))
            for column in columns
        ]
        return np.asarray(np.stack(scales, axis=1) * self.span.dilute(radius, modulus))

    def stiffness(self, radius: Array, modulus: Array) -> Array:
        """Voigt matrices in Pa at n radii times m moduli, shape (n, m, 3, 3)."""
        return square_voigt(*np.moveaxis(self.moduli(radius, modulus), -1, 0))
