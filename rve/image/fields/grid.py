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
        """Nodal forces of fields, both of shape (loads, unknowns, rows, columns).

        Of each pixel they are (trace Tᵀ T + deviator Dᵀ D) times its local unknowns, with T and D
        the matrices to the modes of trace and deviator.
        """
        result = np.zeros_like(fields)
        trace_modes, deviator_modes = (self.element.modes[rows] for rows in self.element.parts)
        matrix = np.hstack([trace_modes.T @ trace_modes, deviator_modes.T @ deviator_modes])
        for rows in blocks(fields.shape):
            local = gather(self.element, fields, rows)
            weighted = np.stack([self.trace[rows] * local, self.deviator[rows] * local])
            forces = matrix @ weighted.reshape(matrix.shape[1], -1)
            scatter(self.element, forces.reshape(local.shape), result, rows)
        return result

    def load(self, mean_modes: Array) -> Array:
        """Right-hand sides: minus the nodal forces of uniform fields.

        Args:
            mean_modes: Modes of each uniform field, from `Element.mean_modes`, (modes, loads).

        Returns:
            Shape (loads, unknowns, rows, columns).
        """
        result = np.zeros((mean_modes.shape[1], self.element.unknowns, *self.trace.shape))
        trace_force, deviator_force = (
            -(self.element.modes[part].T @ mean_modes[part])[..., None, None]
            for part in self.element.parts
        )
        for rows in blocks(result.shape):
            local = trace_force * self.trace[rows] + deviator_force * self.deviator[rows]
            scatter(self.element, local, result, rows)
        return result


def blocks(shape: tuple[int, ...]) -> Iterator[slice]:
    """Slices of rows, each of about `COLUMNS` pixels times loads."""
    loads, _, rows, columns = shape
    count = max(1, COLUMNS // (loads * columns))
    for row in range(0, rows, count):
        yield slice(row, min(rows, row + count))


def gather(element: Element, fields: Array, rows: slice) -> Array:
    """Local unknowns of the pixels of some rows, shape (local unknowns, loads, rows, columns)."""
    row_numbers = np.arange(rows.start, rows.stop)
    local = np.empty((len(element.local), len(fields), row_numbers.size, fields.shape[-1]))
    for k, (unknown, up, right) in enumerate(element.local):
        source = fields[:, unknown, (row_numbers + up) % fields.shape[-2]]
        local[k] = np.roll(source, -right, axis=-1) if right else source
    return local


def scatter(element: Element, forces: Array, result: Array, rows: slice) -> None:
    """Add element forces, (n, loads, rows, columns), of the pixels of some rows to `result`."""
    row_numbers = np.arange(rows.start, rows.stop)
    for k, (unknown, up, right) in enumerate(element.local):
        force = np.roll(forces[k], right, axis=-1) if right else forces[k]
        result[:, unknown, (row_numbers + up) % result.shape[-2]] += force
