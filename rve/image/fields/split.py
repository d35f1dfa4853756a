"""Displacements or temperatures beside pores, with nodes that are split where solids only touch.

A pore has no energy, so that nodes inside it do not count. Solids that share an edge or a corner
alone do not hold one another: each has its own copy of the nodes there (`nodes`). The copies but
the first stand in a list behind the regular grid, for which kernels and Fourier transforms work.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Self

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.rve.image.fields.conjugate_gradient import ConjugateGradient, System
from alphacut.rve.image.fields.element import Element
from alphacut.rve.image.fields.energy import (
    SAFETY,
    UNIT,
    Energies,
    SlabModes,
    energies,
    energies_of,
    solved_loads,
)
from alphacut.rve.image.fields.grid import SLAB_CELLS, Fields, Operator, finished_fields
from alphacut.rve.image.fields.nodes import NodeCopies
from alphacut.rve.image.fields.preconditioner import FourierPreconditioner, Reference


@dataclass(frozen=True, eq=False)
class SplitGrid:
    """Unknowns of a grid with pores: those of the grid, then those of further copies of nodes.

    Packed fields have the shape (fields, 1, unknowns).

    Args:
        element: Element of displacements or temperatures.
        coefficients: Coefficients of the energy of each part of the modes, shape (y, x) or (z, y,
            x) each; all 0 in pores, positive elsewhere.
        cells: Numbers of the cells at a further copy, in C order of the grid.
        local: Number of each of their local unknowns among the packed ones, (local unknowns,
            cells).
        places: Number of the unknown on the grid at each further copy's place.
        diagonal: Diagonal of the matrix of the packed unknowns; 0 inside pores.
        regular: Operator of all other cells.
    """

    element: Element
    coefficients: Sequence[Array]
    cells: Ints
    local: Ints
    places: Ints
    diagonal: Array
    regular: Operator

    @classmethod
    def of_coefficients(cls, element: Element, coefficients: Sequence[Array]) -> Self:
        """Return the unknowns of a grid; see the class."""
        shape = coefficients[-1].shape
        size = coefficients[-1].size
        axes = tuple(range(len(shape)))
        solid = coefficients[-1] > 0
        copies = NodeCopies.of_mask(solid)
        is_first = np.append(True, np.diff(copies.places) > 0)
        extra = np.cumsum(~is_first) - 1
        n_extra = int(np.count_nonzero(~is_first))
        by_cell = np.where(is_first, -1, extra)[copies.copies]  # of each corner, −1 at first copies
        is_beside = (by_cell >= 0).any(axis=1)
        cells = copies.cells[is_beside]
        by_cell = by_cell[is_beside]

        # Unknowns at nodes are split; those within edges and cells are of solids that share a face.
        at_node = np.flatnonzero(~element.places.any(axis=1))
        numbers = np.arange(size).reshape(shape)
        corner_numbers = {offset: k for k, offset in enumerate(product((0, 1), repeat=len(shape)))}
        local = np.empty((len(element.local), len(cells)), int)
        diagonal = np.zeros(element.unknowns * size + len(at_node) * n_extra)
        of_parts = [np.sum(element.modes[rows] ** 2, axis=0) for rows in element.parts]
        for k, (unknown, offset) in enumerate(element.local):
            owners = np.roll(numbers, [-x for x in offset], axes).ravel()
            local[k] = unknown * size + owners[cells]
            if unknown in at_node:
                own = by_cell[:, corner_numbers[offset]]
                first = element.unknowns * size + int(np.searchsorted(at_node, unknown)) * n_extra
                local[k] = np.where(own >= 0, first + own, local[k])
            entries = sum(x[k] * c for x, c in zip(of_parts, coefficients, strict=True))
            entries = np.asarray(entries).ravel()
            there = unknown * size + owners
            there[cells] = local[k]
            np.add.at(diagonal, there, entries)
        places = np.concatenate([unknown * size + copies.places[~is_first] for unknown in at_node])
        regular = []
        for coefficient in coefficients:
            without = coefficient.copy()
            without.ravel()[cells] = 0.0
            regular.append(without)
        return cls(element, coefficients, cells, local, places, diagonal,
                   Operator(element, regular))  # fmt: skip

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the grid."""
        return self.coefficients[-1].shape

    def on_grid(self, packed: Array) -> Array:
        """Return the unknowns of the grid, (fields, unknowns of a cell, *grid), a view."""
        size = self.element.unknowns * self.coefficients[-1].size
        return packed[:, 0, :size].reshape(len(packed), self.element.unknowns, *self.shape)

    def apply(self, packed: Array) -> Array:
        """Return the nodal forces of packed fields, of their shape."""
        forces = np.zeros_like(packed)
        self.on_grid(forces)[:] = self.regular.apply(self.on_grid(packed))
        for k in range(len(packed)):
            modes = self.element.modes @ packed[k, 0][self.local]
            self._add(forces[k, 0], modes)
        return forces

    def load(self, mean_modes: Array) -> Array:
        """Return minus the nodal forces of uniform fields; see `Operator.load`."""
        forces = np.zeros((mean_modes.shape[1], 1, len(self.diagonal)))
        self.on_grid(forces)[:] = self.regular.load(mean_modes)
        for k in range(len(forces)):
            self._add(forces[k, 0], np.repeat(-mean_modes[:, [k]], len(self.cells), axis=1))
        return forces

    def _add(self, force: Array, modes: Array) -> None:
        """Add the nodal forces of modes, (modes, cells), of the cells at copies, in place."""
        weighted = np.empty_like(modes)
        for rows, coefficient in zip(self.element.parts, self.coefficients, strict=True):
            weighted[rows] = coefficient.ravel()[self.cells] * modes[rows]
        np.add.at(force, self.local, self.element.modes.T @ weighted)

    def precondition(self, inverse: FourierPreconditioner, packed: Array) -> Array:
        """Return the inverse for a grid without pores, plus that of the diagonal at split nodes.

        A node of the grid stands for all its copies. In pores the result is 0: it is the extension
        of least energy into them that is solved for.
        """
        size = self.element.unknowns * self.coefficients[-1].size
        on_grid = packed[:, :, :size].copy()
        result = np.zeros_like(packed)
        for k in range(len(packed)):
            np.add.at(on_grid[k, 0], self.places, packed[k, 0, size:])
        solved = inverse.apply(on_grid.reshape(self.on_grid(packed).shape))
        result[:, 0, :size] = solved.reshape(len(packed), size)
        result[:, 0, size:] = result[:, 0, self.places]
        split = np.concatenate([np.unique(self.places), np.arange(size, len(self.diagonal))])
        result[:, :, split] += packed[:, :, split] / self.diagonal[split]
        result[:, :, self.diagonal == 0] = 0.0
        return result

    def modes(self, packed: Array, mean_modes: Array) -> Iterator[SlabModes]:
        """Yield the modes of the cells at copies; see `modes_by_matrices`, whose bounds these are.

        Args:
            packed: Packed fields.
            mean_modes: Modes of the uniform field to add to each, shape (modes, fields).
        """
        magnitude = self.element.magnitude
        relative_error = (int((magnitude > 0).sum(axis=1).max()) + 16) * UNIT
        for start in range(0, len(self.cells), SLAB_CELLS):
            group = slice(start, start + SLAB_CELLS)
            local = np.moveaxis(packed[:, 0][:, self.local[:, group]], 0, 1)
            modes = np.tensordot(self.element.modes, local, axes=1)
            modes += mean_modes[:, :, np.newaxis]
            index = np.unravel_index(self.cells[group], self.shape)
            yield SlabModes(index, modes, magnitude, relative_error * abs(local))


