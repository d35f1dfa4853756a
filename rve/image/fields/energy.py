"""One side of the bounds: fields of least energy in one of two spaces, and their mean energies.

Every rounding error of an energy is bounded. The floating-point numbers of a field are taken as
exact: whatever the solver left in them, they are a field of the space. Rounded are the modes and
the sums of their products.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np

from alphacut.base.arrays import Array
from alphacut.rve.image.fields.conjugate_gradient import ConjugateGradient, System
from alphacut.rve.image.fields.element import Element, field_parts
from alphacut.rve.image.fields.grid import (
    SLAB_CELLS,
    Fields,
    Operator,
    finished_fields,
    gather,
    namespace,
    on_host,
    slabs,
)
from alphacut.rve.image.fields.kernels import ROUNDINGS, modes_by_rows
from alphacut.rve.image.fields.preconditioner import FourierPreconditioner, Reference

UNIT = 2.0**-53
"""Rounding unit of doubles."""
SAFETY = 1.01
"""Factor for the rounding of an error bound itself and for terms of second order."""
SAFETY_OF_SUMS = 1 + 2.0**-40
"""Factor for the rounding of a few sums and quotients of positive numbers."""
COEFFICIENT = 8
"""Rounding units by which a coefficient of the energy may be off."""


@dataclass(frozen=True, eq=False)
class Energies:
    """Mean products of the modes of pairs of fields, by parts: trace and deviator, or all.

    Args:
        value: Computed products of each part, symmetric, shape (parts, fields, fields).
        mode_errors: Bounds of the roots of the mean squares of the errors of modes, weighted as the
            products are, shape (parts, fields).
        summed: Bound of the relative rounding of products and sums.
    """

    value: Array
    mode_errors: Array
    summed: float

    @property
    def rounding(self) -> Array:
        """Bound of the absolute error of each energy product, of the shape of `value`.

        With errors δa, δb of the modes a, b
        the product a b is off by |a| δb + |b| δa + δa δb at most. By Cauchy and Schwarz the mean of
        each summand is at most a product of two root mean squares: of modes (`size`), or of their
        errors (`mode_errors`). Rounding of products and sums adds `summed` times the mean of |a b|,
        which is bounded likewise.
        """
        size = np.sqrt(SAFETY * np.maximum(np.diagonal(self.value, axis1=1, axis2=2), 0))
        by_one = _outer(size, self.mode_errors)
        by_modes = by_one + np.swapaxes(by_one, 1, 2) + _outer(self.mode_errors, self.mode_errors)
        by_sums = self.summed * _outer(size, size)
        return np.asarray(SAFETY * (by_modes + by_sums))

    @property
    def upper(self) -> Array:
        """A matrix above the matrix of the true total energies, shape (fields, fields).

        Above means in the Loewner order: the difference is positive semidefinite. The total energy
        of each pair of fields is the sum of the products of the parts.
        """
        value = self.value.sum(axis=0)
        error_of_sum = 2 * (len(self.value) + 2) * UNIT * np.abs(self.value).sum(axis=0)
        error = self.rounding.sum(axis=0) + error_of_sum
        # By Gershgorin's circles the diagonal matrix of the row sums of D⁻¹ error D⁻¹ is above any
        # symmetric matrix whose entries are that small. D makes loads of any size count alike.
        scale = np.sqrt(np.maximum(np.diagonal(value), np.finfo(float).tiny))
        # Where a load has hardly any energy, errors shared with others count for it, not for them.
        scale = np.maximum(scale, 2.0**30 * self.mode_errors.sum(axis=0))
        return np.asarray(value + np.diag(SAFETY * (error / scale).sum(axis=1) * scale))


def bound_of_trials(means: Array, energy: Energies) -> Array:
    """Return a lower bound of a stiffness or conductivity from trial stresses or fluxes.

    With the means Q of the loads, one a column, and their energies E, the means Q X of any
    combinations X prove K ≥ Q X (Xᵀ E X)⁻¹ Xᵀ Qᵀ in the Loewner order (Thomson's principle). Here
    X are eigenvectors of E over the roots of the eigenvalues, so that Xᵀ E X is near the unit
    matrix: it is at most its largest row sum. Loads without energy are left out, as are
    combinations whose energy is lost in rounding: this only lowers the bound.

    Args:
        means: Means of the components, each off by at most 4 rounding units, shape (components,
            loads).
        energy: Energies of all pairs of loads.

    Returns:
        Symmetric matrix, shape (components, components). Where all means of a component are 0, so
        are its row and column.
    """
    diagonal = np.diagonal(energy.upper)
    # Powers of two, by which nothing is rounded, let loads of any size count alike.
    scale = np.exp2(-np.round(np.log2(np.where(diagonal > 0, diagonal, 1.0)) / 2))
    scale *= diagonal > 0
    scaled = scale[:, np.newaxis] * energy.upper * scale
    eigenvalues, vectors = np.linalg.eigh(scaled)
    # No bound rests on the limit, below which combinations count as lost in rounding.
    is_kept = eigenvalues > 1e-9 * max(eigenvalues[-1], np.finfo(float).tiny)
    x = vectors[:, is_kept] / np.sqrt(eigenvalues[is_kept])
    trials = (means * scale) @ x
    # In rational numbers, since the combinations may have lost many digits.
    rational = np.vectorize(Fraction, otypes=[object])
    of_trials = rational(x).T @ rational(scaled) @ rational(x)
    largest = SAFETY_OF_SUMS * float(max(abs(of_trials).sum(axis=1), default=1))
    # A sum of n products is off by n units of the sum of their magnitudes (Higham, Accuracy and
    # Stability of Numerical Algorithms, section 3.1).
    n = len(scale)
    trial_errors = (n + 5) * UNIT * abs(means * scale) @ abs(x)
    products = abs(trials) @ trial_errors.T
    error = products + products.T + trial_errors @ trial_errors.T
    error += (n + 3) * UNIT * abs(trials) @ abs(trials).T
    # By Gershgorin's circles the row sums of the errors bound the error in the Loewner order.
    margin = SAFETY * error.sum(axis=1) / largest
    return np.asarray(trials @ trials.T / largest - np.diag(margin))


def _outer(first: Array, second: Array) -> Array:
    """Return the products of all pairs of fields of two arrays (parts, fields), by part."""
    return np.asarray(first[:, :, np.newaxis] * second[:, np.newaxis])


def energies(
    element: Element,
    fields: Fields,
    mean_modes: Array,
    coefficients: Sequence[Fields],
) -> Energies:
    """Return mean energy products of all pairs of fields, with bounds of their rounding errors.

    The product of two fields is the mean over the grid of coefficient · mode · mode, summed over
    the modes of each of the element's parts. Modes are coefficients in polynomials that are
    orthonormal on a cell, so that their products are energies.

    Args:
        element: Element of the fields.
        fields: Unknowns of periodic fluctuations, shape (fields, unknowns of a cell, *grid), where
            the grid is (y, x) or (z, y, x).
        mean_modes: Modes of the uniform field to add to each, shape (modes, fields).
        coefficients: Coefficients of the squares of each part in each cell, of the shape of the
            grid, not negative, each with a relative error of up to 8 rounding units of 2⁻⁵³.

    Returns:
        Energies with `value`, the products of each part, shape (parts, fields, fields), symmetric;
        `mode_errors`, for each part of each field a bound of the root of the mean over cells of
        Σ coefficient · error² over modes, shape (parts, fields); and `summed`, a bound of the
        relative rounding of products and sums.
    """
    slabs_of_modes = modes_of(element, fields, mean_modes)
    cells = math.prod(fields.shape[2:])
    return energies_of(element, slabs_of_modes, coefficients, fields=len(fields), cells=cells)


def energies_of(
    element: Element,
    slabs_of_modes: Iterator[SlabModes],
    coefficients: Sequence[Fields],
    *,
    fields: int,
    cells: int,
) -> Energies:
    """Return mean energy products of all pairs of fields from their modes; see `energies`.

    Args:
        element: Element of the fields.
        slabs_of_modes: Modes of groups of cells.
        coefficients: Coefficients of the squares of each part in each cell of the grid.
        fields: Number of fields.
        cells: Number of cells that means are over.
    """
    xp = namespace(coefficients[0])
    value = np.zeros((len(element.parts), fields, fields))
    squared_errors = np.zeros((len(element.parts), fields))
    additions = 0
    max_cells = 0
    for slab, modes, amplification, local in slabs_of_modes:
        # `modes_of` gives the factors of this bound of the errors of modes.
        errors = xp.tensordot(amplification, local, axes=1) + UNIT * xp.abs(modes)
        for k, (rows, coefficient) in enumerate(zip(element.parts, coefficients, strict=True)):
            factor = xp.reshape(coefficient[slab], (-1,))
            products = modes[rows] @ xp.moveaxis(modes[rows] * factor, 1, 2)
            value[k] += on_host(xp.sum(products, axis=0))
            squared_errors[k] += on_host(xp.sum(factor * errors[rows] ** 2, axis=(0, 2)))
        additions += 1
        max_cells = max(max_cells, modes.shape[2])
    # A sum is off by at most n units of the sum of the magnitudes of its terms, if no term takes
    # part in more than n additions (Higham, Accuracy and Stability of Numerical Algorithms, section
    # 4.2). Here these are the sums over the cells of a slab, over the modes, and over the slabs.
    additions += max_cells + len(element.modes)
    return Energies(
        value=(value + np.swapaxes(value, 1, 2)) / (2 * cells),
        mode_errors=SAFETY * np.sqrt(squared_errors / cells),
        summed=SAFETY * (additions + COEFFICIENT + 5) * UNIT,
    )


class SlabModes(NamedTuple):
    """Modes of some cells of a grid, with a bound of their rounding errors.

    Attributes:
        slab: Index of the cells in an array of the grid's shape.
        modes: Shape (modes, fields, cells).
        amplification: Matrix A, shape (modes, unknowns or local unknowns).
        local: Magnitudes b of these unknowns, shape (unknowns or local unknowns, fields, cells).
            The modes are off by at most A b + `UNIT` · |modes|.
    """

    slab: Any
    modes: Fields
    amplification: Fields
    local: Fields


def modes_of(element: Element, fields: Fields, mean_modes: Array) -> Iterator[SlabModes]:
    """Yield the modes of fields plus uniform fields, by groups of cells.

    Modes are coefficients of the element's parts in products of Legendre polynomials that are
    orthonormal on a cell.

    Args:
        element: Element of the fields.
        fields: Unknowns of periodic fluctuations, shape (fields, unknowns of a cell, *grid), where
            the grid is (y, x) or (z, y, x).
        mean_modes: Modes of the uniform field to add to each, shape (modes, fields).

    Yields:
        SlabModes: `slab`, the index of the cells in an array of the grid's shape; `modes`, shape
        (modes, fields, cells); and a matrix A, `amplification`, and magnitudes b of unknowns,
        `local`, with which modes are off by at most A b + 2⁻⁵³ |modes|. Every cell is in one group.
    """
    if isinstance(fields, np.ndarray) and element.dimension == 3:
        return _modes_by_rows(element, fields, mean_modes)
    return modes_by_matrices(element, fields, mean_modes)


def modes_by_matrices(element: Element, fields: Fields, mean_modes: Array) -> Iterator[SlabModes]:
    """Yield the modes of fields plus uniform fields by the element's matrix, in slabs of the grid.

    Modes are coefficients of the element's parts in products of Legendre polynomials that are
    orthonormal on a cell. This is the reference of the compiled kernels for voxels, and takes
    arrays of NumPy or CuPy.

    Args:
        element: Element of the fields.
        fields: Unknowns of periodic fluctuations, shape (fields, unknowns of a cell, *grid), where
            the grid is (y, x) or (z, y, x).
        mean_modes: Modes of the uniform field to add to each, shape (modes, fields).

    Yields:
        SlabModes for each slice of the first axis of the grid: `slab`, that slice; `modes`, shape
        (modes, fields, cells of the slab); and a matrix A, `amplification`, and magnitudes b of
        local unknowns, `local`, with which modes are off by at most A b + 2⁻⁵³ |modes|.
    """
    xp = namespace(fields)
    matrix = xp.asarray(element.modes)
    magnitude = xp.asarray(element.magnitude)
    # A sum of n terms is off by n units, where zeros do not count; each entry of the matrix is off
    # by up to 16 units.
    terms = int((element.magnitude > 0).sum(axis=1).max())
    relative_error = (terms + 16) * UNIT
    for slab in slabs(fields):
        local = gather(element, fields, slab)
        local = xp.reshape(local, (*local.shape[:2], -1))
        error = relative_error * xp.abs(local)
        modes = xp.tensordot(matrix, local, axes=1)
        modes += xp.asarray(mean_modes)[:, :, None]
        yield SlabModes(slab, modes, magnitude, error)


def _modes_by_rows(element: Element, fields: Array, mean_modes: Array) -> Iterator[SlabModes]:
    """Yield the modes of fields of voxels plus uniform fields, by compiled kernels.

    Modes are coefficients of the element's parts in products of Legendre polynomials that are
    orthonormal on a cell.

    Args:
        element: Element of voxels.
        fields: Unknowns of periodic fluctuations, shape (fields, unknowns of a voxel, z, y, x).
        mean_modes: Modes of the uniform field to add to each, shape (modes, fields).

    Yields:
        SlabModes for some rows of a layer, so that few modes are in memory: `slab`, the index (z,
        rows); `modes`, shape (modes, fields, voxels); and a matrix A, `amplification`, and
        magnitudes b of the unknowns of a voxel, `local`, with which modes are off by at most A b +
        2⁻⁵³ |modes|.
    """
    nz, ny, nx = fields.shape[2:]
    n_rows = max(1, SLAB_CELLS // (len(fields) * nx))
    width = 1 + element.reach
    unknown = np.array([local.unknown for local in element.local])
    by_unknown = [element.magnitude[:, unknown == u].sum(axis=1) for u in range(element.unknowns)]
    # A kernel's mode is off by `ROUNDINGS` units of the sum of the magnitudes of its terms. Terms
    # of one unknown share its largest value over the voxels around, a larger bound that takes less
    # memory.
    amplification = ROUNDINGS * UNIT * np.stack(by_unknown, axis=1)
    for z in range(nz):
        layers = np.arange(z, z + width) % nz
        sizes = np.abs(fields[:, :, layers])
        # largest value of each unknown over the cells that own local unknowns of a voxel
        greatest = sizes.max(axis=2)
        for axis in (2, 3):
            greatest = np.max([np.roll(greatest, -k, axis) for k in range(width)], axis=0)
        for first in range(0, ny, n_rows):
            rows = slice(first, min(first + n_rows, ny))
            modes = modes_by_rows(element, fields, z, rows.start, rows.stop)
            modes += mean_modes[:, :, None]
            local = np.moveaxis(greatest[:, :, rows], 1, 0).reshape(-1, *modes.shape[1:])
            yield SlabModes((z, rows), modes, amplification, local)


def solved_loads(element: Element) -> Array:
    """Return mean fields near the eigenvectors of an isotropic material, a row each.

    They are strains or stresses in Voigt order, or gradients or fluxes. With them soft loads are
    not drowned in stiff ones where ν is near 1/2 or −1.
    """
    parts = field_parts(element.dimension, dual=False, conduction=element.conduction)
    return np.asarray(parts / np.abs(parts).max(axis=1, keepdims=True))


def coefficients_of(element: Element, moduli: Sequence[Fields]) -> list[Fields]:
    """Return the coefficients of the energy of each of the element's parts.

    Args:
        element: Element of the fields.
        moduli: Bulk and shear modulus (for trace and deviator), or the conductivity.
    """
    if not element.dual:
        return list(moduli)
    factors = [1.0] if element.conduction else [1 / element.dimension**2, 0.25]
    return [factor / modulus for factor, modulus in zip(factors, moduli, strict=True)]


@dataclass(frozen=True, eq=False)
class FieldSolution:
    """Fields of nearly least energy.

    Args:
        fields: Fields for unit loads, of strains and stresses in Voigt order, shape (loads,
            unknowns, *grid).
        energy: Their energies, whose `upper` bounds the stiffness or conductivity, or its inverse,
            from above.
    """

    fields: Fields
    energy: Energies


def solve_side(
    element: Element,
    moduli: Sequence[Fields],
    *,
    solver: ConjugateGradient,
    start: Fields | None = None,
) -> FieldSolution:
    """Return fields of nearly least energy under unit loads: one side of the bounds.

    Fields of displacements bound the stiffness from above, those of temperatures the conductivity.
    Fields of stresses in equilibrium, or of fluxes without sources, bound the inverse from above;
    for pores there are `solve_stresses` and `solve_fluxes`.

    Args:
        element: Element of the fields.
        moduli: Bulk modulus of each cell (in the plane K + G/3) and shear modulus; or the
            conductivity alone. They are in any unit, of shape (y, x) or (z, y, x), and finite. A
            cell may not have 0.
        solver: Solver with its stopping rule.
        start: Fields to start from, in the shape of the result's fields; None for zero.

    Returns:
        `fields`, shape (loads, unknowns of a cell, *grid), with the unit loads in Voigt's order;
        and `energy`, that of all pairs of these fields.

    Raises:
        FailedError: The solver does not converge.
    """
    coefficients = coefficients_of(element, moduli)
    fields = _least_energy_fields(element, coefficients, solver, start)
    unit_modes = element.mean_modes(np.eye(len(fields)))
    energy = energies(element, fields, unit_modes, coefficients)
    return FieldSolution(fields, energy)


def _least_energy_fields(
    element: Element,
    coefficients: Sequence[Fields],
    solver: ConjugateGradient,
    start: Fields | None,
) -> Fields:
    """Return fields under unit loads whose energy is nearly the least.

    The loads that are solved for are near the eigenvectors of an isotropic stiffness; the fields
    are combined to the fields of the unit loads afterwards.

    Args:
        element: Element of the fields.
        coefficients: Coefficient of the square of each of the element's parts in each cell,
            positive, shape (y, x) or (z, y, x).
        solver: Solver with its stopping rule.
        start: First guess, in the shape of the result; None for zero.

    Returns:
        Unknowns of the periodic fluctuations, shape (loads, unknowns of a cell, *grid), for a unit
        mean field in each component, of strains and stresses in Voigt's order.

    Raises:
        FailedError: The solver does not converge.
    """
    shape = coefficients[0].shape
    xp = namespace(coefficients[0])
    loads = solved_loads(element)
    modes = element.mean_modes(loads)
    constant = Reference.of_grid(element, coefficients)
    preconditioner = FourierPreconditioner.of_material(element, constant, shape, xp)
    operator = Operator(element, coefficients)
    scale = minimum_energy(element, coefficients, modes)
    whole = (len(loads), element.unknowns, *shape)
    fields = finished_fields(whole, shape) if xp is np else xp.empty(whole)
    for k in range(len(loads)):  # one after another: solved together they take more memory
        this = slice(k, k + 1)
        system = System(
            operator=operator.apply,
            preconditioner=preconditioner.apply,
            load=operator.load(modes[:, this]),
            scale=float(scale[k]),
            min_energy_ratio=constant.min_energy_ratio(coefficients),
        )
        if start is not None:
            guess = xp.tensordot(xp.asarray(loads[this]), start, axes=1)
            system = replace(system, start=guess)
        fields[this] = solver.solve(system)
    # Energies are computed from the combined fields later, so that these may be rounded here.
    to_unit_loads = xp.asarray(np.linalg.inv(loads))
    for slab in slabs(fields):  # in place
        fields[:, :, slab] = xp.tensordot(to_unit_loads, fields[:, :, slab], axes=1)
    return fields


def minimum_energy(element: Element, coefficients: Sequence[Fields], modes: Array) -> Array:
    """Return a lower bound of the energy of any fields with given mean modes, shape (loads,).

    The energy is the sum over cells and modes of a coefficient times the squared mode. Modes are
    coefficients of the element's parts in products of Legendre polynomials that are orthonormal on
    a cell. By the inequality of Cauchy and Schwarz the sum of c m² over N cells is at least N times
    the harmonic mean of c times the squared mean of m.

    Args:
        element: Element, which tells the modes of each part.
        coefficients: Coefficient c of the squared modes m of each part, positive, of the grid's
            shape.
        modes: Mean modes of each load, shape (modes, loads).
    """
    total = np.zeros(modes.shape[1])
    for rows, coefficient in zip(element.parts, coefficients, strict=True):
        least = float(coefficient.size / (1 / coefficient).mean())  # N times the harmonic mean
        total += least * np.sum(modes[rows] ** 2, axis=0)
    return total
