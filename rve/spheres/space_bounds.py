"""Bounds of the stiffness of two isotropic phases in three dimensions.

Voigt and Reuss hold as matrices; Hashin and Shtrikman's (J. Mech. Phys. Solids 11, 127, 1963; with
the extreme moduli of either phase, Walpole 1966) for the bulk modulus of any cubic or isotropic
arrangement and for both moduli of an isotropic one.
"""

from __future__ import annotations

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.rve.cell import Phase
from alphacut.rve.spheres.cubic import cubic_voigt


def space_stiffness(phase: Phase) -> Array:
    """Stiffness in Voigt order (11, 22, 33, 23, 13, 12 with 2 ε), shape (6, 6), in Pa."""
    bulk, shear = phase.bulk_and_shear
    return cubic_voigt(bulk, shear, shear)


def hashin_shtrikman(fraction: Array, matrix: Phase, inclusion: Phase) -> Array:
    """Hashin–Shtrikman bounds of K and μ in Pa, for volume fractions of shape (…).

    Returns:
        Lower and upper bound of K, lower and upper bound of μ: shape (2, 2, …).
    """
    bulks, shears = zip(*(map(float, x.bulk_and_shear) for x in (matrix, inclusion)), strict=True)
    bounds = []
    for extreme in (min, max):
        bulk_term, shear_term = _reference_terms(extreme(bulks), extreme(shears))
        bulk_bound = _harmonic_mean_with(fraction, bulks, bulk_term)
        bounds.append([bulk_bound, _harmonic_mean_with(fraction, shears, shear_term)])
    return np.swapaxes(np.array(bounds), 0, 1)


def mori_tanaka(fraction: Array, matrix: Phase, inclusion: Phase) -> Array:
    """K and μ of spheres by Mori and Tanaka (1973), in Pa, shape (2, …).

    The bound that the matrix gives: the lower one of stiffer spheres, the upper one of softer.
    """
    terms = _reference_terms(*matrix.bulk_and_shear)
    pairs = zip(matrix.bulk_and_shear, inclusion.bulk_and_shear, strict=True)
    return np.array(
        [_harmonic_mean_with(fraction, pair, term) for pair, term in zip(pairs, terms, strict=True)]
    )


def _harmonic_mean_with(fraction: Array, moduli: tuple[float, float], term: float) -> Array:
    """X of 1/(X + term) = Σ fraction/(modulus + term), of the matrix's and particle's moduli."""
    matrix, particle = moduli
    f = np.asarray(fraction, float)
    return np.asarray(1 / ((1 - f) / (matrix + term) + f / (particle + term)) - term)


def _reference_terms(bulk: float, shear: float) -> tuple[float, float]:
    """Terms that Hashin and Shtrikman add to bulk and shear moduli in a reference material."""
    return 4 / 3 * shear, shear / 6 * (9 * bulk + 8 * shear) / (bulk + 2 * shear)
