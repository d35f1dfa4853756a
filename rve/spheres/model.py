"""Series model of the cell with a sphere: exact for the simple cubic array, at nodes of θ."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, ClassVar

import numpy as np

from alphacut.base.arrays import Array
from alphacut.rve.series.means import Material, Series
from alphacut.rve.series.model import SeriesModel
from alphacut.rve.spheres.multipoles import VOLUME, Multipoles, couplings, t_matrices
from alphacut.rve.spheres.result import HILL, HomogenisedSpheres, cubic_voigt, spheres_with_checks


def space_moduli(radius: Array, materials: Sequence[Material], degree: int) -> Array:
    """K, (C11 − C12)/2 and C44 of n cubic cells times m spheres, (n, m, 3), in Pa.

    They are the matrix's less the mean dipole stress.
    """
    matrix, *spheres = materials
    (bulk, mu), nu = matrix.bulk_and_shear, matrix.poisson
    axial = _dipoles(radius, matrix, spheres, degree, shear=False)
    shear = _dipoles(radius, matrix, spheres, degree, shear=True)
    # of hydrostatic and of tetragonal strain, (n, m, 2); the former in the latter's scale
    dipoles = np.concatenate([axial / [-3 * (1 - 2 * nu), 1], shear], axis=-1)
    scale = 8 * np.pi * mu * (1 - nu) * radius[:, None] ** 3 / VOLUME
    return np.asarray(np.array([bulk, mu, mu]) - scale[..., None] * dipoles)


SPHERES = Series(
    moduli=space_moduli,
    voigt=cubic_voigt,
    steps=(4, 6, 8, 10, 12, 14, 16, 20, 24, 28, 32, 40, 48, 56, 64),  # reaches 1e-8 at r = 0.985
    decay=2.0,
    start=1 / 3,  # terms cost their sixth power, so that a first try costs little
    unknowns=lambda degree: 3 * (degree + 2) ** 2 // 16,  # amplitudes of one load
    safety=2.0,
    round_off=2e-13,
    tolerance=1e-10,
)
cubic_stiffness = SPHERES.converged_moduli
"""K, (C11 − C12)/2 and C44 of n cubic cells times m spheres, with declared errors."""


@dataclass(frozen=True)
class SpheresModel(SeriesModel):
    """As `SeriesModel`, for spheres; `accuracy` is that of the mean moduli.

    `DEFAULT_TOLERANCE` is the tolerance of E of a case that states none: 1e-9 takes seconds near a
    reduced radius of 0.97.
    """

    accuracy: float = 1e-9
    convention: ClassVar[str] = HILL
    DEFAULT_TOLERANCE: ClassVar[float | None] = 1e-5
    MIN_ACCURACY: ClassVar[float] = 1e-11
    series: ClassVar[Series] = SPHERES

    def _checked_result(self, **parts: Any) -> HomogenisedSpheres:
        return spheres_with_checks(HomogenisedSpheres(**parts))


def _dipoles(
    radius: Array, matrix: Material, inclusions: Sequence[Material], degree: int, *, shear: bool
) -> Array:
    """Force dipoles of n times m spheres over r³ under unit strains, shape (n, m, loads)."""
    # singular amplitudes = T (regular amplitudes of the far field and of all images)
    poles = Multipoles.up_to(degree, shear=shear)
    # powers of r scale amplitudes to r = 1, over one load's; solution 1 of degree 0 is none
    powers = np.maximum(poles.n + poles.kind - 2, 0), poles.n + 3 - poles.kind
    regular_scale, singular_scale = (radius[:, None] ** power for power in powers)
    images = couplings(degree, matrix.poisson, shear=shear)
    images = images * regular_scale[..., None] * singular_scale[:, None]
    order = 2 if shear else 0
    # of each load: index of its far field, of its dipole, and amplitude at unit strain
    loads: list[tuple[int, int, complex]] = [
        (poles.index_of(1, 2, order), poles.index_of(3, 2, order), 1.0)
    ]
    if not shear:
        unit = -1 / (2 * (1 - 2 * matrix.poisson))  # solution 3 of degree 0 is −2(1 − 2ν) x
        loads.insert(0, (poles.index_of(3, 0, 0), poles.index_of(1, 0, 0), unit))
    sources, dipole_rows, units = map(list, zip(*loads, strict=True))
    columns, shape = range(len(loads)), (radius.size, len(inclusions), len(loads))
    kind = np.result_type(*(x for phase in (matrix, *inclusions) for x in phase.bulk_and_shear))
    dipoles = np.empty(shape, kind)
    far_field = np.zeros((poles.n.size, len(loads)), kind)
    far_field[sources, columns] = units
    for j, inclusion in enumerate(inclusions):
        sphere = cached_t_matrices(degree, matrix, inclusion, shear=shear)
        system = np.eye(poles.n.size) - apply_t_matrices(sphere, images)
        source = apply_t_matrices(sphere, far_field)
        source = np.broadcast_to(source, (*system.shape[:2], len(loads)))
        dipoles[:, j] = np.linalg.solve(system, source)[:, dipole_rows, columns]
    return dipoles


@lru_cache(maxsize=1024)
def cached_t_matrices(
    degree: int, matrix: Material, inclusion: Material, *, shear: bool
) -> tuple[Array, Array]:
    """T-matrices of a sphere for the multipoles of one load: of solutions 1 and 3, and of 2."""
    poles = Multipoles.up_to(degree, shear=shear)
    pair, torsion = t_matrices(poles.n, matrix, inclusion)
    return pair[poles.kind == 1], torsion[poles.kind == 2]


def apply_t_matrices(sphere: tuple[Array, Array], regular: Array) -> Array:
    """Singular amplitudes T @ regular, both of shape (…, N, columns), Lamé solution by solution."""
    pair, torsion = sphere
    first, second, third = np.split(regular, [len(pair), len(pair) + torsion.size], axis=-2)
    (t11, t13), (t31, t33) = np.moveaxis(pair[..., None], 0, 2)
    singular = (t11 * first + t13 * third, torsion[:, None] * second, t31 * first + t33 * third)
    return np.concatenate(singular, axis=-2)
