"""A stiffness of square symmetry and its three moduli: C11 + C12, C11 − C12 and C33."""

from __future__ import annotations

import numpy as np

from alphacut.stochastic.theta.truncated_normal import Array

MODULI = ("C11+C12", "C11-C12", "C33")


def square_voigt(bulk: Array, deviator: Array, shear: Array) -> Array:
    """Voigt matrices (…, 3, 3) of square symmetry from C11 + C12, C11 − C12 and C33."""
    voigt = np.zeros((*bulk.shape, 3, 3))
    voigt[..., 0, 0] = voigt[..., 1, 1] = (bulk + deviator) / 2
    voigt[..., 0, 1] = voigt[..., 1, 0] = (bulk - deviator) / 2
    voigt[..., 2, 2] = shear
    return voigt


def square_moduli(stiffness: Array) -> Array:
    """C11 + C12, C11 − C12 and C33 of the square-symmetric part, shape (…, 3)."""
    mean, lateral = (stiffness[..., 0, 0] + stiffness[..., 1, 1]) / 2, stiffness[..., 0, 1]
    return np.stack([mean + lateral, mean - lateral, stiffness[..., 2, 2]], axis=-1)
