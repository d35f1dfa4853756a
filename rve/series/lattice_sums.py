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

from alphacut.base.arrays import Array, Ints
from alphacut.rve.cell.cell import AREA

# ζ(z + P) − ζ(z) = π conj(P) / area: Legendre's relation on the square lattice
ZETA_PERIOD = np.pi / AREA


@dataclass(frozen=True)
class LatticeSums:
    """Σ p^-n and Σ conj(p) p^-n at index n, over p = P/2 so that they stay of order one."""

    plain: Array
    conjugate: Array

    @cached_property
    def natanzon_period(self) -> float:
        """Constant g in Natanzon's Q(z + P) − Q(z) = conj(P) ℘(z) + g P with Weierstrass' ℘.

        From z = −1 and P = 2, where Q is odd and ℘ even.
        """
        n = np.arange(2, len(self.plain))
        half = 0.5**n
        Q_at_1 = np.sum((n - 1) * 2 * half * self.conjugate[2:])
        weierstrass_at_1 = 1 + np.sum((n - 1) * half * self.plain[2:])
        return float(Q_at_1 - weierstrass_at_1)


@cache
def lattice_sums(highest: int) -> LatticeSums:
    """Sums Σ p^-n and Σ conj(p) p^-n over p = m + i j ≠ 0 for n ≤ `highest`, from 60 on."""
    plain, conjugate = np.zeros(highest + 1), np.zeros(highest + 1)
    for n in range(4, highest + 1, 4):
        # Σ p^-n by Riemann's ζ and Lipschitz' formula
        plain[n] = 2 * (zeta(n) + _lipschitz(n, 1)) if n < 40 else _near_points(n, conjugate=False)
    for n in range(7, highest + 1, 4):
        # Σ conj(p) p^-n with conj(p) = p − 2 i j, where Σ p^(1−n) vanishes
        conjugate[n] = 4 * _lipschitz(n, 2) if n < 40 else _near_points(n, conjugate=True)
    return LatticeSums(plain, conjugate)


def lattice_images(sums: Array, k: Ints, n: Ints) -> Array:
    """Taylor coefficients k of Σ (z − P)^-n over all images P ≠ 0, odd n, (len(k), len(n)).

    From `LatticeSums.plain`; from `LatticeSums.conjugate` those of Σ conj(P)/2 (z − P)^-n, even n,
    with the opposite sign.
    """
    k, n = k[:, None], n[None, :]
    log_binomial = gammaln(n + k) - gammaln(n) - gammaln(k + 1)
    return np.asarray(-np.exp(log_binomial - (n + k) * np.log(2)) * sums[n + k])  # P = 2p


def _lipschitz(n: int, power: int) -> float:
    """Σ_q (2π)^n q^(n−1) / (n−1)! · e^(−2πq) / (1 − e^(−2πq))^power, by Lipschitz' formula."""
    q = np.arange(1.0, 40.0)
    logarithm = n * np.log(2 * np.pi) - gammaln(n) + (n - 1) * np.log(q) - 2 * np.pi * q
    return float(np.sum(np.exp(logarithm) / (1 - np.exp(-2 * np.pi * q)) ** power))


def _near_points(n: int, *, conjugate: bool) -> float:
    """Return Σ p^-n, or Σ conj(p) p^-n, over all lattice points p = m + i j ≠ 0, for n ≥ 40.

    Points with |m| ≤ 2 and |j| ≤ 2 are enough. Each of the 8 k points with max(|m|, |j|) = k adds
    at most k^(1 − n), so that all with k ≥ 3 add less than 8 Σ k^-38 < 6e-18 to a sum of about 4.
    """
    m = np.arange(-2.0, 3.0)
    p = (m[:, np.newaxis] + 1j * m).ravel()
    p = p[p != 0]
    factors = p.conj() if conjugate else 1
    return float(np.sum(factors * p ** -float(n)).real)
