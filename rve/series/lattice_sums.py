"""Sums over the square lattice that couple one particle to all its periodic images.

The lattice is P = 2(m + i n) with integers m, n, not both zero: the cell has side 2. Only two
families do not vanish by symmetry, Σ P^-n for n = 4, 8, 12, … and Σ conj(P) P^-n for n = 7, 11, 15,
…. The conditionally convergent Σ P^-2 and Σ conj(P) P^-3 are left out, as in Weierstrass' ζ and
Natanzon's Q; what that leaves out is linear in z and lands in the far-field terms.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
from scipy.special import gammaln, zeta

from alphacut.fuzzy.arrays import Array, Rows
from alphacut.rve.cell import AREA

# ζ(z + P) − ζ(z) = π conj(P) / area: Legendre's relation on the square lattice
ZETA_PERIOD = np.pi / AREA
_UNIT_POINTS = 208  # exponent from which |p| ≥ √2 leaves less than 1e-30


@dataclass(frozen=True)
class LatticeSums:
    """Lattice sums by exponent, over p = P/2 so that they stay of order one.

    Args:
        plain: Σ p^-n at index n, shape (highest + 1,); zero where symmetry or convention makes it
            so.
        conjugate: Σ conj(p) p^-n at index n, same shape.
    """

    plain: Array
    conjugate: Array

    @cached_property
    def natanzon_period(self) -> float:
        """Constant g of Q(z + P) − Q(z) = conj(P) ℘(z) + g P, from z = −1, P = 2."""
        n = np.arange(2, len(self.plain))
        half = 0.5**n
        natanzon = np.sum((n - 1) * 2 * half * self.conjugate[2:])  # Q(1)
        weierstrass = 1 + np.sum((n - 1) * half * self.plain[2:])  # ℘(1)
        return float(natanzon - weierstrass)


@cache
def lattice_sums(highest: int) -> LatticeSums:
    """Both families up to exponent `highest` ≥ 60, to round-off."""
    plain, conjugate = np.zeros(highest + 1), np.zeros(highest + 1)
    for n in range(4, highest + 1, 4):
        # Σ p^-n by Riemann's ζ and Lipschitz' formula
        plain[n] = 2 * (zeta(n) + _lipschitz(n, 1)) if n < 40 else _near_points(n, conjugate=False)
    for n in range(7, highest + 1, 4):
        # Σ conj(p) p^-n with conj(p) = p − 2 i j, where Σ p^(1−n) vanishes
        conjugate[n] = 4 * _lipschitz(n, 2) if n < 40 else _near_points(n, conjugate=True)
    return LatticeSums(plain, conjugate)


def lattice_images(sums: LatticeSums, k: Rows, n: Rows) -> Array:
    """Taylor coefficient k of Σ' (z − P)^-n for odd n, shape (len(k), len(n))."""
    k, n = k[:, None], n[None, :]
    halved = np.exp(
        gammaln(n + k) - gammaln(n) - gammaln(k + 1) - (n + k) * np.log(2)
    )  # binomial over 2^(n + k)
    return np.asarray(-halved * sums.plain[n + k])


def _lipschitz(n: int, power: int) -> float:
    """Σ_q (2π)^n q^(n−1) / (n−1)! · e^(−2πq) / (1 − e^(−2πq))^power, by Lipschitz' formula."""
    q = np.arange(1.0, 40.0)
    logarithm = n * np.log(2 * np.pi) - gammaln(n) + (n - 1) * np.log(q) - 2 * np.pi * q
    return float(np.sum(np.exp(logarithm) / (1 - np.exp(-2 * np.pi * q)) ** power))


def _near_points(n: int, *, conjugate: bool) -> float:
    """Direct sum over |m|, |j| ≤ 8; the rest is below round-off, later all but |p| = 1."""
    if n >= _UNIT_POINTS:
        return 4.0
    m = np.arange(-8.0, 9.0)
    p = (m[:, None] + 1j * m).ravel()
    p = p[p != 0]
    return float(np.sum((p.conj() if conjugate else 1) * p ** -float(n)).real)
