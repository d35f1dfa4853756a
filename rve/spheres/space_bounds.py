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
    """Bounds of K and μ in Pa: shape (2 moduli, 2 ends, …) for volume fractions of shape (…)."""
    share = np.asarray(fraction, float)
    bulks, shears = zip(*(map(float, x.bulk_and_shear) for x in (matrix, inclusion)), strict=True)
    ends = [
        [
            _harmonic_about(share, pair, x)
            for pair, x in zip((bulks, shears), _around(end(bulks), end(shears)), strict=True)
        ]
        for end in (min, max)
    ]
    return np.swapaxes(np.array(ends), 0, 1)


def mori_tanaka(fraction: Array, matrix: Phase, inclusion: Phase) -> Array:
    """K and μ of spheres by Mori and Tanaka (1973), in Pa, shape (2, …).

    The bound that the matrix gives: the lower one of stiffer spheres, the upper one of softer.
    """
    share, around = np.asarray(fraction, float), _around(*matrix.bulk_and_shear)
    pairs = zip(matrix.bulk_and_shear, inclusion.bulk_and_shear, strict=True)
    return np.array(
        [_harmonic_about(share, pair, x) for pair, x in zip(pairs, around, strict=True)]
    )


def _harmonic_about(share: Array, moduli: tuple[float, float], around: float) -> Array:
    """Harmonic mean of matrix's and particle's moduli, each with `around` added, less that."""
    first, second = moduli
    return np.asarray(1 / ((1 - share) / (first + around) + share / (second + around)) - around)


def _around(bulk: float, shear: float) -> tuple[float, float]:
    """Terms that Hashin and Shtrikman add to bulk and shear moduli in a reference material."""
    return 4 / 3 * shear, shear / 6 * (9 * bulk + 8 * shear) / (bulk + 2 * shear)
