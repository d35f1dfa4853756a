"""Certificate of a result: properties that every right one has, measured."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import FailedError
from alphacut.rve.bounds import bulk_modulus, hashin_shtrikman, reuss, voigt
from alphacut.rve.cell import AnyPhase, Phase

ROUND_OFF = 1e-9


class CertificateError(FailedError):
    """A result lacks a property that every right one has."""


@dataclass(frozen=True)
class Limits:
    """Relative violation of each kind that is round-off or declared error.

    Args:
        algebraic: For what holds exactly in exact arithmetic: residual, Hill–Mandel, symmetry,
            periodicity.
        discretisation: Declared error of the stiffness, for the bounds.
    """

    algebraic: float = 1e-7
    discretisation: float = ROUND_OFF


WHAT = {
    "residual": "the linear system is not solved",
    "hill_mandel": "mean stress times mean strain is not the mean of their product (Hill–Mandel)",
    "symmetry": "the effective stiffness is not symmetric",
    "periodicity": "the displacement fluctuation differs on opposite sides of the cell",
    "reuss": "the effective stiffness is below the Reuss bound",
    "voigt": "the effective stiffness is above the Voigt bound",
    "hashin_shtrikman": "the bulk modulus is outside the Hashin–Shtrikman bounds",
    "hashin_shtrikman_shear": "the shear moduli are outside the trace bounds of Milton and Kohn",
}
BOUNDS = ("reuss", "voigt", "hashin_shtrikman", "hashin_shtrikman_shear")


def require(checks: Mapping[str, float], limits: Limits) -> dict[str, float]:
    """The checks as they are, if all are within their limits.

    Raises:
        CertificateError: One is not; the message names it with its value and its limit.
    """
    for name, value in checks.items():
        limit = limits.discretisation if name in BOUNDS else limits.algebraic
        if not value <= limit:
            raise CertificateError(
                f"{WHAT[name]}: relative violation {value:.2e}, {limit:.2e} is allowed",
                "do not use this result",
            )
    return dict(checks)


def stiffness_checks(
    stiffness: Array, fraction: Array, weights: Array, phases: tuple[AnyPhase, AnyPhase]
) -> dict[str, float]:
    """Symmetry and bounds of the mean stiffness.

    Args:
        stiffness: At the nodes of θ, Voigt order, shape (n, 3, 3), in Pa.
        fraction: Area fraction of the particle at the nodes, shape (n,).
        weights: Weights of the nodes, shape (n,).
        phases: Matrix and inclusion.
    """
    mean = _mean(weights, stiffness)
    low, high = (_mean(weights, bound(fraction, *phases)) for bound in (reuss, voigt))
    checks = {
        "symmetry": float(abs(mean - mean.T).max() / abs(mean).max()),
        "reuss": _below(mean - low, mean),
        "voigt": _below(high - mean, mean),
    }
    if all(isinstance(phase, Phase) for phase in phases):
        least, greatest = (weights @ bound for bound in hashin_shtrikman(fraction, *phases)[0])
        bulk = float(bulk_modulus(mean))
        checks["hashin_shtrikman"] = max(0.0, float(least) - bulk, bulk - float(greatest)) / bulk
    return checks


def load_checks(
    stress: Array, loads: Array, fraction: Array, weights: Array, phases: tuple[AnyPhase, AnyPhase]
) -> dict[str, float]:
    """The same from fewer than three loads: symmetry and bounds of the energies that they see.

    Args:
        stress: Homogenised (σ11, σ22, σ12) at the nodes of θ for each load, shape (n, 3, loads), in
            Pa.
        loads: Macroscopic strains (ε11, ε22, 2 ε12), shape (loads, 3).
        fraction: Area fraction of the particle at the nodes, shape (n,).
        weights: Weights of the nodes, shape (n,).
        phases: Matrix and inclusion.
    """
    energy = np.asarray(np.matmul(loads, _mean(weights, stress)))
    low, high = (
        loads @ _mean(weights, bound(fraction, *phases)) @ loads.T for bound in (reuss, voigt)
    )
    return {
        "symmetry": float(abs(energy - energy.T).max() / abs(energy).max()),
        "reuss": _below(energy - low, energy),
        "voigt": _below(high - energy, energy),
    }


def certify(
    stress: Array,
    energy: Array,
    loads: Array,
    share: tuple[Array, Array],
    phases: tuple[AnyPhase, AnyPhase],
) -> dict[str, float]:
    """Measures of what the means of every right result have.

    Args:
        stress: As in `load_checks`.
        energy: Mean of σ_a : ε_b, shape (loads, loads), in Pa.
        loads: As in `load_checks`.
        share: Area fraction of the particle at the nodes, and the nodes' weights, each (n,).
        phases: Matrix and inclusion.
    """
    fraction, weights = share
    work = loads @ np.tensordot(weights, stress, axes=1)  # σ̄_b : ε̄_a
    gap = float(abs(work.T - energy).max() / abs(energy).max())
    if len(loads) == 3:
        bounds = stiffness_checks(stress @ np.linalg.inv(loads).T, fraction, weights, phases)
    else:
        bounds = load_checks(stress, loads, fraction, weights, phases)
    return {"hill_mandel": gap, **bounds}


def _mean(weights: Array, values: Array) -> Array:
    """Weighted sum over the first axis."""
    return np.asarray(np.tensordot(weights, values, axes=1))


def _below(difference: Array, scale: Array) -> float:
    """Depth of the least eigenvalue below zero, relative to the size of `scale`."""
    return max(0.0, -float(np.linalg.eigvalsh((difference + difference.T) / 2)[0])) / float(
        abs(scale).max()
    )
