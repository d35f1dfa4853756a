"""Stiffness of the simple cubic array of spheres by multipole series, to a given error."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.rve.cell import Phase
from alphacut.rve.series.truncation import Truncation, error_by_more_terms, require_radii
from alphacut.rve.spheres.cubic import cubic_voigt
from alphacut.rve.spheres.series.interface import scattering, shear_modulus
from alphacut.rve.spheres.series.translation import VOLUME, Multipoles, couplings

MOST_DEGREES = 64  # reaches 1e-8 at r = 0.985
_DEGREES = np.array([4, 6, 8, 10, 12, 14, 16, 20, 24, 28, 32, 40, 48, 56, MOST_DEGREES])
_BATCH = 2_000_000  # entries of one batch of matrices
_ROUND_OFF = 2e-13
_SAFETY = 2.0
_TRUNCATION = Truncation(
    lambda degrees: _DEGREES[np.searchsorted(_DEGREES, degrees, "right")],
    MOST_DEGREES,
    "degrees of multipoles",
    "spheres",
)


@dataclass(frozen=True)
class CubicStiffness:
    """Stiffness of cells of cubic symmetry by their three moduli, in Pa.

    Args:
        bulk: K.
        deviator: (C11 − C12)/2, shear along the diagonals of a face.
        shear: C44, shear along the edges.
        errors: Declared relative truncation errors of the three, shape (…, 3).
        degrees: Largest degree of the multipoles that reached it.
    """

    bulk: Array
    deviator: Array
    shear: Array
    errors: Array
    degrees: Array

    @property
    def matrix(self) -> Array:
        """Voigt matrices (11, 22, 33, 23, 13, 12 with 2 ε), shape (…, 6, 6)."""
        return cubic_voigt(self.bulk, self.deviator, self.shear)


def cubic_stiffness(
    radius: Array, matrix: Phase, inclusions: Sequence[Phase], *, tolerance: float = 1e-10
) -> CubicStiffness:
    """Stiffness of n cells times m inclusions.

    Args:
        radius: Radii over half the cell's side, shape (n,), each in [0, 1).
        matrix: Material outside the sphere.
        inclusions: Materials of the sphere, m of them; moduli of 1e-12 and 1e12 of the matrix's are
            a pore and a rigid sphere to as many digits.
        tolerance: Relative truncation error allowed, at least 1e-12.

    Returns:
        Moduli of shape (n, m).

    Raises:
        ValueError: A radius lies outside [0, 1).
        SeriesError: The series does not reach `tolerance` (spheres nearly in touch).
    """
    radius = require_radii(radius)

    def solve(rows: Array, degree: int) -> tuple[Array, Array]:
        return _with_errors(radius[rows], matrix, inclusions, degree)

    moduli, errors, used = _TRUNCATION.settle(
        radius,
        len(inclusions),
        _first_degrees(radius, tolerance),
        solve,
        tolerance=max(tolerance, 2 * _ROUND_OFF),
    )
    bulk, deviator, shear = np.moveaxis(moduli, -1, 0)
    return CubicStiffness(bulk, deviator, shear, errors, used)


def _first_degrees(radius: Array, tolerance: float) -> Array:
    """Degree for each radius, from the decay of images between two spheres."""
    rate = 2 * np.arccosh(1 / np.maximum(radius, 1e-3))
    needed = np.log(1 / tolerance) / rate
    place = np.minimum(np.searchsorted(_DEGREES, needed), _DEGREES.size - 1)
    return np.asarray(_DEGREES[place])


def _with_errors(
    radius: Array, matrix: Phase, inclusions: Sequence[Phase], degree: int
) -> tuple[Array, Array]:
    """Moduli and their declared relative errors, shape (rows, m, 3) each.

    A quarter and a half more degrees tell the error, with a margin.
    """
    own, finer, finest = (
        _moduli(radius, matrix, inclusions, n)
        for n in (degree, degree + max(2, degree // 4), degree + max(4, degree // 2))
    )
    return own, _SAFETY * error_by_more_terms(own, finer, finest) + _ROUND_OFF


def _moduli(radius: Array, matrix: Phase, inclusions: Sequence[Phase], degree: int) -> Array:
    """K, (C11 − C12)/2 and C44 with multipoles up to `degree`, in Pa, shape (rows, m, 3)."""
    size = 3 * (degree + 2) ** 2 // 16
    parts = -(-radius.size * len(inclusions) * size**2 // _BATCH)
    cuts = np.linspace(0, radius.size, min(radius.size, max(1, parts)) + 1).astype(int)
    batches = [radius[a:b] for a, b in pairwise(cuts)]
    return np.concatenate([_solve_batch(batch, matrix, inclusions, degree) for batch in batches])


def _solve_batch(radius: Array, matrix: Phase, inclusions: Sequence[Phase], degree: int) -> Array:
    """The same for few enough radii."""
    mu, nu, cube = shear_modulus(matrix), matrix.poisson, radius[:, None] ** 3
    bulk = 2 * mu * (1 + nu) / (3 * (1 - 2 * nu))
    axial, sheared = (
        _dipoles(radius, matrix, inclusions, degree, shear=shear) for shear in (False, True)
    )
    # mean stress less that of the far field: the force dipoles over the volume
    return np.stack(
        [
            bulk + 8 * np.pi * mu * (1 - nu) / (1 - 2 * nu) * cube * axial[..., 0] / (3 * VOLUME),
            *(
                mu - 8 * np.pi * mu * (1 - nu) * cube * dipole / VOLUME
                for dipole in (axial[..., 1], sheared[..., 0])
            ),
        ],
        axis=-1,
    )


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
    loads = [(poles.place(1, 2, least), poles.place(3, 2, least), 1.0)]
    if not shear:
        unit = -1 / (2 * (1 - 2 * matrix.poisson))  # solution 3 of degree 0 is −2(1 − 2ν) x
        loads.insert(0, (poles.place(3, 0, 0), poles.place(1, 0, 0), unit))
    found = np.empty((radius.size, len(inclusions), len(loads)))
    for j, inclusion in enumerate(inclusions):
        spheres = scatterers(degree, matrix, inclusion, shear=shear)
        far = np.zeros((poles.n.size, len(loads)))
        for column, (source, _, unit) in enumerate(loads):
            far[source, column] = unit
        system = np.eye(poles.n.size) - spheres.answer(images)
        amplitudes = np.linalg.solve(
            system, np.broadcast_to(spheres.answer(far), (*system.shape[:2], len(loads)))
        )
        found[:, j] = np.stack(
            [amplitudes[:, pole, column] for column, (_, pole, _) in enumerate(loads)], axis=-1
        )
    return found


def _powers(poles: Multipoles) -> tuple[Array, Array]:
    """Powers of r that scale regular and singular amplitudes to r = 1, over one load's."""
    kind = poles.kind - 2
    return np.maximum(poles.n + kind, 0), poles.n + 1 - kind  # solution 1 of degree 0 is none


