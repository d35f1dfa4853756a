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
from typing import NamedTuple, Self

import numpy as np

from alphacut.base.arrays import Array
from alphacut.rve.cell.cell import Cell, Phase
from alphacut.rve.result.result import HomogenisedStiffness
from alphacut.stochastic import gauss_rule

NAMES = ("E_x", "E_y", "nu_xy", "G_xy")
PLANE_STRAIN = "plane strain"
FREE = "no stress along the fibres"


@dataclass(frozen=True, eq=False)
class EngineeringConstants:
    """Engineering constants of a plane stiffness.

    Args:
        values: E_x, E_y, ν_xy and G_xy, shape (4,), moduli in Pa.
        errors: Their declared absolute errors, shape (4,), nan if unknown.
    """

    values: Array
    errors: Array

    @classmethod
    def of_stiffness(cls, stiffness: Array, errors: Array) -> EngineeringConstants:
        """Return the engineering constants of a plane stiffness C, from its inverse S.

        They are E_x = 1/S_11, E_y = 1/S_22, ν_xy = −S_21/S_11 and G_xy = 1/S_33.

        Args:
            stiffness: C in Voigt's order 11, 22, 12, shape (3, 3), in Pa.
            errors: Declared absolute errors of its entries, shape (3, 3), in Pa; NaN where unknown.

        Returns:
            `values` and absolute `errors`, shape (4,) each in this order, moduli in Pa. The errors
            are of first order with a margin of a tenth.

        Raises:
            numpy.linalg.LinAlgError: C is singular.
        """
        # To first order the compliance S = C⁻¹ changes by δS = −S δC S. The factor 1.1 leaves a
        # margin for terms of second order.
        compliance = np.linalg.inv(stiffness)
        compliance_errors = 1.1 * abs(compliance) @ errors @ abs(compliance)
        moduli = 1 / np.diag(compliance)
        modulus_errors = np.diag(compliance_errors) * moduli * moduli
        poisson = -compliance[0, 1] / compliance[0, 0]
        numerator_error = compliance_errors[0, 1] + abs(poisson) * compliance_errors[0, 0]
        poisson_error = numerator_error / compliance[0, 0]
        return cls(
            values=np.array([moduli[0], moduli[1], poisson, moduli[2]]),
            errors=np.array(
                [modulus_errors[0], modulus_errors[1], poisson_error, modulus_errors[2]]
            ),
        )


def engineering_constants(result: HomogenisedStiffness) -> dict[str, EngineeringConstants]:
    """Return E_x, E_y, ν_xy and G_xy of a result by each definition, with their declared errors.

    Args:
        result: Result of any model.

    Returns:
        Values and absolute errors, shape (4,) each, moduli in Pa, by definition: "plane strain"
        and, of two isotropic phases, "no stress along the fibres" (generalised plane strain).
        Errors are NaN where the result declares none. Empty for a result without its plane
        stiffness.

    Raises:
        numpy.linalg.LinAlgError: The stiffness is singular.
    """
    stiffness = result.stiffness
    errors = result.stiffness_errors
    if stiffness is None or errors is None or stiffness.shape != (3, 3):
        return {}
    constants = {PLANE_STRAIN: EngineeringConstants.of_stiffness(stiffness, errors)}
    axial = AxialStiffness.of_result(result)
    if axial is not None:
        constants[FREE] = axial.free_constants(stiffness, errors)
    return constants


class Interval(NamedTuple):
    """A number with bounds."""

    value: float
    lower: float
    upper: float


