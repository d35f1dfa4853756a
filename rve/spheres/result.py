"""Result of a cell with a sphere: cubic moduli, their isotropic average, and their bounds.

Voigt order in three dimensions: 11, 22, 33, 23, 13, 12, shears with 2 ε. Voigt and Reuss hold as
matrices; Hashin and Shtrikman's (J. Mech. Phys. Solids 11, 127, 1963; with the extreme moduli of
either phase, Walpole 1966) for the bulk modulus of any cubic or isotropic arrangement and for both
moduli of an isotropic one.

Stresses over θ are those of the plane loads, with ε33 = 0: σ11 under ε11 = ε22 = 0.01 and σ12
under ε12 = 0.01. E and ν are Hill's isotropic average of the mean stiffness, not eq. 16.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.rve.cell.cell import Phase
from alphacut.rve.result.bounds import reuss, voigt
from alphacut.rve.result.checks import ROUND_OFF, checks_within_limits, mean, order_checks
from alphacut.rve.result.result import HomogenisedStiffness


def cubic_voigt(bulk: Array, deviator: Array, shear: Array) -> Array:
    """Stiffness in Voigt order, (…, 6, 6), from K, (C11 − C12)/2 and C44, (…,), in their unit."""
    voigt = np.zeros((*np.shape(bulk), 6, 6))
    voigt[..., :3, :3] = np.asarray(bulk - 2 / 3 * deviator)[..., None, None]
    for i in range(3):
        voigt[..., i, i] = bulk + 4 / 3 * deviator
        voigt[..., 3 + i, 3 + i] = shear
    return voigt


def cubic_moduli(stiffness: Array) -> Array:
    """K, (C11 − C12)/2 and C44, (…, 3), of the cubic part of a stiffness (…, 6, 6)."""
    diagonal = np.diagonal(stiffness, axis1=-2, axis2=-1)
    axial, shear = diagonal[..., :3].mean(axis=-1), diagonal[..., 3:].mean(axis=-1)
    lateral = (stiffness[..., 0, 1] + stiffness[..., 0, 2] + stiffness[..., 1, 2]) / 3
    return np.stack([(axial + 2 * lateral) / 3, (axial - lateral) / 2, shear], axis=-1)


def hill_shear(moduli: Array) -> Array:
    """Mean of Voigt's and Reuss's average of shear (Hill 1952) of K, (C11 − C12)/2, C44, (…, 3)."""
    deviator, shear = moduli[..., 1], moduli[..., 2]
    voigt, reuss = (2 * deviator + 3 * shear) / 5, 5 / (2 / deviator + 3 / shear)
    return np.asarray((voigt + reuss) / 2)


def hill_average(moduli: Array) -> Array:
    """Young's modulus (in the unit of `moduli`) and Poisson's ratio of Hill's average, (…, 2)."""
    bulk, shear = moduli[..., 0], hill_shear(moduli)
    young = 9 * bulk * shear / (3 * bulk + shear)
    return np.stack([young, (3 * bulk - 2 * shear) / (6 * bulk + 2 * shear)], axis=-1)


def space_stiffness(phase: Phase) -> Array:
    """Stiffness in Voigt order (11, 22, 33, 23, 13, 12 with 2 ε), shape (6, 6), in Pa."""
    bulk, shear = phase.bulk_and_shear
    return cubic_voigt(bulk, shear, shear)


def hashin_shtrikman(fraction: Array, matrix: Phase, inclusion: Phase) -> Array:
    """Lower and upper bound of K, then of μ, in Pa, (2, 2, …), for volume fractions (…)."""
    bulks, shears = zip(*(map(float, x.bulk_and_shear) for x in (matrix, inclusion)), strict=True)
    bounds = []
    for extreme in (min, max):
        bulk_term, shear_term = _reference_terms(extreme(bulks), extreme(shears))
        bulk_bound = _harmonic_mean_with(fraction, bulks, bulk_term)
        bounds.append([bulk_bound, _harmonic_mean_with(fraction, shears, shear_term)])
    return np.swapaxes(np.array(bounds), 0, 1)


def mori_tanaka(fraction: Array, matrix: Phase, inclusion: Phase) -> Array:
    """K and μ of spheres in Pa, (2, …), by Mori and Tanaka (1973): the bound of the matrix."""
    terms = _reference_terms(*matrix.bulk_and_shear)
    pairs = zip(matrix.bulk_and_shear, inclusion.bulk_and_shear, strict=True)
    return np.array(
        [_harmonic_mean_with(fraction, pair, term) for pair, term in zip(pairs, terms, strict=True)]
    )


def _harmonic_mean_with(fraction: Array, moduli: tuple[float, float], term: float) -> Array:
    """X of 1/(X + term) = Σ fraction/(modulus + term), of the matrix's and particle's moduli."""
    matrix, particle = moduli
    f = np.asarray(fraction, float)
    return np.asarray(1 / ((1 - f) / (matrix + term) + f / (particle + term)) - term)


def _reference_terms(bulk: float, shear: float) -> tuple[float, float]:
    """Terms that Hashin and Shtrikman add to bulk and shear moduli in a reference material."""
    return 4 / 3 * shear, shear / 6 * (9 * bulk + 8 * shear) / (bulk + 2 * shear)


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
    """Copy of a result with the relative violations of symmetry and bounds as its checks."""
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
