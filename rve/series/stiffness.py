"""Stiffness of the one-particle cell by multipole series, to a declared error."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.rve.cell import Phase, square_voigt
from alphacut.rve.series.multipoles import LOADS, MOST_HARMONICS, Contrast, modulus, multipoles
from alphacut.rve.series.truncation import CellModuli, Truncation

TRUNCATION = Truncation(
    steps=(3, 4, 5, 6, 8, 10, 12, 16, 24, 32, 48, 64, 96, 128, MOST_HARMONICS),
    decay=8.0,
    unknowns=lambda harmonics: harmonics,
    safety=1.6,
    round_off=2e-15,
    terms="harmonics",
    particles="particles",
    voigt=square_voigt,
)


def square_stiffness(
    radius: Array, matrix: Phase, inclusions: Sequence[Phase], *, tolerance: float = 1e-12
) -> CellModuli:
    """C11 + C12, C11 − C12 and C33 of n square cells times m inclusions, with declared errors.

    Args:
        radius: Radii over half the cell's side, shape (n,), each in [0, 1).
        matrix: Material outside the particle.
        inclusions: Materials of the particle, m of them.
        tolerance: Relative truncation error allowed, at least 1e-13.

    Raises:
        RefusedError: A radius lies outside [0, 1).
        SeriesError: The series does not reach `tolerance` (particles nearly in touch).
    """
    contrast = Contrast.of_phases(matrix, inclusions)

    def solve(radii: Array, harmonics: int) -> Array:
        columns = [
            modulus(load, multipoles(load, radii, contrast, harmonics=harmonics), radii, contrast)
            for load in LOADS
        ]
        return np.stack(columns, axis=-1)

    return TRUNCATION.converged_moduli(radius, len(inclusions), solve, tolerance=tolerance)
