"""One side of the bounds: fields of least energy in one of two spaces, and their mean energies.

Every rounding error of an energy is bounded. The floating-point numbers of a field are taken as
exact: whatever the solver left in them, they are a field of the space. Rounded are the differences
from the cell's linear function, the modes, and the sums of some products of modes; the sum of these
is exact (`math.fsum`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.rve.image.fields.conjugate_gradient import ConjugateGradient, System
from alphacut.rve.image.fields.element import Element, isotropic_parts
from alphacut.rve.image.fields.grid import SLAB, Fields, Operator, gather, namespace, slabs
from alphacut.rve.image.fields.preconditioner import FourierPreconditioner, Reference

UNIT = 2.0**-53  # rounding unit
SAFETY = 1.01  # for the rounding of the error bound itself and for terms of second order
PIECE = 64  # products that are summed in rounded steps
LONG_PIECE = 4096  # the same where the exact sum of many pieces would take longer than their fields
SMALL = 1 << 17  # cells up to which the loads are solved together, to save memory beyond
COEFFICIENT = 8  # rounding units that a coefficient may be off by
ENTRY = 16  # rounding units that the terms of an entry of the modes' matrix may be off by

Weighted = tuple[slice, Fields]  # rows of the modes, and what they count in each cell


@dataclass(frozen=True, eq=False)
class Energies:
    """Mean products of the modes of fields, by weight.

    Args:
        value: Symmetric, shape (weights, fields, fields).
        by_modes: Bound of what the modes' rounding adds to each, same shape.
        summed: Relative rounding of products and sums.
    """

    value: Array
    by_modes: Array
    summed: float

    @property
    def rounding(self) -> Array:
        """Bound of the absolute error of each product, shape (weights, fields, fields)."""
        size = np.sqrt(SAFETY * np.maximum(np.diagonal(self.value, axis1=1, axis2=2), 0))
        by_sums = self.summed * size[:, :, None] * size[:, None, :]
        return np.asarray(SAFETY * (self.by_modes + by_sums))

    @property
    def upper(self) -> Array:
        """A matrix above the sum over the weights in the Loewner order, shape (fields, fields)."""
        value = self.value.sum(axis=0)
        terms = 2 * (len(self.value) + 2) * UNIT * np.abs(self.value).sum(axis=0)
        off = self.rounding.sum(axis=0) + terms
        # by Gershgorin's circles for D off D⁻¹, with D so that loads of any size count alike
        scale = np.sqrt(np.maximum(np.diagonal(value), np.finfo(float).tiny))
        return np.asarray(value + np.diag(SAFETY * (off / scale).sum(axis=1) * scale))


def energies(
    element: Element, fields: Fields, mean_modes: Array, weights: Sequence[Weighted]
) -> Energies:
    """Mean energy products of all pairs of fields, with a bound of their rounding errors.

    Args:
        element: Unknowns and modes of a cell.
        fields: Periodic fluctuations, shape (fields, unknowns, *grid).
        mean_modes: Modes of the uniform field to add to each, shape (modes, fields).
        weights: Pairs of rows of modes and their coefficient in each cell, of the grid's shape,
            not negative, with a rounding error of up to `COEFFICIENT` units.
    """
    if isinstance(fields, np.ndarray) and element.dimension == 3:
        return _energies_by_rows(element, fields, mean_modes, weights)
    return energies_by_matrices(element, fields, mean_modes, weights)


def energies_by_matrices(
    element: Element, fields: Fields, mean_modes: Array, weights: Sequence[Weighted]
) -> Energies:
    """As `energies`, with the element's matrices, in any library: what kernels are judged by."""
    xp, count, cells = namespace(fields), fields.shape[0], math.prod(fields.shape[2:])
    piece = PIECE if cells <= SMALL else LONG_PIECE
    sums: list[list[Array]] = [[] for _ in weights]
    by_modes = np.zeros((len(weights), count, count))
    for slab, modes, rounding in modes_of(element, fields, mean_modes):
        for k, (rows, weight) in enumerate(weights):
            products = _piecewise_products(modes[rows], weight[slab], piece)
            entries = products.reshape(-1, count**2).T
            sums[k].append(np.array([math.fsum(terms) for terms in entries]))
            # errors δa, δb of modes change a b by at most (|a| + δa/2) δb + (|b| + δb/2) δa
            size, error = (
                xp.reshape(xp.moveaxis(x, 1, 0), (count, -1))
                for x in (xp.abs(modes[rows]), rounding[rows])
            )
            weighted = xp.reshape(xp.moveaxis(rounding[rows] * weight[slab], 1, 0), (count, -1))
            mixed = _on_host((size + error / 2) @ weighted.T)
            by_modes[k] += mixed + mixed.T
    value = np.empty((len(weights), count, count))
    for k, parts in enumerate(sums):
        terms_of = np.array(parts).T
        value[k] = np.reshape([math.fsum(terms) for terms in terms_of], (count, count)) / cells
    relative_rounding = SAFETY * (piece + COEFFICIENT + 5) * UNIT
    return Energies(value, by_modes / cells, relative_rounding)


