"""The elastic operator on a pixel grid, applied pixel by pixel without a matrix.

Fields have the shape (tiles, loads, types, rows, columns): one periodic grid a tile, one field a
load, one unknown per pixel and type.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from alphacut.rve.image.fields.element import Element
from alphacut.stochastic.theta.truncated_normal import Array

COLUMNS = 6144  # pixels times loads worked on at once: what the second cache holds


@dataclass(frozen=True)
class Operator:
    """Sum over pixels of the element matrices for the bulk and the shear coefficient of each pixel.

    Args:
        element: Unknowns and modes of a pixel.
        bulk: Coefficient of the trace, shape (tiles, rows, columns), positive.
        shear: Coefficient of the deviator, same shape, positive.
    """

    element: Element
    bulk: Array
    shear: Array

    @cached_property
    def matrix(self) -> Array:
        """Element matrices for unit bulk and unit shear coefficient, shape (n, 2 n)."""
        modes, rows = self.element.modes, self.element.bulk_rows
        return np.hstack([modes[:rows].T @ modes[:rows], modes[rows:].T @ modes[rows:]])

    def apply(self, fields: Array) -> Array:
        """The operator on fields of shape (tiles, loads, types, rows, columns)."""
        result = np.zeros_like(fields)
        count = len(self.element.local_types)
        matrix = self.matrix.astype(fields.dtype)
        for tiles, rows in blocks(fields.shape):
            bulk, shear = (
                c[tiles, rows][:, None].astype(fields.dtype, copy=False)
                for c in (self.bulk, self.shear)
            )
            local = np.empty((2 * count, *fields[tiles, :, 0, rows].shape), fields.dtype)
            for k, (kind, shift) in enumerate(
                zip(self.element.local_types, self.element.shifts, strict=True)
            ):
                for here, there in shifted(rows, shift, fields.shape):
                    source = fields[tiles, :, kind][(..., *there)]
                    np.multiply(source, bulk[(..., *here)], out=local[k][(..., *here)])
                    np.multiply(source, shear[(..., *here)], out=local[count + k][(..., *here)])
            forces = (matrix @ local.reshape(2 * count, -1)).reshape(count, *local.shape[1:])
            self._scatter(forces, result, tiles, rows)
        return result

    def load(self, mean_modes: Array) -> Array:
        """Minus the operator on uniform fields of the given modes, shape (rows, loads)."""
        tiles, rows, columns = self.bulk.shape
        result = np.zeros((tiles, mean_modes.shape[1], self.element.types, rows, columns))
        split = self.element.bulk_rows
        forces = [
            -self.element.modes[part].T @ mean_modes[part]
            for part in (slice(0, split), slice(split, None))
        ]
        for block, lines in blocks(result.shape):
            local = sum(
                f[:, None, :, None, None] * c[block, lines][None, :, None]
                for f, c in zip(forces, (self.bulk, self.shear), strict=True)
            )
            self._scatter(np.asarray(local), result, block, lines)
        return result

    def _scatter(self, forces: Array, result: Array, tiles: slice, rows: slice) -> None:
        """Add local forces, (n, tiles, loads, rows, columns), to the fields they belong to."""
        for k, (kind, shift) in enumerate(
            zip(self.element.local_types, self.element.shifts, strict=True)
        ):
            for here, there in shifted(rows, shift, result.shape):
                result[tiles, :, kind][(..., *there)] += forces[k][(..., *here)]


def blocks(shape: tuple[int, ...]) -> Iterator[tuple[slice, slice]]:
    """Slices of tiles and rows, each of about `COLUMNS` pixels times loads."""
    tiles, loads, _, rows, columns = shape
    lines = max(1, min(rows, COLUMNS // (loads * columns)))
    together = max(1, COLUMNS // (loads * columns * rows)) if lines == rows else 1
    for tile in range(0, tiles, together):
        for row in range(0, rows, lines):
            yield slice(tile, min(tiles, tile + together)), slice(row, min(rows, row + lines))


def shifted(
    rows: slice, shift: tuple[int, int], shape: tuple[int, ...]
) -> Iterator[tuple[tuple[slice, slice], tuple[slice, slice]]]:
    """Pairs of places, in a block of `rows` and in the grid moved by `shift`."""
    height, width = shape[-2:]
    for lines in _moved(rows.start, rows.stop, shift[0], height):
        for columns in _moved(0, width, shift[1], width):
            yield (lines[0], columns[0]), (lines[1], columns[1])


def _moved(start: int, stop: int, by: int, period: int) -> list[tuple[slice, slice]]:
    """Places from `start` to `stop`, and the same moved by 0 or 1 with the period."""
    length = stop - start
    if stop + by <= period:
        return [(slice(0, length), slice(start + by, stop + by))]
    inner = [(slice(0, length - 1), slice(start + 1, stop))] if length > 1 else []
    return [*inner, (slice(length - 1, length), slice(0, 1))]
