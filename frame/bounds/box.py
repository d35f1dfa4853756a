"""A box of a linear structure's inputs: models over it, and exact motions at points of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.frame.bounds.level import LevelModels
from alphacut.frame.calculus.taylor_model import TaylorModel
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.envelope import within_steps
from alphacut.frame.modes.structure import Classical, classical_structure
from alphacut.frame.modes.superposition import Modal, load_at_nodes, modes_at, outputs_at
from alphacut.frame.records.history import History
from alphacut.frame.response.oscillators import Grid, Oscillators
from alphacut.frame.structures.linear import LinearSystem, histories

MAX_ENTRIES = 400_000
"""Entries of the matrices of all points whose exact motions are computed together."""
SUBSTEPS = 4
"""Parts of a step at whose ends the peak of one motion is read; what lies between falls with its
square."""


@dataclass(frozen=True, eq=False)
class Box:
    """Inputs of a structure between two ends, d of which have a width.

    Unit coordinates are those of these d inputs, within [−1, 1].
    """

    system: LinearSystem  # the structure
    names: tuple[str, ...]  # its inputs, n of them
    time: Array  # nodes, (T,), in s
    low: Array  # lower ends, (n,), in SI units
    high: Array  # upper ends

    @property
    def active(self) -> Ints:
        """Indices of the inputs that have a width, shape (d,)."""
        return np.flatnonzero(self.high > self.low)

    @property
    def centre(self) -> Array:
        """Middle of all inputs, shape (n,)."""
        return np.asarray((self.low + self.high) / 2)

    @cached_property
    def loads(self) -> dict[str, History]:
        """Histories of all loads by name."""
        return histories(self.system)

    @cached_property
    def structure(self) -> Classical:
        """The structure over the whole box."""
        return over_box(self.system, self.names, self.low, self.high)

    def inputs(self, unit: Array) -> Array:
        """Inputs (…, n) in SI units for unit coordinates (…, d)."""
        points = np.tile(self.centre, (*unit.shape[:-1], 1))
        points[..., self.active] += ((self.high - self.low) / 2)[self.active] * unit
        return np.clip(points, self.low, self.high)

    def level(
        self,
        nodes: Ints | slice = slice(None),
        allowed: Array | None = None,
        outputs: Ints | slice = slice(None),
    ) -> LevelModels:
        """Models over the box of the motion of `outputs` at `nodes`, both all unless given.

        `allowed` is the truncation error of each output that is allowed, (m,).

        Raises:
            UnprovedError: No mode of the structure can be enclosed.
        """
        try:
            whole = self.structure
            rows, factor, order = whole.rows[outputs], whole.factor[outputs], whole.order[outputs]
            structure = replace(whole, rows=rows, factor=factor, order=order)
            excitation = self.loads, self.time[nodes], sources(self.system, structure)
            return LevelModels.from_structure(structure, excitation, allowed)
        except UnprovedError as refusal:
            if refusal.along is not None:  # of the active inputs; made one of all
                refusal.along = int(self.active[refusal.along])
            raise

    def reached(self, unit: Array, node: Ints, output: Ints) -> tuple[Array, Array]:
        """Exact values of one output at one node for each of S points, and their rounding, (S,).

        Points are unit coordinates (S, d); modes are found once for all nodes of a point, about.
        """
        values_and_errors = np.empty((2, len(unit)))
        by_point = np.unique(unit, axis=0, return_inverse=True)[1].argsort()
        count = max(MAX_ENTRIES // len(self.structure.pattern) ** 2, 1)
        for rows in np.array_split(by_point, -(-len(unit) // count)):
            points, point = np.unique(unit[rows], axis=0, return_inverse=True)
            modal, nodes = self._modal(points), node[rows]
            loads = {
                name: load_at_nodes(modal.sigma[point], load, self.time, nodes)
                for name, load in self.loads.items()
            }
            values_and_errors[:, rows] = outputs_at(
                modal, point, output[rows], self.time[nodes], loads
            )
        return values_and_errors[0], values_and_errors[1]

    @cached_property
    def centre_modes(self) -> Modal:
        """Modes in the middle of the box."""
        return self._modal(np.zeros((1, len(self.active))))

    def centre_motion(self, outputs: Ints | slice = slice(None)) -> tuple[Array, Array]:
        """Exact outputs in the middle of the box and bounds of their rounding, (T, m) each.

        Outputs are those of some numbers (m,), all unless given.
        """
        sigma, point = self.centre_modes.sigma[0], np.zeros(len(self.time), int)
        loads = {name: load_at_nodes(sigma, x, self.time) for name, x in self.loads.items()}
        columns = [
            outputs_at(self.centre_modes, point, np.full_like(point, output), self.time, loads)
            for output in np.arange(len(self.structure.order))[outputs]
        ]
        value, error = (np.stack(column, -1) for column in zip(*columns, strict=True))
        return value, error

    def peak_over_time(
        self, unit: Array, between: Array, outputs: Ints | slice = slice(None)
    ) -> Array:
        """Upper bound of outputs' magnitudes, (m,), at one point (d,), between nodes too.

        `between` (T, m) bounds how far these outputs stray from straight lines in each step.
        """
        point = self.inputs(unit)
        motion = replace(self, low=point, high=point)
        size = motion._centre_size(outputs)
        peak = size.max(1)
        # steps that may hold more than the nodes are divided
        steps = np.flatnonzero((within_steps(size, between.T) > peak[:, None]).any(0)) - 1
        if len(steps):
            place = np.unique(SUBSTEPS * steps[:, None] + np.arange(SUBSTEPS + 1))
            time = np.interp(place / SUBSTEPS, np.arange(len(self.time)), self.time)
            finer = replace(motion, time=time)
            bound = within_steps(finer._centre_size(outputs), finer.centre_straying(outputs).T)
            is_divided = np.diff(place, prepend=-1) == 1  # no gap between divided steps
            peak = np.maximum(peak, bound[:, is_divided].max(1))
        return peak

    def _centre_size(self, outputs: Ints | slice) -> Array:
        """Upper bounds of outputs' magnitudes in the middle at nodes, (m, T)."""
        value, error = self.centre_motion(outputs)
        return (np.abs(value) + error).T

    def centre_straying(self, outputs: Ints | slice = slice(None)) -> Array:
        """Bound of how far that motion strays from straight lines in the step to a node, (T, m)."""
        modal, outputs = self.centre_modes, np.arange(len(self.structure.order))[outputs]
        orders = [int(order) for order in self.structure.order[outputs]]
        deviation = np.zeros((len(self.time), len(outputs)))
        read = np.abs(modal.output_coefficients(np.zeros_like(outputs), outputs)[0])
        for k, sigma in enumerate(modal.sigma[0]):
            grid = Grid(np.array([sigma.imag]), np.array([-sigma.real / sigma.imag]))
            oscillator = Oscillators(grid, self.loads, self.time, set(orders))
            for source, share in modal.share.items():
                waves = {order: oscillator.responses(source, order) for order in set(orders)}
                for o, order in enumerate(orders):
                    deviation[:, o] += read[o, k] * abs(share[0, k]) * waves[order].line_deviation
        return deviation

    def _modal(self, unit: Array) -> Modal:
        return modes_at(self.system, self.structure, self.names, self.inputs(unit), unit)


def over_box(system: LinearSystem, names: Sequence[str], low: Array, high: Array) -> Classical:
    """The structure as Taylor models in those inputs `names` whose `low` is below `high`."""
    active, centre, radius = np.flatnonzero(high > low), (low + high) / 2, (high - low) / 2
    inputs, d = TaylorModel.variables(centre[active], radius[active]), len(active)
    centres = {name: float(x) for name, x in zip(names, centre, strict=True)}
    values = {**system.parameters, **centres}
    parameters = {name: TaylorModel.constant(x, d) for name, x in values.items()}
    parameters |= {names[int(i)]: inputs[column] for column, i in enumerate(active)}
    return classical_structure(system, parameters)


def sources(system: LinearSystem, structure: Classical) -> tuple[str, ...]:
    """Names of what moves the structure: loads, velocity, start."""
    moved = np.asarray(structure.start.magnitude().any(-1))
    at_start = [name for name, k in (("velocity", 1), ("start", 0)) if moved[k]]
    return (*histories(system), *at_start)
