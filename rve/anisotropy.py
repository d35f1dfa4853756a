"""Stiffness of the cell in every direction of its plane, beside the modulus of eq. 16.

A square array has three moduli, not two. Eq. 16 takes the hydrostatic one and the shear along the
axes; the shear along the diagonals, (C11 − C12)/2, does not enter.

A material whose particles lie at random has no such axes. Its shear modulus is nearer to the mean
of Voigt's average over all directions, (G₀ + G₄₅)/2, and Reuss's, 2/(1/G₀ + 1/G₄₅), as Hill (1952)
proposed for polycrystals; the plane-strain bulk modulus is the same in all directions. E and ν of
the isotropic average are those of an isotropic material of these two in plane strain.
"""

from __future__ import annotations

from dataclasses import fields
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from alphacut.rve.cell import square_moduli, square_voigt
from alphacut.rve.result import Homogenised, spread
from alphacut.rve.spheres.result import HomogenisedSpheres
from alphacut.stochastic.theta.truncated_normal import Array

ISOTROPIC_ENOUGH = 0.1  # difference of the shear ratio from 1 that is not worth a warning


def rotated(stiffness: Array, angle: ArrayLike) -> Array:
    """The stiffness seen in axes turned by `angle`.

    Args:
        stiffness: Voigt order (11, 22, 12 with 2 ε12), shape (3, 3), in Pa.
        angle: Any shape, in radians.

    Returns:
        Shape (…, 3, 3), in Pa.
    """
    c, s = np.cos(angle), np.sin(angle)
    strains = np.array(
        [[c * c, s * s, c * s], [s * s, c * c, -c * s], [-2 * c * s, 2 * c * s, c * c - s * s]]
    )
    # strain in the turned axes from strain in the old ones
    turn = np.moveaxis(strains, (0, 1), (-2, -1))
    back = np.linalg.inv(turn)
    return np.asarray(np.swapaxes(back, -1, -2) @ stiffness @ back)


def directional_young(stiffness: Array, angle: ArrayLike) -> Array:
    """Plane-strain Young's modulus along `angle` (radians) of a bar with free sides, in Pa."""
    return np.asarray(1 / np.linalg.inv(rotated(stiffness, angle))[..., 0, 0])


def directional_shear(stiffness: Array, angle: ArrayLike) -> Array:
    """Shear modulus in axes along `angle` (radians), in Pa: σ12 over 2 ε12."""
    return np.asarray(1 / np.linalg.inv(rotated(stiffness, angle))[..., 2, 2])


def shear_ratio(stiffness: Array) -> float:
    """Shear modulus along the diagonals over that along the axes, (C11 − C12)/(2 C33).

    Of a plane stiffness, or of one in space, whose last entry is C44.
    """
    return float((stiffness[0, 0] - stiffness[0, 1]) / (2 * stiffness[-1, -1]))


def ratio_of(result: Homogenised) -> tuple[float, float]:
    """Shear ratio of a result with its stiffness, and its declared error, nan where unknown.

    Both moduli come from one discretisation and err alike, so that the ratio is surer than they.
    """
    if isinstance(result, HomogenisedSpheres):
        error = result.error_of(lambda moduli: moduli[1] / moduli[2])
        return float(result.moduli[1] / result.moduli[2]), float(error)
    stiffness = np.asarray(result.stiffness)
    ratio, square = map(shear_ratio, (stiffness, square_voigt(*square_moduli(stiffness))))
    return ratio, abs(ratio - square) + abs(square) * result.ratio_error


def shear_ratio_in_words(ratio: float, meaning: str = "cylinders") -> str:
    """One line on what the shear ratio means for E.

    Args:
        ratio: See `shear_ratio`.
        meaning: What E is of: "cylinders", eq. 16; "isotropic" or "spheres", an isotropic average.
    """
    told = (
        f"shear modulus along the diagonals over that along the axes: {ratio:.3f} (1 in an"
        f" isotropic {'material' if meaning == 'spheres' else 'plane'})"
    )
    if meaning != "cylinders" or abs(ratio - 1) <= ISOTROPIC_ENOUGH:
        return told
    side = "below" if ratio > 1 else "above"
    return (
        f"{told}; E of eq. 16 takes that along the axes and can lie {side} that of any isotropic"
        " composite of these phases"
    )


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
