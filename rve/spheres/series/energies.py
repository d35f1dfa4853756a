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
OF_RULE = 10.0
"""Error of mean derivatives by the rule in θ, over that of the mean moduli."""


def mean_energies(
    radius_map: RadiusMap, matrix: Phase, inclusions: Sequence[Phase], means: Sequence[Mean]
) -> list[PhaseEnergies]:
    """X ∂c/∂X of K, (C11 − C12)/2 and C44 for K and G of both phases, for each inclusion.

    Errors hold the difference of both orders, the truncation and the rule in θ.
    """
    energies = []
    for inclusion, mean in zip(inclusions, means, strict=True):
        values, judge = _differences(radius_map(mean.curve.theta), mean, matrix, inclusion)
        relative = TOLERANCE / STEP + OF_RULE * mean.errors["theta"]
        energies.append(
            PhaseEnergies(values, abs(values - judge) + relative * values.sum(axis=(0, 1)))
        )
    return energies


def _differences(radii: Array, mean: Mean, matrix: Phase, inclusion: Phase) -> Array:
    """Mean energies by differences of fourth and of second order, shape (2, 2, 2, 3), in Pa."""
    moduli = np.array([matrix.bulk_and_shear, inclusion.bulk_and_shear])
    energies = np.zeros((2, 2, 2, 3))
    for phase, kind in product(range(2), repeat=2):
        for count, weights in WEIGHTS.items():
            moved = moduli.copy()
            moved[phase, kind] *= 1 + count * STEP
            pair = [Phase.of_bulk_and_shear(*values) for values in moved]
            cells = cubic_stiffness(radii, pair[0], pair[1:], tolerance=TOLERANCE)
            change = mean.curve.weights @ cells.moduli[:, 0] / STEP
            energies[:, phase, kind] += np.multiply.outer(weights, change)
    return energies