def _energies_by_rows(
    element: Element, fields: Array, mean_modes: Array, weights: Sequence[Weighted]
) -> Energies:
    """As `energies`, from modes by kernels."""
    from alphacut.rve.image.fields.kernels import ROUNDINGS, modes_by_rows  # Numba takes its time

    count, (nz, ny, nx) = len(fields), fields.shape[2:]
    n_rows, width = max(1, SLAB // (count * nx)), 1 + max(max(x) for _, x in element.local)
    # a mode is off by at most amplification @ greatest magnitudes of each unknown at the voxel
    unknown, magnitude = np.array([u for u, _ in element.local]), element.magnitude
    by_unknown = [magnitude[:, unknown == u].sum(axis=1) for u in range(element.unknowns)]
    amplification = ROUNDINGS * UNIT * np.stack(by_unknown, axis=1)
    products, by_modes = [], np.zeros((len(weights), count, count))
    for z in range(nz):
        greatest = np.abs(fields[:, :, np.arange(z, z + width) % nz]).max(axis=2)
        for axis in (2, 3):
            greatest = np.max([np.roll(greatest, -k, axis) for k in range(width)], axis=0)
        for first in range(0, ny, n_rows):
            last = min(first + n_rows, ny)
            modes = modes_by_rows(element, fields, z, first, last)
            modes += mean_modes[:, :, None]
            local = np.moveaxis(greatest[:, :, first:last], 1, 0).reshape(-1, *modes.shape[1:])
            for k, (rows, weight) in enumerate(weights):
                voxels = weight[z, first:last].ravel()
                terms = (modes[rows] * voxels) @ np.swapaxes(modes[rows], 1, 2)
                products.append(np.apply_along_axis(math.fsum, 0, terms))
                # errors δa, δb of modes change a b by at most (|a| + δa/2) δb + (|b| + δb/2) δa
                spread = amplification[rows].T
                size = np.tensordot(spread, np.abs(modes[rows]), axes=1)
                size += np.tensordot(spread @ spread.T / 2, local, axes=1)
                mixed = np.sum((size * voxels) @ np.swapaxes(local, 1, 2), axis=0)
                by_modes[k] += mixed + mixed.T
    sums = np.reshape(products, (-1, len(weights), count, count))
    value = np.apply_along_axis(math.fsum, 0, sums) / (nz * ny * nx)
    value = (value + np.swapaxes(value, 1, 2)) / 2
    terms_and_means = min(n_rows, ny) * nx + 2
    relative_rounding = SAFETY * (terms_and_means + COEFFICIENT + 5) * UNIT
    return Energies(value, by_modes / (nz * ny * nx), relative_rounding)


def _on_host(array: Fields) -> Array:
    """The array as NumPy's, wherever it is."""
    return np.asarray(array.get() if hasattr(array, "get") else array)


def _piecewise_products(modes: Fields, weight: Fields, piece: int) -> Array:
    """Weighted products of all pairs of fields, symmetric, in sums of `piece` products each."""
    xp, count = namespace(modes), modes.shape[1]

    def cut(values: Fields) -> Fields:
        """Values by piece, padded with zeros: shape (pieces, fields, piece)."""
        flat = xp.reshape(xp.moveaxis(values, 1, 0), (count, -1))
        padding = xp.zeros((count, -flat.shape[1] % piece))
        return xp.moveaxis(
            xp.reshape(xp.concatenate([flat, padding], axis=1), (count, -1, piece)), 1, 0
        )

    products = _on_host(cut(modes) @ xp.moveaxis(cut(modes * weight), 1, 2))
    return np.asarray((products + np.swapaxes(products, 1, 2)) / 2)


def modes_of(
    element: Element, fields: Fields, mean_modes: Array
) -> Iterator[tuple[slice, Fields, Fields]]:
    """Yield by slabs: the slab, modes (modes, fields, *slab), bounds of their rounding."""
    xp, count = namespace(fields), len(element.local)
    matrix, magnitude = xp.asarray(element.modes), xp.asarray(element.magnitude)
    terms = int((element.magnitude > 0).sum(axis=1).max())
    uniform = xp.reshape(xp.asarray(mean_modes), mean_modes.shape + (1,) * element.dimension)
    for slab in slabs(fields):
        local, local_error = _subtract_linear(element, gather(element, fields, slab))
        shape = (-1, *local.shape[1:])
        modes = xp.reshape(matrix @ xp.reshape(local, (count, -1)), shape)
        # the sums of the product, in which zeros add no error, and the entries of the matrix
        local_error += (terms + ENTRY) * UNIT * xp.abs(local)
        rounding = xp.reshape(magnitude @ xp.reshape(local_error, (count, -1)), shape)
        modes += uniform
        rounding += UNIT * xp.abs(modes)
        yield slab, modes, rounding


def _subtract_linear(element: Element, raw: Fields) -> tuple[Fields, Fields]:
    """Local unknowns less a function without strain or stress; a bound of the rounding error."""
    xp = namespace(raw)
    shifted, error = raw.copy(), xp.zeros_like(raw)
    for k, origin in enumerate(element.origins):
        if origin is not None:
            shifted[k] -= raw[origin]
            error[k] = UNIT * xp.abs(shifted[k])
    local, local_error = shifted.copy(), error.copy()
    for k, slopes in enumerate(element.slopes):
        for slope in slopes:
            local[k] -= shifted[slope]
            local_error[k] += error[slope] + UNIT * xp.abs(local[k])
    return local, local_error


def solved_loads(dimension: int) -> Array:
    """Loads near an isotropic stiffness's own, a row each, in Voigt order.

    So the soft ones are not drowned in the stiff ones where ν is near 1/2 or −1.
    """
    parts = isotropic_parts(dimension, stress=False)
    return np.asarray(parts / np.abs(parts).max(axis=1, keepdims=True))


def coefficients(element: Element, bulk: Fields, shear: Fields) -> tuple[Fields, Fields]:
    """Coefficients of trace and deviator: those of strains, or of stresses in n dimensions."""
    if element.stress:
        return 1 / element.dimension**2 / bulk, 0.25 / shear
    return bulk, shear


@dataclass(frozen=True, eq=False)
class SideSolution:
    """Fields for the unit loads, (loads, unknowns, *grid); energies whose `upper` bounds."""

    fields: Fields
    energy: Energies
    iterations: int


def solve_side(
    element: Element,
    bulk: Fields,
    shear: Fields,
    *,
    solver: ConjugateGradient,
    division: int = 1,
    start: Fields | None = None,
) -> SideSolution:
    """Fields of least energy under the unit loads.

    Args:
        element: Of displacements, whose energy bounds the stiffness from above, or of stresses,
            whose energy bounds the compliance.
        bulk: Bulk modulus of each cell (of the plane: K + G/3), any unit.
        shear: Shear modulus, same shape and unit.
        solver: Stopping rule.
        division: Parts along each side into which every cell is divided: the same image, a larger
            space of fields.
        start: Fields to start from, on the divided cells.
    """
    xp = namespace(bulk)
    trace, deviator = coefficients(element, bulk, shear)
    for axis in range(element.dimension if division > 1 else 0):
        trace, deviator = (xp.repeat(x, division, axis=axis) for x in (trace, deviator))
    fields, iterations = _solve_loads(element, trace, deviator, solver, start)
    to_unit_loads = xp.asarray(np.linalg.inv(solved_loads(element.dimension)))
    for slab in slabs(fields):  # in place
        fields[:, :, slab] = xp.tensordot(to_unit_loads, fields[:, :, slab], axes=1)
    weights = list(zip(element.parts, (trace, deviator), strict=True))
    energy = energies(element, fields, element.mean_modes(np.eye(fields.shape[0])), weights)
    return SideSolution(fields, energy, iterations)


def _solve_loads(
    element: Element,
    trace: Fields,
    deviator: Fields,
    solver: ConjugateGradient,
    start: Fields | None,
) -> tuple[Fields, int]:
    """Fields of `solved_loads`, (loads, unknowns, *grid), and the largest iteration count."""
    xp, loads = namespace(trace), solved_loads(element.dimension)
    modes = element.mean_modes(loads)
    constant = Reference.of_grid(element, trace, deviator)
    preconditioner = FourierPreconditioner.of_material(element, constant, trace.shape, xp)
    operator = Operator(element, trace, deviator)
    scale = minimum_energy(element, trace, deviator, modes)
    least = constant.lowest_energy_ratio(trace, deviator)
    n_together = len(loads) if trace.size <= SMALL else 1  # to save memory
    fields, iterations = xp.empty((len(loads), element.unknowns, *trace.shape)), []
    for first in range(0, len(loads), n_together):
        part = slice(first, first + n_together)
        guess = None if start is None else xp.tensordot(xp.asarray(loads[part]), start, axes=1)
        load = operator.load(modes[:, part])
        system = System(operator.apply, preconditioner.apply, load, scale[part], least, guess)
        fields[part], number = solver.solve(system)
        iterations.append(number)
    return fields, max(iterations)


def minimum_energy(element: Element, trace: Fields, deviator: Fields, modes: Array) -> Array:
    """Lower bound of the energy of any fields with given mean modes, shape (loads,)."""
    trace_squares, deviator_squares = (np.sum(modes[rows] ** 2, axis=0) for rows in element.parts)
    harmonic = [float(x.size / (1 / x).mean()) for x in (trace, deviator)]
    return np.asarray(harmonic[0] * trace_squares + harmonic[1] * deviator_squares)
