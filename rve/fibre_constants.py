"""Constants of the cell as a material of aligned fibres, with their declared errors.

With the in-plane bulk modulus k, l = C13 and n = C33 of `axial`

    E_L = n − l²/k,   ν_LT = l/(2 k),   1/E_T = 1/(4 G_T) + 1/(4 K_T) + ν_LT²/E_L

G_T and K_T are those of the result's average, G_L is the shear modulus along the fibres.
"""

from __future__ import annotations

from dataclasses import dataclass
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
    """E_T, E_L, ν_LT, G_T, G_L and K_T of a result of round fibres, with declared errors.

    Errors are the largest changes over the corners of the intervals of z̄, G_T and G_L.

    Raises:
        RefusedError: The result has no cell, or not of round particles and two isotropic phases.
    """
    cell = result.cell
    if cell is None or not cell.square or cell.interphase is not None:
        raise RefusedError("cell", cell, "a result of round particles and two isotropic phases")
    mixture, bulk = Mixture.of_cell(cell), result.moduli[0] / 2
    G_T, (G_L, G_L_error) = result.shear, _mean_longitudinal_shear(cell)
    G_T_error = float(result.error_of(result.shear_of)) / G_T
    z, *z_bounds = mixture.z_from_bulk(bulk, result.modulus_errors[0])
    values = _constants(mixture, z, bulk, G_T, G_L)
    corners = [
        _constants(mixture, z_bound, mixture.bulk(z_bound), transverse, longitudinal)
        for z_bound in z_bounds
        for transverse in (G_T / (1 + G_T_error), G_T * (1 + G_T_error))
        for longitudinal in (G_L / (1 + G_L_error), G_L * (1 + G_L_error))
    ]
    errors = np.abs(np.array(corners) - values).max(axis=0) + _ROUND_OFF * np.abs(values)
    return FibreConstants(
        dict(zip(CONSTANTS, map(float, values), strict=True)),
        dict(zip(CONSTANTS, map(float, errors), strict=True)),
    )


def _constants(mixture: Mixture, z: float, K_T: float, G_T: float, G_L: float) -> Array:
    """E_T, E_L, ν_LT, G_T, G_L and K_T, shape (6,), from Hill's z̄ and the other moduli."""
    lateral, axial = mixture.lateral_and_axial(z)
    nu_LT, E_L = lateral / (2 * K_T), axial - lateral**2 / K_T
    E_T = 1 / (1 / (4 * G_T) + 1 / (4 * K_T) + nu_LT**2 / E_L)
    return np.array([E_T, E_L, nu_LT, G_T, G_L, K_T])


def _mean_longitudinal_shear(cell: Cell) -> tuple[float, float]:
    """Mean shear modulus G_L along the fibres over θ in Pa, and its declared relative error."""
    matrix, inclusion = cell.matrix, cell.inclusion
    assert isinstance(matrix, Phase)
    assert isinstance(inclusion, Phase)

    def mean(rule: ThetaRule) -> tuple[float, float]:
        values, relative_errors = longitudinal_shear(cell.radius(rule.nodes), matrix, inclusion)
        total = float(rule.weights @ values)
        return total, float(rule.weights @ (values * relative_errors)) / total

    value, error = mean(gauss_rule(cell.radius.distribution, points=_FINE))
    coarser, _ = mean(gauss_rule(cell.radius.distribution, points=_COARSER))
    return value, error + abs(coarser / value - 1)
