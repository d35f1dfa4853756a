"""Bounds of effective stiffness: Reuss, Voigt, Hashin–Shtrikman for the in-plane bulk.

The in-plane bulk modulus of a square array is isotropic enough for Hashin–Shtrikman; its shear
modulus G12 is not and lies below the isotropic lower bound, so it is not tested against that.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.rve.cell.cell import AnyPhase


def voigt(fractions: Array, stiffness: Sequence[Array]) -> Array:
    """Stiffness at uniform strain, shape (…, k, k), of phases (k, k) with fractions (phases, …)."""
    return np.asarray(np.tensordot(fractions, np.stack(stiffness), axes=([0], [0])))


def reuss(fractions: Array, stiffness: Sequence[Array]) -> Array:
    """Stiffness at uniform stress, as `voigt`."""
    compliance = [np.asarray(np.linalg.inv(phase), float) for phase in stiffness]
    return np.asarray(np.linalg.inv(voigt(fractions, compliance)), float)


def hashin_shtrikman(fractions: Array, stiffness: Sequence[Array]) -> Array:
    """Lower and upper bound of the in-plane K, then of G, of a fibre composite in Pa, (2, 2, …).

    Hill (J. Mech. Phys. Solids 12, 199, 1964) and Hashin (ibid. 13, 119, 1965); of any number of
    phases and with the extreme moduli of either Walpole (ibid. 17, 235, 1969). That of K holds for
    hydrostatic strain of any arrangement, that of G for isotropic ones.

    Args:
        fractions: Area fractions, shape (phases, …).
        stiffness: Plane-strain stiffness of each phase, isotropic across the fibres, (3, 3).
    """
    bulk = np.array([float(bulk_modulus(phase)) for phase in stiffness])
    shear = np.array([float(phase[2, 2]) for phase in stiffness])

    def mean_with(moduli: Array, added: float) -> Array:
        """X of 1/(X + added) = Σ fraction/(modulus + added)."""
        return np.asarray(1 / np.tensordot(1 / (moduli + added), fractions, axes=1) - added)

    bounds = []
    for extreme in (np.min, np.max):
        k, g = extreme(bulk), extreme(shear)
        bounds.append([mean_with(bulk, g), mean_with(shear, g * k / (k + 2 * g))])
    return np.swapaxes(np.array(bounds), 0, 1)


def bulk_modulus(stiffness: Array) -> Array:
    """In-plane bulk modulus of stiffnesses of shape (…, 3, 3), in Pa."""
    return np.asarray((stiffness[..., 0, 0] + stiffness[..., 1, 1] + 2 * stiffness[..., 0, 1]) / 4)


def mori_tanaka(fraction: Array, matrix: AnyPhase, inclusion: AnyPhase) -> Array:
    """C11 + C12, C11 − C12 and C33 of round aligned fibres in Pa, (…, 3), by Mori and Tanaka.

    Exact for few fibres (1973); area fractions have the shape (…).
    """
    bulks = [float(bulk_modulus(phase.stiffness)) for phase in (matrix, inclusion)]
    shears = [float(phase.stiffness[2, 2]) for phase in (matrix, inclusion)]
    f = np.asarray(fraction)

    def effective(moduli: list[float], polarisation: float) -> Array:
        """Modulus from those of both phases and 1/(matrix modulus + constraint of the matrix)."""
        contrast = moduli[1] - moduli[0]
        return np.asarray(moduli[0] + f * contrast / (1 + contrast * (1 - f) * polarisation))

    k, g = bulks[0], shears[0]  # of the matrix
    bulk = effective(bulks, 1 / (k + g))
    shear = effective(shears, (k + 2 * g) / (2 * g * (k + g)))
    return np.stack([2 * bulk, 2 * shear, shear], axis=-1)
