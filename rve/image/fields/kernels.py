"""Operator and energies of voxels, axis by axis: products of splines are not multiplied out.

A row of voxels along x is worked on at once, so that every inner loop runs along memory. Splines
become Legendre modes along x, then z, in strips that are kept until the last row that needs them,
then y; the transposed passes lead back. `grid.Operator` and `energy.modes_of` multiply the same out
by matrices, for arrays of any library, and are what this is tested against.

The first arguments of the kernels are the members of `element.SplineProducts`. A term is a
component of the field (Voigt's six of strains and stresses, three of gradients and fluxes), an
unknown and the orders of its derivative along z, y, x. Modes have the shape (component, mode along
z, mode along y, modes along x of a row).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.base.kernels import kernel
from alphacut.rve.image.fields.element import Element

ROUNDINGS = 32
"""Rounding units by which a mode may be off, relative to the sum of the magnitudes of its terms.

Derived: 12 of the entries of the tables (3 each, and 3 of the sides), 3 of each of the three passes
and 3 of the sums of terms, 4 of the parts of the deviator make 28.
"""

fast = kernel(fastmath={"contract", "nsz"})  # fused products round less; the order of sums stays


def apply_by_rows(
    element: Element, coefficients: Sequence[Array], fields: Array, mean_modes: Array
) -> Array:
    """Return the nodal forces of fields of voxels plus uniform fields, by compiled kernels.

    Forces are the derivatives by the unknowns of half the energy trace·tr² + deviator·2 dev:dev, or
    of half the coefficient times the squared gradient or flux.

    Args:
        element: Element of a voxel.
        coefficients: Coefficients of the squares of trace and deviator in each voxel, or the one of
            a gradient or flux, shape (z, y, x) each.
        fields: Unknowns of periodic fields, shape (fields, unknowns of a voxel, z, y, x).
        mean_modes: Modes of the uniform field to add to each, shape (modes, fields): coefficients
            of the element's parts in polynomials that are orthonormal on a voxel.

    Returns:
        New array in the shape of `fields`.
    """
    result = np.zeros_like(fields)
    parts = element.part_matrix
    # Kernels work in components: the constant modes of the uniform fields are turned back.
    uniform = np.linalg.solve(parts, mean_modes[element.of_voigt.any(axis=1)])
    tables, counts, terms, groups, factors = element.products
    # The last entry of `parts` is the factor of a shear. Of conduction both coefficients are the
    # same array, of which the kernel uses one.
    shear_factor = parts[-1, -1] ** 2
    for number, field in enumerate(fields):
        _apply(tables, counts, terms, groups, factors, shear_factor, uniform[:, number].copy(),
               coefficients[0], coefficients[-1], field, result[number])  # fmt: skip
    return result


def modes_by_rows(element: Element, fields: Array, z: int, first: int, last: int) -> Array:
    """Return the modes of fields in some rows of a layer of voxels.

    Modes are coefficients of the element's parts in products of Legendre polynomials that are
    orthonormal on a voxel.

    Args:
        element: Element of a voxel.
        fields: Unknowns of periodic fields, shape (fields, unknowns of a voxel, z, y, x).
        z: Index of the layer.
        first: First row along y.
        last: One past the last row, greater than `first`.

    Returns:
        Modes, shape (modes, fields, voxels of the rows). Each is off by at most `ROUNDINGS` = 32
        rounding units of the sum of the magnitudes of its terms.
    """
    components = np.zeros((len(element.modes), len(fields), (last - first) * fields.shape[-1]))
    tables, counts, terms, groups, factors = element.products
    _fill_modes(tables, counts, terms, groups, factors, fields, z, first, last, components)
    parts = element.part_matrix
    return np.asarray(parts @ components.reshape(len(parts), -1)).reshape(components.shape)


def call_kernels(elements: Iterable[Element]) -> None:
    """Call all kernels for voxels once, so that they are compiled or loaded before they are needed.

    They are called on a field of zeros on a single voxel. Nothing is changed but Numba's cache.

    Args:
        elements: Elements of voxels whose kernels are called.
    """
    coefficient = [np.ones((1, 1, 1))]
    for element in elements:
        fields = np.zeros((1, element.unknowns, 1, 1, 1))
        mean_modes = np.zeros((len(element.modes), 1))
        apply_by_rows(element, coefficient, fields, mean_modes)
        modes_by_rows(element, fields, z=0, first=0, last=1)


@fast
def _apply(
    tables: Array, counts: Ints, terms: Ints, groups: Ints, factors: Array, shear_factor: float,
    uniform: Array, trace: Array, deviator: Array, field: Array, result: Array,
) -> None:  # fmt: skip
    """Add the nodal forces of one field on voxels to `result` in place.

    The energy of the modes of a voxel is trace·tr² + deviator·2 dev:dev. Half its derivative by a
    normal component is mean + 2 deviator · component, with mean = (trace − 2/3 deviator)·tr; by a
    shear component it is shear_factor · deviator · component. By a component of a gradient or flux
    it is deviator · component. The modes are found axis by axis, multiplied by these, and passed
    back to the unknowns by the transposed products.

    Args:
        tables: Matrices from the n functions of one coordinate to Legendre modes of their
            derivatives, shape (axes z, y, x; order 0, 1, 2 of the derivative; n modes; n
            functions).
        counts: Number of modes that are not zero, by the order of the derivative.
        terms: A row for each term of the field: (component, number of the unknown, orders of its
            derivative along z, y, x).
        groups: Ranges [first, last) of terms with the same unknown and order along x, shape
            (groups, 2).
        factors: Factor of each term.
        shear_factor: Factor of shear components: 1 for strains, 4 for stresses.
        uniform: Components of a uniform field to add: Voigt's six of a strain or stress, or three
            of a gradient or flux.
        trace: Coefficient of the squared trace in each voxel, shape (z, y, x).
        deviator: Coefficient of the squared deviator, of the same shape.
        field: Unknowns of the field, shape (unknowns of a voxel, z, y, x).
        result: Nodal forces of the same shape; changed.
    """
    n = tables.shape[-1]
    n_components = len(uniform)
    nz, ny, nx = trace.shape
    strips = np.zeros((len(terms), n, n, n * nx))  # (term, mode along z, y % n, modes along x)
    sums = np.zeros((len(terms), n, n, n * nx))  # (term, y % n, mode along z, modes along x)
    modes = np.zeros((n_components, n, n, n * nx))
    lines = np.zeros((n, n * nx))
    shifted = np.empty((n, n, nx))
    for z in range(nz):
        # A row of voxels takes the strips of n rows of unknowns, from y to y + n − 1. They are kept
        # in a ring of n, so that each further row of voxels computes one.
        for y in range(n - 1):
            _fill_strips(
                tables, counts, terms, groups, factors, field, z, y, shifted, lines, strips
            )
        for y in range(ny):
            _fill_strips(
                tables, counts, terms, groups, factors, field, z, y + n - 1, shifted, lines, strips
            )
            _modes_of_row(tables, counts, terms, strips, y, modes)
            # a uniform field has the constant mode alone
            for c in range(n_components):
                modes[c, 0, 0, :nx] += uniform[c]
            # from modes of the strain or gradient to those of its conjugate, in place
            if n_components == 3:
                _scale(modes, deviator[z, y])
            else:
                _make_conjugate(modes, shear_factor, trace[z, y], deviator[z, y])
            # The transposed pass along y: what a row of voxels exerts on n rows of unknowns is
            # added to their sums, which are passed on once no further row adds to them. Derivatives
            # lower the degree, so that the highest modes are zero and are left out.
            for term in range(len(terms)):
                c, _, dz, dy, dx = terms[term]
                for b in range(n):
                    weights = tables[1, dy, :, b]
                    for i in range(counts[dz]):
                        out = sums[term, (y + b) % n, i]
                        size = counts[dx] * nx
                        _add_combination(out, size, counts[dy], 1.0, weights, modes[c, i])
            _add_forces(tables, counts, terms, groups, factors, sums, z, y, lines, shifted, result)
        # the last rows of unknowns, which are the first ones of the periodic grid
        for y in range(ny, ny + n - 1):
            _add_forces(tables, counts, terms, groups, factors, sums, z, y, lines, shifted, result)


@fast
def _scale(modes: Array, factors: Array) -> None:
    """Multiply the modes of a gradient or flux in a row of nx voxels by a factor of each voxel.

    Args:
        modes: Changed; shape (3, n, n, n · nx), mode k along x of voxel x at k · nx + x.
        factors: Shape (nx,).
    """
    n = modes.shape[1]
    nx = len(factors)
    for c in range(3):
        for i in range(n):
            for j in range(n):
                for k in range(n):
                    row = modes[c, i, j, k * nx : (k + 1) * nx]
                    for x in range(nx):
                        row[x] *= factors[x]


@fast
def _make_conjugate(modes: Array, shear_factor: float, of_trace: Array, of_deviator: Array) -> None:
    """Turn the modes of a strain or stress in a row of nx voxels into those of its conjugate.

    Args:
        modes: Changed; shape (6, n, n, n · nx), mode k along x of voxel x at k · nx + x.
        shear_factor: Factor of shear components: 1 for strains, 4 for stresses.
        of_trace: Coefficient of the squared trace in each voxel, shape (nx,).
        of_deviator: Coefficient of the squared deviator, of the same shape.
    """
    n = modes.shape[1]
    nx = len(of_trace)
    for i in range(n):
        for j in range(n):
            for k in range(n):
                row = slice(k * nx, (k + 1) * nx)
                xx = modes[0, i, j, row]
                yy = modes[1, i, j, row]
                zz = modes[2, i, j, row]
                yz = modes[3, i, j, row]
                xz = modes[4, i, j, row]
                xy = modes[5, i, j, row]
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


@fast
def _fill_modes(
    tables: Array, counts: Ints, terms: Ints, groups: Ints, factors: Array, fields: Array,
    z: int, first: int, last: int, modes: Array,
) -> None:  # fmt: skip
    """Write the modes of the components of fields in some rows of a layer of voxels.

    Args:
        tables: Matrices from the n functions of one coordinate to Legendre modes of their
            derivatives, shape (axes z, y, x; order 0, 1, 2 of the derivative; n modes; n
            functions).
        counts: Number of modes that are not zero, by the order of the derivative.
        terms: A row for each term of the field: (component, number of the unknown, orders of its
            derivative along z, y, x).
        groups: Ranges [first, last) of terms with the same unknown and order along x, shape
            (groups, 2).
        factors: Factor of each term.
        fields: Unknowns of periodic fields, shape (fields, unknowns of a voxel, z, y, x).
        z: Index of the layer.
        first: First row along y.
        last: One past the last row.
        modes: Overwritten; shape (components × n modes along z × n along y × n along x, fields,
            voxels of the rows), the voxels along x within those along y.
    """
    n = tables.shape[-1]
    nx = fields.shape[-1]
    strips = np.zeros((len(terms), n, n, n * nx))
    by_component = np.zeros((len(modes) // n**3, n, n, n * nx))
    lines = np.zeros((n, n * nx))
    shifted = np.empty((n, n, nx))
    for a in range(len(fields)):
        # A row of voxels takes the strips of n rows of unknowns; the first n − 1 rounds, before the
        # row `first`, fill strips alone.
        for y in range(first + 1 - n, last):
            _fill_strips(
                tables, counts, terms, groups, factors, fields[a], z, y + n - 1,
                shifted, lines, strips
            )  # fmt: skip
            if y >= first:
                _modes_of_row(tables, counts, terms, strips, y, by_component)
                row = slice((y - first) * nx, (y - first + 1) * nx)
                modes[:, a, row] = by_component.reshape(len(modes), nx)


@fast
def _fill_strips(
    tables: Array, counts: Ints, terms: Ints, groups: Ints, factors: Array,
    field: Array, z: int, y: int, shifted: Array, lines: Array, strips: Array,
) -> None:  # fmt: skip
    """Compute the modes along x and z of a row of unknowns, and write them into its strip.

    First the modes along x of row y are computed in the n layers of unknowns from layer z on,
    around the periodic grid. Their combinations along z are the modes of the voxels in layer z. A
    row has nx voxels.

    Args:
        tables: Matrices from the n functions of one coordinate to Legendre modes of their
            derivatives, shape (axes z, y, x; order 0, 1, 2 of the derivative; n modes; n
            functions).
        counts: Number of modes that are not zero, by the order of the derivative.
        terms: A row for each term of the field: (component, number of the unknown, orders of its
            derivative along z, y, x).
        groups: Ranges [first, last) of terms with the same unknown and order along x, shape
            (groups, 2).
        factors: Factor of each term.
        field: Unknowns of a periodic field, shape (unknowns of a voxel, z, y, x).
        z: Index of the layer of voxels.
        y: Index of the row of unknowns, taken modulo the size of the grid.
        shifted: Work array for a row of each layer moved by each function, shape (n layers, n
            functions, nx).
        lines: Work array for the modes along x of each layer, shape (n layers, n · nx): mode k of
            voxel x at k · nx + x.
        strips: Modes of each term, shape (terms, n modes along z, n rows, n · nx), the last axis as
            of `lines`. Row y stands at y modulo n; its entries are overwritten but for the highest
            modes where a derivative lowers the degree, which must be zero before.
    """
    n = tables.shape[-1]
    nz, ny, nx = field.shape[1:]
    for start, stop in groups:  # terms of one unknown and one derivative along x
        _, u, _, _, dx = terms[start]
        # Work arrays are emptied here, since combinations are added to what they hold.
        lines[:] = 0.0
        # along x: function f of voxel x has its unknown f voxels further, around the periodic row
        for a in range(n):
            row = field[u, (z + a) % nz, y % ny]
            for f in range(n):
                shift = f % nx  # a row of one voxel is its own neighbour
                for x in range(nx - shift):
                    shifted[a, f, x] = row[x + shift]
                for x in range(shift):
                    shifted[a, f, nx - shift + x] = row[x]
            for k in range(counts[dx]):
                out = lines[a, k * nx : (k + 1) * nx]
                _add_combination(out, nx, n, 1.0, tables[2, dx, k], shifted[a])
        # along z, for each term of the group
        size = counts[dx] * nx
        for term in range(start, stop):
            dz = terms[term, 2]
            for i in range(counts[dz]):
                out = strips[term, i, y % n]
                out[:size] = 0.0
                _add_combination(out, size, n, factors[term], tables[0, dz, i], lines)


@fast
def _modes_of_row(
    tables: Array, counts: Ints, terms: Ints, strips: Array, y: int, modes: Array
) -> None:
    """Write the modes of the components in a row of voxels, from n strips of modes.

    A row has nx voxels; mode k along x of voxel x stands at k · nx + x.

    Args:
        tables: Matrices from the n functions of one coordinate to Legendre modes of their
            derivatives, shape (axes z, y, x; order 0, 1, 2 of the derivative; n modes; n
            functions).
        counts: Number of modes that are not zero, by the order of the derivative.
        terms: A row for each term of the field: (component, number of the unknown, orders of its
            derivative along z, y, x).
        strips: Modes along z and x of each term in the rows of unknowns y … y + n − 1, shape
            (terms, n modes along z, n rows, n · nx). A row stands at its index modulo n.
        y: Index of the row of voxels.
        modes: Overwritten by the sums of the terms; shape (components, n modes along z, n modes
            along y, n · nx).
    """
    n = tables.shape[-1]
    nx = modes.shape[-1] // n
    weights = np.empty(n)
    modes[:] = 0.0
    for term in range(len(terms)):
        c, _, dz, dy, dx = terms[term]
        for j in range(counts[dy]):
            # the strip of row y + b stands at (y + b) % n
            for b in range(n):
                weights[(y + b) % n] = tables[1, dy, j, b]
            for i in range(counts[dz]):
                _add_combination(modes[c, i, j], counts[dx] * nx, n, 1.0, weights, strips[term, i])


@fast
def _add_forces(
    tables: Array, counts: Ints, terms: Ints, groups: Ints, factors: Array,
    sums: Array, z: int, y: int, lines: Array, shifted: Array, result: Array,
) -> None:  # fmt: skip
    """Turn the sums of a row into forces on its unknowns, and add them to the nodal forces.

    This is the transpose of `_fill_strips`, which turns unknowns into modes along x and z. A row
    has nx voxels; mode k along x of voxel x stands at k · nx + x.

    Args:
        tables: Matrices from the n functions of one coordinate to Legendre modes of their
            derivatives, shape (axes z, y, x; order 0, 1, 2 of the derivative; n modes; n
            functions).
        counts: Number of modes that are not zero, by the order of the derivative.
        terms: A row for each term of the field: (component, number of the unknown, orders of its
            derivative along z, y, x).
        groups: Ranges [first, last) of terms with the same unknown and order along x, shape
            (groups, 2).
        factors: Factor of each term.
        sums: Forces on the modes along x and z of each term, shape (terms, n rows, n modes along z,
            n · nx). Row y stands at y modulo n; its entries are set to zero after use.
        z: Index of the layer of voxels, whose unknowns lie in the n layers from z on.
        y: Index of the row of unknowns, taken modulo the size of the grid.
        lines: Work array for modes along x of each layer, shape (n layers, n · nx).
        shifted: Work array for the forces of each function, shape (n layers, n functions, nx).
        result: Nodal forces, shape (unknowns of a voxel, z, y, x); changed.
    """
    n = tables.shape[-1]
    nz, ny, nx = result.shape[1:]
    for start, stop in groups:
        _, u, _, _, dx = terms[start]
        shifted[:] = 0.0
        # Work arrays are emptied here, since combinations are added to what they hold.
        lines[:] = 0.0
        for term in range(start, stop):
            dz = terms[term, 2]
            row_sums = sums[term, y % n]
            for a in range(n):
                weights = tables[0, dz, :, a]
                _add_combination(
                    lines[a], counts[dx] * nx, counts[dz], factors[term], weights, row_sums
                )
            row_sums[:] = 0.0
        for a in range(n):
            row = result[u, (z + a) % nz, y % ny]
            by_mode = lines[a].reshape(n, nx)
            for f in range(n):
                _add_combination(shifted[a, f], nx, counts[dx], 1.0, tables[2, dx, :, f], by_mode)
                shift = f % nx  # as in `_fill_strips`
                for x in range(nx - shift):
                    row[x + shift] += shifted[a, f, x]
                for x in range(shift):
                    row[x] += shifted[a, f, nx - shift + x]


@fast
def _add_combination(
    out: Array, size: int, taps: int, factor: float, weights: Array, sources: Array
) -> None:
    """Add factor · Σ_k weights[k] sources[k] to the first `size` values of a row, in place.

    Args:
        out: The row that is changed; shape (size or more,).
        size: Number of values.
        taps: Number of terms of the sum, 1, 2 or 3: the degrees of splines are at most 2.
        factor: Factor of the sum.
        weights: Weights of the terms, shape (taps or more,).
        sources: Rows that are added, shape (taps or more, size or more).
    """
    a = factor * weights[0]  # sources are indexed in the loops: a view of a row takes as long
    if taps == 3:
        b = factor * weights[1]
        c = factor * weights[2]
        for x in range(size):
            out[x] += a * sources[0, x] + b * sources[1, x] + c * sources[2, x]
    elif taps == 2:
        b = factor * weights[1]
        for x in range(size):
            out[x] += a * sources[0, x] + b * sources[1, x]
    else:
        for x in range(size):
            out[x] += a * sources[0, x]
