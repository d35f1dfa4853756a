"""Strain energies of the phases in the one-particle cell, by complex moduli of the series."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.rve.cell import Phase
from alphacut.rve.phase_energies import STEP, PhaseEnergies
from alphacut.rve.series.means import Mean, finer_count
from alphacut.rve.series.multipoles import LOADS, Contrast, modulus, multipoles
from alphacut.stochastic import RadiusMap, gauss_rule

SAFETY, NOISE = 1.6, 1e-12


def complex_moduli(radius: Array, bulk: Array, shear: Array, *, harmonics: int) -> Array:
    """C11 + C12, C11 − C12 and C33 of n cells times m inclusions, complex, shape (n, m, 3).

    Args:
        radius: Radii over half the cell's side, shape (n,).
        bulk: K of the matrix, then of m inclusions, complex, shape (1 + m,).
        shear: G, likewise.
        harmonics: Terms of the series.
    """
    contrast = Contrast.of_moduli(bulk, shear)
    columns = [
        modulus(load, multipoles(load, radius, contrast, harmonics=harmonics), radius, contrast)
        for load in LOADS
    ]
    return np.stack(columns, axis=-1)


def phase_energies(radius: Array, matrix: Phase, inclusion: Phase, *, harmonics: int) -> Array:
    """X ∂c/∂X of the three moduli for K and G of both phases, shape (n, 2, 2, 3), in Pa."""
    moduli = np.array([matrix.bulk_and_shear, inclusion.bulk_and_shear], complex)
    energies = np.zeros((radius.size, 2, 2, 3))
    for phase, kind in product(range(2), repeat=2):
        moved = moduli.copy()
        moved[phase, kind] *= 1 + 1j * STEP
        values = complex_moduli(radius, *moved.T, harmonics=harmonics)[:, 0]
        energies[:, phase, kind] = values.imag / STEP
    return energies


def mean_energies(
    radius_map: RadiusMap, matrix: Phase, inclusions: Sequence[Phase], means: Sequence[Mean]
) -> list[PhaseEnergies]:
    """Energies of means over θ, one for each inclusion."""
    return [
        _energies_of_mean(radius_map, matrix, inclusion, mean)
        for inclusion, mean in zip(inclusions, means, strict=True)
    ]


def _energies_of_mean(
    radius_map: RadiusMap, matrix: Phase, inclusion: Phase, mean: Mean
) -> PhaseEnergies:
    """Energies of one inclusion; the farther of two finer means tells the error, as of moduli."""
    nodes, terms, law = mean.curve.theta.size, mean.terms, radius_map.distribution
    levels: list[tuple[Array, Array, int]] = [(mean.curve.theta, mean.curve.weights, terms)]
    for _ in range(2):
        nodes, terms = finer_count(nodes), terms + max(2, terms // 2)
        rule = gauss_rule(law, points=nodes)
        levels.append((rule.nodes, rule.weights, terms))
    values, *finer = (
        weights @ phase_energies(radius_map(theta), matrix, inclusion, harmonics=n).reshape(-1, 12)
        for theta, weights, n in levels
    )
    values, distance = values.reshape(2, 2, 3), np.max([abs(values - x) for x in finer], axis=0)
    errors = SAFETY * distance.reshape(2, 2, 3) + NOISE * values.sum(axis=(0, 1))
    return PhaseEnergies(values, errors)
