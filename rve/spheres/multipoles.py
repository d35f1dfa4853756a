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
from typing import NamedTuple

import numpy as np
from scipy.special import gammaln

from alphacut.base.arrays import Array
from alphacut.rve.series.means import Material
from alphacut.rve.spheres.lattice_sums import LatticeSums, lattice_sums

VOLUME = 8.0
"""Volume of the cell of side 2."""


@dataclass(frozen=True)
class Multipoles:
    """Vector multipoles that one load excites, in an order.

    Args:
        n: Degrees, shape (N,): even for solutions 1 and 3, odd for 2.
        m: Orders, not negative, shape (N,); the multipole of −m has the same amplitude or its
            negative.
        kind: Lamé solution 1, 2 or 3, shape (N,). Those of kinds 1 and 3 follow one another in the
            same order of n and m.
    """

    n: Array
    m: Array
    kind: Array

    @classmethod
    @lru_cache(maxsize=256)
    def up_to(cls, highest: int, *, shear: bool) -> Multipoles:
        """Return all multipoles up to a degree that a load excites, sorted by their kind.

        Args:
            highest: Highest degree n.
            shear: Whether the load is ε12, with the orders m = 2, 6, …; else it is axial, with 0,
                4, ….

        Returns:
            Degrees `n`, orders `m` and kinds `kind`, shape (N,) each. Kinds 1 and 3 have even n,
            from 2 on for ε12 and from 0 on else; kind 2 has odd n and m > 0. In each kind n rises,
            and m within it. Equal arguments give the same object.
        """
        first = 2 if shear else 0
        even = [(n, m) for n in range(first, highest + 1, 2) for m in range(first, n + 1, 4)]
        odd = [(n, m) for n in range(3, highest + 1, 2) for m in range(first or 4, n + 1, 4)]
        n, m = np.array(even + odd + even).T
        kind = np.repeat([1, 2, 3], [len(even), len(odd), len(even)])
        return cls(n, m, kind)

    def index_of(self, kind: int, n: int, m: int) -> int:
        """Return the index of one multipole."""
        return int(np.flatnonzero((self.kind == kind) & (self.n == n) & (self.m == m))[0])


@lru_cache(maxsize=96)  # as many Poisson ratios and degrees as a fuzzy modulus takes
def couplings(highest: int, poisson: complex, *, shear: bool) -> Array:
    """Return the regular amplitudes at one sphere by unit multipoles at all its periodic images.

    The displacement is expanded in solutions of Navier's equation of three kinds: 1 is the gradient
    of a solid harmonic, 2 is torsional, 3 has dilatation. Regular ones are finite at the centre of
    the sphere; singular ones, the multipoles, decay from it.

    Args:
        highest: Highest degree of the multipoles, at least 4.
        poisson: Poisson's ratio of the matrix, real or complex.
        shear: Whether the load is ε12; else hydrostatic or tetragonal strain.

    Returns:
        Matrix for spheres in a cell of side 2, with radius 1 as the unit of amplitudes: rows are
        the regular amplitudes, columns the multipoles, both in the order of
        `Multipoles.up_to(highest, shear=shear)`. Equal arguments give the same array, which must
        not be changed.
    """
    poles = Multipoles.up_to(highest, shear=shear)
    sums = lattice_sums(max(2 * highest, 4))
    coupling = np.zeros((poles.n.size, poles.n.size), np.result_type(poisson, float))
    for target, source in ((1, 1), (1, 2), (1, 3), (2, 2), (2, 3), (3, 3)):
        rows = np.flatnonzero(poles.kind == target)
        columns = np.flatnonzero(poles.kind == source)
        pair = _Pair(
            n=poles.n[np.newaxis, columns],
            m=poles.m[np.newaxis, columns],
            k=poles.n[rows, np.newaxis],
            j=poles.m[rows, np.newaxis],
        )
        of_m = _coupling(target, source, pair, poisson, sums)
        of_minus_m = _coupling(target, source, pair._replace(m=-pair.m), poisson, sums)
        # Multipoles of orders m and −m are listed once. By the symmetry of the load the one of −m
        # has the same amplitude or its negative: under axial loads the negative for torsion
        # (kind 2), under ε12 for the other kinds.
        is_opposite = (source == 2) != shear
        of_minus_m = np.where(pair.m > 0, -of_minus_m if is_opposite else of_minus_m, 0.0)
        coupling[np.ix_(rows, columns)] = of_m + of_minus_m

    # The sums of degree −2 are made periodic: their mean strain, that of Eshelby's polarised ball,
    # is taken off, and so is that of the periodic 1/r, whose Laplacian is 4π/V beside its poles.
    order = 2 if shear else 0
    polarised_ball = 16 * np.pi * (4 - 5 * poisson) / (15 * VOLUME)
    coupling[poles.index_of(1, 2, order), poles.index_of(3, 2, order)] -= polarised_ball
    if not shear:
        dilatation = 4 * np.pi / (6 * VOLUME * (1 - 2 * poisson))
        coupling[poles.index_of(3, 0, 0), poles.index_of(1, 0, 0)] -= dilatation
    return coupling


