"""The operator of a grid of voxels, axis by axis: products of splines are never multiplied out.

A row of voxels along x is worked on at once, so that every inner loop runs along memory. For each
derivative in a strain or stress component the coefficients of the row and its neighbours go to
Legendre modes along x, then y, then z; the material weighs the modes; the transposed way leads
back. `grid.Operator` multiplies the same out, by matrices, and is what this is tested against.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.kernels import kernel
from alphacut.rve.image.fields.element import Element, isotropic_parts


def apply_by_rows(element: Element, trace: Array, deviator: Array, fields: Array) -> Array:
    """Nodal forces of fields, both of shape (loads, unknowns, z, y, x)."""
    result = np.zeros_like(fields)
    assert element.products is not None
    tables, terms, factors = element.products
    parts = isotropic_parts(element.dimension, stress=element.stress)
    forms = np.outer(parts[0], parts[0]), parts[1:].T @ parts[1:]
    for load in range(len(fields)):
        _apply(tables, terms, factors, *forms, trace, deviator, fields[load], result[load])
    return result


@kernel(fastmath={"contract", "nsz"})
def _apply(
    tables: Any,
    terms: Any,
    factors: Any,
    trace_form: Any,
    deviator_form: Any,
    trace: Any,
    deviator: Any,
    field: Any,
    result: Any,
) -> None:
    """Add the forces of one field, (unknowns, z, y, x), to the result.

    `tables`, (axis, order, mode, function), lead to modes along z, y, x; a term of `terms` is a
    component, an unknown and the orders along z, y, x. The forms weigh components, (6, 6).
    """
    n = tables.shape[-1]
    nz, ny, nx = trace.shape
    components = len(trace_form)
    modes = np.empty((components, n, n, n, nx))
    along_x, along_y = np.empty((n, n, n, nx)), np.empty((n, n, n, nx))
    row, weighed = np.empty(nx + n - 1), np.empty((components, nx))
    for z in range(nz):
        for y in range(ny):
            modes[:] = 0.0
            for term in range(len(terms)):
                c, u, dz, dy, dx = terms[term]
                factor = factors[term]
                for a in range(n):
                    for b in range(n):
                        line = field[u, (z + a) % nz, (y + b) % ny]
                        row[:nx] = line
                        row[nx:] = line[: n - 1]
                        for k in range(n - dx):
                            out = along_x[a, b, k]
                            out[:] = 0.0
                            for f in range(n):
                                t = factor * tables[2, dx, k, f]
                                for x in range(nx):
                                    out[x] += t * row[x + f]
                    for j in range(n - dy):
                        for k in range(n - dx):
                            out = along_y[a, j, k]
                            out[:] = 0.0
                            for b in range(n):
                                t = tables[1, dy, j, b]
                                source = along_x[a, b, k]
                                for x in range(nx):
                                    out[x] += t * source[x]
                for i in range(n - dz):
                    for j in range(n - dy):
                        for k in range(n - dx):
                            out = modes[c, i, j, k]
                            for a in range(n):
                                t = tables[0, dz, i, a]
                                source = along_y[a, j, k]
                                for x in range(nx):
                                    out[x] += t * source[x]
            by_trace, by_deviator = trace[z, y], deviator[z, y]
            for i in range(n):
                for j in range(n):
                    for k in range(n):
                        weighed[:] = 0.0
                        for c in range(components):
                            for d in range(components):
                                p, q = trace_form[c, d], deviator_form[c, d]
                                if p != 0.0 or q != 0.0:
                                    source = modes[d, i, j, k]
                                    for x in range(nx):
                                        weighed[c, x] += (
                                            p * by_trace[x] + q * by_deviator[x]
                                        ) * source[x]
                        for c in range(components):
                            modes[c, i, j, k] = weighed[c]
            for term in range(len(terms)):
                c, u, dz, dy, dx = terms[term]
                factor = factors[term]
                for a in range(n):
                    for j in range(n - dy):
                        for k in range(n - dx):
                            out = along_y[a, j, k]
                            out[:] = 0.0
                            for i in range(n - dz):
                                t = factor * tables[0, dz, i, a]
                                source = modes[c, i, j, k]
                                for x in range(nx):
                                    out[x] += t * source[x]
                    for b in range(n):
                        row[:] = 0.0
                        for k in range(n - dx):
                            out = along_x[a, b, k]
                            out[:] = 0.0
                            for j in range(n - dy):
                                t = tables[1, dy, j, b]
                                source = along_y[a, j, k]
                                for x in range(nx):
                                    out[x] += t * source[x]
                            for f in range(n):
                                t = tables[2, dx, k, f]
                                for x in range(nx):
                                    row[x + f] += t * out[x]
                        line = result[u, (z + a) % nz, (y + b) % ny]
                        for x in range(nx):
                            line[x] += row[x]
                        for x in range(n - 1):
                            line[x] += row[nx + x]
