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
"""Relative violation of a bound by round-off alone."""


class CertificateError(FailedError):
    """A result lacks a property that every correct one has."""


def checks_within_limits(
    checks: Mapping[str, float], *, discretisation: float = ROUND_OFF
) -> dict[str, float]:
    """Return a copy of violations of properties that right results have, if none is too large.

    Args:
        checks: Relative violations, 0 for none, by the names "residual" and "hill_mandel" (of
            finite elements), "symmetry", "reuss", "voigt", "hashin_shtrikman" and "isotropy";
            another name that is too large is a KeyError.
        discretisation: Largest violation that is allowed of the last four, by the error of a mesh.
            The others are allowed 1e-7.

    Raises:
        CertificateError: A violation is NaN or too large; the message names it, its value and its
            limit.
    """
    meanings = {
        "residual": "the linear system is not solved",
        "hill_mandel": "mean stress times mean strain is not the mean of their product"
        " (Hill–Mandel)",
        "symmetry": "the effective stiffness is not symmetric",
        "reuss": "the effective stiffness is below the Reuss bound",
        "voigt": "the effective stiffness is above the Voigt bound",
        "hashin_shtrikman": "the bulk modulus is outside the Hashin–Shtrikman bounds",
        "isotropy": "the stiffness of a hexagonal array is not isotropic across the fibres",
    }
    # What holds in exact arithmetic for any mesh may be violated by rounding and by the tolerance
    # of iterative solvers; bounds may be violated by the error of the mesh as well.
    algebraic = 1e-7
    for name, value in checks.items():
        has_mesh_error = name in ("reuss", "voigt", "hashin_shtrikman", "isotropy")
        limit = discretisation if has_mesh_error else algebraic
        if not value <= limit:
            raise CertificateError(
                f"{meanings[name]}: relative violation {value:.2e}, {limit:.2e} is allowed",
                "do not use this result",
            )
    return dict(checks)


def with_checks(result: HomogenisedStiffness) -> HomogenisedStiffness:
    """Return a copy of a plane result with its violations of symmetry and bounds as checks.

    Args:
        result: Result with its cell, its plane stiffness at each θ, and declared errors.

    Returns:
        Copy with `checks` by name, 0 for none: "symmetry", "reuss", "voigt" and, of isotropic
        phases, "hashin_shtrikman"; of round ones in a hexagonal array also "isotropy".

    Raises:
        CertificateError: A bound is violated by more than the declared error of the result,
            symmetry by more than 1e-7; or no error is declared.
    """
    curve = result.curve
    cell = result.cell
    assert cell is not None
    assert curve.stiffness is not None
    checks = stress_checks(
        curve.stiffness, np.eye(3), cell.fractions(curve.theta), curve.weights, cell.phases
    )
    checks |= isotropy_check(result)
    checks = checks_within_limits(checks, discretisation=ROUND_OFF + result.largest_error)
    return replace(result, checks=checks)


def stress_checks(
    stress: Array, loads: Array, fractions: Array, weights: Array, phases: Sequence[AnyPhase]
) -> dict[str, float]:
    """Return relative violations of symmetry and of bounds by the mean stiffness, 0 for none.

    Voigt's, Reuss's and, of isotropic phases, Hashin and Shtrikman's bounds are taken of energies
    of the loads, since the stiffness is known under these loads alone.

    Args:
        stress: Homogenised (σ11, σ22, σ12) at the n nodes of θ, shape (n, 3, loads), in Pa.
        loads: Macroscopic strains (ε11, ε22, 2 ε12), shape (loads, 3). Some combination of them is
            ε11 = ε22 without shear.
        fractions: Area fractions of the phases at the nodes, shape (phases, n).
        weights: Weights of the nodes with the density of θ inside, shape (n,), sum 1.
        phases: Materials, in the order of their fractions.

    Returns:
        Violations by name: "symmetry", "reuss" and "voigt", divided by the largest energy, and, of
        isotropic phases, "hashin_shtrikman", divided by the bulk modulus.
    """
    # By the lemma of Hill and Mandel the mean stress under a load, times a load, is the mean energy
    # of the pair of their fields.
    energy = loads @ mean(weights, stress)
    stiffness = [phase.stiffness for phase in phases]
    checks = order_checks(energy, loads, fractions, weights, stiffness)
    if all(isinstance(phase, Phase) for phase in phases):
        # The loads times these factors add up to ε11 = ε22 = 1, whose energy is 4 K.
        equibiaxial = np.linalg.lstsq(loads.T, np.array([1.0, 1.0, 0.0]), rcond=None)[0]
        bulk = float(equibiaxial @ energy @ equibiaxial / 4)
        checks |= bulk_check(bulk, hashin_shtrikman(fractions, phases)[0] @ weights)
    return checks