@lru_cache(maxsize=256)
def multipoles(degree: int, *, shear: bool) -> Multipoles:
    """Those up to a degree, made once."""
    return Multipoles.of(degree, shear=shear)


@lru_cache(maxsize=1024)
def scatterers(degree: int, matrix: Phase, inclusion: Phase, *, shear: bool) -> Scatterers:
    """The answer of a sphere to each multipole of one load, made once."""
    poles = multipoles(degree, shear=shear)
    pair, torsion = scattering(poles.n, matrix, inclusion)
    return Scatterers(pair[poles.kind == 1], torsion[poles.kind == 2])


@dataclass(frozen=True, eq=False)
class Scatterers:
    """Answer of one sphere by multipoles: of solutions 1 and 3, (k, 2, 2), and 2, (l,)."""

    pair: Array
    torsion: Array

    def answer(self, regular: Array) -> Array:
        """Singular amplitudes for regular ones, shape (…, N, columns)."""
        k = len(self.pair)
        first, second, third = np.split(regular, [k, k + self.torsion.size], axis=-2)
        (a, b), (c, d) = np.moveaxis(self.pair[..., None], 0, 2)
        answers = (a * first + b * third, self.torsion[:, None] * second, c * first + d * third)
        return np.concatenate(answers, axis=-2)
