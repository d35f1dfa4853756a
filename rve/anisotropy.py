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
    """Refuses the name of an average that there is not.

    Raises:
        RefusedError: It is none of `AVERAGES`.
    """
    if average not in AVERAGES:
        raise RefusedError("average", average, " or ".join(AVERAGES))


def shear_modulus(moduli: Array, average: str) -> Array:
    """Shear modulus G_T of an average, shape (…), in the unit of the moduli.

    Args:
        moduli: C11 + C12, C11 − C12 and C33, shape (…, 3).
        average: One of `AVERAGES`.
    """
    axes, diagonals = moduli[..., 2], moduli[..., 1] / 2
    if average == AXES:
        return np.asarray(axes)
    voigt, reuss = (axes + diagonals) / 2, 2 / (1 / axes + 1 / diagonals)
    return np.asarray((voigt + reuss) / 2)


def plane_constants(moduli: Array, average: str) -> Array:
    """E (in the unit of the moduli) and ν of an average, shape (…, 2).

    Args:
        moduli: C11 + C12, C11 − C12 and C33, shape (…, 3).
        average: One of `AVERAGES`.
    """
    shear = shear_modulus(moduli, average)
    poisson = (1 - 2 * shear / moduli[..., 0]) / 2  # eq. 16: ν = (1 − A/B)/2 with A = 2 G
    return np.stack([2 * shear * (1 + poisson), poisson], axis=-1)  # E = A (1 + ν)
