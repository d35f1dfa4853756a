"""Sums over the simple cubic lattice that couple one sphere to all its periodic images.

The lattice is p = (i, j, k) with integers, not all zero. With Racah's spherical harmonics C_n^m =
[(n − m)!/(n + m)!]^½ P_n^m(cos θ) exp(imφ), harmonic and biharmonic multipoles need

    S_n^m = Σ C_n^m(p) |p|^(−n−1),   D_n^m = Σ C_n^m(p) |p|^(1−n);

cubic symmetry leaves even n ≥ 4 and m = 0, 4, 8, …, all real. They are Epstein zeta functions by
Ewald's split of the theta function (Borwein et al., Lattice Sums Then and Now, 2013), which also
gives D_4, convergent only in the order of spheres.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from scipy.special import gammaincc, gammaln

from alphacut.base.arrays import Array


def harmonics(points: Array, highest: int, order: int) -> Array:
    """Return Re C_n^m of Racah's spherical harmonics in the directions of points, for one order m.

    C_n^m = [(n − m)!/(n + m)!]^½ P_n^m(cos θ) exp(imφ), with the sign (−1)^m of Condon and
    Shortley.

    Args:
        points: Cartesian coordinates other than the origin, shape (k, 3).
        highest: Highest degree n.
        order: Order m, at least 0.

    Returns:
        Values for n = 0 … `highest`, shape (highest + 1, k); zero where n < m.
    """
    radius = np.linalg.norm(points, axis=1)
    cosine = points[:, 2] / radius
    flat = (points[:, 0] + 1j * points[:, 1]) / radius  # sin θ exp(iφ)
    values = np.zeros((highest + 1, len(points)))
    if order > highest:
        return values
    m = np.arange(1, order + 1)
    values[order] = (-1) ** order * np.prod(np.sqrt((2 * m - 1) / (2 * m))) * (flat**order).real
    for n in range(order + 1, highest + 1):  # three-term recurrence in n
        values[n] = (2 * n - 1) * cosine * values[n - 1]
        if n > order + 1:
            values[n] -= np.sqrt((n - 1) ** 2 - order**2) * values[n - 2]
        values[n] /= np.sqrt(n**2 - order**2)
    return values


class LatticeSums(NamedTuple):
    """Sums over the lattice by degree n and order m, each of shape (highest + 1, highest + 1).

    Attributes:
        harmonic: S_n^m.
        biharmonic: D_n^m.
    """

    harmonic: Array
    biharmonic: Array


@cache
def lattice_sums(highest: int) -> LatticeSums:
    """Return sums of spherical harmonics over the points p of the integer lattice, but the origin.

    With Racah's C_n^m = [(n − m)!/(n + m)!]^½ P_n^m(cos θ) exp(imφ) they are S_n^m = Σ C_n^m(p)
    |p|^(−n−1) and D_n^m = Σ C_n^m(p) |p|^(1−n).

    Args:
        highest: Highest degree n.

    Returns:
        `harmonic`, S, and `biharmonic`, D, at the indices [n, m], shape (highest + 1, highest + 1).
        By symmetry only even n ≥ 4 and orders that are multiples of 4 are not zero; n = 0, whose
        sums diverge, is set to zero. Equal arguments give the same arrays, which must not be
        changed.
    """
    shape = highest + 1, highest + 1
    sums = LatticeSums(np.zeros(shape), np.zeros(shape))
    # Ewald's sums fall like exp(−π |p|²). With all |p|² ≤ 20 the first term left out is exp(−21 π),
    # or 2e-29.
    reach = 4
    axis = np.arange(-reach, reach + 1.0)
    points = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
    square = (points**2).sum(axis=1)
    points = points[(square > 0) & (square <= reach * (reach + 1))]
    for m in range(0, highest + 1, 4):
        angular = harmonics(points, highest, m)
        for n in range(max(4, m), highest + 1, 2):
            sums.harmonic[n, m] = _epstein(angular[n], points, n, power=1)
            sums.biharmonic[n, m] = _epstein(angular[n], points, n, power=-1)
    return sums


def _epstein(angular: Array, points: Array, n: int, *, power: int) -> float:
    """Return Σ C_n^m(p) |p|^(−n − power) over the points p ≠ 0 of the integer lattice.

    The sum is an Epstein zeta function; Ewald's split of the theta function makes it a sum over the
    lattice and one over its reciprocal, which is the lattice itself, both of which fall like exp(−π
    |p|²).

    Args:
        angular: C_n^m at the k lattice points near the origin, shape (k,).
        points: These points, shape (k, 3).
        n: Degree of the harmonic, even and at least 4.
        power: 1 for harmonic multipoles, −1 for biharmonic ones.
    """
    square = (points**2).sum(axis=1)
    s = n + power / 2
    x = np.pi * square
    direct = angular @ (square ** (-(n + power) / 2) * gammaincc(s, x))
    # Incomplete gamma functions of the sum over the reciprocal lattice: Γ(1, x)/x or Γ(2, x)/x².
    gamma = np.exp(-x) * (1 / x if power == 1 else (1 + x) / x**2)
    scale = (-1) ** (n // 2) * np.exp(s * np.log(np.pi) - gammaln(s))
    return float(direct + scale * (angular * square ** (n / 2)) @ gamma)
