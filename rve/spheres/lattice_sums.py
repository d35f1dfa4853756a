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

import numpy as np
from scipy.special import gammaincc, gammaln

from alphacut.base.arrays import Array

_REACH = 4  # of Ewald's sums: exp(−π 17) is the first term left out


def harmonics(points: Array, highest: int, order: int) -> Array:
    """Real parts of Racah's C_n^m of the directions of k points, n up to `highest`, m = `order`.

    Shape (highest + 1, k); zero where n < m.
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


@cache
def lattice_sums(highest: int) -> tuple[Array, Array]:
    """Sums Σ C_n^m(p) |p|^(−n−1) and Σ C_n^m(p) |p|^(1−n) over the simple cubic lattice.

    By degree and order, (highest + 1, highest + 1) each; by symmetry only even n ≥ 4 and orders
    that are multiples of 4 are not zero. Those of degree 0 diverge and are left out.
    """
    harmonic, biharmonic = np.zeros((2, highest + 1, highest + 1))
    axis = np.arange(-_REACH, _REACH + 1.0)
    points = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
    square = (points**2).sum(axis=1)
    points = points[(square > 0) & (square <= _REACH * (_REACH + 1))]
    for m in range(0, highest + 1, 4):
        angular = harmonics(points, highest, m)
        for n in range(max(4, m), highest + 1, 2):
            harmonic[n, m] = _epstein(angular[n], points, n, 1)
            biharmonic[n, m] = _epstein(angular[n], points, n, -1)
    return harmonic, biharmonic


def _epstein(angular: Array, points: Array, n: int, power: int) -> float:
    """Σ C_n^m |p|^(−n−power), power ±1, from the C_n^m at lattice points p near the origin."""
    square = (points**2).sum(axis=1)
    s, x = n + power / 2, np.pi * square
    direct = angular @ (square ** (-(n + power) / 2) * gammaincc(s, x))
    # the reciprocal lattice is the lattice itself: Γ(1, x)/x or Γ(2, x)/x²
    gamma = np.exp(-x) * (1 / x if power == 1 else (1 + x) / x**2)
    scale = (-1) ** (n // 2) * np.exp(s * np.log(np.pi) - gammaln(s))
    return float(direct + scale * (angular * square ** (n / 2)) @ gamma)
