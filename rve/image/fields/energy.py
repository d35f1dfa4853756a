"""One side of the bounds: fields of least energy in one of two spaces, and their mean energies.

Every rounding error of an energy is bounded. The floating-point numbers of a field are taken as
exact: whatever the solver left in them, they are a field of the space. Rounded are the differences
from the cell's linear function, the modes, and the sums of some products of modes; the sum of these
is exact (`math.fsum`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from alphacut.base.arrays import Array
from alphacut.rve.image.fields.conjugate_gradient import ConjugateGradient, System
from alphacut.rve.image.fields.element import Element, isotropic_parts
from alphacut.rve.image.fields.grid import (
    SLAB_CELLS,
    Fields,
    Operator,
    gather,
    namespace,
    on_host,
    slabs,
)
from alphacut.rve.image.fields.kernels import ROUNDINGS, modes_by_rows
from alphacut.rve.image.fields.pores import PoreNodes, PorePotentials
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
    element: Element,
    fields: Fields,
    mean_modes: Array,
    weights: Sequence[Weighted],
    field_errors: Fields | None = None,
) -> Energies:
    """Mean energy products of all pairs of fields, with a bound of their rounding errors.

    Args:
        element: Unknowns and modes of a cell.
        fields: Periodic fluctuations, shape (fields, unknowns, *grid).
        mean_modes: Modes of the uniform field to add to each, shape (modes, fields).
        weights: Pairs of rows of modes and their coefficient in each cell, of the grid's shape,
            not negative, with a rounding error of up to `COEFFICIENT` units.
        field_errors: Bounds of what `fields` are off from those that are meant; None: nothing.
    """
    xp, count, cells = namespace(fields), fields.shape[0], math.prod(fields.shape[2:])
    piece = PIECE if cells <= SMALL else LONG_PIECE
    sums: list[list[Array]] = [[] for _ in weights]
    by_modes = np.zeros((len(weights), count, count))
    for slab, modes, amplification, local in modes_of(element, fields, mean_modes, field_errors):
        for k, (rows, weight) in enumerate(weights):
            factor = xp.reshape(weight[slab], (-1,))
            weighted = modes[rows] * factor
            products = _piecewise_products(modes[rows], weighted, piece)
            sums[k].append(np.apply_along_axis(math.fsum, 0, products))
            # errors δa, δb of modes change a b by at most (|a| + δa/2) δb + (|b| + δb/2) δa
            spread = amplification[rows].T
            larger = xp.tensordot(spread, xp.abs(weighted), axes=1)
            larger += xp.tensordot(spread @ spread.T / 2, local * factor, axes=1)
            mixed = xp.sum(larger @ xp.moveaxis(local, 1, 2), axis=0)
            by_modes[k] += on_host(mixed + mixed.T)
    value = np.array([np.apply_along_axis(math.fsum, 0, np.array(parts)) for parts in sums]) / cells
    size = np.sqrt(np.diagonal(value, axis1=1, axis2=2))
    by_modes += 2 * UNIT * cells * size[:, :, None] * size[:, None, :]  # `UNIT` · |modes| each
    relative_rounding = SAFETY * (piece + COEFFICIENT + 5) * UNIT
    return Energies(value, by_modes / cells, relative_rounding)


def _piecewise_products(modes: Fields, weighted: Fields, piece: int) -> Array:
    """Products of all pairs of fields, symmetric, (sums, fields, fields), of `piece` terms each."""
    xp, (count, n_fields, cells) = namespace(modes), modes.shape
    piece = min(piece, cells)
    padding = xp.zeros((count, n_fields, -cells % piece))

    def cut(values: Fields) -> Fields:
        """Values by piece, padded with zeros: shape (modes, pieces, fields, piece)."""
        padded = xp.concatenate([values, padding], axis=2) if padding.size else values
        return xp.moveaxis(xp.reshape(padded, (count, n_fields, -1, piece)), 1, 2)

    products = on_host(cut(modes) @ xp.moveaxis(cut(weighted), 2, 3))
    products = products.reshape(-1, n_fields, n_fields)
    return np.asarray((products + np.swapaxes(products, 1, 2)) / 2)


Modes = Iterator[tuple[Any, Fields, Fields, Fields]]
"""Slab; modes (modes, fields, cells of the slab); A and b: errors ≤ A @ b + `UNIT` · |modes|."""


def modes_of(
    element: Element, fields: Fields, mean_modes: Array, field_errors: Fields | None = None
) -> Modes:
    """Yield modes by slabs with bounds of their rounding: of voxels of NumPy by kernels."""
    if isinstance(fields, np.ndarray) and element.dimension == 3:
        return _modes_by_rows(element, fields, mean_modes, field_errors)
    return modes_by_matrices(element, fields, mean_modes, field_errors)


def modes_by_matrices(
    element: Element, fields: Fields, mean_modes: Array, field_errors: Fields | None = None
) -> Modes:
    """As `modes_of`, with the element's matrix, in any library: what kernels are judged by."""
    xp = namespace(fields)
    matrix, magnitude = xp.asarray(element.modes), xp.asarray(element.magnitude)
    terms = int((element.magnitude > 0).sum(axis=1).max())
    for slab in slabs(fields):
        pair = _subtract_linear(element, gather(element, fields, slab))
        local, error = (xp.reshape(x, (*x.shape[:2], -1)) for x in pair)
        # the sums of the product, in which zeros add no error, and the entries of the matrix
        error += (terms + ENTRY) * UNIT * xp.abs(local)
        if field_errors is not None:
            error += xp.reshape(
                _with_linear(element, gather(element, field_errors, slab)), error.shape
            )
        modes = xp.tensordot(matrix, local, axes=1)
        modes += xp.asarray(mean_modes)[:, :, None]
        yield slab, modes, magnitude, error


