"""Constants of the cell as a material of aligned fibres, with their declared errors.

With the in-plane bulk modulus k, l = C13 and n = C33 of `axial`

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
from alphacut.rve.axial import Mixture
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
    if cell is None or not cell.square or cell.interphase is not None:
        raise RefusedError("cell", cell, "a result of round particles and two isotropic phases")
    mixture, bulk, shear = Mixture.of_cell(cell), result.moduli[0] / 2, result.shear
    across = float(result.error_of(result.shear_of)) / shear
    along, error = _mean_longitudinal_shear(cell)
    z, *ends = mixture.between(bulk, result.modulus_errors[0])
    values = _constants(mixture, z, bulk, shear, along)
    corners = [
        _constants(
            mixture, end, mixture.bulk(end), shear * (1 + across) ** a, along * (1 + error) ** b
        )
        for end, a, b in product(ends, (-1, 1), (-1, 1))
    ]
    errors = np.abs(np.array(corners) - values).max(axis=0) + _ROUND_OFF * np.abs(values)
    named = (dict(zip(CONSTANTS, map(float, row), strict=True)) for row in (values, errors))
    return FibreConstants(*named)


def _constants(mixture: Mixture, z: float, bulk: float, shear: float, along: float) -> Array:
    """Constants in the order of `CONSTANTS`, from z, K_T, G_T and G_L."""
    lateral, axial = mixture.along(z)
    ratio, young = lateral / (2 * bulk), axial - lateral**2 / bulk
    across = 1 / (1 / (4 * shear) + 1 / (4 * bulk) + ratio**2 / young)
    return np.array([across, young, ratio, shear, along, bulk])


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
    coarser, _ = mean(gauss_rule(cell.radius.distribution, points=_COARSER))
    return value, error + abs(coarser / value - 1)
