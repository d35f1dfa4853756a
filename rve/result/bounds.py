"""Classical bounds of effective stiffness: Reuss, Voigt, Hashin–Shtrikman; Mori and Tanaka.

The in-plane bulk modulus of a square array is isotropic enough for Hashin–Shtrikman; its shear
modulus G12 is not and lies below the isotropic lower bound, so it is not tested against that.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.rve.cell.cell import AnyPhase, Phase


def voigt(fractions: Array, stiffness: Sequence[Array]) -> Array:
    """Stiffness at uniform strain, shape (…, k, k), of phases (k, k) with fractions (phases, …)."""
    return np.asarray(np.tensordot(fractions, np.stack(stiffness), axes=([0], [0])))


def reuss(fractions: Array, stiffness: Sequence[Array]) -> Array:
    """Stiffness at uniform stress, as `voigt`."""
    compliance = [np.asarray(np.linalg.inv(phase), float) for phase in stiffness]
    return np.asarray(np.linalg.inv(voigt(fractions, compliance)), float)


def hashin_shtrikman(fractions: Array, phases: Sequence[AnyPhase], *, space: bool = False) -> Array:
    """Lower and upper bound of K, then of G, in Pa, shape (2, 2, …): of the plane or of space.

    In the plane of fibres by Hill (J. Mech. Phys. Solids 12, 199, 1964) and Hashin (ibid. 13, 119,
    1965), of space by Hashin and Shtrikman (ibid. 11, 127, 1963); of any number of phases and with
    the extreme moduli of either Walpole (ibid. 17, 235, 1969). Those of K hold for hydrostatic
    strain of any arrangement of fibres, and of any cubic one; those of G for isotropic ones.

    Args:
        fractions: Of the phases, shape (phases, …).
        phases: The materials, isotropic in the plane or in space.
        space: Whether K is that of three dimensions, else of plane strain.
    """
    bulk, shear = _bulk_and_shear(phases, space)
    bounds = []
    for extreme in (np.min, np.max):
        terms = _reference_terms(extreme(bulk), extreme(shear), space)
        bounds.append(
            [_mean_with(bulk, fractions, terms[0]), _mean_with(shear, fractions, terms[1])]
        )
    return np.swapaxes(np.array(bounds), 0, 1)


def mori_tanaka(fraction: Array, phases: Sequence[AnyPhase], *, space: bool = False) -> Array:
    """K and G in Pa, (2, …), of round fibres or spheres by Mori and Tanaka (1973).

    `phases` are matrix and particle, of which a `fraction` of shape (…) is taken. These are the
    bounds of Hashin and Shtrikman with the matrix as reference, exact for few particles.
    """
    (bulk, shear), fractions = _bulk_and_shear(phases, space), np.stack([1 - fraction, fraction])
    bulk_term, shear_term = _reference_terms(bulk[0], shear[0], space)
    estimates = _mean_with(bulk, fractions, bulk_term), _mean_with(shear, fractions, shear_term)
    return np.array(estimates)


def bulk_modulus(stiffness: Array) -> Array:
    """In-plane bulk modulus of stiffnesses of shape (…, 3, 3), in Pa."""
    return np.asarray((stiffness[..., 0, 0] + stiffness[..., 1, 1] + 2 * stiffness[..., 0, 1]) / 4)


def _bulk_and_shear(phases: Sequence[AnyPhase], space: bool) -> Array:
    """K of space or of plane strain, and G, of each phase, shape (2, phases), in Pa."""
    if space:
        return np.array([phase.bulk_and_shear for phase in phases if isinstance(phase, Phase)]).T
    stiffness = np.array([phase.stiffness for phase in phases])
    return np.array([bulk_modulus(stiffness), stiffness[:, 2, 2]])


def _reference_terms(bulk: float, shear: float, space: bool) -> tuple[float, float]:
    """What a reference material adds to the bulk and the shear modulus of each phase, in Pa."""
    if space:
        return 4 / 3 * shear, shear / 6 * (9 * bulk + 8 * shear) / (bulk + 2 * shear)
    return shear, shear * bulk / (bulk + 2 * shear)


def _mean_with(moduli: Array, fractions: Array, term: float) -> Array:
    """X of 1/(X + term) = Σ fraction/(modulus + term), from (phases,) and (phases, …)."""
    return np.asarray(1 / np.tensordot(1 / (moduli + term), fractions, axes=1) - term)