def order_checks(
    energy: Array, loads: Array, fractions: Array, weights: Array, stiffness: Sequence[Array]
) -> dict[str, float]:
    """Return relative violations of symmetry and of Reuss ≤ energy ≤ Voigt in Loewner's sense.

    A ≤ B if B − A has no negative eigenvalue. All are divided by the largest entry of `energy`.

    Args:
        energy: Mean energy of pairs of the loads, load · stiffness · load, shape (loads, loads), in
            Pa.
        loads: Macroscopic strains in Voigt's order, shape (loads, k).
        fractions: Fractions of the phases at the n nodes of θ, shape (phases, n).
        weights: Weights of the nodes with the density of θ inside, shape (n,), sum 1.
        stiffness: Positive definite stiffness of each phase, shape (k, k), in Pa.

    Returns:
        Violations by the names "symmetry", "reuss" and "voigt", 0 for none.
    """
    # The energies of the loads by the bounds are compared with those by the stiffness.
    scale = float(abs(energy).max())
    reuss_energy = loads @ mean(weights, reuss(fractions, stiffness)) @ loads.T
    voigt_energy = loads @ mean(weights, voigt(fractions, stiffness)) @ loads.T
    return {
        "symmetry": float(abs(energy - energy.T).max()) / scale,
        # The most negative eigenvalue of each difference; 0 where there is none.
        "reuss": _depth_below_zero(energy - reuss_energy) / scale,
        "voigt": _depth_below_zero(voigt_energy - energy) / scale,
    }


def bulk_check(bulk: float, bounds: Array) -> dict[str, float]:
    """Return the relative violation of the Hashin–Shtrikman bounds by a bulk modulus, 0 for none.

    Args:
        bulk: Bulk modulus in Pa, positive; the violation is relative to it.
        bounds: Lower and upper bound in Pa, shape (2,).

    Returns:
        The violation by the name "hashin_shtrikman".
    """
    low, high = bounds
    return {"hashin_shtrikman": float(max(0.0, low - bulk, bulk - high) / bulk)}


def isotropy_check(result: HomogenisedStiffness) -> dict[str, float]:
    """Return the violation of C11 − C12 = 2 C33 by a hexagonal array, relative to the sum of both.

    A plane stiffness with a symmetry of 60° is isotropic. The dictionary is empty for other cells,
    and where C11 − C12 was not computed.

    Args:
        result: Result with its cell.
    """
    cell = result.cell
    if cell is None or not (cell.square and cell.lattice.is_isotropic) or result.stiffness is None:
        return {}
    _, deviator, shear = result.moduli
    return {"isotropy": float(abs(deviator - 2 * shear) / (deviator + 2 * shear))}


def mean(weights: Array, values: Array) -> Array:
    """Return the weighted sum over the first axis."""
    return np.asarray(np.tensordot(weights, values, axes=1))


def _depth_below_zero(difference: Array) -> float:
    """Return by how much the smallest eigenvalue of a matrix's symmetric part lies below 0."""
    # Rounding makes the matrix slightly unsymmetric; symmetry has a check of its own.
    return max(0.0, -float(np.linalg.eigvalsh((difference + difference.T) / 2)[0]))
