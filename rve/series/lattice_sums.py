"""Sums over a lattice that couple one particle to all its periodic images.

The lattice P = 2p is symmetric about the x axis, and its nearest points are 2 apart: it is square,
rectangular or hexagonal. Then Σ p^-n vanishes for odd n, Σ conj(p) p^-n for even n, and all sums
are real. On the square only every second one of these does not vanish, on the hexagonal lattice
every third.

Σ p^-2 and Σ conj(p) p^-3 converge conditionally. They are taken here in the limit of the factor
|p|^-2s for s → 0 (Hecke), so that no direction is preferred.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from math import lgamma

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.rve.cell.lattice import Lattice


@dataclass(frozen=True)
class LatticeSums:
    """Lattice sums over p = P/2, which are of order one, with the number of the far field.

    With these sums Σ (z − P)^-1, whose Taylor coefficients are −Σ P^-n, jumps by `zeta_period`
    conj(P) over a period P (Legendre's relation), and Σ conj(P) (z − P)^-2 by conj(P) Σ (z − P)^-2.

    Args:
        plain: Σ p^-n at index n.
        conjugate: Σ conj(p) p^-n at index n.
        zeta_period: π over the area of the cell.
    """

    plain: Array
    conjugate: Array
    zeta_period: float


@cache
def lattice_sums(highest: int, lattice: Lattice) -> LatticeSums:
    """Return Σ p^-n and Σ conj(p) p^-n over all p = P/2 ≠ 0 of a lattice.

    With p = v (m + j τ), where v is the shorter half vector, the row j = 0 is summed for n
    < 40 by Riemann's ζ, and the other rows by Lipschitz' formula. In the second sum conj(p) is p −
    2 i v j Im τ but for the sign. For larger n the points near 0 are enough.

    Args:
        highest: Largest exponent n, at least 3.
        lattice: The cell, symmetric about x1, with the nearest particles 2 apart.

    Returns:
        `plain`, Σ p^-n, and `conjugate`, Σ conj(p) p^-n, at the index n, shape (highest + 1,) each,
        and π over the area of the cell. Equal arguments give the same arrays, which must not be
        changed.
    """
    shorter, longer = [complex(*vector) for vector in lattice.half_vectors[:2]]
    if abs(shorter) > 1:
        shorter, longer = longer, shorter
    tau = longer / shorter
    height = abs(tau.imag)
    # e^(2πi τ), which is real for rectangles and for the hexagonal lattice, where Re τ is 1/2.
    nome = np.cos(2 * np.pi * tau.real) * np.exp(-2 * np.pi * height)
    plain = np.zeros(highest + 1)
    conjugate = np.zeros(highest + 1)
    for n in range(2, min(highest + 1, 40), 2):
        plain[n] = 2 * _zeta(n) + 2 * (-1) ** (n // 2) * _lipschitz(n, 1, nome)
    for n in range(3, min(highest + 1, 40), 2):
        rows = 4 * height * (-1) ** ((n + 1) // 2) * _lipschitz(n, 2, nome)
        conjugate[n] = plain[n - 1] + rows
    # What the rows, summed one after the other, lack of the limit of Hecke: the factor |p|^-2s
    # leaves of each row j an integral of order s/|j Im τ|^(1 + 2s), whose sum over j is finite.
    plain[2] -= np.pi / height
    conjugate[3] -= np.pi / (2 * height)
    # The lattice is turned by the argument of v, which is 0 or a right angle.
    orders = np.arange(highest + 1)
    plain *= (shorter**-orders).real
    conjugate *= (shorter ** -(orders + 1)).real
    plain[40::2] = _near_points(orders[40::2], shorter, longer, conjugate=False)
    conjugate[41::2] = _near_points(orders[41::2], shorter, longer, conjugate=True)
    return LatticeSums(plain, conjugate, np.pi / lattice.area)


def lattice_images(sums: Array, k: Ints, n: Ints) -> Array:
    """Return Taylor coefficients at 0 of Σ_P (z − P)^-n over all periodic images P ≠ 0.

    For odd n the coefficient of z^k is −binomial(n + k − 1, k) Σ P^(−n−k), with P = 2 p.

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
    """Return Riemann's ζ(n) for a whole number n ≥ 2, by the formula of Euler and Maclaurin.

    To the sum of x^-n over x < 100 are added ∫ x^-n dx from 100 on, half the term x = 100, and two
    corrections. The error is at most the third correction, n (n + 1) … (n + 4) 100^(−n−5) / 30240 ≤
    3e-16.
    """
    last = 100.0
    head = float(np.sum(np.arange(last - 1, 0, -1) ** -float(n)))
    tail = last ** (1 - n) / (n - 1) + last**-n / 2 + n * last ** (-n - 1) / 12
    return head + tail - n * (n + 1) * (n + 2) * last ** (-n - 3) / 720


def _lipschitz(n: int, power: int, nome: float) -> float:
    """Return Σ_q (2π)^n q^(n−1) / (n−1)! · w^q / (1 − w^q)^power over q = 1, 2, ….

    Lipschitz' formula turns the sum over all rows of the lattice into this one. Terms beyond q = 39
    are below rounding for n < 40 and |w| ≤ exp(−π √3).

    Args:
        n: Exponent of the lattice sum, from 2 to 39.
        power: 1 for Σ p^-n over the rows, 2 for Σ j p^-n, where j numbers the rows.
        nome: w = e^(2πi τ), real, with the period τ from a row to the next.
    """
    q = np.arange(1.0, 40.0)
    logarithm = n * np.log(2 * np.pi) - lgamma(n) + (n - 1) * np.log(q) + q * np.log(abs(nome))
    signs = np.sign(nome) ** q
    return float(np.sum(signs * np.exp(logarithm) / (1 - nome**q) ** power))


def _near_points(n: Ints, first: complex, second: complex, *, conjugate: bool) -> Array:
    """Return Σ p^-n, or Σ conj(p) p^-n, over all p = m first + j second ≠ 0, for large n.

    Points with |m| ≤ 2 and |j| ≤ 2 are enough: all others are at least √7 away, and add less than
    1e-15 to a sum of 2 or more.

    Args:
        n: Exponents, at least 40, shape (N,).
        first: Half of the shortest vector of the lattice, of length 1.
        second: Half of another one.
        conjugate: Whether the terms have the factor conj(p).

    Returns:
        The sums, shape (N,).
    """
    steps = np.arange(-2.0, 3.0)
    p = (steps[:, np.newaxis] * first + steps * second).ravel()
    p = p[p != 0]
    terms = p ** -n[:, np.newaxis].astype(float)
    if conjugate:
        terms = p.conj() * terms
    return np.asarray(terms.sum(axis=1).real)
