"""Result of a cell with a sphere: the plane's words, moduli in space.

Stresses over θ are those of the plane loads, with ε33 = 0: σ11 under ε11 = ε22 = 0.01 and σ12
under ε12 = 0.01. E and ν are Hill's isotropic average of the mean stiffness, not eq. 16.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from alphacut.rve.cell import Cell, Phase
from alphacut.rve.certificate import ROUND_OFF, Limits, require
from alphacut.rve.result import Homogenised, spread
from alphacut.rve.spheres.bounds import hashin_shtrikman, reuss, shear_against_trace_bounds, voigt
from alphacut.rve.spheres.cubic import cubic_moduli, hill_average
from alphacut.stochastic import RadiusMap
from alphacut.stochastic.theta.truncated_normal import Array

VOLUME_OF_UNIT_SPHERE = np.pi / 6  # over the cell's volume at r = 1: fraction = π r³/6


@dataclass(frozen=True)
class HomogenisedSpheres(Homogenised):
    """Effective behaviour of the simple cubic array with what it cost.

    As `Homogenised`, but `curve.stiffness` has shape (n, 6, 6), and `errors` are those of K, (C11 −
    C12)/2 and C44.
    """

    convention: ClassVar[str] = "Hill's isotropic average"

    @property
    def moduli(self) -> Array:
        """Mean K, (C11 − C12)/2 and C44 under f_Θ, shape (3,), in Pa."""
        return cubic_moduli(np.asarray(self.stiffness))

    @property
    def modulus(self) -> float:
        """Young's modulus of Hill's isotropic average, in Pa."""
        return float(hill_average(self.moduli)[0])

    @property
    def poisson(self) -> float:
        """Poisson's ratio of Hill's isotropic average."""
        return float(hill_average(self.moduli)[1])

    @property
    def largest_error(self) -> float:
        """The largest declared relative error of E and the moduli, absolute of ν."""
        if not self.errors:
            return float("nan")
        nu = self.error_of(lambda moduli: hill_average(moduli)[1])
        return float(np.max([*self.modulus_errors, self.estimated_error, nu]))

    def error_of(self, function: Callable[[Array], Array | float]) -> Array:
        """Declared absolute error of a function of K, (C11 − C12)/2 and C44, of its shape."""
        return spread(function, self.moduli, self.modulus_errors)

    def _error_of_modulus(self, errors: Array) -> float:
        """Relative error of E from those of the moduli."""
        modulus = self.modulus

        def ratio(moduli: Array) -> Array:
            other = float(hill_average(moduli)[0])
            return np.array([other / modulus, modulus / other])

        return float(spread(ratio, self.moduli, errors).max())


def volume_fraction(radius: Array) -> Array:
    """Share of the cell that a sphere takes, π r³/6, of radii over half the cell's side."""
    return np.asarray(VOLUME_OF_UNIT_SPHERE * np.asarray(radius) ** 3)


def certified_spheres(
    result: HomogenisedSpheres, radius_map: RadiusMap, matrix: Phase, inclusion: Phase
) -> HomogenisedSpheres:
    """Result with its certificate: symmetry, Voigt, Reuss, Hashin–Shtrikman.

    Raises:
        CertificateError: One is violated by more than the declared error.
    """
    fraction, phases = volume_fraction(radius_map(result.curve.theta)), (matrix, inclusion)
    weights, mean = result.curve.weights, np.asarray(result.stiffness)
    low, high = (
        np.tensordot(weights, bound(fraction, *phases), axes=1) for bound in (reuss, voigt)
    )
    limits = hashin_shtrikman(fraction, *phases)
    scale, bulk = float(abs(mean).max()), result.moduli[0]
    least, greatest = limits[0] @ weights
    pointwise = cubic_moduli(np.asarray(result.curve.stiffness))
    sheared = max(
        shear_against_trace_bounds(first, second, ends, phases)
        for (first, second), ends in zip(pointwise[:, 1:], limits[1].T, strict=True)
    )
    checks = {
        "symmetry": float(abs(mean - mean.T).max()) / scale,
        "reuss": max(0.0, -float(np.linalg.eigvalsh(mean - low)[0])) / scale,
        "voigt": max(0.0, -float(np.linalg.eigvalsh(high - mean)[0])) / scale,
        "hashin_shtrikman": max(0.0, least - bulk, bulk - greatest) / bulk,
        "hashin_shtrikman_shear": sheared,
    }
    allowed = Limits(discretisation=ROUND_OFF + result.largest_error)
    cell = Cell(matrix, inclusion, radius_map)
    return replace(result, checks=require(checks, allowed), cell=cell)
