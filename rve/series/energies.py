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
from alphacut.stochastic import RadiusMap, ThetaRule, gauss_rule

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
    """Parts X ∂c/∂X of K and G of both phases in C11 ± C12 and C33, shape (n, 2, 2, 3), in Pa."""
    moduli = np.array([matrix.bulk_and_shear, inclusion.bulk_and_shear], complex)
    energies = np.zeros((radius.size, 2, 2, 3))
    for phase, kind in product(range(2), repeat=2):
        stepped = moduli.copy()
        stepped[phase, kind] *= 1 + 1j * STEP
        bulk, shear = stepped.T
        values = complex_moduli(radius, bulk, shear, harmonics=harmonics)[:, 0]
        energies[:, phase, kind] = values.imag / STEP
    return energies


def mean_energies(
    radius_map: RadiusMap, matrix: Phase, inclusions: Sequence[Phase], means: Sequence[Mean]
) -> list[PhaseEnergies]:
    """Mean parts of the phases in the strain energy over θ, for each inclusion."""
    return [
        _energies_of_mean(radius_map, matrix, inclusion, mean)
        for inclusion, mean in zip(inclusions, means, strict=True)
    ]


def _energies_of_mean(
    radius_map: RadiusMap, matrix: Phase, inclusion: Phase, mean: Mean
) -> PhaseEnergies:
    """Mean energies of the phases with one inclusion; error: distance from two finer means."""

    def mean_at(rule: ThetaRule, terms: int) -> Array:
        radii = radius_map(rule.nodes)
        return rule.mean(phase_energies(radii, matrix, inclusion, harmonics=terms))

    rule, terms = ThetaRule(mean.curve.theta, mean.curve.weights), mean.terms
    values, distances = mean_at(rule, terms), []
    for _ in range(2):
        rule = gauss_rule(radius_map.distribution, points=finer_count(rule.nodes.size))
        terms += max(2, terms // 2)
        distances.append(abs(values - mean_at(rule, terms)))
    errors = SAFETY * np.max(distances, axis=0) + NOISE * values.sum(axis=(0, 1))
    return PhaseEnergies(values, errors)
