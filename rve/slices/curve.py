"""Stress curve, its error in E and its certificate, from stiffnesses at nodes of θ."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from alphacut.rve.cell import STRAIN, Phase
from alphacut.rve.certificate import ROUND_OFF, Limits, require, stiffness_checks
from alphacut.rve.result import Homogenised, StressCurve
from alphacut.stochastic import RadiusMap, ThetaRule
from alphacut.stochastic.theta.truncated_normal import Array

AREA = 4.0


def stresses(stiffness: Array) -> tuple[Array, Array]:
    """σ11 under load 1 and σ12 under load 2 of eq. 15 from stiffnesses (n, 3, 3)."""
    return STRAIN * (stiffness[:, 0, 0] + stiffness[:, 0, 1]), 2 * STRAIN * stiffness[:, 2, 2]


def curve_of(rule: ThetaRule, stiffness: Array) -> StressCurve:
    """Stress over θ from the stiffness (n, 3, 3) at the nodes."""
    return StressCurve(rule.nodes, rule.weights, *stresses(stiffness), stiffness)


def modulus_error(curve: StressCurve, error: Array) -> float:
    """Relative error of E of eq. 16 from those of C11 + C12 and C33, shape (n,)."""
    s11, s12 = curve.mean
    bulk, shear = (
        float(curve.weights @ (s * error)) / mean
        for s, mean in ((curve.s11, s11), (curve.s12, s12))
    )
    ratio = s12 / s11
    return (abs(ratio) * bulk + abs(3 - 2 * ratio) * shear) / abs(3 - ratio)  # E = A (3 − A/B) / 2


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
    return replace(
        result, checks=require(checks, Limits(discretisation=ROUND_OFF + result.estimated_error))
    )
