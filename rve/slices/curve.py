"""Stress curve, its error in E and its certificate, from stiffnesses at nodes of θ."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from alphacut.rve.cell import STRAIN, Cell, Phase, square_moduli
from alphacut.rve.certificate import ROUND_OFF, Limits, require, stiffness_checks
from alphacut.rve.result import Homogenised, StressCurve
from alphacut.stochastic import RadiusMap, ThetaRule
from alphacut.stochastic.theta.truncated_normal import Array

AREA = 4.0


def stresses(stiffness: Array) -> tuple[Array, Array]:
    """σ11 under load 1 and σ12 under load 2 of eq. 15 from stiffnesses (n, 3, 3) or (n, 6, 6)."""
    return STRAIN * (stiffness[:, 0, 0] + stiffness[:, 0, 1]), 2 * STRAIN * stiffness[:, -1, -1]


def curve_of(rule: ThetaRule, stiffness: Array) -> StressCurve:
    """Stress over θ from the stiffness (n, 3, 3) or (n, 6, 6) at the nodes."""
    return StressCurve(rule.nodes, rule.weights, *stresses(stiffness), stiffness)


def with_errors(curve: StressCurve, error: Array) -> StressCurve:
    """The curve with the declared relative errors of its stresses.

    Args:
        curve: With its stiffness.
        error: Relative errors of C11 + C12, C11 − C12 and C33 at the nodes, shape (n, 3).
    """
    moduli = square_moduli(np.asarray(curve.stiffness))
    uneven = abs(STRAIN * moduli[:, 0] / curve.s11 - 1)  # of the mesh: x1 is not quite x2
    return replace(curve, error=np.stack([error[:, 0] + uneven, error[:, 2]], axis=-1))


def mean_errors(curve: StressCurve, error: Array) -> Array:
    """Relative errors of the mean moduli, shape (3,), from those at the nodes, shape (n, 3)."""
    moduli = square_moduli(np.asarray(curve.stiffness))
    mean, uneven = curve.weights @ moduli, np.zeros(3)
    uneven[0] = abs(STRAIN * mean[0] / curve.mean[0] - 1)  # of the mesh: x1 is not quite x2
    return np.asarray(curve.weights @ (moduli * error) / mean + uneven)


def certified(
    result: Homogenised, radius_map: RadiusMap, matrix: Phase, inclusion: Phase
) -> Homogenised:
    """Result with the certificate of its stiffness, within the estimated error.

    Raises:
        CertificateError: Symmetry or a bound is violated.
    """
    curve = result.curve
    if curve.stiffness is None:
        return result
    fraction = np.pi / AREA * radius_map(curve.theta) ** 2
    checks = stiffness_checks(curve.stiffness, fraction, curve.weights, (matrix, inclusion))
    limits = Limits(discretisation=ROUND_OFF + result.largest_error)
    return replace(result, checks=require(checks, limits), cell=Cell(matrix, inclusion, radius_map))
