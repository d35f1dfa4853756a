"""Sums over the simple cubic lattice that couple one sphere to all its periodic images.

The lattice is p = (i, j, k) with integers, not all zero. With Racah's spherical harmonics C_n^m =
[(n − m)!/(n + m)!]^½ P_n^m(cos θ) exp(imφ), harmonic and biharmonic multipoles need

    S_n^m = Σ C_n^m(p) |p|^(−n−1),   D_n^m = Σ C_n^m(p) |p|^(1−n);

cubic symmetry leaves even n ≥ 4 and m = 0, 4, 8, …, all real. Up to n = 40 they are Epstein zeta
functions by Ewald's split of the theta function (Borwein et al., Lattice Sums Then and Now, 2013),
which also gives D_4, convergent only in the order of spheres; beyond, the nearest points suffice.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from scipy.special import gammaincc, gammaln

from alphacut.fuzzy.arrays import Array

_DIRECT = 40  # from this degree on, points beyond √11 are below round-off
_REACH = 4  # of Ewald's sums: exp(−π 17) is the first term left out


def harmonics(points: Array, highest: int, order: int) -> Array:
    """Real parts of Racah's C_n^m of directions, m = `order`, n = 0 … `highest`.

    Args:
        points: Shape (k, 3), none zero.
        highest: Largest degree n.
        order: m ≥ 0.

    Returns:
        Shape (highest + 1, k); zero where n < m.
    """
    radius = np.linalg.norm(points, axis=1)
    cosine = points[:, 2] / radius
    flat = (points[:, 0] + 1j * points[:, 1]) / radius  # sin θ exp(iφ)
    values = np.zeros((highest + 1, len(points)))
    if order > highest:
        return values
    factors = np.sqrt((2 * np.arange(1, order + 1) - 1) / (2 * np.arange(1, order + 1)))
    values[order] = (-1) ** order * np.prod(factors) * (flat**order).real
    for n in range(order + 1, highest + 1):
        before = np.sqrt((n - 1) ** 2 - order**2) * values[n - 2] if n > order + 1 else 0.0
        values[n] = ((2 * n - 1) * cosine * values[n - 1] - before) / np.sqrt(n**2 - order**2)
    return values


@cache
def lattice_sums(highest: int) -> tuple[Array, Array]:
    """S and D by degree and order, shape (highest + 1, highest + 1); zero where symmetry says so.

    Args:
        highest: Largest degree, at least 4.
    """
    harmonic, biharmonic = np.zeros((2, highest + 1, highest + 1))
    near, far = _points(_REACH), _points(3)
    for order in range(0, highest + 1, 4):
        ewald = harmonics(near, min(highest, _DIRECT), order)
        direct = harmonics(far, highest, order)
        for n in range(max(4, order), highest + 1, 2):
            if n <= _DIRECT:
                harmonic[n, order] = _epstein(ewald[n], near, n, 1)
                biharmonic[n, order] = _epstein(ewald[n], near, n, -1)
            else:
                radius = np.linalg.norm(far, axis=1)
                harmonic[n, order] = direct[n] @ radius ** (-n - 1.0)
                biharmonic[n, order] = direct[n] @ radius ** (1.0 - n)
    return harmonic, biharmonic


def _points(reach: int) -> Array:
    """Lattice points of length up to √(reach² + reach), none zero, shape (k, 3)."""
    axis = np.arange(-reach - 1.0, reach + 2)
    points = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
    square = (points**2).sum(axis=1)
    return np.asarray(points[(square > 0) & (square <= reach * (reach + 1))])


def _epstein(angular: Array, points: Array, n: int, power: int) -> float:
    """Σ C_n^m |p|^(−n−power), power 1 or −1, by Ewald's split at t = 1."""
    square = (points**2).sum(axis=1)
    s, x = n + power / 2, np.pi * square
    near = angular @ (square ** (-(n + power) / 2) * gammaincc(s, x))
    # the reciprocal lattice is the lattice itself: Γ(1, x)/x or Γ(2, x)/x²
    tail = np.exp(-x) * (1 / x if power == 1 else (1 + x) / x**2)
    scale = np.exp(s * np.log(np.pi) - gammaln(s))
    return float(near + (-1) ** (n // 2) * scale * (angular * square ** (n / 2)) @ tail)