class HarmonicCouplings(NamedTuple):
    """Multipoles of Laplace's equation that a gradient along z excites, and what images add.

    Attributes:
        n: Degrees, odd, rising, shape (N,).
        coupling: Regular amplitudes at one sphere (rows) by unit multipoles at all its images
            (columns), for Racah's harmonics and a cell of side 2, shape (N, N).
    """

    n: Array
    coupling: Array


@lru_cache(maxsize=16)
def harmonic_couplings(highest: int) -> HarmonicCouplings:
    """Return the multipoles up to an odd degree, with the orders 0, 4, …, and their couplings.

    The multipole of the order −m has the same amplitude as that of m, and is not listed. Equal
    arguments give the same arrays, which must not be changed.
    """
    listed = [(n, m) for n in range(1, highest + 1, 2) for m in range(0, n + 1, 4)]
    n, m = np.array(listed).T
    sums = lattice_sums(2 * highest).harmonic
    pair = _Pair(n=n[np.newaxis], m=m[np.newaxis], k=n[:, np.newaxis], j=m[:, np.newaxis])
    of_m = _weighted_sum(sums, pair, 0)
    of_minus_m = np.where(pair.m > 0, _weighted_sum(sums, pair._replace(m=-pair.m), 0), 0.0)
    return HarmonicCouplings(n, of_m + of_minus_m)


class _Pair(NamedTuple):
    """Degrees and orders of a multipole (n, m) and of a regular solution (k, j); all broadcast."""

    n: Array
    m: Array
    k: Array
    j: Array


def _coupling(target: int, source: int, pair: _Pair, poisson: complex, sums: LatticeSums) -> Array:
    """Return the amplitudes of regular solutions of one kind by the images of unit multipoles.

    Solutions of Navier's equation are of kind 1 (gradient of a solid harmonic), 2 (torsional) or 3
    (with dilatation), as by Kushch (Micromechanics of Composites, 2013). An amplitude is a sum over
    the lattice, by the expansion of the images' irregular solid harmonics about the sphere, times a
    factor. The factors follow from the invariants div u, x·curl u and x·u of the displacement u,
    which tell the three kinds apart.

    Args:
        target: Kind of the regular solutions.
        source: Kind of the multipoles, at least `target`.
        pair: Degrees `n` and orders `m` of the multipoles, as a row, and `k`, `j` of the regular
            solutions, as a column.
        poisson: Poisson's ratio of the matrix.
        sums: Sums over the lattice of harmonic and of biharmonic multipoles, at [degree, order].

    Returns:
        Amplitudes, shape (regular solutions, multipoles). There is no regular solution of kind 1
        and degree k = 0: its amplitudes, 0 for the sources 1 and 3, do not matter.
    """
    n = pair.n
    k = np.maximum(pair.k, 1) if target == 1 else pair.k  # no division by the degree 0 of kind 1
    if target == source:
        factors = {1: pair.k > 0, 2: -n / (k + 1), 3: n * (2 * n - 1) / ((k + 1) * (2 * k + 3))}
        return np.asarray(factors[target] * _weighted_sum(sums.harmonic, pair, 0))
    if 2 in (target, source):  # by the ladder operators
        rotated = (n * pair.j + k * pair.m) * _weighted_sum(sums.harmonic, pair, -1)
        if target == 1:
            return np.asarray(-rotated / k)
        return np.asarray(4 * (2 * n - 1) * (1 - poisson) / (k * (k + 1)) * rotated)
    # A multipole of kind 3 is α_d r² ∇h + c_d x h with d = −n − 1: α_d = d + 5 − 4ν = 4 − 4ν − n
    # and c_d = −2 [3 d + 1 − 2ν (2 d + 1)] = 2 [3 n + 2 − 2ν (2 n + 1)].
    alpha = 4 - 4 * poisson - n
    c = 2 * (3 * n + 2 - 2 * poisson * (2 * n + 1))
    projection = (2 * alpha * (k - 1) + c) / (2 * (n + k) - 1)
    by_biharmonic = (alpha - projection) * 4 * _weighted_sum(sums.biharmonic, pair, 0)
    factor = projection / (k * (2 * k - 1)) * _projection_factor(pair)
    by_harmonic = factor * _weighted_sum(sums.harmonic, pair, -2)
    return np.where(pair.k > 0, by_biharmonic - by_harmonic, 0.0)


