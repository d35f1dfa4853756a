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
    """In-plane shear modulus G_T of a plane stiffness, shape (…), in the unit of the moduli.

    Args:
        moduli: C11 + C12, C11 − C12 and C33, shape (…, 3).
        average: "axes" for C33 alone, "isotropic" for Hill's mean over all directions.
    """
    along_axes, along_diagonals = moduli[..., 2], moduli[..., 1] / 2
    if average == AXES:
        return np.asarray(along_axes)
    voigt = (along_axes + along_diagonals) / 2
    reuss = 2 / (1 / along_axes + 1 / along_diagonals)
    return np.asarray((voigt + reuss) / 2)


def plane_constants(moduli: Array, average: str) -> Array:
    """E (in the unit of the moduli) and ν of a plane-strain stiffness, shape (…, 2).

    Args:
        moduli: C11 + C12, C11 − C12 and C33, shape (…, 3).
        average: Which shear modulus G counts, one of `AVERAGES`.
    """
    hydrostatic, shear = moduli[..., 0], shear_modulus(moduli, average)
    poisson = (1 - 2 * shear / hydrostatic) / 2  # eq. 16 with A = 2 G and B = C11 + C12
    young = 2 * shear * (1 + poisson)
    return np.stack([young, poisson], axis=-1)
