"""Operator and energies of voxels, axis by axis: products of splines are not multiplied out.

A row of voxels along x is worked on at once, so that every inner loop runs along memory. Splines
become Legendre modes along x, then z, in strips that are kept until the last row that needs them,
then y; the transposed passes lead back. `grid.Operator` and `energy.modes_of` multiply the same out
by matrices, for arrays of any library, and are what this is tested against.

Names: `tables`, (axis, order, mode, function), lead to modes along z, y, x; a term of `terms` is a
component, an unknown and the orders of its derivative along z, y, x, sorted by unknown and the last
order; modes have the shape (component, mode along z, along y, modes along x of a row).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.kernels import kernel
from alphacut.rve.image.fields.element import Element, isotropic_parts

ROUNDINGS = 32
"""Of a mode, relative to the sum of the magnitudes of its terms: 12 of the tables' entries (3 each,
and 3 of the sides), 3 a pass and 3 of sums of terms, 4 of the parts; 28 with those of a part."""

fast = kernel(fastmath={"contract", "nsz"})  # fused products round less; the order of sums stays


def apply_by_rows(
    element: Element, trace: Array, deviator: Array, fields: Array, mean_modes: Array
) -> Array:
    """Nodal forces of fields, both of shape (loads, unknowns, z, y, x), with mean modes added."""
    result = np.zeros_like(fields)
    assert element.products is not None
    parts = isotropic_parts(3, stress=element.stress)
    uniform = np.linalg.solve(parts, _constant_modes(element, mean_modes))
    for load, field in enumerate(fields):
        _apply(*element.products, parts[3, 3] ** 2, uniform[:, load].copy(),
               trace, deviator, field, result[load])  # fmt: skip
    return result


def energies_by_rows(
    element: Element, trace: Array, deviator: Array, fields: Array, mean_modes: Array, unit: float
) -> tuple[Array, Array]:
    """Sums over each row of products of modes, and what rounding of the modes changes in them.

    Args:
        element: Of products of splines.
        trace: Weight of the trace's modes, shape (z, y, x).
        deviator: Weight of the deviator's modes.
        fields: Shape (fields, unknowns, z, y, x).
        mean_modes: Modes of the uniform field to add to each, shape (modes, fields).
        unit: Rounding unit.

    Returns:
        Both of shape (trace or deviator, fields, fields, z, y).
    """
    assert element.products is not None
    count = len(fields)
    # errors of the constant mode of each part, and norms of those of all other modes of trace and
    # deviator: ≤ Σ_u amplification_u · greatest magnitude of u at the voxel
    unknown = np.array([u for u, _ in element.local])
    is_constant = np.asarray(element.of_voigt.any(axis=1))
    sums = np.stack([element.magnitude[:, unknown == u].sum(axis=1)
                     for u in range(element.unknowns)], axis=1)  # fmt: skip
    norms = [np.linalg.norm(sums[rows][~is_constant[rows]], axis=0) for rows in element.parts]
    amplification = np.concatenate([sums[is_constant], norms])
    products, errors = np.zeros((2, 2, count, count, *trace.shape[:2]))
    _add_energies(*element.products, isotropic_parts(3, stress=element.stress),
                  _constant_modes(element, mean_modes), ROUNDINGS * unit * amplification, unit,
                  np.stack([trace, deviator]), fields, products, errors)  # fmt: skip
    return products, errors


def _constant_modes(element: Element, modes: Array) -> Array:
    """Of modes (modes, fields) those that are constant, (parts, fields)."""
    return np.ascontiguousarray(modes[element.of_voigt.any(axis=1)])


@fast
def _apply(
    tables: Any, terms: Any, factors: Any, shear_factor: float, uniform: Any,
    trace: Any, deviator: Any, field: Any, result: Any,
) -> None:  # fmt: skip
    """Add the forces of one field, (unknowns, z, y, x), to the result.

    The law is trace·tr² + deviator·2 dev:dev; shear components count `shear_factor` times.
    """
    n = tables.shape[-1]
    nz, ny, nx = trace.shape
    strips = np.zeros((len(terms), n, n, n * nx))  # (term, mode along z, y % n, modes along x)
    sums = np.zeros((len(terms), n, n, n * nx))  # (term, y % n, mode along z, modes along x)
    modes = np.zeros((6, n, n, n * nx))
    lines, shifted = np.zeros((n, n * nx)), np.empty((n, n, nx))
    for z in range(nz):
        for y in range(n - 1):
            _fill_strips(tables, terms, factors, field, z, y, shifted, lines, strips)
        for y in range(ny):
            _fill_strips(tables, terms, factors, field, z, y + n - 1, shifted, lines, strips)
            _modes_of_row(tables, terms, strips, y, modes)
            for c in range(6):
                modes[c, 0, 0, :nx] += uniform[c]
            of_trace, of_deviator = trace[z, y], deviator[z, y]
            for i in range(n):
                for j in range(n):
                    for k in range(n):
                        row = slice(k * nx, (k + 1) * nx)
                        xx, yy, zz = modes[0, i, j, row], modes[1, i, j, row], modes[2, i, j, row]
                        yz, xz, xy = modes[3, i, j, row], modes[4, i, j, row], modes[5, i, j, row]
                        for x in range(nx):
                            twice = 2.0 * of_deviator[x]
                            mean = (of_trace[x] - twice / 3.0) * (xx[x] + yy[x] + zz[x])
                            xx[x] = twice * xx[x] + mean
                            yy[x] = twice * yy[x] + mean
                            zz[x] = twice * zz[x] + mean
                            shear = shear_factor * of_deviator[x]
                            yz[x] *= shear
                            xz[x] *= shear
                            xy[x] *= shear
            for term in range(len(terms)):
                c, _, dz, dy, dx = terms[term]
                for b in range(n):
                    weights = tables[1, dy, :, b]
                    for i in range(n - dz):
                        out = sums[term, (y + b) % n, i]
                        _add_combination(out, (n - dx) * nx, n - dy, 1.0, weights, modes[c, i])
            _add_forces(tables, terms, factors, sums, z, y, lines, shifted, result)
        for y in range(ny, ny + n - 1):
            _add_forces(tables, terms, factors, sums, z, y, lines, shifted, result)


@fast
def _add_energies(
    tables: Any, terms: Any, factors: Any, parts: Any, uniform: Any, amplification: Any,
    unit: float, weights: Any, fields: Any, products: Any, errors: Any,
) -> None:  # fmt: skip
    """Add products and errors of all pairs of fields by row, (weights, fields, fields, z, y)."""
    n, count = tables.shape[-1], len(fields)
    nz, ny, nx = weights.shape[1:]
    strips = np.zeros((count, len(terms), n, n, n * nx))
    by_component = np.zeros((6, n, n, n * nx))
    modes = np.zeros((count, 6, n * n, n * nx))
    lines, shifted = np.zeros((n, n * nx)), np.empty((n, n, nx))
    magnitude, product = np.empty((fields.shape[1], nx + n - 1)), np.empty(nx)
    # of the constant modes of the six parts, of the other modes of trace and of deviator
    size, error = np.zeros((8, count, nx)), np.zeros((8, count, nx))
    for z in range(nz):
        for y in range(1 - n, ny):
            for a in range(count):
                _fill_strips(
                    tables, terms, factors, fields[a], z, y + n - 1, shifted, lines, strips[a]
                )
            if y < 0:
                continue
            for a in range(count):
                _modes_of_row(tables, terms, strips[a], y, by_component)
                modes[a] = 0.0
                for p in range(6):
                    for c in range(6):
                        if parts[p, c] != 0.0:
                            _add_block(modes[a, p], parts[p, c], by_component[c])
                    modes[a, p, 0, :nx] += uniform[p, a]
                _greatest_magnitudes(fields[a], z, y, n, magnitude)
                for kind in range(8):
                    error[kind, a] = 0.0
                    for u in range(len(magnitude)):
                        factor = amplification[kind, u]
                        for x in range(nx):
                            error[kind, a, x] += factor * magnitude[u, x]
                for p in range(6):
                    for x in range(nx):
                        size[p, a, x] = abs(modes[a, p, 0, x])
                        error[p, a, x] += unit * size[p, a, x]  # of the uniform modes added
            for group in range(2):
                weight, first, last = weights[group, z, y], group, 1 + 5 * group
                for a in range(count):
                    for b in range(a, -1, -1):
                        _multiply_modes(modes[a, first:last], modes[b, first:last], product)
                        if a == b:  # differences of sums of 162 terms are off by 1e-13 at most
                            rest = size[6 + group, a]
                            for x in range(nx):
                                rest[x] = 1.0000000000001 * product[x]
                                for p in range(first, last):
                                    rest[x] -= size[p, a, x] ** 2
                                rest[x] = np.sqrt(max(rest[x], 0.0))
                        total = 0.0
                        for x in range(nx):
                            total += weight[x] * product[x]
                        products[group, a, b, z, y] = products[group, b, a, z, y] = total
            # errors δa, δb of modes change a b by at most (|a| + δa/2) δb + (|b| + δb/2) δa
            for kind in range(8):
                group = 0 if kind in (0, 6) else 1
                weight = weights[group, z, y]
                for a in range(count):
                    for b in range(count):
                        change = 0.0
                        for x in range(nx):
                            larger = size[kind, a, x] + error[kind, a, x] / 2.0
                            change += weight[x] * larger * error[kind, b, x]
                        errors[group, a, b, z, y] += change
                        errors[group, b, a, z, y] += change


@fast
def _fill_strips(
    tables: Any, terms: Any, factors: Any, field: Any, z: int, y: int,
    shifted: Any, lines: Any, strips: Any,
) -> None:  # fmt: skip
    """Pass the row y of the n planes from z on to modes along x, `lines`, and z."""
    n = tables.shape[-1]
    nz, ny, nx = field.shape[1:]
    for term in range(len(terms)):
        _, u, dz, _, dx = terms[term]
        if _is_new(terms, term, 1):
            for a in range(n):
                row = field[u, (z + a) % nz, y % ny]
                for f in range(n):
                    for x in range(nx - f):
                        shifted[a, f, x] = row[x + f]
                    for x in range(f):
                        shifted[a, f, nx - f + x] = row[x]
        if _is_new(terms, term, 4):
            lines[:] = 0.0
            for a in range(n):
                for k in range(n - dx):
                    out = lines[a, k * nx : (k + 1) * nx]
                    _add_combination(out, nx, n, 1.0, tables[2, dx, k], shifted[a])
        size = (n - dx) * nx
        for i in range(n - dz):
            out = strips[term, i, y % n]
            out[:size] = 0.0
            _add_combination(out, size, n, factors[term], tables[0, dz, i], lines)


@fast
def _modes_of_row(tables: Any, terms: Any, strips: Any, y: int, modes: Any) -> None:
    """Pass strips of the rows from y on to modes, (components, n, n, modes along x)."""
    n = tables.shape[-1]
    nx = modes.shape[-1] // n
    weights = np.empty(n)
    modes[:] = 0.0
    for term in range(len(terms)):
        c, _, dz, dy, dx = terms[term]
        for j in range(n - dy):
            for b in range(n):
                weights[(y + b) % n] = tables[1, dy, j, b]
            for i in range(n - dz):
                _add_combination(modes[c, i, j], (n - dx) * nx, n, 1.0, weights, strips[term, i])


@fast
def _add_forces(
    tables: Any, terms: Any, factors: Any, sums: Any, z: int, y: int,
    lines: Any, shifted: Any, result: Any,
) -> None:  # fmt: skip
    """Pass the sums of the row y back along z and x to the result, and empty them."""
    n = tables.shape[-1]
    nz, ny, nx = result.shape[1:]
    for term in range(len(terms)):
        _, u, dz, _, dx = terms[term]
        if _is_new(terms, term, 1):
            shifted[:] = 0.0
        if _is_new(terms, term, 4):
            lines[:] = 0.0
        row_sums = sums[term, y % n]
        for a in range(n):
            weights = tables[0, dz, :, a]
            _add_combination(lines[a], (n - dx) * nx, n - dz, factors[term], weights, row_sums)
        row_sums[:] = 0.0
        if _is_new(terms, term + 1, 4):
            for a in range(n):
                for f in range(n):
                    by_mode = lines[a].reshape(n, nx)
                    _add_combination(shifted[a, f], nx, n - dx, 1.0, tables[2, dx, :, f], by_mode)
        if _is_new(terms, term + 1, 1):
            for a in range(n):
                row = result[u, (z + a) % nz, y % ny]
                for f in range(n):
                    for x in range(nx - f):
                        row[x + f] += shifted[a, f, x]
                    for x in range(f):
                        row[x] += shifted[a, f, nx - f + x]


@fast
def _is_new(terms: Any, term: int, column: int) -> bool:
    """Whether a term's unknown (column 1), or its order along x too (4), is not the last one's."""
    is_end = term in (0, len(terms))
    return bool(
        is_end
        or terms[term, 1] != terms[term - 1, 1]
        or terms[term, column] != terms[term - 1, column]
    )


@fast
def _add_combination(
    out: Any, size: int, taps: int, factor: float, weights: Any, sources: Any
) -> None:
    """Add factor · weights @ sources, of so many taps, to the first values of a row."""
    a = factor * weights[0]  # sources are indexed in the loops: a view of a row takes as long
    if taps == 3:
        b, c = factor * weights[1], factor * weights[2]
        for x in range(size):
            out[x] += a * sources[0, x] + b * sources[1, x] + c * sources[2, x]
    elif taps == 2:
        b = factor * weights[1]
        for x in range(size):
            out[x] += a * sources[0, x] + b * sources[1, x]
    else:
        for x in range(size):
            out[x] += a * sources[0, x]


@fast
def _add_block(out: Any, factor: float, block: Any) -> None:
    """Add a multiple of a component's modes, (n, n, size), to those of a part, (n², size)."""
    n = len(block)
    for i in range(n):
        for j in range(n):
            row = block[i, j]
            for x in range(len(row)):
                out[i * n + j, x] += factor * row[x]