@dataclass(frozen=True)
class Mixture:
    """The moduli of two isotropic phases and what bounds z̄.

    Args:
        moduli: k, l and n of matrix and inclusion, shape (3, 2), in Pa.
        fractions: Their mean area fractions, shape (2,).
        bounds: Bounds of z̄ by Hashin and Shtrikman, in 1/Pa.
    """

    moduli: Array
    fractions: Array
    bounds: tuple[float, float]

    @classmethod
    def of_cell(cls, cell: Cell) -> Self:
        """Return what Hill's relations need of a cell of two isotropic phases, with fibres along z.

        With k the plane-strain bulk modulus, l = C13 and n = C33 of the phases, Δ their differences
        and ⟨⟩ means by area, the cell has the bulk modulus ⟨k⟩ − z̄ Δk², C13 = ⟨l⟩ − z̄ Δk Δl and
        C33 = ⟨n⟩ − z̄ Δl².

        Args:
            cell: Cell whose phases are both isotropic.

        Returns:
            `moduli` k, l and n of matrix and inclusion, shape (3, 2), in Pa; `fractions`, their
            mean area fractions over θ by Gauss quadrature with 32 nodes, shape (2,); and `bounds`
            of z̄ by Hashin and Shtrikman, in 1/Pa.
        """
        rule = gauss_rule(cell.radius_map.distribution, points=32)
        inclusion = cell.fraction(rule.nodes)
        # Isotropic phases have n = C33 = C11 and l = C13 = C12.
        stiffness = np.array(cell.stiffness)
        axial = stiffness[:, 0, 0]
        lateral = stiffness[:, 0, 1]
        bulk = (axial + lateral) / 2
        # z = f₁ f₂ / (f₂ k₁ + f₁ k₂ + G) with the area fractions f is bounded by taking the shear
        # modulus G of either phase.
        matrix = 1 - inclusion
        swapped = inclusion * bulk[0] + matrix * bulk[1]
        products = matrix * inclusion
        bounds = [
            float(rule.weights @ (products / (swapped + shear))) for shear in stiffness[:, 2, 2]
        ]
        mean = float(rule.weights @ inclusion)
        return cls(
            moduli=np.array([bulk, lateral, axial]),
            fractions=np.array([1 - mean, mean]),
            bounds=(min(bounds), max(bounds)),
        )

    @property
    def differences(self) -> Array:
        """Δk, Δl and Δn, shape (3,), in Pa."""
        return np.asarray(np.diff(self.moduli, axis=1)[:, 0])

    def z_from_bulk(self, bulk: float, relative_error: float) -> Interval:
        """Return Hill's number z̄, by which phases share strain, from a cell's bulk modulus.

        With k the plane-strain bulk moduli of the phases and ⟨k⟩ their mean by area, the bulk
        modulus of the cell is ⟨k⟩ − z̄ (k₂ − k₁)². The result is clipped to Hashin and Shtrikman's
        bounds of z̄. If the error of the bulk modulus leaves z̄ open, or k₁ = k₂, the result is the
        midpoint of these bounds, with them as its own bounds.

        Args:
            bulk: Plane-strain bulk modulus of the cell in Pa.
            relative_error: Its declared relative error; NaN makes the bounds NaN unless k₁ = k₂.

        Returns:
            z̄ with its lower and upper bound, in 1/Pa.
        """
        low, high = self.bounds
        contrast_squared = float(self.differences[0] ** 2)
        tolerance = relative_error * bulk
        # The error of the bulk modulus then leaves z̄ open by as much as the bounds do; with k₁ = k₂
        # the bulk modulus does not depend on z̄ at all.
        if 2 * tolerance >= contrast_squared * (high - low) or contrast_squared == 0:
            return Interval((low + high) / 2, low, high)
        drop = self.fractions @ self.moduli[0] - bulk
        # The value, and z̄ at both ends of the bulk modulus: z̄ falls with it.
        candidates = (drop + np.array([0, -tolerance, tolerance])) / contrast_squared
        return Interval._make(np.clip(candidates, low, high).tolist())

    def bulk(self, z: float) -> float:
        """Return the in-plane bulk modulus in Pa from z̄ in 1/Pa."""
        return float(self.fractions @ self.moduli[0] - z * self.differences[0] ** 2)

    def lateral_and_axial(self, z: float) -> tuple[float, float]:
        """Return C13 = C23 of a cell of square symmetry, and C33, in Pa, from z̄ in 1/Pa."""
        # Hill's relations: C13 = ⟨l⟩ − z̄ Δk Δl and C33 = ⟨n⟩ − z̄ Δl², with means ⟨⟩ by area.
        _, lateral, axial = self.moduli @ self.fractions
        bulk_contrast, lateral_contrast, _ = self.differences
        coupling = bulk_contrast * lateral_contrast
        return float(lateral - z * coupling), float(axial - z * lateral_contrast**2)


