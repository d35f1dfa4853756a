"""What the modulus of eq. 16 hides: the stiffness of the cell in every direction of its plane.

A square array has three moduli, not two. Eq. 16 takes the hydrostatic one and the shear along the axes; the shear along the
diagonals, (C11 − C12)/2, does not enter.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from stochastic.truncated_normal import Array


def rotated(stiffness: Array, angle: ArrayLike) -> Array:
    """The stiffness seen in axes turned by `angle`.

    Args:
        stiffness: Voigt order (11, 22, 12 with 2 ε12), shape (3, 3), in Pa.
        angle: Any shape, in radians.

    Returns:
        Shape (…, 3, 3), in Pa.
    """
    c, s = np.cos(angle), np.sin(angle)
    strains = np.array([[c * c, s * s, c * s], [s * s, c * c, -c * s], [-2 * c * s, 2 * c * s, c * c - s * s]])
    turn = np.moveaxis(strains, (0, 1), (-2, -1))  # strain in the turned axes from strain in the old ones
    back = np.linalg.inv(turn)
    return np.asarray(np.swapaxes(back, -1, -2) @ stiffness @ back)


def directional_young(stiffness: Array, angle: ArrayLike) -> Array:
    """Plane-strain Young's modulus along `angle` (radians): stress over strain in a bar cut along it, free at its sides, in Pa."""
    return np.asarray(1 / np.linalg.inv(rotated(stiffness, angle))[..., 0, 0])


def directional_shear(stiffness: Array, angle: ArrayLike) -> Array:
    """Shear modulus in axes along `angle` (radians), in Pa: σ12 over 2 ε12, the normal stresses being zero."""
    return np.asarray(1 / np.linalg.inv(rotated(stiffness, angle))[..., 2, 2])


def shear_ratio(stiffness: Array) -> float:
    """Shear modulus along the diagonals over that along the axes, (C11 − C12)/(2 C33): 1 for an isotropic plane."""
    return float((stiffness[0, 0] - stiffness[0, 1]) / (2 * stiffness[2, 2]))
