"""Result of a cell with a sphere: the plane's words, moduli in space.

Stresses over θ are those of the plane loads, with ε33 = 0: σ11 under ε11 = ε22 = 0.01 and σ12
under ε12 = 0.01. E and ν are Hill's isotropic average of the mean stiffness, not eq. 16.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.rve.bounds import reuss, voigt
from alphacut.rve.cell import Phase
from alphacut.rve.certificate import ROUND_OFF, checks_within_limits, mean, order_checks
from alphacut.rve.result import HomogenisedStiffness
from alphacut.rve.spheres.cubic import cubic_moduli, hill_average, hill_shear
from alphacut.rve.spheres.space_bounds import hashin_shtrikman, space_stiffness

VOLUME_OF_UNIT_SPHERE = np.pi / 6  # over the cell's volume at r = 1: fraction = π r³/6


@dataclass(frozen=True, eq=False, repr=False)
class HomogenisedSpheres(HomogenisedStiffness):
    """Effective behaviour of the simple cubic array with what it cost.

    As `HomogenisedStiffness`, but `curve.stiffness` has shape (n, 6, 6), and `errors` and `moduli`
    are those of K, (C11 − C12)/2 and C44.
    """

    @property
    def convention(self) -> str:
        """Name of the average that E and ν are of."""
        return "Hill's isotropic average"

    @property
    def moduli(self) -> Array:
        """Mean K, (C11 − C12)/2 and C44 under f_Θ, shape (3,), in Pa."""
        return cubic_moduli(np.asarray(self.stiffness))

    def constants_of(self, moduli: Array) -> Array:
        """E in Pa and ν of Hill's average, shape (2,)."""
        return hill_average(moduli)

    def shear_of(self, moduli: Array) -> float:
        """Shear modulus of Hill's average, in Pa."""
        return float(hill_shear(moduli))


def volume_fraction(radius: Array) -> Array:
    """Share of the cell that a sphere takes, π r³/6, of radii over half the cell's side."""
    return np.asarray(VOLUME_OF_UNIT_SPHERE * np.asarray(radius) ** 3)


def spheres_with_checks(result: HomogenisedSpheres) -> HomogenisedSpheres:
    """Copy of a result with the relative violations of symmetry and bounds as its checks.

    Raises:
        CertificateError: A violation exceeds the declared error of the result.
    """
    cell = result.cell
    assert cell is not None
    matrix, inclusion = cell.phases
    assert isinstance(matrix, Phase)
    assert isinstance(inclusion, Phase)
    fraction = volume_fraction(cell.radius(result.curve.theta))
    stiffness = space_stiffness(matrix), space_stiffness(inclusion)
    weights, bulk = result.curve.weights, result.moduli[0]
    fractions = np.stack([1 - fraction, fraction])
    reuss_mean, voigt_mean = (
        mean(weights, bound(fractions, stiffness)) for bound in (reuss, voigt)
    )
    low, high = hashin_shtrikman(fraction, matrix, inclusion)[0] @ weights
    checks = order_checks(np.asarray(result.stiffness), reuss_mean, voigt_mean)
    checks["hashin_shtrikman"] = float(max(0.0, low - bulk, bulk - high) / bulk)
    checks = checks_within_limits(checks, discretisation=ROUND_OFF + result.largest_error)
    return replace(result, checks=checks)
