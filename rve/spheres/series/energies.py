"""Strain energies of the phases in the simple cubic array, by differences of the series."""

from __future__ import annotations

from itertools import product

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.rve.cell import Phase
from alphacut.rve.spheres.series.stiffness import moduli_of_degree

STEP = 1e-3
"""Relative step: of order 1e-12 is what differences of fourth order leave, 1e-10 the round-off."""
WEIGHTS = {-2: 1 / 12, -1: -2 / 3, 1: 2 / 3, 2: -1 / 12}
"""Of the values at multiples of the step, for a first derivative of fourth order."""


def phase_energies(radius: Array, matrix: Phase, inclusion: Phase, *, harmonics: int) -> Array:
    """X ∂c/∂X of K, (C11 − C12)/2 and C44 for K and G of both phases, (n, 2, 2, 3), in Pa.

    Args:
        radius: Radii over half the cell's side, shape (n,).
        matrix: Material outside the sphere.
        inclusion: Material of the sphere.
        harmonics: Degree of the series.
    """
    moduli = np.array([matrix.bulk_and_shear, inclusion.bulk_and_shear])
    energies = np.zeros((radius.size, 2, 2, 3))
    for phase, kind in product(range(2), repeat=2):
        for count, weight in WEIGHTS.items():
            moved = moduli.copy()
            moved[phase, kind] *= 1 + count * STEP
            pair = [Phase.of_bulk_and_shear(*values) for values in moved]
            stiffness = moduli_of_degree(radius, pair[0], pair[1:], harmonics)[:, 0]
            energies[:, phase, kind] += weight / STEP * stiffness
    return energies
