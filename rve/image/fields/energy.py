"""One side of the bounds: fields of least energy in one of two spaces, and their mean energies.

Every rounding error of an energy is bounded. The floating-point numbers of a field are taken as
exact: whatever the solver left in them, they are a field of the space. Rounded are the differences
from the pixel's anchor, the modes, and the sums of some products of modes; the sum of these is
exact (`math.fsum`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.rve.image.fields.conjugate_gradient import ConjugateGradient, System
from alphacut.rve.image.fields.element import Element, Operator, blocks, gather
from alphacut.rve.image.fields.preconditioner import FourierPreconditioner, Reference

UNIT = 2.0**-53  # rounding unit
SAFETY = 1.01  # for the rounding of the error bound itself and for terms of second order
PIECE = 64  # products that are summed in rounded steps
COEFFICIENT = 8  # rounding units that a coefficient may be off by

Weighted = tuple[slice, Array]  # rows of the modes, and what they count in each pixel


@dataclass(frozen=True, eq=False)
class Energies:
    """Mean products of the modes of fields, by weight.

    Args:
        value: Symmetric, shape (weights, fields, fields).
        error: Norm of the rounding error of each field's modes, shape (weights, fields).
        summed: Relative rounding of products and sums.
    """

    value: Array
    error: Array
    summed: float

    @property
    def size(self) -> Array:
        """Norm of each field, not below the true one, shape (weights, fields)."""
        squares = np.maximum(np.diagonal(self.value, axis1=1, axis2=2), 0)
        return np.asarray(np.sqrt(SAFETY * squares))

    @property
    def rounding(self) -> Array:
        """Bound of the absolute error of each product, shape (weights, fields, fields)."""
        size, wrong = self.size, self.error
        mixed = _outer(size, wrong) + _outer(wrong, size) + _outer(wrong, wrong)
        return np.asarray(SAFETY * (mixed + self.summed * _outer(size, size)))

    @property
    def upper(self) -> Array:
        """A matrix above the sum over the weights in the Loewner order, shape (fields, fields)."""
        value = self.value.sum(axis=0)
        terms = 2 * (len(self.value) + 2) * UNIT * np.abs(self.value).sum(axis=0)
        return np.asarray(value + np.diag(SAFETY * (self.rounding.sum(axis=0) + terms).sum(axis=1)))


def energies(
    element: Element, fields: Array, mean_modes: Array, weights: Sequence[Weighted]
) -> Energies:
    """Mean energy products of all pairs of fields, with a bound of their rounding errors.

    Args:
        element: Unknowns and modes of a pixel.
        fields: Periodic fluctuations, shape (fields, unknowns, rows, columns).
        mean_modes: Modes of the uniform field to add to each, shape (modes, fields).
        weights: Pairs of rows of modes and their coefficient in each pixel, shape (rows, columns),
            not negative, with a rounding error of up to `COEFFICIENT` units.
    """
    count, pixels = len(fields), fields.shape[-2] * fields.shape[-1]
    piece = max(PIECE, count**2)  # so that there are not more sums than products
    sums: list[list[Array]] = [[] for _ in weights]
    error_squared = np.zeros((len(weights), count))
    for pixel_rows, modes, rounding in modes_of(element, fields, mean_modes):
        for k, (mode_rows, weight) in enumerate(weights):
            sums[k].append(_piecewise_products(modes[mode_rows], weight[pixel_rows], piece))
            error_squared[k] += np.einsum(
                "rfyx,yx->f", rounding[mode_rows] ** 2, weight[pixel_rows]
            )
    value = np.empty((len(weights), count, count))
    for k, parts in enumerate(sums):
        entries = np.concatenate(parts).reshape(-1, count**2).T
        value[k] = np.reshape([math.fsum(terms) for terms in entries], (count, count)) / pixels
    relative_rounding = SAFETY * (piece + COEFFICIENT + 4) * UNIT
    return Energies(value, np.sqrt(SAFETY * error_squared / pixels), relative_rounding)


def _piecewise_products(modes: Array, weight: Array, piece: int) -> Array:
    """Weighted products of all pairs of fields, symmetric, in sums of `piece` products each."""
    count = modes.shape[1]

    def cut(values: Array) -> Array:
        """Values by piece, padded with zeros: shape (pieces, fields, piece)."""
        flat = np.swapaxes(values, 0, 1).reshape(count, -1)
        padded = np.pad(flat, ((0, 0), (0, -flat.shape[1] % piece)))
        return np.swapaxes(padded.reshape(count, -1, piece), 0, 1)

    products = cut(modes) @ np.swapaxes(cut(modes * weight), 1, 2)
    return np.asarray((products + np.swapaxes(products, 1, 2)) / 2)


def modes_of(
    element: Element, fields: Array, mean_modes: Array
) -> Iterator[tuple[slice, Array, Array]]:
    """Yield by blocks: rows of pixels, modes (modes, fields, rows, columns), bounds of rounding."""
    absolute, count = np.abs(element.modes), len(element.local)
    for rows in blocks(fields.shape):
        local, local_error = _subtract_anchors(element, gather(element, fields, rows))
        shape = (-1, *local.shape[1:])
        modes = (element.modes @ local.reshape(count, -1)).reshape(shape)
        # the product of matrices; entries of the matrix are right to 10 units
        local_error += (count + 12) * UNIT * np.abs(local)
        rounding = (absolute @ local_error.reshape(count, -1)).reshape(shape)
        modes += mean_modes[..., None, None]
        rounding += UNIT * np.abs(modes)
        yield rows, modes, rounding


def _subtract_anchors(element: Element, raw: Array) -> tuple[Array, Array]:
    """Local unknowns minus their anchors, and a bound of the rounding error, shaped like `raw`."""
    local, error = raw.copy(), np.zeros_like(raw)
    for k, anchors in enumerate(element.anchors):
        for anchor in anchors:
            local[k] -= raw[anchor]
            error[k] += UNIT * np.abs(local[k])
    return local, error


def _outer(first: Array, second: Array) -> Array:
    return np.asarray(first[:, :, None] * second[:, None, :])


UNIT_LOADS = np.eye(3)
# the loads that are solved: near an isotropic stiffness's own, so that the soft ones are not
# drowned in the stiff ones where ν is near 1/2 or −1
SOLVED_LOADS = np.array([[1.0, 1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 0.0, 1.0]])
SMALL = 1 << 17  # pixels up to which the loads are solved together


def coefficients(element: Element, bulk: Array, shear: Array) -> tuple[Array, Array]:
    """Coefficients of trace and deviator: K + G/3 and G of strains, 1/4 over them of stresses."""
    if element.stress:
        return np.asarray(0.25 / bulk), np.asarray(0.25 / shear)
    return bulk, shear


@dataclass(frozen=True, eq=False)
class SideSolution:
    """Fields for the unit loads, (3, unknowns, rows, columns); energies whose `upper` bounds."""

    fields: Array
    energy: Energies
    iterations: int


def solve_side(
    element: Element,
    bulk: Array,
    shear: Array,
    *,
    solver: ConjugateGradient,
    division: int = 1,
    start: Array | None = None,
) -> SideSolution:
    """Fields of least energy under the three unit loads.

    Args:
        element: Of displacements, whose energy bounds the stiffness from above, or of stresses,
            whose energy bounds the compliance.
        bulk: Plane-strain bulk modulus K + G/3 of each pixel, shape (rows, columns), any unit.
        shear: Shear modulus, same shape and unit.
        solver: Stopping rule.
        division: Parts along each side into which every pixel is divided: the same image, a larger
            space of fields.
        start: Fields to start from, on the divided pixels.
    """
    pixel_coefficients, parts = coefficients(element, bulk, shear), np.ones((division, division))
    trace, deviator = (np.asarray(np.kron(x, parts)) for x in pixel_coefficients)
    fields, iterations = _solve_loads(element, trace, deviator, solver, start)
    to_unit_loads = np.linalg.inv(SOLVED_LOADS)
    for rows in blocks(fields.shape):  # in place
        fields[:, :, rows] = np.tensordot(to_unit_loads, fields[:, :, rows], axes=1)
    weights = list(zip(element.parts, (trace, deviator), strict=True))
    energy = energies(element, fields, element.mean_modes(UNIT_LOADS), weights)
    return SideSolution(fields, energy, iterations)


def _solve_loads(
    element: Element, trace: Array, deviator: Array, solver: ConjugateGradient, start: Array | None
) -> tuple[Array, int]:
    """Fields of `SOLVED_LOADS`, (3, unknowns, rows, columns), and the largest iteration count."""
    modes = element.mean_modes(SOLVED_LOADS)
    constant = Reference.of_image(trace, deviator, stress=element.stress)
    rows, columns = trace.shape
    preconditioner = FourierPreconditioner.of_material(element, constant, (rows, columns))
    operator = Operator(element, trace, deviator)
    scale = minimum_energy(element, trace, deviator, modes)
    least = constant.lowest_energy_ratio(trace, deviator)
    n_together = len(SOLVED_LOADS) if trace.size <= SMALL else 1  # to save memory
    fields, iterations = np.empty((len(SOLVED_LOADS), element.unknowns, rows, columns)), []
    for first in range(0, len(SOLVED_LOADS), n_together):
        part = slice(first, first + n_together)
        guess = None if start is None else np.tensordot(SOLVED_LOADS[part], start, axes=1)
        load = operator.load(modes[:, part])
        system = System(operator.apply, preconditioner.apply, load, scale[part], least, guess)
        fields[part], number = solver.solve(system)
        iterations.append(number)
    return fields, max(iterations)


def minimum_energy(element: Element, trace: Array, deviator: Array, modes: Array) -> Array:
    """Lower bound of the energy of any fields with given mean modes, shape (loads,)."""
    trace_squares, deviator_squares = (np.sum(modes[rows] ** 2, axis=0) for rows in element.parts)
    trace_energy = trace.size / np.mean(1 / trace) * trace_squares
    return np.asarray(trace_energy + deviator.size / np.mean(1 / deviator) * deviator_squares)