def _weighted_sum(sums: Array, pair: _Pair, lower: int) -> Array:
    """Return a lattice sum of irregular solid harmonics, with the weights of a pair of multipoles.

    It is Σ_P f_N^M(P) (−1)^n w_N^M/(w_n^m w_k^j) with N = n + k + `lower` and M = m − j. The f_N^M
    are irregular solid harmonics at P = 2p, and w_n^m = √((n − m)! (n + m)!) makes them Racah's,
    whose sums over the integer lattice p are known.

    Args:
        sums: Lattice sums at the indices [N, |M|], up to the largest N.
        pair: Degrees n, k and orders m, j, in shapes that broadcast to that of the result.
        lower: 0, −1 or −2.

    Returns:
        The sums in that shape; 0 where N < |M| or N < 0.
    """
    degree = pair.n + pair.k + lower
    order = abs(pair.m - pair.j)
    exists = (order <= degree) & (degree >= 0)
    degree = np.where(exists, degree, 0)
    order = np.where(exists, order, 0)
    weight = _log_weight(degree, order) - _log_weight(pair.n, pair.m) - _log_weight(pair.k, pair.j)
    value = np.exp(weight - (degree + 1) * np.log(2)) * sums[degree, order]
    return np.where(exists, np.where(pair.n % 2, -value, value), 0.0)


def _log_weight(n: Array, m: Array) -> Array:
    """Return the logarithm of √((n − m)! (n + m)!)."""
    return np.asarray((gammaln(n - m + 1) + gammaln(n + m + 1)) / 2)


def _projection_factor(pair: _Pair) -> Array:
    """Return a factor in the harmonic part of degree k of (x·P) F, for the image P of a multipole.

    F is the irregular solid harmonic (n, m) about the point P, expanded in regular ones of the
    position x about the origin. The product x·P F is no longer harmonic; its part of degree k, made
    harmonic, holds the irregular solid harmonic f_{n+k-2}^{m-j} at P times this result over (2k −
    1)(2n + 2k − 1).

    Args:
        pair: Degrees n, k and orders m, j, in shapes that broadcast to that of the result.
    """
    degree = pair.n + pair.k - 1
    order = pair.m - pair.j
    p = pair.k - pair.j
    q = pair.k + pair.j
    a = degree - order
    b = degree + order
    sides = q * (q - 1) * b * (b + 1) + p * (p - 1) * a * (a + 1)
    return np.asarray(1.0 * p * q * a * b - sides / 2)


class TMatrices(NamedTuple):
    """T-matrices of a sphere of radius 1: singular amplitudes = T @ regular amplitudes.

    Attributes:
        pair: Blocks of the coupled solutions 1 and 3, shape (k, 2, 2); rows are singular, columns
            regular amplitudes.
        torsion: Factors of solution 2, shape (l,).
    """

    pair: Array
    torsion: Array

    def apply(self, regular: Array) -> Array:
        """Return the singular amplitudes of a sphere by regular ones.

        The rows of both are multipoles of kinds 1, then 2, then 3, with the degrees that these
        T-matrices were made for.

        Args:
            regular: Regular amplitudes, shape (…, N multipoles, columns).

        Returns:
            New array in the shape of `regular`.
        """
        ends = [len(self.pair), len(self.pair) + self.torsion.size]
        first, second, third = np.split(regular, ends, axis=-2)
        pair = self.pair[..., np.newaxis]
        singular = (
            pair[:, 0, 0] * first + pair[:, 0, 1] * third,
            self.torsion[:, np.newaxis] * second,
            pair[:, 1, 0] * first + pair[:, 1, 1] * third,
        )
        return np.concatenate(singular, axis=-2)


