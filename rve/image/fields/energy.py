"""Mean energies of given fields, with a bound of every rounding error made on the way.

The floating-point numbers of a field are taken as exact: whatever the solver left in them, they are
a field of the space. Rounded are the differences from the pixel's anchor, the modes, and the energy
of each pixel; the sum over pixels is exact (`math.fsum`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from alphacut.rve.image.fields.element import Element
from alphacut.rve.image.fields.operator import blocks, shifted
from alphacut.stochastic.theta.truncated_normal import Array

UNIT = 2.0**-53  # rounding unit
SAFETY = 1.01  # for the rounding of the error bound itself and for terms of second order


@dataclass(frozen=True)
class Energy:
    """Mean energies of all pairs of fields.

    Args:
        value: Symmetric, shape (tiles, fields, fields).
        rounding: Bound of the absolute error of each entry, same shape.
        pixels: Energies of all pairs in each pixel, shape (tiles, fields, fields, rows, columns),
            or None.
    """

    value: Array
    rounding: Array
    pixels: Array | None = None

    @property
    def upper(self) -> Array:
        """A matrix above the true one in the Loewner order, shape (tiles, fields, fields)."""
        above = self.rounding.sum(axis=-1) * SAFETY + 4 * UNIT * np.abs(self.value).sum(axis=-1)
        return np.asarray(self.value + above[..., None] * np.eye(above.shape[-1]))


def energy(
    element: Element,
    bulk: Array,
    shear: Array,
    fields: Array,
    mean_modes: Array,
    *,
    pixels: bool = False,
) -> Energy:
    """Mean energies of fields plus uniform ones.

    Args:
        element: Unknowns and modes of a pixel.
        bulk: Coefficient of the trace, shape (tiles, rows, columns); exact up to 8 rounding units.
        shear: Coefficient of the deviator, same shape and exactness.
        fields: Shape (tiles, fields, types, rows, columns).
        mean_modes: Modes of the uniform fields, shape (mode rows, fields).
        pixels: Keep the energy of each pixel too.
    """
    tiles, count, _, rows, columns = fields.shape
    value = np.empty((tiles, count, count))
    error = np.zeros((tiles, count))
    density = np.empty((tiles, count, count, rows, columns))
    for block, lines, modes, rounding in modes_of(element, fields, mean_modes):
        weights = _weights(element, bulk[block, lines], shear[block, lines])
        error[block] += np.einsum("rtyx,rtlyx,rtlyx->tl", weights, rounding, rounding)
        for k in range(count):
            weighted = weights * modes[:, :, k]
            for j in range(k + 1):
                density[block, j, k, lines] = np.einsum("rtyx,rtyx->tyx", weighted, modes[:, :, j])
    for tile, j, k in np.ndindex(tiles, count, count):
        if j <= k:
            value[tile, j, k] = value[tile, k, j] = math.fsum(
                density[tile, j, k].ravel().tolist()
            ) / (rows * columns)
    size = np.sqrt(SAFETY * np.diagonal(value, axis1=1, axis2=2))
    wrong = np.sqrt(SAFETY * error / (rows * columns))
    summed = (len(element.modes) + 16) * UNIT * _outer(size, size)
    bound = SAFETY * (_outer(size, wrong) + _outer(wrong, size) + _outer(wrong, wrong) + summed)
    if not pixels:
        return Energy(value, bound)
    for j, k in np.ndindex(count, count):
        density[:, max(j, k), min(j, k)] = density[:, min(j, k), max(j, k)]
    return Energy(value, bound, density)


def modes_of(
    element: Element, fields: Array, mean_modes: Array
) -> Iterator[tuple[slice, slice, Array, Array]]:
    """Modes and bounds of their rounding errors, block by block.

    Yields:
        Tiles, rows, modes of shape (mode rows, tiles, fields, rows, columns) and the bound of each,
        same shape.
    """
    absolute = np.abs(element.modes)
    count = len(element.local_types)
    for block, lines in blocks(fields.shape):
        local, doubt = _anchored(element, fields, block, lines)
        shape = local.shape[1:]
        modes = (element.modes @ local.reshape(count, -1)).reshape(-1, *shape)
        np.abs(local, out=local)
        # the product of matrices; entries of the matrix are right to 10 units
        doubt += (count + 12) * UNIT * local
        rounding = (absolute @ doubt.reshape(count, -1)).reshape(-1, *shape)
        modes += mean_modes[:, None, :, None, None]
        rounding += UNIT * np.abs(modes)
        yield block, lines, modes, rounding


def _anchored(element: Element, fields: Array, tiles: slice, lines: slice) -> tuple[Array, Array]:
    """Local unknowns minus their anchors, and the bound of the rounding."""
    raw = np.empty((len(element.local_types), *fields[tiles, :, 0, lines].shape))
    for k, (kind, shift) in enumerate(zip(element.local_types, element.shifts, strict=True)):
        for here, there in shifted(lines, shift, fields.shape):
            raw[k][(..., *here)] = fields[tiles, :, kind][(..., *there)]
    local, doubt = raw.copy(), np.zeros_like(raw)
    for k, anchors in enumerate(element.anchors):
        for anchor in anchors:
            local[k] -= raw[anchor]
            doubt[k] += UNIT * np.abs(local[k])
    return local, doubt


def _weights(element: Element, bulk: Array, shear: Array) -> Array:
    """Coefficient of each mode, shape (mode rows, tiles, rows, columns)."""
    split = element.bulk_rows
    return np.concatenate(
        [
            np.broadcast_to(bulk, (split, *bulk.shape)),
            np.broadcast_to(shear, (len(element.modes) - split, *shear.shape)),
        ]
    )


def _outer(first: Array, second: Array) -> Array:
    return first[:, :, None] * second[:, None, :]
