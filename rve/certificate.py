"""Checks of a result: measured violations of properties that every correct result has."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import FailedError
from alphacut.rve.bounds import hashin_shtrikman, reuss, voigt
from alphacut.rve.cell import AnyPhase, Phase
from alphacut.rve.result import HomogenisedStiffness

ROUND_OFF = 1e-9
ALGEBRAIC = 1e-7
"""Most by which what holds in exact arithmetic may be violated."""


class CertificateError(FailedError):
    """A result lacks a property that every correct one has."""


WHAT = {
    "residual": "the linear system is not solved",
    "hill_mandel": "mean stress times mean strain is not the mean of their product (Hill–Mandel)",
    "symmetry": "the effective stiffness is not symmetric",
    "reuss": "the effective stiffness is below the Reuss bound",
    "voigt": "the effective stiffness is above the Voigt bound",
    "hashin_shtrikman": "the bulk modulus is outside the Hashin–Shtrikman bounds",
}
BOUNDS = ("reuss", "voigt", "hashin_shtrikman")


def require(checks: Mapping[str, float], *, discretisation: float = ROUND_OFF) -> dict[str, float]:
    """The checks as they are, if all are within their limits.

    Args:
        checks: Relative violations by the names of `WHAT`.
        discretisation: Declared error of the stiffness, the limit of the bounds; that of the others
            is `ALGEBRAIC`.

    Raises:
        CertificateError: One is not; the message names it with its value and its limit.
    """
    for name, value in checks.items():
        limit = discretisation if name in BOUNDS else ALGEBRAIC
        if not value <= limit:
            raise CertificateError(
                f"{WHAT[name]}: relative violation {value:.2e}, {limit:.2e} is allowed",
                "do not use this result",
            )
    return dict(checks)


def certified(result: HomogenisedStiffness) -> HomogenisedStiffness:
    """The result with its checks, which hold within its declared error.

    Args:
        result: With its cell and its stiffness.

    Raises:
        CertificateError: Symmetry or a bound is violated.
    """
    curve, cell = result.curve, result.cell
    assert cell is not None
    assert curve.stiffness is not None
    checks = stress_checks(
        curve.stiffness, np.eye(3), cell.fractions(curve.theta), curve.weights, cell.phases
    )
    checks = require(checks, discretisation=ROUND_OFF + result.largest_error)
    return replace(result, checks=checks)


def stress_checks(
    stress: Array, loads: Array, fractions: Array, weights: Array, phases: Sequence[AnyPhase]
) -> dict[str, float]:
    """Symmetry and bounds of the mean stiffness, as the loads see it.

    Args:
        stress: Homogenised (σ11, σ22, σ12) at the nodes of θ for each load, shape (n, 3, loads), in
            Pa.
        loads: Macroscopic strains (ε11, ε22, 2 ε12), shape (loads, 3), ε11 = ε22 in their span.
        fractions: Area fractions of the phases at the nodes, shape (phases, n).
        weights: Weights of the nodes, shape (n,).
        phases: Materials, in the order of their fractions.
    """
    stiffness = [phase.stiffness for phase in phases]
    energy = loads @ mean(weights, stress)
    low, high = (
        loads @ mean(weights, bound(fractions, stiffness)) @ loads.T for bound in (reuss, voigt)
    )
    checks = order_checks(energy, low, high)
    if all(isinstance(phase, Phase) for phase in phases):
        least, greatest = hashin_shtrikman(fractions, stiffness)[0] @ weights
        even = np.linalg.lstsq(loads.T, np.array([1.0, 1.0, 0.0]), rcond=None)[0]
        bulk = even @ energy @ even / 4
        checks["hashin_shtrikman"] = float(max(0.0, least - bulk, bulk - greatest) / bulk)
    return checks


def order_checks(energy: Array, low: Array, high: Array) -> dict[str, float]:
    """Symmetry of a quadratic form, (k, k), and its order between two others."""
    scale = float(abs(energy).max())
    return {
        "symmetry": float(abs(energy - energy.T).max()) / scale,
        "reuss": _below(energy - low) / scale,
        "voigt": _below(high - energy) / scale,
    }


def mean(weights: Array, values: Array) -> Array:
    """Weighted sum over the first axis."""
    return np.asarray(np.tensordot(weights, values, axes=1))


def _below(difference: Array) -> float:
    """Depth of the least eigenvalue below zero."""
    return max(0.0, -float(np.linalg.eigvalsh((difference + difference.T) / 2)[0]))
