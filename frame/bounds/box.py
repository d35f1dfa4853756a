"""A box of a linear structure's inputs: models over it, and exact responses at points of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.frame.bounds.level import LevelModels
from alphacut.frame.calculus.taylor_model import TaylorModel
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.modes.intervening import Excitation
from alphacut.frame.modes.structure import ClassicalStructure, classical_structure
from alphacut.frame.modes.superposition import (
    PointModes,
    RoundedValues,
    load_at_nodes,
    modes_at,
    outputs_at,
)
from alphacut.frame.records.history import History
from alphacut.frame.response.oscillators import Grid, Oscillators
from alphacut.frame.result import within_steps
from alphacut.frame.structures.linear import LinearSystem, histories


@dataclass(frozen=True, eq=False)
class Box:
    """Box of the n inputs of a structure, d of which have a width; T time nodes, m outputs.

    Unit coordinates are those of these d inputs, within [−1, 1].
    """

    system: LinearSystem  # the structure
    names: tuple[str, ...]  # its inputs, n of them
    time: Array  # nodes, (T,), in s
    low: Array  # lower ends, (n,), in SI units
    high: Array  # upper ends, (n,), in SI units

    @property
    def active(self) -> Ints:
        """Indices of the inputs that have a width, shape (d,)."""
        return np.flatnonzero(self.high > self.low)

    @property
    def midpoint(self) -> Array:
        """Midpoints of all inputs, shape (n,)."""
        return np.asarray((self.low + self.high) / 2)

    @cached_property
    def loads(self) -> dict[str, History]:
        """Histories of all loads by name."""
        return histories(self.system)

    @cached_property
    def structure(self) -> ClassicalStructure:
        """The structure over the whole box."""
        return over_box(self.system, self.names, self.low, self.high)

    def inputs(self, unit: Array) -> Array:
        """Return the inputs (…, n) in SI units for unit coordinates (…, d); never outside."""
        points = np.tile(self.midpoint, (*unit.shape[:-1], 1))
        radius = ((self.high - self.low) / 2)[self.active]
        points[..., self.active] += radius * unit
        return np.clip(points, self.low, self.high)

    def level(
        self,
        nodes: Ints | slice = slice(None),
        truncation_tolerance: Array | None = None,
        outputs: Ints | slice = slice(None),
    ) -> LevelModels:
        """Return models of the response over the box, with tables of its modes' responses.

        Args:
            nodes: Indices of the time nodes that the models are for, rising, shape (nodes,), or a
                slice of them; all unless given.
            truncation_tolerance: Allowed error of each selected output by modes that are not
                enclosed one by one, shape (m,), in its unit. As many modes as possible are enclosed
                unless it is given.
            outputs: Indices of the outputs that are selected, shape (m,), or a slice; all unless
                given.

        Raises:
            UnprovedError: Dashpots couple the modes, or another reason that `over_box` names; no
                mode can be enclosed; or the structure is not known to oscillate and to be stable in
                the whole box. The attribute `along` is the index, among all n inputs, of the input
                whose bisection is most likely to help, or None.
        """
        try:
            whole = self.structure
            structure = replace(
                whole,
                output_rows=whole.output_rows[outputs],
                output_factors=whole.output_factors[outputs],
                derivative_orders=whole.derivative_orders[outputs],
            )
            excitation = Excitation(self.loads, self.time[nodes], sources(self.system, structure))
            return LevelModels.from_structure(structure, excitation, truncation_tolerance)
        except UnprovedError as refusal:
            if refusal.along is not None:  # counts the active inputs; made to count all
                refusal.along = int(self.active[refusal.along])
            raise

    def exact_values(self, unit: Array, node: Ints, output: Ints) -> RoundedValues:
        """Return one output at one time node for each of S points, exact but for rounding.

        The modes of equal points are found once for all their nodes and outputs; points are taken
        in chunks that limit the memory.

        Args:
            unit: Points, shape (S, d), S ≥ 1: coordinates in [−1, 1] of the d inputs of nonzero
                width.
            node: Index of the time node of each point, shape (S,).
            output: Index of the output of each point, shape (S,).

        Returns:
            `value`, shape (S,), in the units of the outputs, and `error`, shape (S,), a bound of
            its rounding.

        Raises:
            UnprovedError: A mode does not oscillate at one of the points, or turns too far within
                one sample interval of a load.
        """
        value = np.empty(len(unit))
        error = np.empty(len(unit))
        # Entries of the matrices of all points of a chunk: 3 MB, tuned to limit the memory.
        max_entries = 400_000
        # Equal points stand side by side, so that they come into one chunk.
        by_point = np.unique(unit, axis=0, return_inverse=True)[1].argsort()
        points_at_once = max(max_entries // self.structure.unknowns**2, 1)
        for rows in np.array_split(by_point, -(-len(unit) // points_at_once)):
            points, point = np.unique(unit[rows], axis=0, return_inverse=True)
            modes = self._modes(points)
            nodes = node[rows]
            loads = {
                name: load_at_nodes(modes.sigma[point], load, self.time, nodes)
                for name, load in self.loads.items()
            }
            found = outputs_at(modes, point, output[rows], self.time[nodes], loads)
            value[rows] = found.value
            error[rows] = found.error
        return RoundedValues(value, error)

    @cached_property
    def midpoint_modes(self) -> PointModes:
        """Modes at the midpoint of the box."""
        return self._modes(np.zeros((1, len(self.active))))

    def midpoint_response(self, outputs: Ints | slice = slice(None)) -> RoundedValues:
        """Return outputs at the midpoint of the box at all time nodes, exact but for rounding.

        Args:
            outputs: Indices of the outputs, shape (m,), m ≥ 1, or a slice; all unless given.

        Returns:
            `value`, shape (T, m) for T time nodes, in the units of the outputs, and `error` of the
            same shape, a bound of its rounding.

        Raises:
            UnprovedError: A mode does not oscillate at the midpoint, or turns too far within one
                sample interval of a load.
        """
        sigma = self.midpoint_modes.sigma[0]
        point = np.zeros(len(self.time), int)
        loads = {name: load_at_nodes(sigma, x, self.time) for name, x in self.loads.items()}
        columns = [
            outputs_at(self.midpoint_modes, point, np.full_like(point, output), self.time, loads)
            for output in self._output_numbers(outputs)
        ]
        value = np.stack([column.value for column in columns], axis=-1)
        error = np.stack([column.error for column in columns], axis=-1)
        return RoundedValues(value, error)

    def peak_over_time(
        self, unit: Array, between_nodes: Array, outputs: Ints | slice = slice(None)
    ) -> Array:
        """Return upper bounds of max |output| over time at one point, also between nodes, (m,).

        Rounding is contained at the nodes; within time steps, the rounding of the modes is not.

        Args:
            unit: The point, shape (d,): coordinates in [−1, 1] of the d inputs of nonzero width.
            between_nodes: Bounds of the distance of these outputs from a straight line in the step
                that ends at each of the T time nodes, shape (T, m).
            outputs: Indices of the outputs, shape (m,), m ≥ 1, or a slice; all unless given.

        Raises:
            UnprovedError: A mode does not oscillate at the point, or turns too far within one
                sample interval of a load.
        """
        point = self.inputs(unit)
        at_point = replace(self, low=point, high=point)
        magnitude = at_point._midpoint_magnitude(outputs)  # at the nodes, (m, T)
        peak = magnitude.max(axis=1)
        # Only steps whose bound exceeds the peak at nodes matter. They are divided: the distance
        # from a straight line falls with the square of the number of substeps.
        is_above = within_steps(magnitude, between_nodes.T) > peak[:, np.newaxis]
        first_nodes = np.flatnonzero(is_above.any(axis=0)) - 1  # column j: the step to node j
        if len(first_nodes):
            substeps = 4
            # times of the divided steps, counted in substeps from the first node on
            place = np.unique(substeps * first_nodes[:, np.newaxis] + np.arange(substeps + 1))
            time = np.interp(place / substeps, np.arange(len(self.time)), self.time)
            finer = replace(at_point, time=time)
            error = finer.midpoint_interpolation_error(outputs)
            bound = within_steps(finer._midpoint_magnitude(outputs), error.T)
            is_substep = np.diff(place, prepend=-1) == 1  # and no gap between divided steps
            peak = np.maximum(peak, bound[:, is_substep].max(axis=1))
        return peak

    def _midpoint_magnitude(self, outputs: Ints | slice) -> Array:
        """Return upper bounds of |output| at the midpoint and at nodes, shape (m, T)."""
        found = self.midpoint_response(outputs)
        return np.asarray((np.abs(found.value) + found.error).T)

    def midpoint_interpolation_error(self, outputs: Ints | slice = slice(None)) -> Array:
        """Bound how far midpoint outputs lie from a straight line within each time step.

        A response is at most the sum over modes of |output coefficient| |participation factor|
        times that of an oscillator of unit participation, so the distances of the oscillators are
        added with these weights. The rounding of modes and weights is not contained.

        Args:
            outputs: Indices of the outputs, shape (m,), or a slice; all unless given.

        Returns:
            Shape (T, m) for T time nodes; row j belongs to the step that ends at node j, and row 0
            is 0.

        Raises:
            UnprovedError: A mode does not oscillate, or turns too far within one sample interval of
                a load.
        """
        modes = self.midpoint_modes
        numbers = self._output_numbers(outputs)
        orders = [int(order) for order in self.structure.derivative_orders[numbers]]
        error = np.zeros((len(self.time), len(numbers)))
        coefficients = modes.output_coefficients(np.zeros_like(numbers), numbers).value
        for k, sigma in enumerate(modes.sigma[0]):
            # a grid of one point: this mode alone
            grid = Grid(np.array([sigma.imag]), np.array([-sigma.real / sigma.imag]))
            oscillator = Oscillators(grid, self.loads, self.time, set(orders))
            for source, participation in modes.participation.items():
                responses = {order: oscillator.responses(source, order) for order in set(orders)}
                for o, order in enumerate(orders):
                    of_mode = np.abs(coefficients[o, k]) * abs(participation.value[0, k])
                    error[:, o] += of_mode * responses[order].line_deviation
        return error

    def _output_numbers(self, outputs: Ints | slice) -> Ints:
        """Return the numbers of the outputs, shape (m,)."""
        return np.arange(len(self.structure.derivative_orders))[outputs]

    def _modes(self, unit: Array) -> PointModes:
        """Return the modes at points with unit coordinates (S, d)."""
        return modes_at(self.system, self.structure, self.names, self.inputs(unit), unit)


def over_box(
    system: LinearSystem, names: Sequence[str], low: Array, high: Array
) -> ClassicalStructure:
    """Return a structure as Taylor models of its inputs of nonzero width.

    A Taylor model is a polynomial over the unit box [−1, 1]^d with a bound of what it leaves out.
    Here d is the number of these inputs, in the order of `names`. Inputs without a width, and all
    other parameters of the structure, enter as constants.

    Args:
        system: The structure.
        names: Names of its inputs, n of them.
        low: Lower ends of the inputs, shape (n,), in SI units.
        high: Upper ends, shape (n,); none may be below its lower end.

    Returns:
        Mass, stiffness, damping, initial state and output rows as Taylor models of d inputs.

    Raises:
        UnprovedError: Dashpots couple the modes, an output row depends on inputs or mixes
            displacements and velocities, or a matrix that is inverted may be singular in the box.
        ValueError: `names` and the ends differ in length.
    """
    return classical_structure(system, parameters_over_box(system, names, low, high))


def parameters_over_box(
    system: LinearSystem, names: Sequence[str], low: Array, high: Array
) -> dict[str, TaylorModel]:
    """Return all parameters of a structure by name, as scalar Taylor models as of `over_box`."""
    midpoint = (low + high) / 2
    radius = (high - low) / 2
    active = np.flatnonzero(high > low)
    variables = TaylorModel.variables(midpoint[active], radius[active])
    values = dict(system.parameters)
    for name, value in zip(names, midpoint, strict=True):
        values[name] = float(value)
    parameters = {name: TaylorModel.constant(x, len(active)) for name, x in values.items()}
    for column, i in enumerate(active):
        parameters[names[int(i)]] = variables[column]
    return parameters


def sources(system: LinearSystem, structure: ClassicalStructure) -> tuple[str, ...]:
    """Return the names of what sets a structure in motion, in the order of all arrays over sources.

    They are "load" if the ground moves, then "force1", "force2", … of the distinct load histories,
    then "velocity" if some initial velocity may differ from zero in the box of the inputs, then
    "start" if some initial displacement may. A structure without any of them gives ().
    """
    displacements, velocities = structure.initial_state.magnitude()
    names = list(histories(system))
    if velocities.any():
        names.append("velocity")
    if displacements.any():
        names.append("start")
    return tuple(names)
