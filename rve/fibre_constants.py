"""Orthotropic constants of the cell as a material of aligned fibres, with their declared errors.

What acts along the fibres follows from the plane by Hill's relations (J. Mech. Phys. Solids 12,
199, 1964), exact for two isotropic phases in any arrangement that answers hydrostatic strain
hydrostatically. With k the in-plane bulk modulus, l = C13 and n = C33 of phases and composite, c
the shares of area and Δ the difference of the phases,

    k = Σ c k − z Δk²,   l = Σ c l − z Δk Δl,   n = Σ c n − z Δl²

with one number z; they are linear and hold for means over θ too. So the mean of σ33 = ν (σ11 + σ22)
needs no field. Hashin and Shtrikman bound z where the phases' k are too close to show it.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from alphacut.rve.cell import Cell, Phase, square_moduli
from alphacut.rve.result import Homogenised
from alphacut.rve.series.stiffness import longitudinal_shear
from alphacut.rve.slices.theta_rule import theta_rule
from alphacut.stochastic import ThetaRule
from alphacut.stochastic.theta.truncated_normal import Array

CONSTANTS = ("E1", "E2", "E3", "nu12", "nu13", "nu23", "G12", "G13", "G23")
_FINE, _COARSER = 128, 96  # nodes in θ
_ROUND_OFF = 1e-12


@dataclass(frozen=True)
class FibreConstants:
    """Orthotropic constants, axes 1 and 2 along the array, 3 along the particles.

    Args:
        values: By the names of `CONSTANTS`, moduli in Pa.
        errors: Declared absolute errors by the same names, nan where unknown.
    """

    values: dict[str, float]
    errors: dict[str, float]


def fibre_constants(result: Homogenised) -> FibreConstants:
    """Constants of a result that has its whole plane stiffness and its cell.

    Raises:
        ValueError: It has not.
    """
    if result.stiffness is None or result.cell is None:
        raise ValueError("the result has no plane stiffness; solve the third load as well")
    moduli, errors = square_moduli(result.stiffness), result.modulus_errors
    shear13, error13 = _mean_longitudinal_shear(result.cell)
    slack = _Slack.of(result.cell)
    z, *ends = slack.between(moduli[0] / 2, errors[0])
    values = _constants(moduli[0] / 2, z, moduli[1], moduli[2], shear13, slack=slack)
    changes = [
        _constants(
            slack.bulk(end),
            end,
            moduli[1] * (1 + errors[1]) ** first,
            moduli[2] * (1 + errors[2]) ** second,
            shear13 * (1 + error13) ** second,
            slack=slack,
        )
        - values
        for end, first, second in product(ends, (-1, 1), (-1, 1))
    ]
    found = np.abs(changes).max(axis=0) + _ROUND_OFF * np.abs(values)
    return FibreConstants(_by_name(values), _by_name(found))


def across_fibres(cell: Cell, bulk: float, shear: float) -> dict[str, float]:
    """Constants of fibres with no direction of their own across, from those of the plane.

    1/E_T = 1/(4 G23) + 1/(4 K23) + ν_LT²/E_L (Hill 1964).

    Args:
        cell: Phases and radius, by which E_L and ν_LT follow from K23.
        bulk: In-plane bulk modulus K23 = (C11 + C12)/2 in Pa, of plane strain.
        shear: G23 in Pa.

    Returns:
        "E_T", "E_L", "G23" and "K23" in Pa, and "nu_LT".
    """
    slack = _Slack.of(cell)
    z, *_ = slack.between(bulk, 0.0)
    values = _by_name(_constants(bulk, z, 2 * shear, shear, shear, slack=slack))
    across, young = values["E1"], values["E3"]
    ratio = values["nu13"] * young / across
    return {"E_T": across, "E_L": young, "G23": shear, "K23": bulk, "nu_LT": ratio}


def _by_name(values: Array) -> dict[str, float]:
    return dict(zip(CONSTANTS, map(float, values), strict=True))


def _constants(
    bulk: float, z: float, deviator: float, shear: float, shear13: float, *, slack: _Slack
) -> Array:
    """Constants in the order of `CONSTANTS`.

    They follow from the in-plane bulk modulus, z, C11 − C12, C33 of the plane (σ12 over 2 ε12) and
    G13.
    """
    lateral, axial = slack.along(z)
    ratio, young = lateral / (2 * bulk), axial - lateral**2 / bulk
    softness = ratio**2 / young + 1 / (4 * bulk)
    across = 1 / (1 / (2 * deviator) + softness)
    nu12 = across * (1 / (2 * deviator) - softness)
    nu13 = ratio * across / young
    return np.array([across, across, young, nu12, nu13, nu13, shear, shear13, shear13])


@dataclass(frozen=True)
class _Slack:
    """The number z of Hill's relations for one mixture.

    Args:
        phases: Matrix and inclusion.
        shares: Their mean shares of area, shape (2,).
        bounds: Of z by Hashin and Shtrikman, in 1/Pa.
    """

    phases: tuple[Phase, Phase]
    shares: Array
    bounds: tuple[float, float]

    @classmethod
    def of(cls, cell: Cell) -> _Slack:
        """Of a cell, averaged over θ."""
        rule = theta_rule(cell.radius, points=_FINE)
        inner = np.pi / 4 * cell.radius(rule.nodes) ** 2
        phases = cell.matrix, cell.inclusion
        (bulk, *_), mean = _fibre(phases), float(rule.weights @ inner)
        between = inner * bulk[0] + (1 - inner) * bulk[1]
        ends = [
            float(rule.weights @ ((1 - inner) * inner / (between + phase.stiffness[2, 2])))
            for phase in phases
        ]
        return cls(phases, np.array([1 - mean, mean]), (min(ends), max(ends)))

    def between(self, bulk: float, error: float) -> tuple[float, float, float]:
        """Value of z and its ends, from k in Pa and its relative error."""
        low, high = self.bounds
        phase = _fibre(self.phases)[0]
        square, width = (phase[1] - phase[0]) ** 2, error * bulk
        if 2 * width >= square * (high - low) or square == 0:
            return (low + high) / 2, low, high
        places = (self.shares @ phase - bulk + np.array([0, -width, width])) / square
        value, first, last = np.clip(places, low, high)
        return float(value), float(first), float(last)

    def bulk(self, z: float) -> float:
        """In-plane bulk modulus k in Pa."""
        k, *_ = _fibre(self.phases)
        return float(self.shares @ k - z * (k[1] - k[0]) ** 2)

    def along(self, z: float) -> tuple[float, float]:
        """C13 and C33 in Pa: l and n."""
        k, lateral, axial = _fibre(self.phases)
        change = lateral[1] - lateral[0]
        return (
            float(self.shares @ lateral - z * (k[1] - k[0]) * change),
            float(self.shares @ axial - z * change**2),
        )


def _fibre(phases: tuple[Phase, Phase]) -> tuple[Array, Array, Array]:
    """The k, l and n of both phases in Pa, shape (2,) each."""
    c = np.array([phase.stiffness for phase in phases])
    return (c[:, 0, 0] + c[:, 0, 1]) / 2, c[:, 0, 1], c[:, 0, 0]


def _mean_longitudinal_shear(cell: Cell) -> tuple[float, float]:
    """Mean G13 under f_Θ in Pa, and its declared relative error."""

    def mean(rule: ThetaRule) -> tuple[float, float]:
        values, errors = longitudinal_shear(cell.radius(rule.nodes), cell.matrix, cell.inclusion)
        total = float(rule.weights @ values)
        return total, float(rule.weights @ (values * errors)) / total

    value, error = mean(theta_rule(cell.radius, points=_FINE))
    other, _ = mean(theta_rule(cell.radius, points=_COARSER))
    return value, error + abs(other / value - 1)
