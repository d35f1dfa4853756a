"""Engineering constants of a plane stiffness along x and y, with fibres along z.

In plane strain they are those of the inverse of C. Without stress along the fibres (generalised
plane strain) they are those of the inverse of C − c cᵀ/C33 with c = (C13, C23, C63).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.rve.axial import AxialStiffness
from alphacut.rve.result import HomogenisedStiffness

NAMES = ("E_x", "E_y", "nu_xy", "G_xy")
PLANE_STRAIN, FREE = "plane strain", "no stress along the fibres"
MARGIN = 1.1  # of errors to first order in those of the stiffness


@dataclass(frozen=True, eq=False)
class EngineeringConstants:
    """E_x, E_y, ν_xy and G_xy of one definition.

    Args:
        values: In the order of `NAMES`, moduli in Pa, shape (4,).
        errors: Declared absolute errors, same shape; nan where unknown.
    """

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
    """E_x, E_y, ν_xy and G_xy in plane strain, and without stress along the fibres where known.

    Returns:
        Constants by `PLANE_STRAIN` and, of two isotropic phases, `FREE`; empty for a result without
        its plane stiffness.
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
