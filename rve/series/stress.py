"""Stresses in the cell by the multipole series, and their spread.

σ11 + σ22 = 4 Re φ' and σ22 − σ11 + 2i σ12 = 2 (conj(z) φ'' + ψ'). Of the images, the eight nearest
are summed one by one, the others by their Taylor series around the cell's centre, which converges
everywhere in the cell.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaln

from alphacut.rve.cell import Phase
from alphacut.rve.series.lattice_sums import ZETA_PERIOD, lattice_sums
from alphacut.rve.series.multipoles import LOADS, MOST_HARMONICS, Contrast, family, multipoles
from alphacut.rve.series.stiffness import square_stiffness
from alphacut.stochastic.theta.truncated_normal import Array

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
class Spread:
    """Stress components (11, 22, 12) over a cell, in Pa; every array has shape (3,).

    Args:
        mean: Mean over the cell.
        deviation: Standard deviation over the cell.
        least: Smallest value found.
        greatest: Largest value found.
    """

    mean: Array
    deviation: Array
    least: Array
    greatest: Array


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

    def stress(self, points: Array, strain: Array) -> Array:
        """Stress at points of the cell [−1, 1]².

        Args:
            points: Shape (n, 2).
            strain: Mean strain (ε11, ε22, 2 ε12), shape (3,).

        Returns:
            (σ11, σ22, σ12) in Pa, shape (n, 3).
        """
        z = points[:, 0] + 1j * points[:, 1]
        inside = np.abs(z) <= self.radius
        found = np.empty((len(z), 3))
        for part, chosen in ((self._inside, inside), (self._outside, ~inside)):
            found[chosen] = part(z[chosen], strain)
        return found

    def interface(self, angle: Array, strain: Array, *, outside: bool = True) -> Array:
        """Normal and shear traction on the interface in Pa, shape (n, 2), from either side."""
        normal = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        z = self.radius * (normal[:, 0] + 1j * normal[:, 1])
        s11, s22, s12 = (self._outside if outside else self._inside)(z, strain).T
        traction = np.stack(
            [s11 * normal[:, 0] + s12 * normal[:, 1], s12 * normal[:, 0] + s22 * normal[:, 1]],
            axis=-1,
        )
        tangent = np.stack([-normal[:, 1], normal[:, 0]], axis=-1)
        return np.stack(
            [(traction * normal).sum(axis=1), (traction * tangent).sum(axis=1)], axis=-1
        )

    def spread(self, strain: Array, *, points: int = 24) -> Spread:
        """Mean, deviation and extremes of the stress under a mean strain (3,)."""
        places, weights = _cell_rule(self.radius, points)
        angle = np.linspace(0, 2 * np.pi, 16 * points, endpoint=False)
        z = self.radius * np.exp(1j * angle)
        field, rim = (
            self.stress(places, strain),
            [self._inside(z, strain), self._outside(z, strain)],
        )
        mean = weights @ field
        extremes = np.concatenate([field, *rim])
        return Spread(
            mean, np.sqrt(weights @ (field - mean) ** 2), extremes.min(axis=0), extremes.max(axis=0)
        )

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
    kind, a = (
        family(harmonics, hydrostatic=load == "hydrostatic"),
        multipoles(load, at, contrast, harmonics=harmonics)[0, 0],
    )
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
    turn, g = (
        ZETA_PERIOD * radius * a[0],
        lattice_sums(8 * MOST_HARMONICS + 8).natanzon_period * radius * a[0],
    )
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
    sums, half = lattice_sums(8 * MOST_HARMONICS + 8), _NEAR / 2
    m, k = np.array(powers)[None, :], np.arange(_TERMS)[:, None]
    total = (2 * sums.conjugate if conjugate else sums.plain)[m + k]
    near = sum((2 * p.conj() if conjugate else 1) * p ** -(m + k).astype(float) for p in half)
    binomial = np.exp(gammaln(m + k) - gammaln(m) - gammaln(k + 1))
    return np.asarray((-1.0) ** m * binomial * (total - near.real))


def _cell_rule(radius: float, points: int) -> tuple[Array, Array]:
    """Gauss points of the cell (n, 2) and weights of sum 1 on rays cut at the interface."""
    x, w = np.polynomial.legendre.leggauss(points)
    angle = ((np.arange(8)[:, None] + (1 + x) / 2) * np.pi / 4).ravel()
    side = 1 / np.maximum(np.abs(np.cos(angle)), np.abs(np.sin(angle)))
    places, weights = [], []
    for start, stop in (
        (np.zeros_like(side), np.full_like(side, radius)),
        (np.full_like(side, radius * (1 + 1e-14)), side),
    ):
        half = (stop - start) / 2
        ray = start[:, None] + half[:, None] * (1 + x)
        places.append(
            np.stack([ray * np.cos(angle)[:, None], ray * np.sin(angle)[:, None]], axis=-1).reshape(
                -1, 2
            )
        )
        weights.append((np.tile(w, 8)[:, None] * np.pi / 8 * half[:, None] * w * ray).ravel())
    return np.concatenate(places), np.concatenate(weights) / 4
