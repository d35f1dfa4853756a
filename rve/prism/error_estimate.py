"""Error of a product-space result, measured against the exact plane cell at each θ.

The product space has no θ-derivative, so its exact solution at each θ is a plane cell: the
multipole series for circles of isotropic phases, slices of order 4 for all others. Neither shares
elements or mesh with the wedges; its own declared error is added.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.rve.cell import STRAIN, Cell, Phase, axial_moduli
from alphacut.rve.phase_energies import PhaseEnergies
from alphacut.rve.result import HomogenisedStiffness, StressCurve
from alphacut.rve.series.model import SeriesModel
from alphacut.rve.slices.model import SlicesModel

_ACCURACY = 1e-9  # of the series
_POINTS = 14  # of slices in θ


def with_errors(result: HomogenisedStiffness) -> HomogenisedStiffness:
    """The result with its declared errors.

    Args:
        result: Of the product space, with its cell.

    Raises:
        SeriesError: Particles nearly touch.
        RuleError: The map of the radius is not smooth.
    """
    assert result.cell is not None
    exact = _exact(result.cell)
    moduli, truth = _readings(result.curve), _readings(exact.curve)
    # where one load is lacking, s11 is along x1
    truth = truth[1:] if len(moduli) == 1 else truth
    pairs = [_relative_distance(*pair) for pair in zip(moduli, truth, strict=False)]
    distance = np.max(pairs, axis=0)  # nan where a modulus is not known
    error = np.asarray((1 + distance) * (1 + exact.modulus_errors) - 1)
    return replace(result, errors={"space": error}, energies=_judged_energies(result, exact))


def _judged_energies(
    result: HomogenisedStiffness, exact: HomogenisedStiffness
) -> PhaseEnergies | None:
    """Energies of the phases with their distance from the exact cell as declared errors."""
    if result.energies is None or exact.energies is None:
        return result.energies
    values = result.energies.values
    return PhaseEnergies(values, abs(values - exact.energies.values) + exact.energies.errors)


def _exact(cell: Cell) -> HomogenisedStiffness:
    """Result of another model of the cell, far more accurate than wedges are."""
    matrix, inclusion = cell.matrix, cell.inclusion
    if (
        cell.square
        and cell.interphase is None
        and isinstance(matrix, Phase)
        and isinstance(inclusion, Phase)
    ):
        return SeriesModel(accuracy=_ACCURACY, energies=True).solve(
            cell.radius, matrix, [inclusion]
        )[0]
    model = SlicesModel(points=_POINTS, outline=cell.outline, energies=True)
    return model.solve(cell.radius, matrix, [inclusion], cell.interphase)[0]


def _readings(curve: StressCurve) -> Sequence[Array]:
    """The mean moduli, (3,), along either axis and, at last, of both.

    Where no third load was solved, C11 − C12 is not known, and only those printed are.
    """
    s11, s12 = curve.mean
    if curve.stiffness is None:
        return [np.array([s11 / STRAIN, np.nan, s12 / (2 * STRAIN)])]
    mean = np.asarray(np.tensordot(curve.weights, curve.stiffness, axes=1), float)
    mean_axes, first, second = axial_moduli(mean, square=False)
    return [second, first, mean_axes]


def _relative_distance(first: Array, second: Array) -> Array:
    """Relative distance by the larger of both ratios."""
    return np.asarray(np.maximum(first / second, second / first) - 1)
