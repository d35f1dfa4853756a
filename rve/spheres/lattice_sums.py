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
    """Return the real parts of Racah's C_n^m of the directions of points, m being `order`.

    Args:
        points: Points other than the origin, shape (k, 3).
        highest: Highest degree n.
        order: Order m.

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
    """Return the sums S_n^m and D_n^m up to a degree.

    By symmetry only even n ≥ 4 and orders that are multiples of 4 are not zero. The sums of degree
    0 diverge and are left out.
    """
    shape = highest + 1, highest + 1
    sums = LatticeSums(np.zeros(shape), np.zeros(shape))
    reach = 4  # of Ewald's sums: exp(−π 17) is the first term left out
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
    """Return Σ C_n^m(p) |p|^(−n − power) over the lattice, by Ewald's split.

    Args:
        angular: C_n^m at lattice points near the origin.
        points: These points.
        n: Degree.
        power: 1 or −1.
    """
    square = (points**2).sum(axis=1)
    s = n + power / 2
    x = np.pi * square
    direct = angular @ (square ** (-(n + power) / 2) * gammaincc(s, x))
    # the reciprocal lattice is the lattice itself: Γ(1, x)/x or Γ(2, x)/x²
    gamma = np.exp(-x) * (1 / x if power == 1 else (1 + x) / x**2)
    scale = (-1) ** (n // 2) * np.exp(s * np.log(np.pi) - gammaln(s))
    return float(direct + scale * (angular * square ** (n / 2)) @ gamma)
