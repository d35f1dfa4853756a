"""Stress curve, its error in E and its certificate, from stiffnesses at nodes of θ."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.rve.cell import STRAIN, square_moduli
from alphacut.rve.certificate import ROUND_OFF, require, stress_checks
from alphacut.rve.mesh.outline import area
from alphacut.rve.result import Homogenised, StressCurve
from alphacut.stochastic import ThetaRule

AREA = 4.0


def stresses(stiffness: Array) -> tuple[Array, Array]:
    """σ11 under load 1 and σ12 under load 2 of eq. 15 from stiffnesses (n, 3, 3) or (n, 6, 6)."""
    return STRAIN * (stiffness[:, 0, 0] + stiffness[:, 0, 1]), 2 * STRAIN * stiffness[:, -1, -1]


def curve_of(rule: ThetaRule, stiffness: Array) -> StressCurve:
    """Stress over θ from the stiffness (n, 3, 3) or (n, 6, 6) at the nodes."""
    return StressCurve(rule.nodes, rule.weights, *stresses(stiffness), stiffness)


def with_errors(curve: StressCurve, error: Array, *, square: bool = True) -> StressCurve:
    """The curve with the declared relative errors of its stresses.

    Args:
        curve: With its stiffness.
        error: Relative errors of C11 + C12, C11 − C12 and C33 at the nodes, shape (n, 3).
        square: Whether x1 and x2 differ by the mesh alone.
    """
    moduli = square_moduli(np.asarray(curve.stiffness))
    uneven = abs(STRAIN * moduli[:, 0] / curve.s11 - 1) * square
    return replace(curve, error=np.stack([error[:, 0] + uneven, error[:, 2]], axis=-1))


def mean_errors(curve: StressCurve, error: Array, *, square: bool = True) -> Array:
    """Relative errors of the mean moduli from those at the nodes, shape (n, 3).

    Args:
        curve: With its stiffness.
        error: As in `with_errors`.
        square: Whether x1 and x2 differ by the mesh alone.

    Returns:
        Of C11 + C12, C11 − C12 and C33, shape (3,).
    """
    moduli = square_moduli(np.asarray(curve.stiffness))
    mean = curve.weights @ moduli
    errors = np.asarray(curve.weights @ (moduli * error) / mean)
    errors[0] += abs(STRAIN * mean[0] / curve.mean[0] - 1) * square
    return errors


def certified(result: Homogenised) -> Homogenised:
    """Result with the certificate of its stiffness, within the estimated error.

    Raises:
        CertificateError: Symmetry or a bound is violated.
    """
    curve, cell = result.curve, result.cell
    assert cell is not None
    assert curve.stiffness is not None
    fraction = area(cell.outline) / AREA * cell.radius(curve.theta) ** 2
    phases = cell.matrix, cell.inclusion
    checks = stress_checks(curve.stiffness, np.eye(3), fraction, curve.weights, phases)
    checks = require(checks, discretisation=ROUND_OFF + result.largest_error)
    return replace(result, checks=checks)
