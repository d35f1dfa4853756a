"""Engineering constants of a plane stiffness along x and y, with fibres along z.

In plane strain they are those of the inverse of C. Without stress along the fibres (generalised
plane strain) they are those of the inverse of C − c cᵀ/C33 with c = (C13, C23, C63).

C13 and C33 follow from the plane stiffness alone. With k the in-plane bulk modulus, l = C13 and
n = C33 of the phases, Δ their differences and ⟨⟩ their means by area, strains along the fibres and
in the plane that leave both phases at one uniform strain (Hill, J. Mech. Phys. Solids 12, 199,
1964; Dvorak, Proc. R. Soc. A 431, 89, 1990) give

    (C13, C23, C63) = ⟨l⟩ (1, 1, 0) − z Δk Δl,   C33 = ⟨n⟩ − z̄ Δl²
    with C (1, 1, 0)/2 = ⟨k⟩ (1, 1, 0) − z Δk² and z̄ = (z1 + z2)/2

for two isotropic phases in any arrangement, and for means over θ. Hashin and Shtrikman bound z̄
where the phases' k are too close to show it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from alphacut.base.arrays import Array
from alphacut.rve.cell.cell import Cell, Phase
from alphacut.rve.result.result import HomogenisedStiffness
from alphacut.stochastic import gauss_rule

NAMES = ("E_x", "E_y", "nu_xy", "G_xy")
PLANE_STRAIN, FREE = "plane strain", "no stress along the fibres"
MARGIN = 1.1  # of errors to first order in those of the stiffness


@dataclass(frozen=True, eq=False)
class EngineeringConstants:
    """E_x, E_y, ν_xy, G_xy, moduli in Pa, (4,), and declared absolute errors, nan if unknown."""

    values: Array
    errors: Array

    @classmethod
    def of_stiffness(cls, stiffness: Array, errors: Array) -> EngineeringConstants:
        """E_x, E_y, ν_xy and G_xy of C, (3, 3), from the declared errors of its entries, in Pa."""
        S = np.linalg.inv(stiffness)
        S_error = MARGIN * abs(S) @ errors @ abs(S)  # δS = −S δC S
        moduli, poisson = 1 / np.diag(S), -S[0, 1] / S[0, 0]
        moduli_error = np.diag(S_error) * moduli * moduli
        poisson_error = (S_error[0, 1] + abs(poisson) * S_error[0, 0]) / S[0, 0]
        values = np.array([*moduli[:2], poisson, moduli[2]])
        return cls(values, np.array([*moduli_error[:2], poisson_error, moduli_error[2]]))


def engineering_constants(result: HomogenisedStiffness) -> dict[str, EngineeringConstants]:
    """E_x, E_y, ν_xy and G_xy by `PLANE_STRAIN` and, of two isotropic phases, `FREE`.

    Empty for a result without its plane stiffness.
    """
    stiffness, errors = result.stiffness, result.stiffness_errors
    if stiffness is None or errors is None or stiffness.shape != (3, 3):
        return {}
    constants = {PLANE_STRAIN: EngineeringConstants.of_stiffness(stiffness, errors)}
    axial = AxialStiffness.of_result(result)
    if axial is not None:
        condensed = axial.condense_axial_stress(stiffness, errors)
        constants[FREE] = EngineeringConstants.of_stiffness(*condensed)
    return constants


POINTS = 32  # nodes in θ
EQUIBIAXIAL = np.array([1.0, 1.0, 0.0])  # plane strain in Voigt order


@dataclass(frozen=True)
class Mixture:
    """The moduli of two isotropic phases and what bounds z̄.

    Args:
        moduli: k, l and n of matrix and inclusion, shape (3, 2), in Pa.
        fractions: Their mean area fractions, shape (2,).
        bounds: Of z̄ by Hashin and Shtrikman, in 1/Pa.
    """

    moduli: Array
    fractions: Array
    bounds: tuple[float, float]

    @classmethod
    def of_cell(cls, cell: Cell) -> Self:
        """Moduli, mean area fractions and Hashin–Shtrikman bounds of z̄ of a cell of two phases."""
        rule = gauss_rule(cell.radius_map.distribution, points=POINTS)
        inclusion, stiffness = cell.fraction(rule.nodes), np.array(cell.stiffness)
        axial, lateral, shear = stiffness[:, 0, 0], stiffness[:, 0, 1], stiffness[:, 2, 2]
        bulk, matrix = (axial + lateral) / 2, 1 - inclusion
        # z = f₁ f₂ / (f₂ k₁ + f₁ k₂ + G), bounded with G of either phase
        swapped = inclusion * bulk[0] + matrix * bulk[1]
        bounds = [float(rule.weights @ (matrix * inclusion / (swapped + G))) for G in shear]
        mean = float(rule.weights @ inclusion)
        moduli = np.array([bulk, lateral, axial])
        return cls(moduli, np.array([1 - mean, mean]), (min(bounds), max(bounds)))

    @property
    def differences(self) -> Array:
        """Δk, Δl and Δn, shape (3,), in Pa."""
        return np.asarray(np.diff(self.moduli, axis=1)[:, 0])

    def z_from_bulk(self, bulk: float, relative_error: float) -> tuple[float, float, float]:
        """z̄ in bulk = ⟨k⟩ − z̄ (k₂ − k₁)², and its lower and upper bound, in 1/Pa.

        Where the error of the bulk modulus (in Pa) hides z̄, the Hashin–Shtrikman bounds alone.
        """
        low, high = self.bounds
        contrast_squared, tolerance = float(self.differences[0] ** 2), relative_error * bulk
        if 2 * tolerance >= contrast_squared * (high - low) or contrast_squared == 0:
            return (low + high) / 2, low, high
        drop = self.fractions @ self.moduli[0] - bulk
        candidates = (drop + np.array([0, -tolerance, tolerance])) / contrast_squared
        z, lower, upper = np.clip(candidates, low, high)
        return float(z), float(lower), float(upper)

    def bulk(self, z: float) -> float:
        """In-plane bulk modulus in Pa."""
        return float(self.fractions @ self.moduli[0] - z * self.differences[0] ** 2)

    def lateral_and_axial(self, z: float) -> tuple[float, float]:
        """C13 = C23 of a cell of square symmetry, and C33, from z̄ in 1/Pa; in Pa."""
        _, lateral, axial = self.moduli @ self.fractions
        bulk_contrast, lateral_contrast, _ = self.differences
        coupling = bulk_contrast * lateral_contrast
        return float(lateral - z * coupling), float(axial - z * lateral_contrast**2)


@dataclass(frozen=True, eq=False)
class AxialStiffness:
    """C13, C23 and C63, shape (3,), and C33, with their declared absolute errors, in Pa."""

    lateral: Array
    axial: float
    lateral_errors: Array
    axial_error: float

    @classmethod
    def of_result(cls, result: HomogenisedStiffness) -> Self | None:
        """C13, C23, C63 and C33 from a computed plane stiffness by Hill's relations, with errors.

        None without a cell of two isotropic phases, a plane stiffness and its errors.
        """
        cell, stiffness, errors = result.cell, result.stiffness, result.stiffness_errors
        if cell is None or stiffness is None or errors is None:
            return None
        if not all(isinstance(phase, Phase) for phase in cell.phases):
            return None
        mixture, response = Mixture.of_cell(cell), stiffness @ EQUIBIAXIAL / 2
        bulk = float(response @ EQUIBIAXIAL / 2)
        z, *z_bounds = mixture.z_from_bulk(bulk, float(result.modulus_errors[0]))
        z_error = max(abs(bound - z) for bound in z_bounds)
        dk, dl, _ = mixture.differences
        mean_lateral, axial = mixture.lateral_and_axial(z)
        # the part of C (1, 1, 0)/2 that is not of square symmetry enters times Δl/Δk
        ratio = dl / dk if abs(dk) > 1e-9 * mixture.moduli[0].max() else 0.0
        anisotropic = response - bulk * EQUIBIAXIAL
        mean_error = z_error * abs(dk * dl)
        return cls(
            lateral=mean_lateral * EQUIBIAXIAL + ratio * anisotropic,
            axial=axial,
            lateral_errors=mean_error * EQUIBIAXIAL + abs(ratio) * (errors @ EQUIBIAXIAL) / 2,
            axial_error=z_error * dl**2,
        )

    def condense_axial_stress(self, stiffness: Array, errors: Array) -> tuple[Array, Array]:
        """C − c cᵀ/C33 without stress along the fibres, and errors of its entries, (3, 3) in Pa."""
        c = self.lateral
        reduction = np.outer(c, c) / self.axial
        by_lateral = np.outer(abs(c), self.lateral_errors) / self.axial
        by_axial = abs(reduction) * self.axial_error / self.axial
        return stiffness - reduction, errors + by_lateral + by_lateral.T + by_axial
