"""Division of every pixel into equal parts: the same image, a larger space of fields."""

from __future__ import annotations

import numpy as np
from numpy.polynomial import polynomial

from alphacut.fuzzy.arrays import Array
from alphacut.rve.image.fields.element import Element
from alphacut.rve.image.fields.grid import blocks, gathered


def divided(image: Array, parts: int) -> Array:
    """Each pixel of an image, shape (rows, columns), as parts × parts equal ones."""
    return np.repeat(np.repeat(image, parts, axis=-2), parts, axis=-1)


def prolonged(element: Element, fields: Array, parts: int) -> Array:
    """The same fields, (loads, unknowns, rows, columns), as unknowns of the parts."""
    loads, count, rows, columns = fields.shape
    result = np.empty((loads, count, rows * parts, columns * parts))
    matrices = {place: evaluation(element, *place, parts) for place in np.ndindex(parts, parts)}
    for lines in blocks(fields.shape):
        local = gathered(element, fields, lines)
        for (y, x), matrix in matrices.items():
            values = (matrix @ local.reshape(len(local), -1)).reshape(count, *local.shape[1:])
            place = slice(lines.start * parts + y, lines.stop * parts, parts)
            result[:, :, place, x::parts] = np.moveaxis(values, 0, 1)
    return result


def evaluation(element: Element, row: int, column: int, parts: int) -> Array:
    """From a pixel's unknowns to those of the part (row, column) of it, shape (unknowns, n)."""
    size = len(element.line) ** 2
    matrix = np.zeros((len(element.unknowns), len(element.local)))
    for kind, unknown in enumerate(element.unknowns):
        (y, x), slopes = unknown.place, unknown.slopes
        along_y = _values(element, (row + y) / parts, slopes[0])
        along_x = _values(element, (column + x) / parts, slopes[1])
        own = slice(unknown.component * size, (unknown.component + 1) * size)
        # lengths are in pixels
        matrix[kind, own] = float(parts) ** (element.order - sum(slopes)) * np.kron(
            along_y, along_x
        )
    return matrix


def _values(element: Element, place: float, order: int) -> Array:
    """Derivatives of the basis functions of a line at a place in [0, 1]."""
    lines = (polynomial.polyder(f, order) if order else np.array(f) for f in element.line)
    return np.array([polynomial.polyval(place, line) for line in lines])
