"""Checks of a result: measured violations of properties that every correct result has."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import FailedError
from alphacut.rve.cell.cell import AnyPhase, Phase
from alphacut.rve.result.moduli import hashin_shtrikman, reuss, voigt
from alphacut.rve.result.result import HomogenisedStiffness

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


def checks_within_limits(
    checks: Mapping[str, float], *, discretisation: float = ROUND_OFF
) -> dict[str, float]:
    """Copy of the checks, relative violations by the names of `WHAT`.

    Args:
        checks: The checks.
        discretisation: Limit of those in `BOUNDS`; that of the others is `ALGEBRAIC`.

    Raises:
        CertificateError: A violation is too large; the message names it, its value and its limit.
    """
    for name, value in checks.items():
        limit = discretisation if name in BOUNDS else ALGEBRAIC
        if not value <= limit:
            raise CertificateError(
                f"{WHAT[name]}: relative violation {value:.2e}, {limit:.2e} is allowed",
                "do not use this result",
            )
    return dict(checks)


def with_checks(result: HomogenisedStiffness) -> HomogenisedStiffness:
    """Copy of a result, which has its stiffness, with violations of symmetry and bounds as checks.

    Raises:
        CertificateError: A violation exceeds the declared error of the result.
    """
    curve, cell = result.curve, result.cell
    assert cell is not None
    assert curve.stiffness is not None
    checks = stress_checks(
        curve.stiffness, np.eye(3), cell.fractions(curve.theta), curve.weights, cell.phases
    )
    checks = checks_within_limits(checks, discretisation=ROUND_OFF + result.largest_error)
    return replace(result, checks=checks)


def stress_checks(
    stress: Array, loads: Array, fractions: Array, weights: Array, phases: Sequence[AnyPhase]
) -> dict[str, float]:
    """Relative violations of symmetry and of bounds by the mean stiffness over θ, 0 for none.

    Voigt's, Reuss's and, of isotropic phases, Hashin and Shtrikman's bounds are those of energies
    of the loads, under which alone the stiffness is known.

    Args:
        stress: Homogenised (σ11, σ22, σ12) at the nodes of θ, shape (n, 3, loads), in Pa.
        loads: Macroscopic strains (ε11, ε22, 2 ε12), shape (loads, 3), ε11 = ε22 in their span.
        fractions: Area fractions of the phases at the nodes, shape (phases, n).
        weights: Weights of the nodes, shape (n,).
        phases: Materials, in the order of their fractions.
    """
    energy = loads @ mean(weights, stress)
    stiffness = [phase.stiffness for phase in phases]
    checks = order_checks(energy, loads, fractions, weights, stiffness)
    if all(isinstance(phase, Phase) for phase in phases):
        # factors of the loads that add up to ε11 = ε22 = 1
        equibiaxial = np.linalg.lstsq(loads.T, np.array([1.0, 1.0, 0.0]), rcond=None)[0]
        bulk = float(equibiaxial @ energy @ equibiaxial / 4)
        checks |= bulk_check(bulk, hashin_shtrikman(fractions, phases)[0] @ weights)
    return checks


def order_checks(
    energy: Array, loads: Array, fractions: Array, weights: Array, stiffness: Sequence[Array]
) -> dict[str, float]:
    """Relative violations of symmetry and of Reuss ≤ energy ≤ Voigt, in the sense of Loewner.

    Args as of `stress_checks`; `energy` is that of pairs of the loads, `stiffness` of each phase.
    """
    scale = float(abs(energy).max())
    reuss_energy, voigt_energy = (
        loads @ mean(weights, bound(fractions, stiffness)) @ loads.T for bound in (reuss, voigt)
    )
    return {
        "symmetry": float(abs(energy - energy.T).max()) / scale,
        "reuss": _below(energy - reuss_energy) / scale,
        "voigt": _below(voigt_energy - energy) / scale,
    }


def bulk_check(bulk: float, bounds: Array) -> dict[str, float]:
    """Relative violation of the lower and upper Hashin–Shtrikman bound by a bulk modulus, in Pa."""
    low, high = bounds
    return {"hashin_shtrikman": float(max(0.0, low - bulk, bulk - high) / bulk)}


def mean(weights: Array, values: Array) -> Array:
    """Weighted sum over the first axis."""
    return np.asarray(np.tensordot(weights, values, axes=1))


def _below(difference: Array) -> float:
    return max(0.0, -float(np.linalg.eigvalsh((difference + difference.T) / 2)[0]))
