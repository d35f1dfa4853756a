"""Constants of the cell as a material of aligned fibres, with their declared errors.

With k the in-plane bulk modulus, l = C13 and n = C33 of phases and composite, c the shares of area
and Δ the difference of the phases, Hill's relations (J. Mech. Phys. Solids 12, 199, 1964)

    k = Σ c k − z Δk²,   l = Σ c l − z Δk Δl,   n = Σ c n − z Δl²

hold with one number z for two isotropic phases in any arrangement that answers hydrostatic strain
hydrostatically, and for means over θ too. So what acts along the fibres needs no field. Hashin and
Shtrikman bound z where the phases' k are too close to show it.

    E_L = n − l²/k,   ν_LT = l/(2 k),   1/E_T = 1/(4 G_T) + 1/(4 K_T) + ν_LT²/E_L

G_T and K_T are those of the result's average, G_L is the shear modulus along the fibres.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import RefusedError
from alphacut.rve.cell import Cell, Phase
from alphacut.rve.series.longitudinal import longitudinal_shear
from alphacut.stochastic import ThetaRule, gauss_rule

if TYPE_CHECKING:
    from alphacut.rve.result import HomogenisedStiffness

CONSTANTS = ("E_T", "E_L", "nu_LT", "G_T", "G_L", "K_T")
_FINE, _COARSER = 32, 24  # nodes in θ
_ROUND_OFF = 1e-12


@dataclass(frozen=True)
class FibreConstants:
    """Constants along (L) and across (T) the fibres.

    Args:
        values: By the names of `CONSTANTS`, moduli in Pa.
        errors: Declared absolute errors by the same names, nan where unknown.
    """

    values: dict[str, float]
    errors: dict[str, float]


def fibre_constants(result: HomogenisedStiffness) -> FibreConstants:
    """Constants of a result that knows its cell, of round particles and isotropic phases.

    Raises:
        RefusedError: It does not, or they are not.
    """
    cell = result.cell
    if cell is None or not cell.square:
        raise RefusedError("cell", cell, "a result of round particles and isotropic phases")
    slack, bulk, shear = _Slack.of(cell), result.moduli[0] / 2, result.shear
    across = float(result.error_of(result.shear_of)) / shear
    along, error = _mean_longitudinal_shear(cell)
    z, *ends = slack.between(bulk, result.modulus_errors[0])
    values = _constants(slack, z, bulk, shear, along)
    corners = [
        _constants(slack, end, slack.bulk(end), shear * (1 + across) ** a, along * (1 + error) ** b)
        for end, a, b in product(ends, (-1, 1), (-1, 1))
    ]
    errors = np.abs(np.array(corners) - values).max(axis=0) + _ROUND_OFF * np.abs(values)
    named = (dict(zip(CONSTANTS, map(float, row), strict=True)) for row in (values, errors))
    return FibreConstants(*named)


def _constants(slack: _Slack, z: float, bulk: float, shear: float, along: float) -> Array:
    """Constants in the order of `CONSTANTS`, from z, K_T, G_T and G_L."""
    lateral, axial = slack.along(z)
    ratio, young = lateral / (2 * bulk), axial - lateral**2 / bulk
    across = 1 / (1 / (4 * shear) + 1 / (4 * bulk) + ratio**2 / young)
    return np.array([across, young, ratio, shear, along, bulk])


@dataclass(frozen=True)
class _Slack:
    """The number z of Hill's relations for one mixture.

    Args:
        moduli: k, l and n of matrix and inclusion, shape (3, 2), in Pa.
        shares: Their mean shares of area, shape (2,).
        bounds: Of z by Hashin and Shtrikman, in 1/Pa.
    """

    moduli: Array
    shares: Array
    bounds: tuple[float, float]

    @classmethod
    def of(cls, cell: Cell) -> _Slack:
        """Of a cell, averaged over θ."""
        rule = gauss_rule(cell.radius.distribution, points=_FINE)
        inner, c = cell.fraction(rule.nodes), np.array(cell.stiffness)
        bulk, mean = (c[:, 0, 0] + c[:, 0, 1]) / 2, float(rule.weights @ inner)
        between = inner * bulk[0] + (1 - inner) * bulk[1]
        ends = [rule.weights @ ((1 - inner) * inner / (between + shear)) for shear in c[:, 2, 2]]
        moduli = np.array([bulk, c[:, 0, 1], c[:, 0, 0]])
        return cls(moduli, np.array([1 - mean, mean]), (float(min(ends)), float(max(ends))))

    def between(self, bulk: float, error: float) -> tuple[float, float, float]:
        """Value of z and its ends, from k in Pa and its relative error."""
        (low, high), square = self.bounds, float(np.diff(self.moduli[0])[0] ** 2)
        width = error * bulk
        if 2 * width >= square * (high - low) or square == 0:
            return (low + high) / 2, low, high
        places = (self.shares @ self.moduli[0] - bulk + np.array([0, -width, width])) / square
        value, first, last = np.clip(places, low, high)
        return float(value), float(first), float(last)

    def bulk(self, z: float) -> float:
        """In-plane bulk modulus k in Pa."""
        return float(self.shares @ self.moduli[0] - z * np.diff(self.moduli[0])[0] ** 2)

    def along(self, z: float) -> tuple[float, float]:
        """C13 and C33 in Pa: l and n."""
        _, lateral, axial = self.moduli @ self.shares
        bulk, change, _ = np.diff(self.moduli, axis=1)[:, 0]
        return float(lateral - z * bulk * change), float(axial - z * change**2)


def _mean_longitudinal_shear(cell: Cell) -> tuple[float, float]:
    """Mean G_L under f_Θ in Pa, and its declared relative error."""
    matrix, inclusion = cell.matrix, cell.inclusion
    assert isinstance(matrix, Phase)
    assert isinstance(inclusion, Phase)

    def mean(rule: ThetaRule) -> tuple[float, float]:
        values, errors = longitudinal_shear(cell.radius(rule.nodes), matrix, inclusion)
        total = float(rule.weights @ values)
        return total, float(rule.weights @ (values * errors)) / total

    value, error = mean(gauss_rule(cell.radius.distribution, points=_FINE))
    other, _ = mean(gauss_rule(cell.radius.distribution, points=_COARSER))
    return value, error + abs(other / value - 1)
