"""Strain energies of the phases in the simple cubic array, by differences of the series."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.rve.cell import Phase
from alphacut.rve.phase_energies import PhaseEnergies
from alphacut.rve.series.means import Mean
from alphacut.rve.spheres.series.stiffness import cubic_stiffness
from alphacut.stochastic import RadiusMap

STEP, TOLERANCE = 0.02, 1e-7
"""Relative step of a modulus, and truncation error of the series: loss factors to four digits."""
WEIGHTS = {-2: (1 / 12, 0.0), -1: (-2 / 3, -0.5), 1: (2 / 3, 0.5), 2: (-1 / 12, 0.0)}
"""Of the values at multiples of the step: for derivatives of fourth and of second order."""
RULE_FACTOR = 10.0
"""Error of mean derivatives by the rule in θ, over that of the mean moduli."""


def mean_energies(
    radius_map: RadiusMap, matrix: Phase, inclusions: Sequence[Phase], means: Sequence[Mean]
) -> list[PhaseEnergies]:
    """Parts X ∂c/∂X of K and G of both phases in K, (C11 − C12)/2 and C44, for each inclusion.

    Errors are those of the differences, of the truncated series and of the rule in θ.
    """
    energies = []
    for inclusion, mean in zip(inclusions, means, strict=True):
        radii = radius_map(mean.curve.theta)
        values, second_order = _energies_by_differences(radii, mean, matrix, inclusion)
        relative_error = TOLERANCE / STEP + RULE_FACTOR * mean.errors["theta"]
        errors = abs(values - second_order) + relative_error * values.sum(axis=(0, 1))
        energies.append(PhaseEnergies(values, errors))
    return energies


def _energies_by_differences(radii: Array, mean: Mean, matrix: Phase, inclusion: Phase) -> Array:
    """Mean energies over θ by differences of fourth and of second order, in Pa.

    Returns:
        Shape (2 orders, 2 phases, K and G, 3 moduli).
    """
    moduli = np.array([matrix.bulk_and_shear, inclusion.bulk_and_shear])
    energies = np.zeros((2, 2, 2, 3))
    for phase, kind in product(range(2), repeat=2):
        for multiple, weights in WEIGHTS.items():
            stepped = moduli.copy()
            stepped[phase, kind] *= 1 + multiple * STEP
            stepped_matrix, stepped_inclusion = (Phase.of_bulk_and_shear(*x) for x in stepped)
            cells = cubic_stiffness(radii, stepped_matrix, [stepped_inclusion], tolerance=TOLERANCE)
            mean_moduli = mean.curve.weights @ cells.moduli[:, 0]
            energies[:, phase, kind] += np.multiply.outer(weights, mean_moduli / STEP)
    return energies
