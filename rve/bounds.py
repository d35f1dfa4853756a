"""Bounds of effective stiffness: Reuss, Voigt, Hashin–Shtrikman for the in-plane bulk.

The in-plane bulk modulus of a square array is isotropic enough for Hashin–Shtrikman; its shear
modulus G12 is not and lies below the isotropic lower bound, so it is not tested against that.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.rve.cell import AnyPhase


def voigt(fractions: Array, stiffness: Sequence[Array]) -> Array:
    """Stiffness at uniform strain of any number of phases, shape (…, k, k).

    Args:
        fractions: Of area or volume, shape (phases, …).
        stiffness: Of the phases, (k, k) each.
    """
    return np.asarray(np.tensordot(fractions, np.stack(stiffness), axes=([0], [0])))


def reuss(fractions: Array, stiffness: Sequence[Array]) -> Array:
    """Stiffness at uniform stress, as `voigt`."""
    compliance = [np.asarray(np.linalg.inv(phase), float) for phase in stiffness]
    return np.asarray(np.linalg.inv(voigt(fractions, compliance)), float)


def hashin_shtrikman(fractions: Array, stiffness: Sequence[Array]) -> Array:
    """Bounds of K and G of phases that are isotropic across their fibres, in plane strain, in Pa.

    Hill (J. Mech. Phys. Solids 12, 199, 1964) and Hashin (ibid. 13, 119, 1965); of any number of
    phases and with the extreme moduli of either Walpole (ibid. 17, 235, 1969). That of K holds for
    hydrostatic strain of any arrangement, that of G for isotropic ones.

    Args:
        fractions: Of area, shape (phases, …).
        stiffness: Of the phases, (3, 3) each.

    Returns:
        Shape (2 moduli, 2 ends, …).
    """
    bulk = np.array([float(bulk_modulus(phase)) for phase in stiffness])
    shear = np.array([float(phase[2, 2]) for phase in stiffness])
    ends = []
    for end in (np.min, np.max):
        k, g = end(bulk), end(shear)
        pairs = ((bulk, g), (shear, g * k / (k + 2 * g)))
        ends.append(
            [1 / np.tensordot(1 / (moduli + x), fractions, axes=1) - x for moduli, x in pairs]
        )
    return np.swapaxes(np.array(ends), 0, 1)


def bulk_modulus(stiffness: Array) -> Array:
    """In-plane bulk modulus of stiffnesses of shape (…, 3, 3), in Pa."""
    return np.asarray((stiffness[..., 0, 0] + stiffness[..., 1, 1] + 2 * stiffness[..., 0, 1]) / 4)


def mori_tanaka(fraction: Array, matrix: AnyPhase, inclusion: AnyPhase) -> Array:
    """Moduli of round aligned fibres by Mori and Tanaka (1973), exact where particles are few.

    Returns:
        C11 + C12, C11 − C12 and C33 in Pa, shape (…, 3) for area fractions of shape (…).
    """
    bulk = [float(bulk_modulus(phase.stiffness)) for phase in (matrix, inclusion)]
    shear = [float(phase.stiffness[2, 2]) for phase in (matrix, inclusion)]
    share = np.asarray(fraction)

    def mixed(values: list[float], resistance: float) -> Array:
        contrast = values[1] - values[0]
        return np.asarray(values[0] + share * contrast / (1 + contrast * (1 - share) * resistance))

    polar = (bulk[0] + 2 * shear[0]) / (2 * shear[0] * (bulk[0] + shear[0]))
    in_plane, axial = mixed(bulk, 1 / (bulk[0] + shear[0])), mixed(shear, polar)
    return np.stack([2 * in_plane, 2 * axial, axial], axis=-1)
