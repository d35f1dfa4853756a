"""The elastic operator on a periodic pixel grid, applied pixel by pixel without a matrix.

Fields have the shape (loads, unknowns, rows, columns): one field a load, one value per pixel and
unknown of the element.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.rve.image.fields.element import Element

COLUMNS = 6144  # pixels times loads worked on at once: what the second cache holds


@dataclass(frozen=True)
class Operator:
    """Stiffness of a pixel grid: sum of the element matrices times each pixel's coefficients.

    Args:
        element: Unknowns and modes of a pixel.
        trace: Coefficient of the trace, shape (rows, columns), positive.
        deviator: Coefficient of the deviator, same shape, positive.
    """

    element: Element
    trace: Array
    deviator: Array

    def apply(self, fields: Array) -> Array:
        """Product with fields, shape (loads, unknowns, rows, columns), of the same shape."""
        result = np.zeros_like(fields)
        modes = [self.element.modes[part] for part in self.element.parts]
        matrix = np.hstack([m.T @ m for m in modes])
        for rows in blocks(fields.shape):
            local = gathered(self.element, fields, rows)
            weighted = np.stack([c[rows] * local for c in (self.trace, self.deviator)])
            forces = matrix @ weighted.reshape(matrix.shape[1], -1)
            scatter(self.element, forces.reshape(local.shape), result, rows)
        return result

    def load(self, mean_modes: Array) -> Array:
        """Right-hand sides of uniform fields: minus their nodal forces, shaped like fields.

        Args:
            mean_modes: Modes of each uniform field, from `Element.mean_modes`, (modes, loads).
        """
        result = np.zeros((mean_modes.shape[1], self.element.unknowns, *self.trace.shape))
        forces = [-self.element.modes[p].T @ mean_modes[p] for p in self.element.parts]
        for rows in blocks(result.shape):
            local = sum(
                force[..., None, None] * c[rows]
                for force, c in zip(forces, (self.trace, self.deviator), strict=True)
            )
            scatter(self.element, np.asarray(local), result, rows)
        return result


def blocks(shape: tuple[int, ...]) -> Iterator[slice]:
    """Slices of rows, each of about `COLUMNS` pixels times loads."""
    loads, _, rows, columns = shape
    count = max(1, COLUMNS // (loads * columns))
    for row in range(0, rows, count):
        yield slice(row, min(rows, row + count))


def gathered(element: Element, fields: Array, rows: slice) -> Array:
    """Element unknowns of the pixels of some rows, shape (n, loads, rows, columns)."""
    lines = np.arange(rows.start, rows.stop)
    local = np.empty((len(element.local), len(fields), lines.size, fields.shape[-1]))
    for k, (kind, up, right) in enumerate(element.local):
        source = fields[:, kind, (lines + up) % fields.shape[-2]]
        local[k] = np.roll(source, -right, axis=-1) if right else source
    return local


def scatter(element: Element, forces: Array, result: Array, rows: slice) -> None:
    """Add element forces, (n, loads, rows, columns), of the pixels of some rows to `result`."""
    lines = np.arange(rows.start, rows.stop)
    for k, (kind, up, right) in enumerate(element.local):
        force = np.roll(forces[k], right, axis=-1) if right else forces[k]
        result[:, kind, (lines + up) % result.shape[-2]] += force