@fast
def _multiply_modes(first: Any, second: Any, product: Any) -> None:
    """Sum over parts and modes of the products at each voxel of a row, (parts, n², n·nx)."""
    nx = len(product)
    product[:] = 0.0
    for p in range(len(first)):
        for m in range(first.shape[1]):
            left, right = first[p, m], second[p, m]
            if len(left) == 3 * nx:
                for x in range(nx):
                    product[x] += (
                        left[x] * right[x]
                        + left[nx + x] * right[nx + x]
                        + left[2 * nx + x] * right[2 * nx + x]
                    )
            else:
                for x in range(nx):
                    product[x] += left[x] * right[x] + left[nx + x] * right[nx + x]


@fast
def _greatest_magnitudes(field: Any, z: int, y: int, n: int, magnitude: Any) -> None:
    """Greatest magnitude of each unknown among those of a voxel of the row, (unknowns, nx + …)."""
    nz, ny, nx = field.shape[1:]
    magnitude[:] = 0.0
    for u in range(len(field)):
        greatest = magnitude[u]
        for a in range(n):
            for b in range(n):
                row = field[u, (z + a) % nz, (y + b) % ny]
                for x in range(nx):
                    greatest[x] = max(greatest[x], abs(row[x]))
        greatest[nx:] = greatest[: n - 1]
        for x in range(nx):
            for f in range(1, n):
                greatest[x] = max(greatest[x], greatest[x + f])


@fast
def multiply_by_blocks(triangles: Any, spectra: Any) -> None:
    """Multiply each wave of spectra, (loads, unknowns, waves), by its symmetric block, in place.

    `triangles`, (entries, waves), are the lower triangles of the blocks by rows.
    """
    loads, count, waves = spectra.shape
    size = 256  # waves worked on at once: what the first cache holds
    product = np.empty((count, size), spectra.dtype)
    for load in range(loads):
        for start in range(0, waves, size):
            length = min(size, waves - start)
            product[:] = 0
            for a in range(count):
                for b in range(a + 1):
                    entry = triangles[a * (a + 1) // 2 + b, start : start + length]
                    first, second = spectra[load, a, start:], spectra[load, b, start:]
                    for w in range(length):
                        product[a, w] += entry[w] * second[w]
                    if a != b:
                        for w in range(length):
                            product[b, w] += entry[w] * first[w]
            for a in range(count):
                spectra[load, a, start : start + length] = product[a, :length]
