"""One side of the bounds: fields of least energy in one of the two spaces, and their energies."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.rve.image.fields.conjugate_gradient import ConjugateGradient, System
from alphacut.rve.image.fields.element import Element, Operator, blocks
from alphacut.rve.image.fields.energy import Energies, energies
from alphacut.rve.image.fields.preconditioner import FourierPreconditioner, Reference

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
    scale = least_energy(element, trace, deviator, modes)
    least = constant.lowest_energy_ratio(trace, deviator)
    n_together = len(SOLVED_LOADS) if trace.size <= SMALL else 1  # to save memory
    fields, iterations = np.empty((len(SOLVED_LOADS), element.unknowns, rows, columns)), []
    for first in range(0, len(SOLVED_LOADS), n_together):
        part = slice(first, first + n_together)
        guess = None if start is None else np.tensordot(SOLVED_LOADS[part], start, axes=1)
        load = operator.load(modes[:, part])
        system = System(operator, preconditioner, load, scale[part], least, guess)
        fields[part], number = solver.solve(system)
        iterations.append(number)
    return fields, max(iterations)


def least_energy(element: Element, trace: Array, deviator: Array, modes: Array) -> Array:
    """Lower bound of the energy of any fields with given mean modes, shape (loads,)."""
    trace_squares, deviator_squares = (np.sum(modes[rows] ** 2, axis=0) for rows in element.parts)
    trace_energy = trace.size / np.mean(1 / trace) * trace_squares
    return np.asarray(trace_energy + deviator.size / np.mean(1 / deviator) * deviator_squares)
