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
from alphacut.rve.result import Homogenised, StressCurve
from alphacut.rve.series.model import SeriesModel
from alphacut.rve.series.stiffness import square_stiffness
from alphacut.rve.slices.curve import stresses
from alphacut.rve.slices.model import SlicesModel

_ACCURACY = 1e-9  # of the series
_POINTS = 14  # of slices in θ


def judged(result: Homogenised) -> Homogenised:
    """The result with its declared errors.

    Args:
        result: Of the product space, with its cell.

    Raises:
        SeriesError: Particles nearly touch.
        RuleError: The map of the radius is not smooth.
    """
    cell, curve = result.cell, result.curve
    assert cell is not None
    mean, nodes = _by_series(curve, cell) if cell.square else _by_slices(curve, cell)
    return replace(result, curve=replace(curve, error=nodes), errors={"space": mean})


def _by_series(curve: StressCurve, cell: Cell) -> tuple[Array, Array]:
    """Errors of means, (3,), and of stresses at the nodes, (n, 2), by the multipole series."""
    matrix, inclusion = cell.matrix, cell.inclusion
    assert isinstance(matrix, Phase)
    assert isinstance(inclusion, Phase)
    exact = SeriesModel(accuracy=_ACCURACY).solve(cell.radius, matrix, [inclusion])[0]
    at = square_stiffness(cell.radius(curve.theta), matrix, [inclusion], tolerance=_ACCURACY)
    stress = np.stack(stresses(at.matrix[:, 0]), axis=-1)
    return _of_means(curve, exact), _of_nodes(curve, stress, at.errors[:, 0][:, [0, 2]])


def _by_slices(curve: StressCurve, cell: Cell) -> tuple[Array, Array]:
    """The same by slices; between their nodes by the polynomial through them."""
    model = SlicesModel(points=_POINTS, outline=cell.outline)
    exact = model.solve(cell.radius, cell.matrix, [cell.inclusion])[0]
    nodes = exact.curve
    assert nodes.error is not None
    values = np.log(np.stack([nodes.s11, nodes.s12], axis=-1))
    fits = [_polynomial(nodes.theta, values, curve.theta, degree) for degree in (_POINTS - 1, 9)]
    left = abs(fits[0] - fits[1]) + nodes.error.max(axis=0)
    return _of_means(curve, exact), _of_nodes(curve, np.exp(fits[0]), left)


def _polynomial(x: Array, y: Array, at: Array, degree: int) -> Array:
    """Values (m, k) at points (m,) of the polynomials through y (n, k) at x (n,)."""
    low, high = min(x.min(), at.min()), max(x.max(), at.max())
    own, other = ((2 * z - low - high) / (high - low) for z in (x, at))
    basis = np.polynomial.chebyshev.chebvander
    coefficients = np.linalg.lstsq(basis(own, degree), y, rcond=None)[0]
    return np.asarray(basis(other, degree) @ coefficients)


def _of_means(curve: StressCurve, exact: Homogenised) -> Array:
    """Relative errors of the mean moduli, shape (3,)."""
    own, truth = _readings(curve), _readings(exact.curve)
    # where one load is lacking, s11 is along x1
    truth = truth[1:] if len(own) == 1 else truth
    pairs = [_apart(*pair) for pair in zip(own, truth, strict=False)]
    apart = np.max(pairs, axis=0)  # nan where a modulus is not known
    return np.asarray((1 + apart) * (1 + exact.modulus_errors) - 1)


def _readings(curve: StressCurve) -> Sequence[Array]:
    """The mean moduli, (3,), along either axis and, at last, of both.

    Where no third load was solved, C11 − C12 is not known, and only those printed are.
    """
    s11, s12 = curve.mean
    if curve.stiffness is None:
        return [np.array([s11 / STRAIN, np.nan, s12 / (2 * STRAIN)])]
    mean = np.asarray(np.tensordot(curve.weights, curve.stiffness, axes=1), float)
    both, first, second = axial_moduli(mean, square=False)
    return [second, first, both]


def _of_nodes(curve: StressCurve, exact: Array, left: Array) -> Array:
    """Relative errors of σ11 and σ12 at the nodes, shape (n, 2)."""
    own = np.stack([curve.s11, curve.s12], axis=-1)
    return np.asarray((1 + _apart(own, exact)) * (1 + left) - 1)


def _apart(first: Array, second: Array) -> Array:
    """Relative distance by the larger of both ratios."""
    return np.asarray(np.maximum(first / second, second / first) - 1)
