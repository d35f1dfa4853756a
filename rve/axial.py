"""What acts along the fibres, C13 and C33 of the cell, from its plane stiffness alone.

With k the in-plane bulk modulus, l = C13 and n = C33 of the phases, Δ their differences and ⟨⟩
their means by area, strains along the fibres and in the plane that leave both phases at one uniform
strain (Hill, J. Mech. Phys. Solids 12, 199, 1964; Dvorak, Proc. R. Soc. A 431, 89, 1990) give

    (C13, C23, C63) = ⟨l⟩ (1, 1, 0) − z Δk Δl,   C33 = ⟨n⟩ − z̄ Δl²
    with C (1, 1, 0)/2 = ⟨k⟩ (1, 1, 0) − z Δk² and z̄ = (z1 + z2)/2

for two isotropic phases in any arrangement, and for means over θ. Hashin and Shtrikman bound z̄
where the phases' k are too close to show it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.rve.cell import Cell, Phase
from alphacut.rve.result import HomogenisedStiffness
from alphacut.stochastic import gauss_rule

POINTS = 32  # nodes in θ
EVEN = np.array([1.0, 1.0, 0.0])


@dataclass(frozen=True)
class Mixture:
    """The moduli of two isotropic phases and what bounds z̄.

    Args:
        moduli: k, l and n of matrix and inclusion, shape (3, 2), in Pa.
        shares: Their mean shares of area, shape (2,).
        bounds: Of z̄ by Hashin and Shtrikman, in 1/Pa.
    """

    moduli: Array
    shares: Array
    bounds: tuple[float, float]

    @classmethod
    def of_cell(cls, cell: Cell) -> Self:
        """Of a cell, averaged over θ."""
        rule = gauss_rule(cell.radius.distribution, points=POINTS)
        inner, c = cell.fraction(rule.nodes), np.array(cell.stiffness)
        bulk, mean = (c[:, 0, 0] + c[:, 0, 1]) / 2, float(rule.weights @ inner)
        between = inner * bulk[0] + (1 - inner) * bulk[1]
        ends = [rule.weights @ ((1 - inner) * inner / (between + shear)) for shear in c[:, 2, 2]]
        moduli = np.array([bulk, c[:, 0, 1], c[:, 0, 0]])
        return cls(moduli, np.array([1 - mean, mean]), (float(min(ends)), float(max(ends))))

    @property
    def differences(self) -> Array:
        """Δk, Δl and Δn, shape (3,), in Pa."""
        return np.asarray(np.diff(self.moduli, axis=1)[:, 0])

    def between(self, bulk: float, error: float) -> tuple[float, float, float]:
        """Value of z̄ and its ends, from the in-plane bulk modulus in Pa and its relative error."""
        (low, high), square = self.bounds, float(self.differences[0] ** 2)
        width = error * bulk
        if 2 * width >= square * (high - low) or square == 0:
            return (low + high) / 2, low, high
        places = (self.shares @ self.moduli[0] - bulk + np.array([0, -width, width])) / square
        value, first, last = np.clip(places, low, high)
        return float(value), float(first), float(last)

    def bulk(self, z: float) -> float:
        """In-plane bulk modulus in Pa."""
        return float(self.shares @ self.moduli[0] - z * self.differences[0] ** 2)

    def along(self, z: float) -> tuple[float, float]:
        """C13 = C23 of an even cell and C33, in Pa."""
        _, lateral, axial = self.moduli @ self.shares
        bulk, change, _ = self.differences
        return float(lateral - z * bulk * change), float(axial - z * change**2)


@dataclass(frozen=True, eq=False)
class AxialStiffness:
    """C13, C23, C63 and C33 with their declared absolute errors, in Pa.

    Args:
        lateral: C13, C23 and C63, shape (3,).
        axial: C33.
        lateral_errors: Shape (3,).
        axial_error: Of C33.
    """

    lateral: Array
    axial: float
    lateral_errors: Array
    axial_error: float

    @classmethod
    def of_result(cls, result: HomogenisedStiffness) -> Self | None:
        """Of a result with its cell, of two isotropic phases, and its stiffness; else None."""
        cell, stiffness, errors = result.cell, result.stiffness, result.stiffness_errors
        if cell is None or stiffness is None or errors is None:
            return None
        isotropic = all(isinstance(phase, Phase) for phase in cell.phases)
        if not isotropic or len(cell.phases) > 2:
            return None
        mixture, uneven = Mixture.of_cell(cell), stiffness @ EVEN / 2
        z, *ends = mixture.between(float(uneven @ EVEN / 2), float(result.modulus_errors[0]))
        z_error = max(abs(end - z) for end in ends)
        bulk, lateral, _ = mixture.differences
        even, axial = mixture.along(z)
        ratio = lateral / bulk if abs(bulk) > 1e-9 * mixture.moduli[0].max() else 0.0
        uneven = uneven - EVEN * (uneven @ EVEN) / 2
        return cls(
            even * EVEN + ratio * uneven,
            axial,
            z_error * abs(bulk * lateral) * EVEN + abs(ratio) * (errors @ EVEN) / 2,
            z_error * lateral**2,
        )

    def released(self, stiffness: Array, errors: Array) -> tuple[Array, Array]:
        """C − c cᵀ/C33, whose fibres bear no stress, and the errors of its entries, (3, 3)."""
        c, off = self.lateral, np.outer(abs(self.lateral), self.lateral_errors) / self.axial
        change = np.outer(c, c) / self.axial
        of_change = off + off.T + abs(change) * self.axial_error / self.axial
        return stiffness - change, errors + of_change
