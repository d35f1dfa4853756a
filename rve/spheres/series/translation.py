"""Couplings of vector multipoles on the simple cubic lattice: what all images do at one sphere.

With a solid harmonic h of degree d (n inside, −n − 1 outside) Navier's equation has three Lamé
solutions (Kushch, Micromechanics of Composites, 2013, ch. 2 and 4, in his sense)

    1: ∇h,   2: i x × ∇h,   3: α_d r² ∇h + c_d x h,
    α_d = d + 5 − 4ν,   c_d = −2 [3d + 1 − 2ν (2d + 1)].

A multipole (n, m) about a lattice point P is there, by F = f_n^m(x − P) = Σ_k F_k and three
invariants of the displacement, div u, x·curl u and x·u, a sum of regular solutions (k, j). Euler's
theorem gives (P·∇F)_k = (n + k + 1) F_k, the ladder operators give

    [P·(x × ∇F)]_k^j ∝ (n j + k m) f_{n+k-1}^{m-j}(P),
    H[(x·P) F]_k = k (P² F)_k / (2n + 2k − 1) + (a term with f_{n+k-2}^{m-j}(P)).

Two sums converge on the order of summation alone: those of degree −2 about each other. They are
made periodic; then the macroscopic strain is the jump of the far field across the cell.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.special import gammaln

from alphacut.fuzzy.arrays import Array
from alphacut.rve.spheres.series.lattice_sums import lattice_sums

VOLUME = 8.0  # of the cell of side 2


@dataclass(frozen=True)
class Multipoles:
    """Vector multipoles that one load excites, in an order.

    Args:
        n: Degrees, shape (N,): even for solutions 1 and 3, odd for 2.
        m: Orders, not negative, shape (N,); the multipole of −m has the same amplitude or its
            negative.
        kind: Lamé solution 1, 2 or 3, shape (N,). Places of kinds 1 and 3 follow one another in the
            same order of n and m.
    """

    n: Array
    m: Array
    kind: Array

    @classmethod
    def up_to(cls, highest: int, *, shear: bool) -> Multipoles:
        """Those up to degree `highest`: m = 0, 4, … of axial loads, m = 2, 6, … of ε12."""
        first = 2 if shear else 0
        even = [(n, m) for n in range(first, highest + 1, 2) for m in range(first, n + 1, 4)]
        odd = [(n, m) for n in range(3, highest + 1, 2) for m in range(first or 4, n + 1, 4)]
        rows = [(*p, kind) for kind, orders in ((1, even), (2, odd), (3, even)) for p in orders]
        return cls(*np.array(rows).T)

    def index_of(self, kind: int, n: int, m: int) -> int:
        """Index of one multipole."""
        return int(np.flatnonzero((self.kind == kind) & (self.n == n) & (self.m == m))[0])


@lru_cache(maxsize=96)  # as many Poisson ratios and degrees as a fuzzy modulus takes
def couplings(highest: int, poisson: float, *, shear: bool) -> Array:
    """Amplitudes of regular solutions (rows) that the images of unit multipoles (columns) make.

    Args:
        highest: Largest degree n.
        poisson: Poisson's ratio of the matrix.
        shear: Whether the load is ε12; else ε11, ε22 or ε33.

    Returns:
        In the order of `Multipoles.up_to`, at r = 1, shape (N, N).
    """
    poles = Multipoles.up_to(highest, shear=shear)
    sums = lattice_sums(max(2 * highest, 4))
    coupling = np.zeros((poles.n.size, poles.n.size))
    for to, source in ((1, 1), (1, 2), (1, 3), (2, 2), (2, 3), (3, 3)):
        rows, columns = np.flatnonzero(poles.kind == to), np.flatnonzero(poles.kind == source)
        k, j = poles.n[rows, None], poles.m[rows, None]
        n, m = poles.n[None, columns], poles.m[None, columns]
        mirror = (-1.0 if source == 2 else 1.0) * (-1.0 if shear else 1.0) * (m > 0)
        coupling[np.ix_(rows, columns)] = _coupling(to, source, _Pair(n, m, k, j), poisson, sums)
        coupling[np.ix_(rows, columns)] += mirror * _coupling(
            to, source, _Pair(n, -m, k, j), poisson, sums
        )
    return _made_periodic(coupling, poles, poisson, shear=shear)


@dataclass(frozen=True)
class _Pair:
    """A multipole (n, ±m) and a regular solution (k, j); both broadcast."""

    n: Array
    m: Array
    k: Array
    j: Array


def _coupling(to: int, source: int, at: _Pair, poisson: float, sums: tuple[Array, Array]) -> Array:
    """Amplitude of Lamé solution `to` by the images of solution `source`."""
    n, k = at.n, np.maximum(at.k, 1) if to == 1 else at.k
    if to == source:
        same = _scaled(sums[0], at, 0)
        factors = {1: at.k > 0, 2: -n / (k + 1), 3: n * (2 * n - 1) / ((k + 1) * (2 * k + 3))}
        return np.asarray(factors[to] * same)
    if 2 in (to, source):
        turned = (n * at.j + k * at.m) * _scaled(sums[0], at, -1)
        if to == 1:
            return np.asarray(-turned / k)
        return np.asarray(4 * (2 * n - 1) * (1 - poisson) / (k * (k + 1)) * turned)
    alpha, c = 4 - 4 * poisson - n, 2 * (3 * n + 2 - 2 * poisson * (2 * n + 1))
    tilt = (2 * alpha * (k - 1) + c) / (2 * (n + k) - 1)
    far = (alpha - tilt) * 4 * _scaled(sums[1], at, 0)
    lower = tilt / (k * (2 * k - 1)) * _lifted(at) * _scaled(sums[0], at, -2)
    return np.where(at.k > 0, far - lower, 0.0)


def _scaled(sums: Array, at: _Pair, lower: int) -> Array:
    """(−1)^n w_N^M / (w_n^m w_k^j) Σ f_N^M(P), N = n + k + `lower`, M = m − j, P = 2p.

    w_n^m = √((n − m)! (n + m)!) carries amplitudes of the ladder's harmonics to Racah's.
    """
    total, order = at.n + at.k + lower, abs(at.m - at.j)
    valid = (order <= total) & (total >= 0)
    total, order = np.where(valid, total, 0), np.where(valid, order, 0)
    weight = _log_weight(total, order) - _log_weight(at.n, at.m) - _log_weight(at.k, at.j)
    size = np.exp(weight - (total + 1) * np.log(2)) * sums[total, order]
    return np.where(valid, np.where(at.n % 2, -size, size), 0.0)


def _log_weight(n: Array, m: Array) -> Array:
    return np.asarray((gammaln(n - m + 1) + gammaln(n + m + 1)) / 2)


def _lifted(at: _Pair) -> Array:
    """Factor of f_{n+k-2}^{m-j}(P) in H[(x·P) F]_k, times (2k − 1)(2n + 2k − 1)."""
    degree, order, p, q = at.n + at.k - 1, at.m - at.j, at.k - at.j, at.k + at.j
    a, b = degree - order, degree + order
    sides = q * (q - 1) * b * (b + 1) + p * (p - 1) * a * (a + 1)
    return np.asarray(1.0 * p * q * a * b - sides / 2)


def _made_periodic(coupling: Array, poles: Multipoles, poisson: float, *, shear: bool) -> Array:
    """Add the uniform strain that gives the sums of degree −2 no mean strain."""
    m = 2 if shear else 0
    # of solution 3, a polarised ball: less its strain by Eshelby
    coupling[poles.index_of(1, 2, m), poles.index_of(3, 2, m)] -= (
        16 * np.pi * (4 - 5 * poisson) / (15 * VOLUME)
    )
    if not shear:  # the periodic 1/r has the Laplacian 4π/V besides its poles: strain 4π/(3V)
        coupling[poles.index_of(3, 0, 0), poles.index_of(1, 0, 0)] -= (
            4 * np.pi / (6 * VOLUME * (1 - 2 * poisson))
        )
    return coupling
