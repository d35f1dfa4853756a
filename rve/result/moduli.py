"""Averages of a plane stiffness over its directions: which E and ν are meant.

A square array has three moduli, not two. Eq. 16 takes the hydrostatic one, B = C11 + C12, and the
shear along the axes, C33; the shear along the diagonals, (C11 − C12)/2, does not enter. This is the
average "axes".

A material whose particles lie at random has no such axes. Its shear modulus is nearer to the mean
of Voigt's average over all directions, (G₀ + G₄₅)/2, and Reuss's, 2/(1/G₀ + 1/G₄₅), as Hill (1952)
proposed for polycrystals; the plane-strain bulk modulus is the same in all directions. This is the
average "isotropic". Either way E and ν are those of an isotropic material of this shear and bulk
modulus in plane strain. Of a stiffness without the symmetry of the square its square part counts:
C11 is then (C11 + C22)/2.
"""

from __future__ import annotations

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import RefusedError

AXES, ISOTROPIC = "axes", "isotropic"
AVERAGES = {AXES: "eq. 16", ISOTROPIC: "the isotropic average of the plane stiffness"}


def require_average(average: str) -> None:
    """Refuse an average that is not one of `AVERAGES`."""
    if average not in AVERAGES:
        raise RefusedError("average", average, " or ".join(AVERAGES))


def shear_modulus(moduli: Array, average: str) -> Array:
    """In-plane shear modulus G_T, shape (…), of C11 + C12, C11 − C12 and C33, shape (…, 3).

    C33 alone for `average` "axes", Hill's mean over all directions for "isotropic".
    """
    along_axes, along_diagonals = moduli[..., 2], moduli[..., 1] / 2
    if average == AXES:
        return np.asarray(along_axes)
    voigt = (along_axes + along_diagonals) / 2
    reuss = 2 / (1 / along_axes + 1 / along_diagonals)
    return np.asarray((voigt + reuss) / 2)


def plane_constants(moduli: Array, average: str) -> Array:
    """E and ν, (…, 2), by an average of `AVERAGES`, from C11 + C12, C11 − C12 and C33, (…, 3)."""
    hydrostatic, shear = moduli[..., 0], shear_modulus(moduli, average)
    poisson = (1 - 2 * shear / hydrostatic) / 2  # eq. 16 with A = 2 G and B = C11 + C12
    young = 2 * shear * (1 + poisson)
    return np.stack([young, poisson], axis=-1)


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


def moduli_of_energies(energies: Array, loads: Array) -> Array:
    """C11 + C12, C11 − C12 and C33 from the energies of loads, shape (…, 3), in Pa.

    Args:
        energies: Mean of σ_a : ε_a for each load a, shape (…, loads), in Pa.
        loads: `LOADS` or `THREE_LOADS`; without the third, C11 − C12 is nan.
    """
    moduli = np.full((*energies.shape[:-1], 3), np.nan)
    columns = (0, 2, 1)  # of the moduli that the equibiaxial, shear and deviatoric load give
    for k, strain in enumerate(loads):
        moduli[..., columns[k]] = energies[..., k] / np.dot(strain, strain)
    return moduli


def axial_moduli(stiffness: Array, *, square: bool) -> Array:
    """C11 + C12, C11 − C12 and C33 of a plane stiffness (…, 3, 3), shape (…, 1 or 3, 3).

    First with the mean of C11 and C22; if not `square`, then also with C11 and with C22 alone.
    """
    moduli = [square_moduli(stiffness)]
    for k in () if square else (0, 1):
        axial, lateral = stiffness[..., k, k], stiffness[..., 0, 1]
        moduli.append(np.stack([axial + lateral, axial - lateral, stiffness[..., 2, 2]], -1))
    return np.stack(moduli, axis=-2)
