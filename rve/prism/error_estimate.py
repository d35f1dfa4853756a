"""Declared error of a product-space result: its distance from a reference model, plus that error.

The product space has no θ-derivative, so its exact solution at each θ is that of a two-dimensional
unit cell. The reference solves that cell by the multipole series for circles of isotropic phases,
by slices of order 4 for all others; neither shares elements or mesh with the prisms.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.rve.cell.cell import STRAIN, Cell, Phase
from alphacut.rve.result.moduli import axial_moduli
from alphacut.rve.result.result import HomogenisedStiffness, PhaseEnergies, StressCurve
from alphacut.rve.series.model import SeriesModel
from alphacut.rve.slices.model import SlicesModel

_ACCURACY = 1e-9  # relative, of the series
_POINTS = 14  # slices in θ


def with_errors(result: HomogenisedStiffness) -> HomogenisedStiffness:
    """Copy of a result with declared errors: its distance from a reference plus the reference's.

    Args:
        result: Of the product space, with its cell.

    Raises:
        SeriesError: Particles nearly touch.
        RuleError: The map of the radius is not smooth.
    """
    assert result.cell is not None
    reference = _reference_result(result.cell)
    moduli, reference_moduli = _mean_moduli(result.curve), _mean_moduli(reference.curve)
    if len(moduli) == 1:  # two loads: s11 is along x1
        reference_moduli = reference_moduli[1:]
    distances = list(map(_relative_distance, moduli, reference_moduli))
    distance = np.max(distances, axis=0)  # nan where a modulus was not computed
    error = np.asarray((1 + distance) * (1 + reference.modulus_errors) - 1)
    energies = _energies_with_errors(result, reference)
    return replace(result, errors={"space": error}, energies=energies)


def _energies_with_errors(
    result: HomogenisedStiffness, reference: HomogenisedStiffness
) -> PhaseEnergies | None:
    """Energies of the phases; their error is the distance from the reference plus the latter's."""
    if result.energies is None or reference.energies is None:
        return result.energies
    values, errors = result.energies.values, reference.energies.errors
    return PhaseEnergies(values, abs(values - reference.energies.values) + errors)


def _reference_result(cell: Cell) -> HomogenisedStiffness:
    """Result of the series, or of slices where it has no formula; more accurate than prisms."""
    matrix, inclusion = cell.matrix, cell.inclusion
    is_square = cell.square and cell.interphase is None
    if is_square and isinstance(matrix, Phase) and isinstance(inclusion, Phase):
        series = SeriesModel(accuracy=_ACCURACY, energies=True)
        return series.solve(cell.radius, matrix, [inclusion])[0]
    slices = SlicesModel(points=_POINTS, outline=cell.outline, energies=True)
    return slices.solve(cell.radius, matrix, [inclusion], cell.interphase)[0]


def _mean_moduli(curve: StressCurve) -> Sequence[Array]:
    """Mean C11 + C12, C11 − C12 and C33 over θ in Pa, (3,) each, in three versions.

    Returns:
        With C22 in place of C11, with C11, and with their mean; without a third load only the
        second one, where C11 − C12 is nan.
    """
    s11, s12 = curve.mean
    if curve.stiffness is None:
        return [np.array([s11 / STRAIN, np.nan, s12 / (2 * STRAIN)])]
    mean = np.asarray(np.tensordot(curve.weights, curve.stiffness, axes=1), float)
    mean_axes, first, second = axial_moduli(mean, square=False)
    return [second, first, mean_axes]


def _relative_distance(first: Array, second: Array) -> Array:
    """Larger of both ratios less 1, entry by entry."""
    return np.asarray(np.maximum(first / second, second / first) - 1)