def t_matrices(degrees: Array, matrix: Material, inclusion: Material) -> TMatrices:
    """Return what a sphere of radius 1 makes of incoming regular fields: its T-matrices.

    Kinds of solutions of Navier's equation are numbered as by Kushch (2013): 1 is the gradient of a
    harmonic, 2 torsional, 3 the one with dilatation. On the sphere kinds 1 and 3 have displacements
    and tractions along x Y and ∇Y, with the spherical harmonic Y, and kind 2 along x × ∇Y alone. So
    continuity gives a system of 2 × 2 for each degree, whatever the order m. The inclusion may be
    as soft as a pore or as stiff as a rigid sphere.

    Args:
        degrees: Degrees n of the spherical harmonics, whole numbers from 0, shape (k,).
        matrix: Material outside.
        inclusion: Material of the sphere.

    Returns:
        `pair`, from regular to singular amplitudes of kinds 1 and 3, shape (k, 2, 2) with singular
        ones as rows; and `torsion`, the factors of kind 2, shape (k,).
    """
    n = np.asarray(degrees, float)
    ratio = inclusion.bulk_and_shear[1] / matrix.bulk_and_shear[1]
    # Weights of the tractions outside and inside: their ratio is that of the shear moduli, and both
    # stay finite for pores and rigid spheres.
    outside = 1 / (1 + ratio)
    inside = ratio / (1 + ratio)
    displacement, traction = _surface_fields(n, inclusion.poisson)
    # For n = 0 solution 1 is ∇1, no displacement: this keeps the matrix invertible.
    displacement[n == 0, 1, 0] = 1.0
    stiffness = traction @ np.linalg.inv(displacement)  # traction over μ of the solid sphere

    def traction_mismatch(degree: Array) -> Array:
        """Return the traction outside less that inside, (k, 2, 2), for equal displacements."""
        displacement, traction = _surface_fields(degree, matrix.poisson)
        return outside * traction - inside * stiffness @ displacement

    # The mismatch of the singular waves (degree −n − 1) and that of the regular ones (degree n)
    # must vanish together: singular @ T = regular.
    singular = traction_mismatch(-n - 1)
    regular = -traction_mismatch(n)
    # Of degree 0 there are the singular solution 1 and the regular solution 3 alone.
    is_radial = n == 0
    singular[is_radial, :, 1] = 0.0
    singular[is_radial, 1, :] = 0.0
    singular[is_radial, 1, 1] = 1.0
    regular[is_radial, 1, :] = 0.0
    torsion_sum = np.where(is_radial, 1.0, (n + 2) * outside + (n - 1) * inside)
    torsion = np.where(is_radial, 0.0, (n - 1) * (outside - inside) / torsion_sum)
    return TMatrices(np.asarray(np.linalg.solve(singular, regular)), np.asarray(torsion))


def _surface_fields(degree: Array, poisson: complex) -> tuple[Array, Array]:
    """Return displacements and tractions of the Lamé solutions 1 and 3 on the unit sphere.

    With a solid harmonic h of degree d and Y its values on the sphere, solution 1 is ∇h and
    solution 3 is α r² ∇h + c x h with α = d + 5 − 4ν and c = −2 [3 d + 1 − 2ν (2 d + 1)].

    Args:
        degree: Degrees d, shape (k,): n of regular and −n − 1 of singular solutions.
        poisson: Poisson's ratio ν.

    Returns:
        Displacements, and tractions over the shear modulus, shape (k, 2, 2) each: rows are the
        components along x Y and ∇Y, columns the solutions 1 and 3.
    """
    d = degree
    alpha = d + 5 - 4 * poisson
    radial = d * alpha - 2 * (3 * d + 1 - 2 * poisson * (2 * d + 1))  # α d + c
    dilatation = -4 * poisson * (d + 1) * (2 * d + 3)  # λ/μ div u
    displacement = np.array([[d, radial], [np.ones_like(d), alpha]])
    traction = np.array(
        [[2 * (d - 1) * d, dilatation + (2 * d + 2) * radial], [2 * (d - 1), radial + d * alpha]]
    )
    return np.moveaxis(displacement, -1, 0), np.moveaxis(traction, -1, 0)
