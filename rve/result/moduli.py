"""Moduli of a plane stiffness by averages over its directions, and classical bounds of stiffness.

A square array has three moduli, not two. Eq. 16 takes the hydrostatic one, B = C11 + C12, and the
shear along the axes, C33; the shear along the diagonals, (C11 − C12)/2, does not enter. This is the
average "axes".

A material whose particles lie at random has no such axes. Its shear modulus is nearer to the mean
of Voigt's average over all directions, (G₀ + G₄₅)/2, and Reuss's, 2/(1/G₀ + 1/G₄₅), as Hill (1952)
proposed for polycrystals; the plane-strain bulk modulus is the same in all directions. This is the
average "isotropic". Either way E and ν are those of an isotropic material of this shear and bulk
modulus in plane strain. Of a stiffness without the symmetry of the square its square part counts:
C11 is then (C11 + C22)/2.

The in-plane bulk modulus of a square array is isotropic enough for Hashin–Shtrikman; its shear
modulus G12 is not and lies below the isotropic lower bound, so it is not tested against that.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import RefusedError
from alphacut.rve.cell.cell import AnyPhase, Phase


def voigt(fractions: Array, stiffness: Sequence[Array]) -> Array:
    """Return Voigt's average, the stiffness at uniform strain: the mean of those of the phases.

    Args:
        fractions: Fractions of the phases, shape (phases, …), where … is any shape.
        stiffness: Stiffness of each phase in one unit, shape (k, k).

    Returns:
        Averages, shape (…, k, k).
    """
    return np.asarray(np.tensordot(fractions, np.stack(stiffness), axes=([0], [0])))


def reuss(fractions: Array, stiffness: Sequence[Array]) -> Array:
    """Return the stiffness at uniform stress, the inverse of the mean compliance; as `voigt`."""
    compliance = [np.asarray(np.linalg.inv(phase), float) for phase in stiffness]
    return np.asarray(np.linalg.inv(voigt(fractions, compliance)), float)


def hashin_shtrikman(fractions: Array, phases: Sequence[AnyPhase], *, space: bool = False) -> Array:
    """Return bounds of K and of G of a composite of isotropic phases, in the plane or in space.

    The bounds of K hold for any arrangement of fibres under equal strains along x and y, and for
    any cubic composite of space under hydrostatic strain; those of G hold for isotropic composites.
    For fibres they are by Hill (J. Mech. Phys. Solids 12, 199, 1964) and Hashin (ibid. 13, 119,
    1965), in space by Hashin and Shtrikman (ibid. 11, 127, 1963), and for any number of phases by
    Walpole (ibid. 17, 235, 1969).

    Args:
        fractions: Fractions of the phases, shape (phases, …), where … is any shape; their sum over
            the phases is 1.
        phases: The materials, isotropic in the plane or in space, with positive moduli.
        space: Whether K is that of three dimensions and the composite one of space; else K is that
            of plane strain.

    Returns:
        Bounds in Pa, shape (2, 2, …): the first axis is K, G, the second one lower, upper.
    """
    bulk, shear = _bulk_and_shear(phases, space)
    bounds = []
    # The bounds are the means with the softest and with the stiffest moduli of all phases as
    # reference.
    for extreme in (np.min, np.max):
        bulk_term, shear_term = _reference_terms(extreme(bulk), extreme(shear), space)
        mean_bulk = _mean_with(bulk, fractions, bulk_term)
        bounds.append([mean_bulk, _mean_with(shear, fractions, shear_term)])
    return np.swapaxes(np.array(bounds), 0, 1)


def mori_tanaka(fraction: Array, phases: Sequence[AnyPhase]) -> Array:
    """Return plane-strain K and G of round fibres by Mori and Tanaka (1973), in Pa, shape (2, …).

    These are the bounds of Hashin and Shtrikman with the matrix as reference, exact for few fibres.

    Args:
        fraction: Fraction of the fibres, of any shape (…).
        phases: Isotropic matrix and fibre, in this order.
    """
    bulk, shear = _bulk_and_shear(phases, space=False)
    fractions = np.stack([1 - fraction, fraction])
    bulk_term, shear_term = _reference_terms(bulk[0], shear[0], space=False)
    mean_bulk = _mean_with(bulk, fractions, bulk_term)
    return np.array([mean_bulk, _mean_with(shear, fractions, shear_term)])


def _bulk_and_shear(phases: Sequence[AnyPhase], space: bool) -> Array:
    """Return K of space or of plane strain, and G, of each phase, shape (2, phases), in Pa."""
    if space:
        return np.array([phase.bulk_and_shear for phase in phases if isinstance(phase, Phase)]).T
    # In plane strain K is (C11 + C12)/2 and G is C33, whatever the phase is along the fibres.
    moduli = square_moduli(np.array([phase.stiffness for phase in phases]))
    return np.array([moduli[:, 0] / 2, moduli[:, 2]])


def _reference_terms(bulk: float, shear: float, space: bool) -> tuple[float, float]:
    """Return the terms of Hashin and Shtrikman's bounds that a reference material gives, in Pa.

    A bound of K is X in 1/(X + term) = Σ fraction/(K of the phase + term), and that of G likewise.

    Args:
        bulk: K of the reference, in Pa: of three dimensions, or of plane strain. K and G are not
            both 0.
        shear: G of the reference, in Pa.
        space: Whether the composite is one of space; else of the plane across fibres.

    Returns:
        The term of K, and that of G.
    """
    if space:
        # By Hashin and Shtrikman (1963) the terms are those of a spherical inclusion in the
        # reference, of Eshelby's tensor.
        return 4 / 3 * shear, shear / 6 * (9 * bulk + 8 * shear) / (bulk + 2 * shear)
    # By Hashin (1965) they are those of a cylinder across its axis.
    return shear, shear * bulk / (bulk + 2 * shear)


def _mean_with(moduli: Array, fractions: Array, term: float) -> Array:
    """Return the modulus X with 1/(X + term) = Σ_k fraction_k/(modulus_k + term), in Pa, shape (…).

    This is the common form of the bounds of Hashin and Shtrikman.

    Args:
        moduli: Modulus of each phase, shape (phases,), in Pa.
        fractions: Fractions of the phases, shape (phases, …), where … is any shape.
        term: Term of the reference material, in Pa; not 0 if a modulus is 0.
    """
    return np.asarray(1 / np.tensordot(1 / (moduli + term), fractions, axes=1) - term)


AXES = "axes"
ISOTROPIC = "isotropic"
AVERAGES = {AXES: "eq. 16", ISOTROPIC: "the isotropic average of the plane stiffness"}
"""Averages of a plane stiffness by their names in Python and cases, in words."""


def require_average(average: str) -> None:
    """Refuse an average that is not one of `AVERAGES`."""
    if average not in AVERAGES:
        raise RefusedError("average", average, " or ".join(AVERAGES))


def shear_modulus(moduli: Array, average: str) -> Array:
    """Return the in-plane shear modulus G_T of an average over directions, shape (…).

    Args:
        moduli: C11 + C12, C11 − C12 and C33 in one unit, shape (…, 3), where … is any shape; "axes"
            does not use the first two.
        average: "axes" for C33 alone; any other name, such as "isotropic", for Hill's mean (1952)
            of Voigt's and Reuss's averages over all directions.
    """
    along_axes = moduli[..., 2]
    if average == AXES:
        return np.asarray(along_axes)
    # The shear modulus along the diagonals of the square. Over all directions it lies between this
    # and C33, so that both averages are of these two.
    along_diagonals = moduli[..., 1] / 2
    voigt_mean = (along_axes + along_diagonals) / 2
    reuss_mean = 2 / (1 / along_axes + 1 / along_diagonals)
    return np.asarray((voigt_mean + reuss_mean) / 2)


def plane_constants(moduli: Array, average: str) -> Array:
    """Return E in Pa and ν of an isotropic solid in plane strain, by an average of the stiffness.

    The solid has the bulk modulus (C11 + C12)/2 and the shear modulus G_T of the average, so that ν
    = (1 − 2 G_T/(C11 + C12))/2 and E = 2 G_T (1 + ν).

    Args:
        moduli: C11 + C12, C11 − C12 and C33 in Pa, shape (…, 3), where … is any shape. They may be
            complex.
        average: "axes" for G_T = C33, eq. 16 of the paper, where C11 − C12 is not used; "isotropic"
            for Hill's mean over all directions of the plane.

    Returns:
        E and ν, shape (…, 2). E is negative where 2 G_T > 3 (C11 + C12).
    """
    hydrostatic = moduli[..., 0]
    shear = shear_modulus(moduli, average)
    poisson = (1 - 2 * shear / hydrostatic) / 2  # eq. 16 with A = 2 G and B = C11 + C12
    young = 2 * shear * (1 + poisson)
    return np.stack([young, poisson], axis=-1)


def square_voigt(bulk: Array, deviator: Array, shear: Array) -> Array:
    """Return Voigt matrices of square symmetry, (…, 3, 3), from C11 + C12, C11 − C12 and C33."""
    stiffness = np.zeros((*bulk.shape, 3, 3))
    stiffness[..., 0, 0] = stiffness[..., 1, 1] = (bulk + deviator) / 2
    stiffness[..., 0, 1] = stiffness[..., 1, 0] = (bulk - deviator) / 2
    stiffness[..., 2, 2] = shear
    return stiffness


def square_moduli(stiffness: Array) -> Array:
    """Return C11 + C12, C11 − C12 and C33 of the square-symmetric part, shape (…, 3)."""
    mean = (stiffness[..., 0, 0] + stiffness[..., 1, 1]) / 2
    lateral = stiffness[..., 0, 1]
    return np.stack([mean + lateral, mean - lateral, stiffness[..., 2, 2]], axis=-1)


def axial_moduli(stiffness: Array, *, square: bool) -> Array:
    """Return C11 + C12, C11 − C12 and C33 of plane stiffnesses, with C11 taken in 1 or 3 ways.

    Args:
        stiffness: Plane stiffnesses in Voigt's order 11, 22, 12, shape (…, 3, 3).
        square: Whether C11 and C22 are equal but for the mesh, so that their mean is enough.

    Returns:
        The three moduli are on the last axis, the ways on the last but one. If `square`, C11 is
        taken as the mean of C11 and C22, shape (…, 1, 3); else as this mean, as C11, and as C22, in
        this order, shape (…, 3, 3).
    """
    moduli = [square_moduli(stiffness)]
    if not square:
        lateral = stiffness[..., 0, 1]
        shear = stiffness[..., 2, 2]
        for axis in (0, 1):
            axial = stiffness[..., axis, axis]
            moduli.append(np.stack([axial + lateral, axial - lateral, shear], axis=-1))
    return np.stack(moduli, axis=-2)
