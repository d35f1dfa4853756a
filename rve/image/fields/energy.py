"""Mean energies of fields, with a bound of every rounding error made on the way.

The floating-point numbers of a field are taken as exact: whatever the solver left in them, they are
a field of the space. Rounded are the differences from the pixel's anchor, the modes, and the sums
of some products of modes; the sum of these is exact (`math.fsum`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.rve.image.fields.element import Element
from alphacut.rve.image.fields.grid import blocks, gathered

UNIT = 2.0**-53  # rounding unit
SAFETY = 1.01  # for the rounding of the error bound itself and for terms of second order
PIECE = 64  # products that are summed in rounded steps
COEFFICIENT = 8  # rounding units that a coefficient may be off by

Weighted = tuple[slice, Array]  # rows of the modes, and what they count in each pixel


@dataclass(frozen=True, eq=False)
class Energies:
    """Mean products of the modes of fields, by weight.

    Args:
        value: Symmetric, shape (weights, fields, fields).
        error: Norm of the rounding error of each field's modes, shape (weights, fields).
        summed: Relative rounding of products and sums.
    """

    value: Array
    error: Array
    summed: float

    @property
    def size(self) -> Array:
        """Norm of each field, not below the true one, shape (weights, fields)."""
        squares = np.maximum(np.diagonal(self.value, axis1=1, axis2=2), 0)
        return np.asarray(np.sqrt(SAFETY * squares))

    @property
    def rounding(self) -> Array:
        """Bound of the absolute error of each product, shape (weights, fields, fields)."""
        size, wrong = self.size, self.error
        mixed = _outer(size, wrong) + _outer(wrong, size) + _outer(wrong, wrong)
        return np.asarray(SAFETY * (mixed + self.summed * _outer(size, size)))

    @property
    def upper(self) -> Array:
        """A matrix above the sum over the weights in the Loewner order, shape (fields, fields)."""
        value = self.value.sum(axis=0)
        terms = 2 * (len(self.value) + 2) * UNIT * np.abs(self.value).sum(axis=0)
        return np.asarray(value + np.diag(SAFETY * (self.rounding.sum(axis=0) + terms).sum(axis=1)))


def energies(
    element: Element, fields: Array, mean_modes: Array, weights: Sequence[Weighted]
) -> Energies:
    """Mean products of the modes of fields plus uniform ones.

    Args:
        element: Unknowns and modes of a pixel.
        fields: Shape (fields, unknowns, rows, columns).
        mean_modes: Modes of the uniform fields, shape (mode rows, fields).
        weights: What modes count in each pixel, shape (rows, columns), not negative; right to
            `COEFFICIENT` units.
    """
    count, pixels = len(fields), fields.shape[-2] * fields.shape[-1]
    piece = max(PIECE, count**2)  # so that there are not more sums than products
    sums: list[list[Array]] = [[] for _ in weights]
    error = np.zeros((len(weights), count))
    for lines, modes, rounding in modes_of(element, fields, mean_modes):
        for k, (rows, weight) in enumerate(weights):
            sums[k].append(_summed(modes[rows], weight[lines], piece))
            error[k] += np.einsum("rfyx,yx->f", rounding[rows] ** 2, weight[lines])
    value = np.empty((len(weights), count, count))
    for k, parts in enumerate(sums):
        entries = np.concatenate(parts).reshape(-1, count**2).T
        value[k] = np.reshape([math.fsum(terms) for terms in entries], (count, count)) / pixels
    summed = SAFETY * (piece + COEFFICIENT + 4) * UNIT
    return Energies(value, np.sqrt(SAFETY * error / pixels), summed)


def _summed(modes: Array, weight: Array, piece: int) -> Array:
    """Products of the modes, (rows, fields, lines, columns), summed piece by piece.

    Returns:
        Shape (pieces, fields, fields).
    """
    count = modes.shape[1]
    flat = np.swapaxes(modes, 0, 1).reshape(count, -1)
    weighted = np.swapaxes(modes * weight, 0, 1).reshape(count, -1)
    missing = -flat.shape[1] % piece
    first, second = (
        np.swapaxes(np.pad(x, ((0, 0), (0, missing))).reshape(count, -1, piece), 0, 1)
        for x in (flat, weighted)
    )
    products = first @ np.swapaxes(second, 1, 2)
    return np.asarray((products + np.swapaxes(products, 1, 2)) / 2)


def modes_of(
    element: Element, fields: Array, mean_modes: Array
) -> Iterator[tuple[slice, Array, Array]]:
    """Modes and bounds of their rounding errors, block by block.

    Yields:
        Rows, modes of shape (mode rows, fields, rows, columns) and the bound of each, same shape.
    """
    absolute, count = np.abs(element.modes), len(element.local)
    for lines in blocks(fields.shape):
        local, doubt = _anchored(element, gathered(element, fields, lines))
        shape = (-1, *local.shape[1:])
        modes = (element.modes @ local.reshape(count, -1)).reshape(shape)
        # the product of matrices; entries of the matrix are right to 10 units
        doubt += (count + 12) * UNIT * np.abs(local)
        rounding = (absolute @ doubt.reshape(count, -1)).reshape(shape)
        modes += mean_modes[..., None, None]
        rounding += UNIT * np.abs(modes)
        yield lines, modes, rounding


def _anchored(element: Element, raw: Array) -> tuple[Array, Array]:
    """Local unknowns minus their anchors, and the bound of the rounding."""
    local, doubt = raw.copy(), np.zeros_like(raw)
    for k, anchors in enumerate(element.anchors):
        for anchor in anchors:
            local[k] -= raw[anchor]
            doubt[k] += UNIT * np.abs(local[k])
    return local, doubt


def _outer(first: Array, second: Array) -> Array:
    return np.asarray(first[:, :, None] * second[:, None, :])
