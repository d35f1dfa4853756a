"""Division of every pixel into equal parts: the same image, a larger space of fields."""

from __future__ import annotations

import numpy as np
from numpy.polynomial import polynomial

from alphacut.rve.image.fields.element import Element
from alphacut.rve.image.fields.operator import blocks, shifted
from alphacut.stochastic.theta.truncated_normal import Array


def divided(image: Array, parts: int) -> Array:
    """Each pixel of an image, shape (…, rows, columns), as parts × parts equal ones."""
    return np.repeat(np.repeat(image, parts, axis=-2), parts, axis=-1)


def prolonged(element: Element, fields: Array, parts: int) -> Array:
    """The same fields, (tiles, loads, types, rows, columns), as unknowns of the parts."""
    tiles, loads, types, rows, columns = fields.shape
    result = np.empty((tiles, loads, types, rows * parts, columns * parts))
    matrices = {
        (row, column): evaluation(element, row, column, parts)
        for row, column in np.ndindex(parts, parts)
    }
    for block, lines in blocks(fields.shape):
        local = np.empty((len(element.local_types), *fields[block, :, 0, lines].shape))
        for k, (kind, shift) in enumerate(zip(element.local_types, element.shifts, strict=True)):
            for here, there in shifted(lines, shift, fields.shape):
                local[k][(..., *here)] = fields[block, :, kind][(..., *there)]
        for (y, x), matrix in matrices.items():
            values = (matrix @ local.reshape(len(local), -1)).reshape(types, *local.shape[1:])
            place = slice(lines.start * parts + y, lines.stop * parts, parts)
            result[block, :, :, place, x::parts] = np.moveaxis(values, 0, 2)
    return result


def evaluation(element: Element, row: int, column: int, parts: int) -> Array:
    """From a pixel's unknowns to those of the part (row, column) of it, shape (types, n)."""
    components = len(element.local_types) // len(element.line) ** 2
    size = len(element.line) ** 2
    matrix = np.zeros((element.types, components * size))
    for kind, (component, y, x, order_y, order_x) in enumerate(element.functionals):
        along_y = _values(element, (row + y) / parts, order_y)
        along_x = _values(element, (column + x) / parts, order_x)
        scale = float(parts) ** (element.order - order_y - order_x)  # lengths are in pixels
        matrix[kind, component * size : (component + 1) * size] = scale * np.kron(along_y, along_x)
    return matrix


def _values(element: Element, place: float, order: int) -> Array:
    """Derivatives of the basis functions of a line at a place in [0, 1]."""
    return np.array(
        [
            polynomial.polyval(place, polynomial.polyder(f, order) if order else np.array(f))
            for f in element.line
        ]
    )
