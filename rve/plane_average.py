"""Isotropic average of the plane stiffness of a square array, in place of eq. 16.

Eq. 16 takes the shear along the array's axes, where it is softest if the particles are stiffer. A
material whose particles lie at random has no such axes. Its shear modulus is nearer to the mean of
Voigt's average over all directions, (G₀ + G₄₅)/2, and Reuss's, 2/(1/G₀ + 1/G₄₅), as Hill (1952)
proposed for polycrystals; the plane-strain bulk modulus is the same in all directions. E and ν are
those of an isotropic material of these two in plane strain.
"""

from __future__ import annotations

from dataclasses import fields
from typing import ClassVar

import numpy as np

from alphacut.rve.cell import square_moduli
from alphacut.rve.result import Homogenised, spread
from alphacut.stochastic.theta.truncated_normal import Array


def plane_average(moduli: Array) -> Array:
    """E in Pa and ν of the isotropic average, shape (2,).

    Args:
        moduli: C11 + C12, C11 − C12 and C33, shape (3,), in Pa.
    """
    whole, axes, diagonals = moduli[0], moduli[2], moduli[1] / 2
    shear = ((axes + diagonals) / 2 + 2 / (1 / axes + 1 / diagonals)) / 2
    poisson = (1 - 2 * shear / whole) / 2  # whole = 2 G/(1 − 2 ν)
    return np.array([2 * shear * (1 + poisson), poisson])


class AveragedPlane(Homogenised):
    """A cell whose E and ν are those of the isotropic average of its plane stiffness."""

    convention: ClassVar[str] = "the isotropic average of the plane stiffness"

    @property
    def _moduli(self) -> Array:
        return square_moduli(np.asarray(self.stiffness))

    @property
    def modulus(self) -> float:
        """Young's modulus of the isotropic average, in Pa."""
        return float(plane_average(self._moduli)[0])

    @property
    def poisson(self) -> float:
        """Poisson's ratio of the isotropic average."""
        return float(plane_average(self._moduli)[1])

    @property
    def poisson_error(self) -> float:
        """Declared absolute error of ν; nan where none was made."""
        errors = self.modulus_errors
        return float(spread(lambda moduli: plane_average(moduli)[1], self._moduli, errors))

    def _error_of_modulus(self, errors: Array) -> float:
        """Relative error of E from those of the moduli."""
        modulus = self.modulus

        def ratio(moduli: Array) -> Array:
            other = float(plane_average(moduli)[0])
            return np.array([other / modulus, modulus / other if other > 0 else np.inf])

        return float(spread(ratio, self._moduli, errors[:3]).max())


def averaged(result: Homogenised) -> AveragedPlane:
    """The same cell with E and ν of the isotropic average.

    Raises:
        ValueError: The model made no whole plane stiffness.
    """
    if result.stiffness is None:
        raise ValueError(
            f"method {result.method} made no whole plane stiffness, which its isotropic average"
            " needs"
        )
    return AveragedPlane(**{one.name: getattr(result, one.name) for one in fields(Homogenised)})
