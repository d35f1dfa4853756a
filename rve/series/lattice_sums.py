"""Sums over the square lattice that couple one particle to all its periodic images.

The lattice is P = 2 (m + i n) with integers m and n that are not both zero; the cell has side 2. By
symmetry only two families of sums do not vanish: Σ P^-n for n = 4, 8, 12, … and Σ conj(P) P^-n for
n = 7, 11, 15, …. The sums Σ P^-2 and Σ conj(P) P^-3 converge conditionally and are left out, as in
Weierstrass' ζ and Natanzon's Q. What is left out is linear in z and part of the far field.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property
from math import lgamma
from typing import ClassVar

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.rve.cell.cell import AREA


@dataclass(frozen=True)
class LatticeSums:
    """Lattice sums over p = P/2, which are of order one.

    Args:
        plain: Σ p^-n at index n.
        conjugate: Σ conj(p) p^-n at index n.
    """

    plain: Array
    conjugate: Array

    # Factor of conj(P) in the jump ζ(z + P) − ζ(z) of Weierstrass' function over a period P, by
    # Legendre's relation on the square lattice.
    ZETA_PERIOD: ClassVar[float] = np.pi / AREA

    @cached_property
    def natanzon_period(self) -> float:
        """Constant g in the jump Q(z + P) − Q(z) = conj(P) ℘(z) + g P of Natanzon's function Q.

        Q is Σ_P conj(P) [(z − P)^-2 − P^-2 − 2 z P^-3] over the images P = 2p ≠ 0, ℘ Weierstrass'
        function, and P in the jump any period. The constant follows at z = −1 with P = 2, since Q
        is odd and ℘ is even: 2 Q(1) = 2 ℘(1) + 2 g. Both are power series in z, with the sums Σ
        p^-n of `self.plain` and Σ conj(p) p^-n of `self.conjugate`.
        """
        n = np.arange(2, len(self.plain))
        half = 0.5**n
        Q_at_1 = np.sum((n - 1) * 2 * half * self.conjugate[2:])
        weierstrass_at_1 = 1 + np.sum((n - 1) * half * self.plain[2:])
        return float(Q_at_1 - weierstrass_at_1)


@cache
def lattice_sums(highest: int) -> LatticeSums:
    """Return Σ p^-n and Σ conj(p) p^-n over all p = m + i j ≠ 0 with integers m and j.

    For n < 40 the row j = 0 is summed by Riemann's ζ, and the other rows by Lipschitz' formula. In
    the second sum conj(p) is p − 2 i j, of which Σ p^(1−n) vanishes. For larger n the points near 0
    are enough.

    Args:
        highest: Largest exponent n.

    Returns:
        `plain`, Σ p^-n, and `conjugate`, Σ conj(p) p^-n, at the index n, shape (highest + 1,) each.
        Both are real. By symmetry the first is zero but for n = 4, 8, …, the second but for n = 7,
        11, …; its entry n = 3, which converges conditionally, is set to 0. Equal arguments give the
        same arrays, which must not be changed.
    """
    plain = np.zeros(highest + 1)
    conjugate = np.zeros(highest + 1)
    for n in range(4, min(highest + 1, 40), 4):
        plain[n] = 2 * (_zeta(n) + _lipschitz(n, 1))
    for n in range(7, min(highest + 1, 40), 4):
        conjugate[n] = 4 * _lipschitz(n, 2)
    plain[40::4] = _near_points(np.arange(40, highest + 1, 4), conjugate=False)
    conjugate[43::4] = _near_points(np.arange(43, highest + 1, 4), conjugate=True)
    return LatticeSums(plain, conjugate)


def lattice_images(sums: Array, k: Ints, n: Ints) -> Array:
    """Return Taylor coefficients at 0 of Σ_P (z − P)^-n over all periodic images P ≠ 0.

    For odd n the coefficient of z^k is −binomial(n + k − 1, k) Σ P^(−n−k), with P = 2 p and p over
    the integer lattice.

    Args:
        sums: Σ p^-N by its exponent N, shape (max(k) + max(n) + 1 or more,). With Σ conj(p) p^-N in
            its place and even n, the result is minus the coefficients of Σ conj(P)/2 (z − P)^-n.
        k: Orders of the coefficients, at least 0, shape (K,).
        n: Orders n, at least 1, shape (N,).

    Returns:
        Coefficients, shape (K, N).
    """
    k = k[:, None]
    n = n[None, :]
    # ln Γ at whole numbers by the standard library: SciPy's functions take .12 s to import, a tenth
    # of the time of a sample. Logarithms keep binomials of hundreds within range.
    log_gamma = np.array([0.0] + [lgamma(x) for x in range(1, int(n.max() + k.max()) + 2)])
    log_binomial = log_gamma[n + k] - log_gamma[n] - log_gamma[k + 1]
    return np.asarray(-np.exp(log_binomial - (n + k) * np.log(2)) * sums[n + k])


def _zeta(n: int) -> float:
    """Return Riemann's ζ(n) for a whole number n ≥ 4, by the formula of Euler and Maclaurin.

    To the sum of x^-n over x < 100 are added ∫ x^-n dx from 100 on, half the term x = 100, and two
    corrections. The error is at most the third correction, n (n + 1) … (n + 4) 100^(−n−5) / 30240 <
    3e-19.
    """
    last = 100.0
    head = float(np.sum(np.arange(last - 1, 0, -1) ** -float(n)))
    tail = last ** (1 - n) / (n - 1) + last**-n / 2 + n * last ** (-n - 1) / 12
    return head + tail - n * (n + 1) * (n + 2) * last ** (-n - 3) / 720


def _lipschitz(n: int, power: int) -> float:
    """Return Σ_q (2π)^n q^(n−1) / (n−1)! · e^(−2πq) / (1 − e^(−2πq))^power over q = 1, 2, ….

    Lipschitz' formula turns the sum over all rows of the lattice into this one. Terms beyond q = 39
    are below rounding for n < 40.

    Args:
        n: Exponent of the lattice sum, from 4 to 39.
        power: 1 for Σ p^-n over the rows, 2 for Σ j p^-n, where j numbers the rows.
    """
    q = np.arange(1.0, 40.0)
    logarithm = n * np.log(2 * np.pi) - lgamma(n) + (n - 1) * np.log(q) - 2 * np.pi * q
    return float(np.sum(np.exp(logarithm) / (1 - np.exp(-2 * np.pi * q)) ** power))


def _near_points(n: Ints, *, conjugate: bool) -> Array:
    """Return Σ p^-n, or Σ conj(p) p^-n, over all lattice points p = m + i j ≠ 0, for large n.

    Points with |m| ≤ 2 and |j| ≤ 2 are enough. Each of the 8 k points with max(|m|, |j|) = k adds
    at most k^(1 − n), so that all with k ≥ 3 add less than 8 Σ k^-38 < 6e-18 to a sum of about 4.

    Args:
        n: Exponents, at least 40, shape (N,).
        conjugate: Whether the terms have the factor conj(p).

    Returns:
        The sums, shape (N,).
    """
    m = np.arange(-2.0, 3.0)
    p = (m[:, np.newaxis] + 1j * m).ravel()
    p = p[p != 0]
    terms = p ** -n[:, np.newaxis].astype(float)
    if conjugate:
        terms = p.conj() * terms
    return np.asarray(terms.sum(axis=1).real)
