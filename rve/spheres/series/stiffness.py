"""Stiffness of the simple cubic array of spheres by multipole series, to a declared error."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.rve.cell import Phase
from alphacut.rve.series.truncation import CellModuli, Truncation
from alphacut.rve.spheres.cubic import cubic_voigt
from alphacut.rve.spheres.series.scattering import scattering
from alphacut.rve.spheres.series.translation import VOLUME, Multipoles, couplings


def unknowns(degree: int) -> int:
    """Amplitudes of one load up to a degree."""
    return 3 * (degree + 2) ** 2 // 16


TRUNCATION = Truncation(
    steps=(4, 6, 8, 10, 12, 14, 16, 20, 24, 28, 32, 40, 48, 56, 64),  # reaches 1e-8 at r = 0.985
    decay=2.0,
    unknowns=unknowns,
    safety=2.0,
    round_off=2e-13,
    terms="degrees of multipoles",
    particles="spheres",
    voigt=cubic_voigt,
)


def cubic_stiffness(
    radius: Array, matrix: Phase, inclusions: Sequence[Phase], *, tolerance: float = 1e-10
) -> CellModuli:
    """K, (C11 − C12)/2 and C44 of n cells times m inclusions.

    Args:
        radius: Radii over half the cell's side, shape (n,), each in [0, 1).
        matrix: Material outside the sphere.
        inclusions: Materials of the sphere, m of them; moduli of 1e-12 and 1e12 of the matrix's are
            a pore and a rigid sphere to as many digits.
        tolerance: Relative truncation error allowed, at least 1e-12.

    Raises:
        RefusedError: A radius lies outside [0, 1).
        SeriesError: The series does not reach `tolerance` (spheres nearly in touch).
    """

    def solve(radii: Array, degree: int) -> Array:
        """By mean stress less that of the far field, from force dipoles."""
        (bulk, mu), nu = matrix.bulk_and_shear, matrix.poisson
        axial, sheared = (
            _dipoles(radii, matrix, inclusions, degree, shear=shear) for shear in (False, True)
        )
        scale = 8 * np.pi * mu * (1 - nu) * radii[:, None] ** 3 / VOLUME
        axial[..., 0] /= -3 * (1 - 2 * nu)
        dipoles = np.concatenate([axial, sheared], axis=-1)
        return np.asarray(np.array([bulk, mu, mu]) - scale[..., None] * dipoles)

    return TRUNCATION.settle(radius, len(inclusions), solve, tolerance=tolerance)


def _dipoles(
    radius: Array, matrix: Phase, inclusions: Sequence[Phase], degree: int, *, shear: bool
) -> Array:
    """Leading amplitudes over r³ at unit strains: of hydrostatic and deviatoric, or shear load.

    Returns:
        Shape (n, m, loads).
    """
    poles = multipoles(degree, shear=shear)
    inward, outward = (radius[:, None] ** power for power in _powers(poles))
    images = couplings(degree, matrix.poisson, shear=shear) * inward[..., None] * outward[:, None]
    least = 2 if shear else 0
    loads = [(poles.index_of(1, 2, least), poles.index_of(3, 2, least), 1.0)]
    if not shear:
        unit = -1 / (2 * (1 - 2 * matrix.poisson))  # solution 3 of degree 0 is −2(1 − 2ν) x
        loads.insert(0, (poles.index_of(3, 0, 0), poles.index_of(1, 0, 0), unit))
    sources, poles_of, units = map(list, zip(*loads, strict=True))
    columns, dipoles = range(len(loads)), np.empty((radius.size, len(inclusions), len(loads)))
    far = np.zeros((poles.n.size, len(loads)))
    far[sources, columns] = units
    for j, inclusion in enumerate(inclusions):
        spheres = scatterers(degree, matrix, inclusion, shear=shear)
        system = np.eye(poles.n.size) - answer(spheres, images)
        right = np.broadcast_to(answer(spheres, far), (*system.shape[:2], len(loads)))
        dipoles[:, j] = np.linalg.solve(system, right)[:, poles_of, columns]
    return dipoles


def _powers(poles: Multipoles) -> tuple[Array, Array]:
    """Powers of r that scale regular and singular amplitudes to r = 1, over one load's."""
    kind = poles.kind - 2
    return np.maximum(poles.n + kind, 0), poles.n + 1 - kind  # solution 1 of degree 0 is none


@lru_cache(maxsize=256)
def multipoles(degree: int, *, shear: bool) -> Multipoles:
    """Those up to a degree, made once."""
    return Multipoles.up_to(degree, shear=shear)


@lru_cache(maxsize=1024)
def scatterers(degree: int, matrix: Phase, inclusion: Phase, *, shear: bool) -> tuple[Array, Array]:
    """Answer of a sphere to the multipoles of one load: `scattering`, made once."""
    poles = multipoles(degree, shear=shear)
    pair, torsion = scattering(poles.n, matrix, inclusion)
    return pair[poles.kind == 1], torsion[poles.kind == 2]


def answer(spheres: tuple[Array, Array], regular: Array) -> Array:
    """Singular amplitudes for regular ones, shape (…, N, columns)."""
    pair, torsion = spheres
    first, second, third = np.split(regular, [len(pair), len(pair) + torsion.size], axis=-2)
    (a, b), (c, d) = np.moveaxis(pair[..., None], 0, 2)
    answers = (a * first + b * third, torsion[:, None] * second, c * first + d * third)
    return np.concatenate(answers, axis=-2)
