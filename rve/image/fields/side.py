"""One side of the bounds: fields of least energy in one of the two spaces, and their energies."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from alphacut.rve.image.fields.clamped import ClampedOperator, ClampedPreconditioner, free_unknowns
from alphacut.rve.image.fields.division import divided, prolonged
from alphacut.rve.image.fields.element import Element, airy_element, displacement_element
from alphacut.rve.image.fields.energy import Energy, energy
from alphacut.rve.image.fields.operator import Operator
from alphacut.rve.image.fields.preconditioner import FourierPreconditioner
from alphacut.rve.image.fields.reference import Reference
from alphacut.rve.image.fields.solver import Solver
from alphacut.rve.image.fields.system import System
from alphacut.stochastic.theta.truncated_normal import Array

UNIT_LOADS = np.eye(3)
# the loads that are solved: near an isotropic stiffness's own, so that the soft ones are not
# drowned in the stiff ones where ν is near 1/2 or −1
SOLVED_LOADS = np.array([[1.0, 1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 0.0, 1.0]])
SMALL = 1 << 17  # pixels up to which the loads are solved together
COARSER = 10.0  # accuracy of a start on whole pixels over that asked for


@dataclass(frozen=True)
class Side:
    """Space of trial fields with its coefficients.

    Args:
        name: "displacement" bounds the stiffness from above, "stress" the compliance.
        element: Maker of the element for a pixel's aspect ratio.
        stiff: Coefficients are K + G/3 and G; else 1/(4 (K + G/3)) and 1/(4 G).
    """

    name: str
    element: Callable[[float], Element]
    stiff: bool

    def coefficients(self, bulk: Array, shear: Array) -> tuple[Array, Array]:
        """Coefficients of trace and deviator from plane bulk and shear moduli."""
        return (bulk, shear) if self.stiff else (0.25 / bulk, 0.25 / shear)


DISPLACEMENT = Side("displacement", displacement_element, stiff=True)
STRESS = Side("stress", airy_element, stiff=False)


@dataclass(frozen=True)
class SideSolution:
    """Fields of one side.

    Args:
        side: The space.
        aspect: Height of a pixel over its width.
        fields: Fluctuations for the unit loads, shape (tiles, 3, types, rows, columns).
        energy: Mean energies with their rounding.
        iterations: Of the slowest load.
    """

    side: Side
    aspect: float
    fields: Array
    energy: Energy
    iterations: int


def solve_side(
    side: Side,
    bulk: Array,
    shear: Array,
    *,
    solver: Solver,
    aspect: float = 1.0,
    division: int = 1,
    start: Array | None = None,
    clamped: bool = False,
    pixels: bool = False,
) -> SideSolution:
    """Fields of least energy under the three unit loads of tiles.

    Args:
        side: Space of the fields.
        bulk: Plane-strain bulk modulus K + G/3 of each pixel, shape (tiles, rows, columns), any
            unit.
        shear: Shear modulus, same shape and unit.
        solver: Stopping rule.
        aspect: Height of a pixel over its width.
        division: Parts along each side into which every pixel is divided; the fields of whole
            pixels are the start.
        start: Fields to start from, on the divided pixels.
        clamped: Fluctuations vanish on the edge of each tile; else they are periodic.
        pixels: Keep the energy of each pixel.
    """
    element = side.element(aspect)
    modes = element.mean_modes(SOLVED_LOADS)
    start = None if start is None else _of_solved_loads(start)
    trace, deviator = side.coefficients(bulk, shear)
    if division > 1 and start is None:
        coarse = solver.coarser(COARSER)
        fields, _ = _fields(element, trace, deviator, modes, coarse, None, clamped)
        start = prolonged(element, fields, division)
    trace, deviator = divided(trace, division), divided(deviator, division)
    fields, iterations = _fields(element, trace, deviator, modes, solver, start, clamped)
    fields = _of_unit_loads(fields)
    modes = element.mean_modes(UNIT_LOADS)
    result = energy(element, trace, deviator, fields, modes, pixels=pixels)
    return SideSolution(side, aspect, fields, result, iterations)


def _fields(
    element: Element,
    trace: Array,
    deviator: Array,
    modes: Array,
    solver: Solver,
    start: Array | None,
    clamped: bool,
) -> tuple[Array, int]:
    """Fields of the unit loads and the most iterations; large images load by load."""
    shape = (trace.shape[1], trace.shape[2])
    constant = Reference.between(trace, deviator, exchange=element.order == 2)
    kind = ClampedPreconditioner if clamped else FourierPreconditioner
    preconditioner = kind.of(element, constant.trace, constant.deviator, shape)
    periodic = Operator(element, trace, deviator)
    operator = ClampedOperator(periodic, free_unknowns(element, shape)) if clamped else periodic
    scale = least_energy(element, trace, deviator, modes)
    least = constant.least(trace, deviator)
    loads = modes.shape[1]
    fields = np.empty((len(trace), loads, element.types, *shape))
    iterations = 0
    together = loads if trace.size <= SMALL else 1
    for first in range(0, loads, together):
        part = slice(first, first + together)
        guess = None if start is None else start[:, part]
        load = operator.load(modes[:, part])
        origin = trace, deviator, modes[:, part]
        system = System(operator, preconditioner, load, scale[:, part], least, guess, origin)
        solution = solver.found(system)
        fields[:, part] = solution.fields
        iterations = max(iterations, solution.iterations)
    return fields, iterations


def _of_solved_loads(fields: Array) -> Array:
    """Fields under `SOLVED_LOADS` from those under `UNIT_LOADS`."""
    first, second = fields[:, 0], fields[:, 1]
    return np.stack([first + second, first - second, fields[:, 2]], axis=1)


def _of_unit_loads(fields: Array) -> Array:
    """Fields under `UNIT_LOADS` from those under `SOLVED_LOADS`, in place."""
    fields[:, 0] += fields[:, 1]
    fields[:, 0] *= 0.5
    np.subtract(fields[:, 0], fields[:, 1], out=fields[:, 1])
    return fields


def least_energy(element: Element, trace: Array, deviator: Array, modes: Array) -> Array:
    """Total energy that no field with the given means is below, shape (tiles, loads)."""
    split = element.bulk_rows
    parts = ((trace, modes[:split]), (deviator, modes[split:]))
    pixels = trace.shape[1] * trace.shape[2]
    return np.asarray(
        sum(pixels / np.mean(1 / c, axis=(1, 2))[:, None] * np.sum(m**2, axis=0) for c, m in parts)
    )