def _modes_by_rows(
    element: Element, fields: Array, mean_modes: Array, field_errors: Array | None
) -> Modes:
    """As `modes_of`, in pieces of a layer, so that few modes are in memory."""
    count, (nz, ny, nx) = len(fields), fields.shape[2:]
    n_rows, width = max(1, SLAB_CELLS // (count * nx)), 1 + element.reach
    unknown = np.array([u for u, _ in element.local])
    by_unknown = [element.magnitude[:, unknown == u].sum(axis=1) for u in range(element.unknowns)]
    amplification = ROUNDINGS * UNIT * np.stack(by_unknown, axis=1)
    for z in range(nz):
        layers = np.arange(z, z + width) % nz
        sizes = np.abs(fields[:, :, layers])
        if field_errors is not None:  # as a part of what modes are rounded by
            sizes += field_errors[:, :, layers] / (ROUNDINGS * UNIT)
        greatest = sizes.max(axis=2)
        for axis in (2, 3):  # of the values of an unknown at a voxel
            greatest = np.max([np.roll(greatest, -k, axis) for k in range(width)], axis=0)
        for first in range(0, ny, n_rows):
            rows = slice(first, min(first + n_rows, ny))
            modes = modes_by_rows(element, fields, z, rows.start, rows.stop)
            modes += mean_modes[:, :, None]
            local = np.moveaxis(greatest[:, :, rows], 1, 0).reshape(-1, *modes.shape[1:])
            yield (z, rows), modes, amplification, local


def _subtract_linear(element: Element, raw: Fields) -> tuple[Fields, Fields]:
    """Local unknowns less a function without strain or stress; a bound of the rounding error."""
    local, error = raw.copy(), namespace(raw).zeros_like(raw)
    for k, subtracted in enumerate(element.subtracted):
        for other in subtracted:
            local[k] -= raw[other]
            error[k] += UNIT * abs(local[k])
    return local, error


def _with_linear(element: Element, errors: Fields) -> Fields:
    """Errors of local unknowns less a linear function: of all numbers that enter, summed."""
    total = errors.copy()
    for k, subtracted in enumerate(element.subtracted):
        for other in subtracted:
            total[k] += errors[other]
    return total


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
) -> SideSolution | None:
    """Fields of least energy under the unit loads; None where pores leave no stress.

    Stresses vanish in pores, whose bulk or shear modulus is 0; see `pores`.

    Args:
        element: Of displacements, whose energy bounds the stiffness from above, or of stresses,
            whose energy bounds the compliance.
        bulk: Bulk modulus of each cell (of the plane: K + G/3), any unit.
        shear: Shear modulus, same shape and unit; of displacements both are positive.
        solver: Stopping rule.
        division: Parts along each side into which every cell is divided: the same image, a larger
            space of fields.
        start: Fields to start from, on the divided cells.
    """
    xp = namespace(bulk)
    for axis in range(element.dimension if division > 1 else 0):
        bulk, shear = (xp.repeat(x, division, axis=axis) for x in (bulk, shear))
    is_pore = (bulk == 0) | (shear == 0)
    potentials = None
    if element.stress and bool(is_pore.any()):
        nodes = PoreNodes.of_mask(on_host(is_pore).astype(bool), element.reach)
        if nodes is None:
            return None
        potentials = PorePotentials.of_nodes(element, nodes)
        # stiff there for the preconditioner, as there is no stress that could have an energy
        bulk, shear = (xp.where(is_pore, x.max(), x) for x in (bulk, shear))
    trace, deviator = coefficients(element, bulk, shear)
    loads = solved_loads(element.dimension)
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
        if potentials is None:
            fields[part], number = solver.solve(system)
        else:
            fields[part], number = _solve_beside_pores(solver, system, potentials, loads[part])
        iterations.append(number)
    to_unit_loads = xp.asarray(np.linalg.inv(loads))
    for slab in slabs(fields):  # in place
        fields[:, :, slab] = xp.tensordot(to_unit_loads, fields[:, :, slab], axes=1)
    field_errors = None
    if potentials is not None:
        field_errors = potentials.impose(fields)
        trace, deviator = (xp.where(is_pore, 0.0, x) for x in (trace, deviator))
    weights = list(zip(element.parts, (trace, deviator), strict=True))
    unit_modes = element.mean_modes(np.eye(len(loads)))
    energy = energies(element, fields, unit_modes, weights, field_errors)
    return SideSolution(fields, energy, max(iterations))


