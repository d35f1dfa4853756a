"""Result of a cell with a sphere: cubic moduli, their isotropic average, and their bounds.

Stiffness matrices are in Voigt order 11, 22, 33, 23, 13, 12, with shear strains 2 ε. The stress
curves over θ are those of the plane loads, with ε33 = 0: σ11 under ε11 = ε22 = 0.01 and σ12 under
ε12 = 0.01. E and ν are Hill's isotropic average of the mean stiffness, and not those of eq. 16.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from alphacut.base.arrays import Array
from alphacut.rve.cell.cell import Phase
from alphacut.rve.result.checks import ROUND_OFF, bulk_check, checks_within_limits, order_checks
from alphacut.rve.result.moduli import hashin_shtrikman
from alphacut.rve.result.result import HomogenisedStiffness
from alphacut.stochastic.particles.shapes import SPHERES

HILL = "Hill's isotropic average"


def cubic_voigt(bulk: Array, deviator: Array, shear: Array) -> Array:
    """Return stiffnesses of cubic symmetry in Voigt order 11, 22, 33, 23, 13, 12, shape (…, 6, 6).

    Args:
        bulk: Bulk modulus K, of any shape (…).
        deviator: (C11 − C12)/2, of the same shape and unit.
        shear: C44, of the same shape and unit.
    """
    voigt = np.zeros((*np.shape(bulk), 6, 6))
    voigt[..., :3, :3] = np.asarray(bulk - 2 / 3 * deviator)[..., None, None]
    for i in range(3):
        voigt[..., i, i] = bulk + 4 / 3 * deviator
        voigt[..., 3 + i, 3 + i] = shear
    return voigt


def cubic_moduli(stiffness: Array) -> Array:
    """Return K, (C11 − C12)/2 and C44 of the cubic part of a stiffness (…, 6, 6): shape (…, 3)."""
    diagonal = np.diagonal(stiffness, axis1=-2, axis2=-1)
    axial = diagonal[..., :3].mean(axis=-1)
    shear = diagonal[..., 3:].mean(axis=-1)
    lateral = (stiffness[..., 0, 1] + stiffness[..., 0, 2] + stiffness[..., 1, 2]) / 3
    return np.stack([(axial + 2 * lateral) / 3, (axial - lateral) / 2, shear], axis=-1)


def hill_shear(moduli: Array) -> Array:
    """Return the shear modulus of Hill's isotropic average (1952) of cubic stiffnesses, shape (…,).

    It is the mean of Voigt's average (2 D + 3 C44)/5 and Reuss's 5/(2/D + 3/C44).

    Args:
        moduli: K, D = (C11 − C12)/2 and C44, positive, shape (…, 3), in one unit.
    """
    deviator = moduli[..., 1]
    shear = moduli[..., 2]
    voigt = (2 * deviator + 3 * shear) / 5
    reuss = 5 / (2 / deviator + 3 / shear)
    return np.asarray((voigt + reuss) / 2)


def hill_average(moduli: Array) -> Array:
    """Return Young's modulus and Poisson's ratio of Hill's isotropic average of cubic stiffnesses.

    Args:
        moduli: K, (C11 − C12)/2 and C44, positive, shape (…, 3), in one unit.

    Returns:
        E in that unit and ν, shape (…, 2).
    """
    bulk = moduli[..., 0]
    shear = hill_shear(moduli)
    young = 9 * bulk * shear / (3 * bulk + shear)
    return np.stack([young, (3 * bulk - 2 * shear) / (6 * bulk + 2 * shear)], axis=-1)


@dataclass(frozen=True, eq=False, repr=False)
class HomogenisedSpheres(HomogenisedStiffness):
    """Homogenised stiffness of the simple cubic array of spheres.

    It differs from `HomogenisedStiffness` in that `curve.stiffness` has shape (n, 6, 6), and that
    `errors` and `moduli` are those of K, (C11 − C12)/2 and C44.
    """

    @property
    def convention(self) -> str:
        """Name of the average of which E and ν are given."""
        return HILL

    @property
    def is_of_fibres(self) -> bool:
        """False: the particles are spheres."""
        return False

    @property
    def fractions(self) -> Array:
        """Mean volume fractions of the phases of the cell under f_Θ, matrix first, shape (2,)."""
        assert self.cell is not None
        sphere = SPHERES.fractions(self.cell.radius_map(self.curve.theta))
        return np.asarray(np.stack([1 - sphere, sphere]) @ self.curve.weights)

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


def spheres_with_checks(result: HomogenisedSpheres) -> HomogenisedSpheres:
    """Return a copy of a result with checks: violations of symmetry and of classical bounds.

    Args:
        result: Result with its cell, of isotropic phases, and its stiffness in space.

    Returns:
        Copy with `checks` by name, 0 for none: "symmetry", "reuss" and "voigt" of the stiffness,
        and "hashin_shtrikman" of the bulk modulus.

    Raises:
        CertificateError: A bound is violated by more than the declared error of the result,
            symmetry by more than 1e-7; or no error is declared.
    """
    cell = result.cell
    assert cell is not None
    fraction = SPHERES.fractions(cell.radius_map(result.curve.theta))
    fractions = np.stack([1 - fraction, fraction])
    weights = result.curve.weights
    moduli = [phase.bulk_and_shear for phase in cell.phases if isinstance(phase, Phase)]
    stiffness = [cubic_voigt(bulk, shear, shear) for bulk, shear in moduli]
    checks = order_checks(np.asarray(result.stiffness), np.eye(6), fractions, weights, stiffness)
    bulk_bounds = hashin_shtrikman(fractions, cell.phases, space=True)[0] @ weights
    checks |= bulk_check(float(result.moduli[0]), bulk_bounds)
    checks = checks_within_limits(checks, discretisation=ROUND_OFF + result.largest_error)
    return replace(result, checks=checks)
