"""A stiffness of cubic symmetry, its three moduli and its isotropic average.

Voigt order in three dimensions: 11, 22, 33, 23, 13, 12, shears with 2 ε.
"""

from __future__ import annotations

import numpy as np

from alphacut.fuzzy.arrays import Array


def cubic_voigt(bulk: Array, deviator: Array, shear: Array) -> Array:
    """Stiffness in Voigt order, (…, 6, 6), from K, (C11 − C12)/2 and C44, (…,), in their unit."""
    voigt = np.zeros((*np.shape(bulk), 6, 6))
    voigt[..., :3, :3] = np.asarray(bulk - 2 / 3 * deviator)[..., None, None]
    for i in range(3):
        voigt[..., i, i] = bulk + 4 / 3 * deviator
        voigt[..., 3 + i, 3 + i] = shear
    return voigt


def cubic_moduli(stiffness: Array) -> Array:
    """K, (C11 − C12)/2 and C44, (…, 3), of the cubic part of a stiffness (…, 6, 6)."""
    diagonal = np.diagonal(stiffness, axis1=-2, axis2=-1)
    axial, shear = diagonal[..., :3].mean(axis=-1), diagonal[..., 3:].mean(axis=-1)
    lateral = (stiffness[..., 0, 1] + stiffness[..., 0, 2] + stiffness[..., 1, 2]) / 3
    return np.stack([(axial + 2 * lateral) / 3, (axial - lateral) / 2, shear], axis=-1)


def hill_shear(moduli: Array) -> Array:
    """Mean of the Voigt and Reuss averages of the shear modulus over all directions (Hill 1952).

    Args:
        moduli: K, (C11 − C12)/2 and C44, shape (…, 3).
    """
    deviator, shear = moduli[..., 1], moduli[..., 2]
    voigt, reuss = (2 * deviator + 3 * shear) / 5, 5 / (2 / deviator + 3 / shear)
    return np.asarray((voigt + reuss) / 2)


def hill_average(moduli: Array) -> Array:
    """Young's modulus (in the unit of `moduli`) and Poisson's ratio of Hill's average, (…, 2)."""
    bulk, shear = moduli[..., 0], hill_shear(moduli)
    young = 9 * bulk * shear / (3 * bulk + shear)
    return np.stack([young, (3 * bulk - 2 * shear) / (6 * bulk + 2 * shear)], axis=-1)