@dataclass(frozen=True, eq=False)
class SideSolution:
    """Solution of one side of the bounds.

    Args:
        fields: Unknowns for each load, shape (loads, unknowns, *grid). Those of elements are of
            unit loads, of strains and stresses in Voigt order.
        bound: What they prove of the stiffness or conductivity, from above or from below in the
            Loewner order.
        beside_pores: Whether the fields are those of a method for pores.
        split: The grid of packed displacements or temperatures beside pores; else None.
    """

    fields: Fields
    bound: Array
    beside_pores: bool = False
    split: SplitGrid | None = None


def solve_beside_pores(
    element: Element,
    moduli: Sequence[Array],
    *,
    solver: ConjugateGradient,
    start: Array | None = None,
) -> SideSolution:
    """Return displacements or temperatures of nearly least energy beside pores.

    What solids do in common at an edge or a corner needs no energy: in space displacements and
    temperatures that differ on either side of a line, or of a point, are limits of continuous ones
    with the same energy, and a pore has none. So the copies of split nodes are free, and the energy
    is an upper bound as it is without pores.

    Args:
        element: Element of displacements or temperatures.
        moduli: Bulk modulus of each cell (in the plane K + G/3) and shear modulus, or the
            conductivity; finite, all 0 in pores and positive elsewhere.
        solver: Solver with its stopping rule.
        start: Packed fields to start from; those of another shape are not used.

    Returns:
        Packed fields under unit loads, with `split`, and what they prove.

    Raises:
        FailedError: The solver does not converge.
    """
    grid = SplitGrid.of_coefficients(element, moduli)
    solid = moduli[-1] > 0
    loads = solved_loads(element)
    modes = element.mean_modes(loads)
    constant = Reference.of_grid(element, [modulus[solid] for modulus in moduli])
    inverse = FourierPreconditioner.of_material(element, constant, grid.shape)
    pairs = zip(element.parts, moduli, strict=True)
    uniform = sum(modulus.sum() * np.sum(modes[rows] ** 2, axis=0) for rows, modulus in pairs)
    fields = finished_fields((len(loads), 1, len(grid.diagonal)), grid.shape)
    for k in range(len(loads)):
        this = slice(k, k + 1)
        system = System(
            operator=grid.apply,
            preconditioner=lambda x: grid.precondition(inverse, x),
            load=grid.load(modes[:, this]),
            # A porous cell is much softer than the mean of its phases. Both numbers are guesses, on
            # which accuracy alone depends: beside pores no bound of the spectrum is known.
            scale=0.1 * float(np.asarray(uniform)[k]),
            min_energy_ratio=0.03 * constant.min_energy_ratio([x[solid] for x in moduli]),
        )
        if start is not None and start.shape == fields.shape:
            system = replace(system, start=np.tensordot(loads[this], start, axes=1))
        fields[this] = solver.solve(system)
    to_unit_loads = np.linalg.inv(loads)
    for first in range(0, fields.shape[2], SLAB_CELLS):  # in place
        part = slice(first, first + SLAB_CELLS)
        fields[:, :, part] = np.tensordot(to_unit_loads, fields[:, :, part], axes=1)
    unit_modes = element.mean_modes(np.eye(len(loads)))
    regular = energies(element, grid.on_grid(fields), unit_modes, grid.regular.coefficients)
    beside = energies_of(
        element, grid.modes(fields, unit_modes), moduli, fields=len(loads), cells=solid.size
    )
    total = Energies(
        value=regular.value + beside.value,
        mode_errors=SAFETY * np.hypot(regular.mode_errors, beside.mode_errors),
        summed=max(regular.summed, beside.summed) + 2 * UNIT,
    )
    return SideSolution(fields, total.upper, beside_pores=True, split=grid)
