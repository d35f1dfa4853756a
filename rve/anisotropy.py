"""Stiffness of the cell in every direction of its plane, beside the modulus of eq. 16.

A square array has three moduli, not two. Eq. 16 takes the hydrostatic one and the shear along the
axes; the shear along the diagonals, (C11 − C12)/2, does not enter.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

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
