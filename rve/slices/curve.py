"""Stress curve, its error in E and its certificate, from stiffnesses at nodes of θ."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.rve.cell import STRAIN, Cell, square_moduli
from alphacut.rve.certificate import ROUND_OFF, Limits, require, stiffness_checks
from alphacut.rve.mesh.outline import area, circle
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
        error: Relative errors of C11 + C12, C11 − C12, C33 and their ratio at the nodes, shape
            (n, 4).
        square: Whether x1 and x2 differ by the mesh alone.
    """
    moduli = square_moduli(np.asarray(curve.stiffness))
    uneven = abs(STRAIN * moduli[:, 0] / curve.s11 - 1) * square
    return replace(curve, error=np.stack([error[:, 0] + uneven, error[:, 2]], axis=-1))


def mean_errors(curve: StressCurve, error: Array, *, square: bool = True) -> Array:
    """Relative errors of the mean moduli and their ratio from those at the nodes, shape (n, 4).

    Args:
        curve: With its stiffness.
        error: As in `with_errors`.
        square: Whether x1 and x2 differ by the mesh alone.

    Returns:
        Of C11 + C12, C11 − C12, C33 and the ratio of the last two means, shape (4,).
    """
    moduli = square_moduli(np.asarray(curve.stiffness))
    mean = curve.weights @ moduli
    own = curve.weights @ (moduli * error[:, :3]) / mean
    errors = np.append(own, ratio_error(curve.weights, moduli, error))
    errors[0] += abs(STRAIN * mean[0] / curve.mean[0] - 1) * square
    return errors


def ratio_error(weights: Array, moduli: Array, error: Array) -> float:
    """Relative error of the ratio of the mean C11 − C12 and C33 from those at n nodes.

    With shares p and q of the nodes in either mean and errors d of C11 − C12, s of C33 and ρ of
    their ratio, it is Σ p d − Σ q s = Σ p ρ + Σ (p − q) s = Σ q ρ + Σ (p − q) d.

    Args:
        weights: Shape (n,).
        moduli: C11 + C12, C11 − C12 and C33 at the nodes, shape (n, 3).
        error: Relative, of the three moduli and the ratio, shape (n, 4).
    """
    p, q = (weights[:, None] * moduli / (weights @ moduli))[:, 1:].T
    _, d, s, ratio = error.T
    return float(min(p @ ratio + abs(p - q) @ s, q @ ratio + abs(p - q) @ d))


def certified(result: Homogenised, cell: Cell) -> Homogenised:
    """Result with its cell and the certificate of its stiffness, within the estimated error.

    Raises:
        CertificateError: Symmetry or a bound is violated.
    """
    curve = result.curve
    if curve.stiffness is None:
        return replace(result, cell=cell)
    fraction = area(cell.outline or circle) / AREA * cell.radius(curve.theta) ** 2
    phases = cell.matrix, cell.inclusion
    checks = stiffness_checks(curve.stiffness, fraction, curve.weights, phases)
    limits = Limits(discretisation=ROUND_OFF + result.largest_error)
    return replace(result, checks=require(checks, limits), cell=cell)
