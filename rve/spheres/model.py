"""Series model of the cell with a sphere: exact for the simple cubic array, at nodes of θ."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, ClassVar, NamedTuple

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import require
from alphacut.rve.series.means import Material, Series
from alphacut.rve.series.model import SeriesModel
from alphacut.rve.spheres.multipoles import VOLUME, Multipoles, TMatrices, couplings, t_matrices
from alphacut.rve.spheres.result import HILL, HomogenisedSpheres, cubic_voigt, spheres_with_checks


def space_moduli(radius: Array, materials: Sequence[Material], degree: int) -> Array:
    """Return K, (C11 − C12)/2 and C44 of cubic cells with a sphere at the centre.

    Each is the matrix's modulus less the mean stress of the sphere's dipole at unit mean strain.

    Args:
        radius: Radii over half the cell's side, in [0, 1), shape (n,).
        materials: Materials of the matrix and of m spheres, with real or complex moduli.
        degree: Highest degree of the multipoles, at least 4.

    Returns:
        Moduli in Pa, shape (n, m, 3).
    """
    matrix, *spheres = materials
    bulk, mu = matrix.bulk_and_shear
    nu = matrix.poisson
    axial = _dipoles(radius, matrix, spheres, degree, shear=False)
    shear = _dipoles(radius, matrix, spheres, degree, shear=True)
    # Three columns: the dipoles of hydrostatic strain, put into the scale of the others, of
    # tetragonal strain and of shear.
    dipoles = np.concatenate([axial / [-3 * (1 - 2 * nu), 1], shear], axis=-1)
    scale = 8 * np.pi * mu * (1 - nu) * radius[:, np.newaxis] ** 3 / VOLUME
    return np.asarray(np.array([bulk, mu, mu]) - scale[..., np.newaxis] * dipoles)


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

    @property
    def series(self) -> Series:
        """The multipole series of the simple cubic array."""
        return SPHERES

    def __post_init__(self) -> None:
        """RefusedError for points or an accuracy not allowed, or an array that is not cubic."""
        super().__post_init__()
        cure = 'particles = "cylinders" have other arrays'
        require(self.lattice == "square", "lattice", self.lattice, '"square", of spheres', cure)

    def _checked_result(self, **fields: Any) -> HomogenisedSpheres:
        """Return the result with these fields and its checks."""
        return spheres_with_checks(HomogenisedSpheres(**fields))


class _Load(NamedTuple):
    """A uniform strain at infinity.

    Attributes:
        far_field: Index of the regular multipole that it is.
        amplitude: Its amplitude at unit strain.
        dipole: Index of the singular multipole that the mean stress follows from.
    """

    far_field: int
    amplitude: complex
    dipole: int


def _loads(poles: Multipoles, poisson: complex, *, shear: bool) -> list[_Load]:
    """Return the uniform strains at infinity whose responses give the moduli.

    Each is a regular solution of Navier's equation, of one multipole. They are numbered by kind as
    by Kushch (2013): 1 is the gradient of a harmonic, 2 torsional, 3 the one with dilatation.

    Args:
        poles: The multipoles that the loads excite, in which indices are counted.
        poisson: Poisson's ratio of the matrix.
        shear: Whether the load is the shear ε12 alone; else the loads are the hydrostatic and the
            tetragonal strain, in this order.

    Returns:
        For each load `far_field`, the index of the regular multipole that it is, its `amplitude` at
        unit strain, and `dipole`, the index of the singular multipole that gives the mean stress.
    """
    order = 2 if shear else 0
    deviatoric = _Load(poles.index_of(1, 2, order), 1.0, poles.index_of(3, 2, order))
    if shear:
        return [deviatoric]
    amplitude = -1 / (2 * (1 - 2 * poisson))  # solution 3 of degree 0 is −2(1 − 2ν) x
    return [_Load(poles.index_of(3, 0, 0), amplitude, poles.index_of(1, 0, 0)), deviatoric]


def _dipoles(
    radius: Array, matrix: Material, inclusions: Sequence[Material], degree: int, *, shear: bool
) -> Array:
    """Return force dipoles of n times m spheres over r³ under unit strains, shape (n, m, loads).

    The singular amplitudes are x = T (f + C x), with the regular amplitudes f of the far field and
    C x of all images, and the T-matrix T of the sphere.

    Args:
        radius: Radii r over half the cell's side, in [0, 1), shape (n,).
        matrix: Material outside the spheres.
        inclusions: Materials of the spheres, m of them.
        degree: Highest degree of the multipoles, at least 4.
        shear: Whether the load is ε12, so that there is 1; else the 2 loads are hydrostatic and
            tetragonal strain.
    """
    poles = Multipoles.up_to(degree, shear=shear)
    loads = _loads(poles, matrix.poisson, shear=shear)
    # Powers of r scale amplitudes to r = 1, relative to the loads' own. There is no regular
    # solution of kind 1 and degree 0, so that its power does not matter.
    regular_scale = radius[:, np.newaxis] ** np.maximum(poles.n + poles.kind - 2, 0)
    singular_scale = radius[:, np.newaxis] ** (poles.n + 3 - poles.kind)
    images = couplings(degree, matrix.poisson, shear=shear)
    images = images * regular_scale[..., np.newaxis] * singular_scale[:, np.newaxis]
    moduli = [phase.bulk_and_shear for phase in (matrix, *inclusions)]
    kind = np.array(moduli).dtype  # complex if a modulus is
    far_field = np.zeros((poles.n.size, len(loads)), kind)
    for column, load in enumerate(loads):
        far_field[load.far_field, column] = load.amplitude
    dipoles = np.empty((radius.size, len(inclusions), len(loads)), kind)
    for j, inclusion in enumerate(inclusions):
        sphere = _cached_t_matrices(degree, matrix, inclusion, shear=shear)
        system = np.eye(poles.n.size) - sphere.apply(images)
        source = np.broadcast_to(sphere.apply(far_field), (*system.shape[:2], len(loads)))
        amplitudes = np.linalg.solve(system, source)
        for column, load in enumerate(loads):
            dipoles[:, j, column] = amplitudes[:, load.dipole, column]
    return dipoles


@lru_cache(maxsize=1024)
def _cached_t_matrices(
    degree: int, matrix: Material, inclusion: Material, *, shear: bool
) -> TMatrices:
    """Return the T-matrices of a sphere for the multipoles of one load, in their order."""
    poles = Multipoles.up_to(degree, shear=shear)
    matrices = t_matrices(poles.n, matrix, inclusion)
    return TMatrices(matrices.pair[poles.kind == 1], matrices.torsion[poles.kind == 2])