def _solve_beside_pores(
    solver: ConjugateGradient, system: System, potentials: PorePotentials, loads: Array
) -> tuple[Fields, int]:
    """Solve for fields whose stress under `loads` (rows, in Voigt order) vanishes in pores.

    With Q the projection on their differences, the system is Q A Q, and Q M Q its preconditioner,
    M being that of A. The energy of the differences is that of A, so that the ratio `least` holds.
    """
    particular = potentials.particular_fields(loads, system.load)
    start = None if system.start is None else potentials.project(system.start - particular)
    projected = replace(
        system,
        operator=lambda x: potentials.project(system.operator(x)),
        preconditioner=lambda r: potentials.project(system.preconditioner(r)),
        load=potentials.project(system.load - system.operator(particular)),
        start=start,
    )
    differences, iterations = solver.solve(projected)
    return particular + differences, iterations


def minimum_energy(element: Element, trace: Fields, deviator: Fields, modes: Array) -> Array:
    """Lower bound of the energy of any fields with given mean modes, shape (loads,)."""
    trace_squares, deviator_squares = (np.sum(modes[rows] ** 2, axis=0) for rows in element.parts)
    harmonic = [float(x.size / (1 / x).mean()) for x in (trace, deviator)]
    return np.asarray(harmonic[0] * trace_squares + harmonic[1] * deviator_squares)
