"""Displacements and stresses anywhere in the cell by the multipole series.

2μ (u1 + i u2) = κφ − z conj(φ') − conj(ψ), σ11 + σ22 = 4 Re φ', σ22 − σ11 + 2i σ12 = 2 (conj(z) φ''
+ ψ'). Of the images, the eight nearest are summed one by one, the others by their Taylor series
around the cell's centre, which converges everywhere in the cell.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaln

from alphacut.fuzzy.arrays import Array
from alphacut.rve.cell import Phase
from alphacut.rve.series.lattice_sums import ZETA_PERIOD, lattice_sums
from alphacut.rve.series.multipoles import LOADS, MOST_HARMONICS, Contrast, family, multipoles
from alphacut.rve.series.stiffness import square_stiffness

Complex = NDArray[np.complex128]
_TERMS = 60  # of the Taylor series of the far images; each is at most 0.48 of the one before
_NEAR = np.array([complex(x, y) for x in (-2, 0, 2) for y in (-2, 0, 2) if (x, y) != (0, 0)])


@dataclass(frozen=True)
class UnitLoad:
    """Coefficients of both phases' potentials under one unit strain; powers of z/r.

    Args:
        orders: Orders n of a_n and of the particle's ψ, and orders of b_n and of the particle's φ;
            shape (2, N).
        far: A and B.
        outside: a_n and b_n, shape (2, N).
        inside: Coefficients of the particle's φ (at the orders of b) and ψ (at those of a), shape
            (2, N).
    """

    orders: NDArray[np.int64]
    far: tuple[complex, complex]
    outside: Complex
    inside: Complex


@dataclass(frozen=True)
class SeriesField:
    """The elastic field of one cell.

    Args:
        radius: Radius of the particle over half the cell's side, in (0, 1).
        matrix: Material outside the particle.
        inclusion: Material of the particle.
    """

    radius: float
    matrix: Phase
    inclusion: Phase

    def stress(self, points: Array, strain: Array, *, inside: NDArray[np.bool_]) -> Array:
        """Stress (σ11, σ22, σ12) at points in Pa, shape (n, 3); arguments as of `displacement`."""
        z, stress = points[:, 0] + 1j * points[:, 1], np.empty((len(points), 3))
        for part, chosen in ((self._inside, inside), (self._outside, ~inside)):
            stress[chosen] = part(z[chosen], strain)
        return stress

    def displacement(self, points: Array, strain: Array, *, inside: NDArray[np.bool_]) -> Array:
        """Displacement at points, zero at the cell's centre, in halves of its side, shape (n, 2).

        Args:
            points: Shape (n, 2).
            strain: Mean strain (ε11, ε22, 2 ε12), shape (3,).
            inside: Whether a point belongs to the particle, shape (n,); on the interface either.
        """
        z, motion = points[:, 0] + 1j * points[:, 1], np.empty(len(points), complex)
        for phase, chosen, potentials in (
            (self.matrix, ~inside, self._potentials_outside),
            (self.inclusion, inside, self._potentials_inside),
        ):
            at = z[chosen]
            phi, slope, psi = potentials(at, strain)
            kappa = 3 - 4 * phase.poisson
            motion[chosen] = kappa * phi - at * slope.conj() - psi.conj()
            motion[chosen] /= 2 * phase.stiffness[2, 2]
        return np.stack([motion.real, motion.imag], axis=-1)

    def _loads(self) -> list[UnitLoad]:
        return [_unit_load(load, self.radius, self.matrix, self.inclusion) for load in LOADS]

    def _amounts(self, strain: Array) -> Array:
        """Amounts of the unit loads that make up the mean strain."""
        return np.array([strain[0] + strain[1], strain[0] - strain[1], strain[2] / 2])

    def _inside(self, z: Complex, strain: Array) -> Array:
        t, parts = z / self.radius, np.zeros((3, z.size), complex)
        for amount, load in zip(self._amounts(strain), self._loads(), strict=True):
            n, m = load.orders[1], load.orders[0]
            first = (t[:, None] ** (n - 1)) @ (n * load.inside[0]) / self.radius
            second = (
                (t[:, None] ** np.maximum(n - 2, 0))
                @ (n * (n - 1) * load.inside[0])
                / self.radius**2
            )
            parts += amount * np.stack(
                [first, second, (t[:, None] ** (m - 1)) @ (m * load.inside[1]) / self.radius]
            )
        return _stress(z, *parts)

    def _outside(self, z: Complex, strain: Array) -> Array:
        parts = np.zeros((3, z.size), complex)
        for amount, load in zip(self._amounts(strain), self._loads(), strict=True):
            (a, b), (n, m) = load.outside, load.orders
            first = load.far[0] - _images(z, n + 1, self.radius) @ (n * a) / self.radius
            second = _images(z, n + 2, self.radius) @ (n * (n + 1) * a) / self.radius**2
            psi = load.far[1] - _images(z, m + 1, self.radius) @ (m * b) / self.radius
            psi -= (
                _images(z, n + 2, self.radius, conjugate=True) @ (n * (n + 1) * a) / self.radius**2
            )
            parts += amount * np.stack([first, second, psi])
        return _stress(z, *parts)

    def _potentials_inside(self, z: Complex, strain: Array) -> Complex:
        """The particle's φ, φ' and ψ at `z`, shape (3, n)."""
        t, parts = (z / self.radius)[:, None], np.zeros((3, z.size), complex)
        for amount, load in zip(self._amounts(strain), self._loads(), strict=True):
            (m, n), (phi, psi) = load.orders, load.inside
            slope = t ** (n - 1) @ (n * phi) / self.radius
            parts += amount * np.stack([t**n @ phi, slope, t**m @ psi])
        return parts

    def _potentials_outside(self, z: Complex, strain: Array) -> Complex:
        """The matrix' φ, φ' and ψ at `z`, shape (3, n)."""
        parts = np.zeros((3, z.size), complex)
        for amount, load in zip(self._amounts(strain), self._loads(), strict=True):
            (a, b), (n, m) = load.outside, load.orders
            phi = load.far[0] * z + _images(z, n, self.radius) @ a
            slope = load.far[0] - _images(z, n + 1, self.radius) @ (n * a) / self.radius
            psi = load.far[1] * z + _images(z, m, self.radius) @ b
            psi += _images(z, n + 1, self.radius, conjugate=True) @ (n * a) / self.radius
            parts += amount * np.stack([phi, slope, psi])
        return parts


def _stress(z: Complex, first: Complex, second: Complex, psi: Complex) -> Array:
    """(σ11, σ22, σ12) from φ', φ'' and ψ' at `z`, shape (n, 3)."""
    total, difference = 4 * first.real, 2 * (z.conj() * second + psi)
    return np.stack(
        [(total - difference.real) / 2, (total + difference.real) / 2, difference.imag / 2], axis=-1
    )


@cache
def _unit_load(load: str, radius: float, matrix: Phase, inclusion: Phase) -> UnitLoad:
    """All coefficients for ε11 + ε22 = 1, ε11 − ε22 = 1 or ε12 = 1."""
    at, contrast = np.array([radius]), Contrast.of(matrix, [inclusion])
    # fields need twice what moduli do
    harmonics = int(square_stiffness(at, matrix, [inclusion]).harmonics.max()) * 2 + 2
    harmonics = min(harmonics, MOST_HARMONICS)
    kind = family(harmonics, hydrostatic=load == "hydrostatic")
    a = multipoles(load, at, contrast, harmonics=harmonics)[0, 0]
    mirror, far = (-1.0 if load == "shear" else 1.0), (1.0 if load == "hydrostatic" else 0.0)
    in_a, in_b, lam = radius**kind.a, radius**kind.b, float(contrast.ratio[0])
    p = kind.to_p * in_b[:, None] @ (in_a * a) + far * radius * (kind.b == 1)
    b = mirror * contrast.inner[0] * p
    b[kind.b > 1] += (kind.b[kind.b > 1] - 2) * a[: np.count_nonzero(kind.b > 1)]
    following = kind.to_next * (in_a * radius**2)[:, None] @ (in_a * a)  # (n + 2) p_{n+2}
    passed = (1 + contrast.kappa) / (1 + lam * contrast.kappa_i[0])
    c = passed * p
    if far:
        b[0] = contrast.swelling[0] * p[0]
        c[0] = (1 + contrast.kappa) * p[0] / (2 + lam * (contrast.kappa_i[0] - 1))
    q = (
        kind.a_to_q * in_a[:, None] @ (in_a * a)
        + kind.b_to_q * in_a[:, None] @ (in_b * b)
        + (1 - far) * radius * (kind.a == 1)
    )
    d = mirror * a + following + q - passed * following
    unit = complex(1j if load == "shear" else 1) / _strain(load, a, b, radius, contrast)
    return UnitLoad(
        np.stack([kind.a, kind.b]),
        (unit * far, unit * (1 - far)),
        np.stack([unit * a, unit * b]),
        np.stack([unit * c, unit * d]),
    )


def _strain(load: str, a: Array, b: Array, radius: float, contrast: Contrast) -> float:
    """ε11 + ε22, ε11 − ε22 or ε12 under the unit far field."""
    kappa, mu = contrast.kappa, contrast.mu
    if load == "hydrostatic":
        return float((kappa - 1 - ZETA_PERIOD * radius * b[0]) / mu)
    turn = ZETA_PERIOD * radius * a[0]
    g = lattice_sums(12 * MOST_HARMONICS + 8).natanzon_period * radius * a[0]
    return float(
        (kappa * turn - 1 - g) / mu if load == "deviator" else (kappa * turn + 1 + g) / (2 * mu)
    )


def _images(
    z: Complex, power: NDArray[np.int64], radius: float, *, conjugate: bool = False
) -> Complex:
    """Σ_P r^m (z − P)^-m for each power m, or Σ' conj(P) r^m (z − P)^-m; shape (points, powers)."""
    near = _NEAR if conjugate else np.append(_NEAR, 0)
    weight = near.conj() if conjugate else np.ones_like(near)
    direct = sum(
        w * (radius / (z - at))[:, None] ** power for w, at in zip(weight, near, strict=True)
    )
    k = np.arange(_TERMS)
    return np.asarray(
        direct
        + (z[:, None] / 2) ** k @ _far_taylor(tuple(power), conjugate) * (radius / 2.0) ** power
    )


@cache
def _far_taylor(powers: tuple[int, ...], conjugate: bool) -> Array:
    """Taylor coefficients of the images beyond the eight nearest, shape (terms, powers)."""
    sums, half = lattice_sums(12 * MOST_HARMONICS + 8), _NEAR / 2
    m, k = np.array(powers)[None, :], np.arange(_TERMS)[:, None]
    total = (2 * sums.conjugate if conjugate else sums.plain)[m + k]
    near = sum((2 * p.conj() if conjugate else 1) * p ** -(m + k).astype(float) for p in half)
    binomial = np.exp(gammaln(m + k) - gammaln(m) - gammaln(k + 1))
    return np.asarray((-1.0) ** m * binomial * (total - near.real))