@dataclass(frozen=True, eq=False)
class AxialStiffness:
    """Stiffness along the fibres, with declared absolute errors, in Pa.

    Args:
        lateral: C13, C23 and C63, shape (3,).
        axial: C33.
        lateral_errors: Errors of `lateral`, shape (3,).
        axial_error: Error of `axial`.
    """

    lateral: Array
    axial: float
    lateral_errors: Array
    axial_error: float

    @classmethod
    def of_result(cls, result: HomogenisedStiffness) -> Self | None:
        """Return the stiffness along the fibres, from the plane stiffness by Hill's relations.

        Strains along the fibres and in the plane that leave both phases at one uniform strain
        (Hill, J. Mech. Phys. Solids 12, 199, 1964) tie C13, C23, C63 and C33 to the plane stiffness
        C. With k, l = C13 and n = C33 of the phases, Δ their differences and ⟨⟩ means by area,
        (C13, C23, C63) = ⟨l⟩ (1, 1, 0) − z Δk Δl and C33 = ⟨n⟩ − z̄ Δl², where C (1, 1, 0)/2 = ⟨k⟩
        (1, 1, 0) − z Δk² gives the vector z, and z̄ = (z1 + z2)/2.

        Args:
            result: Result of any model.

        Returns:
            `lateral`, (C13, C23, C63), and `axial`, C33, in Pa, with their absolute errors; these
            are NaN if the result declares no errors. None without a cell of two isotropic phases,
            or without a plane stiffness.
        """
        cell = result.cell
        stiffness = result.stiffness
        errors = result.stiffness_errors
        if cell is None or stiffness is None or errors is None:
            return None
        if not all(isinstance(phase, Phase) for phase in cell.phases):
            return None
        mixture = Mixture.of_cell(cell)
        equibiaxial = np.array([1.0, 1.0, 0.0])
        # Half of C (1, 1, 0): its mean normal component is the plane-strain bulk modulus.
        response = stiffness @ equibiaxial / 2
        bulk = float(response @ equibiaxial / 2)
        z, lower, upper = mixture.z_from_bulk(bulk, float(result.modulus_errors[0]))
        z_error = max(z - lower, upper - z)
        bulk_contrast, lateral_contrast, _ = mixture.differences
        mean_lateral, axial = mixture.lateral_and_axial(z)

        # The part of C (1, 1, 0)/2 that is not of square symmetry enters times Δl/Δk. It vanishes
        # where Δk does, since the phases then have equal stress under (1, 1, 0).
        # Below 1e-9 of the modulus the contrast is rounding of moduli that are meant to be equal.
        is_contrast = abs(bulk_contrast) > 1e-9 * mixture.moduli[0].max()
        ratio = lateral_contrast / bulk_contrast if is_contrast else 0.0
        anisotropic = response - bulk * equibiaxial
        # The error of z̄ acts on C13 and C33 by Δk Δl and Δl²; the part that is not of square
        # symmetry has the errors of C.
        mean_error = z_error * abs(bulk_contrast * lateral_contrast)
        anisotropic_errors = abs(ratio) * (errors @ equibiaxial) / 2
        return cls(
            lateral=mean_lateral * equibiaxial + ratio * anisotropic,
            axial=axial,
            lateral_errors=mean_error * equibiaxial + anisotropic_errors,
            axial_error=z_error * lateral_contrast**2,
        )

    def free_constants(self, stiffness: Array, errors: Array) -> EngineeringConstants:
        """Return the engineering constants without stress along the fibres.

        In this generalised plane strain they are those of C − c cᵀ/C33 with c = (C13, C23, C63) of
        `self.lateral` and C33 of `self.axial`.

        Args:
            stiffness: C of plane strain in Voigt's order 11, 22, 12, shape (3, 3), in Pa.
            errors: Declared absolute errors of its entries, shape (3, 3), in Pa; NaN where unknown.

        Returns:
            E_x, E_y, ν_xy and G_xy with their absolute errors, shape (4,) each, moduli in Pa.

        Raises:
            numpy.linalg.LinAlgError: C − c cᵀ/C33 is singular.
        """
        c = self.lateral
        reduction = np.outer(c, c) / self.axial
        # To first order the errors of c cᵀ/C33 by either factor c and by C33 add up.
        by_lateral = np.outer(abs(c), self.lateral_errors) / self.axial
        by_axial = abs(reduction) * self.axial_error / self.axial
        return EngineeringConstants.of_stiffness(
            stiffness - reduction, errors + by_lateral + by_lateral.T + by_axial
        )
