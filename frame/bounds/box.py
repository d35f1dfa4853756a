"""A box of a linear structure's inputs: models over it, and exact responses at points of it.

A box is pruned, of each input, of the end of its range that cannot hold a higher peak. The half or
quarter of an input's range that lies away from the best inputs found is bounded by the models at
hand. Where no bound there exceeds the peak, that end is pruned (domain reduction by probing:
Tawarmalani, Sahinidis 2002). What remains is narrower in many inputs at once, and the remainders of
models that are expanded anew there fall with the fourth power of the widths.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.frame import numbers
from alphacut.frame.bounds.level import LevelModels, OutputBounds
from alphacut.frame.bounds.node_bounds import response_and_gradient
from alphacut.frame.boxes import Boxes
from alphacut.frame.calculus.taylor_model import TaylorModel
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.dynamics.flow import LinearFlow
from alphacut.frame.dynamics.integrators import Exact
from alphacut.frame.modes.classical_modes import classical_modes
from alphacut.frame.modes.modes import Excitation, damped_modes
from alphacut.frame.modes.structure import (
    ClassicalStructure,
    CoupledModesError,
    PointModes,
    classical_structure,
    parameter_models,
)
from alphacut.frame.response.tables import Source
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
    def structure(self) -> ClassicalStructure | None:
        """The structure over the whole box; None if its undamped modes are coupled."""
        try:
            return over_box(self.system, self.names, self.low, self.high)
        except CoupledModesError:
            return None

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
        *,
        model_tolerance: Array | None = None,
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
            model_tolerance: Where the modes are damped ones, error that their polynomials may have
                in each of all outputs; infinite unless given.

        Raises:
            UnprovedError: No mode can be enclosed, or the structure is not known to oscillate and
                to be stable in the whole box. The attribute `along` is the index, among all n
                inputs, of the input whose bisection is most likely to help, or None.
        """
        try:
            structure = self.structure
            if structure is None:
                return self._damped_level(nodes, outputs, model_tolerance)
            structure = replace(
                structure,
                output_rows=structure.output_rows[outputs],
                output_factors=structure.output_factors[outputs],
                derivative_orders=structure.derivative_orders[outputs],
            )
            excitation = Excitation(self.time[nodes], sources(self.system, structure))
            modes = classical_modes(structure, excitation, truncation_tolerance)
            return LevelModels.from_modes(modes)
        except UnprovedError as refusal:
            if refusal.along is not None:  # counts the active inputs; made to count all
                refusal.along = int(self.active[refusal.along])
            raise

    def _damped_level(
        self, nodes: Ints | slice, outputs: Ints | slice, model_tolerance: Array | None
    ) -> LevelModels:
        """Return models by damped modes, as `level` does."""
        active = self.active
        names = tuple(self.names[i] for i in active)
        fixed = {name: float(x) for name, x in zip(self.names, self.midpoint, strict=True)}
        cuts = Boxes(
            names,
            np.zeros(1),
            lower=self.low[np.newaxis, active],
            upper=self.high[np.newaxis, active],
            nominal=self.midpoint[active],
        )
        step = float(self.time[1] - self.time[0])
        duration = float(self.time[-1])
        flow = LinearFlow(self.system, names, duration=duration, step=step, integrator=Exact())
        if model_tolerance is None:
            model_tolerance = np.full(len(flow.outputs), np.inf)
        modes = damped_modes(flow, cuts, fixed, model_tolerance)
        return LevelModels.from_modes(modes.at(nodes, outputs))

    def exact_values(self, unit: Array, node: Ints, output: Ints) -> Array:
        """Return one output at one time node for each of S points, exact but for rounding, (S,).

        The modes of equal points are found once for all their nodes and outputs; points are taken
        in chunks that limit the memory.

        Args:
            unit: Points, shape (S, d), S ≥ 1: coordinates in [−1, 1] of the d inputs of nonzero
                width.
            node: Index of the time node of each point, shape (S,).
            output: Index of the output of each point, shape (S,).

        Raises:
            UnprovedError: Modes are nearly defective, or turn too far within one sample interval of
                a load.
        """
        value = np.empty(len(unit))
        # Entries of the matrices of all points of a chunk: 3 MB, tuned to limit the memory.
        max_entries = 400_000
        # Equal points stand side by side, so that they come into one chunk.
        by_point = np.unique(unit, axis=0, return_inverse=True)[1].argsort()
        unknowns = self.midpoint_modes.sigma.shape[1]
        points_at_once = max(max_entries // unknowns**2, 1)
        for rows in np.array_split(by_point, -(-len(unit) // points_at_once)):
            points, point = np.unique(unit[rows], axis=0, return_inverse=True)
            value[rows] = self._modes(points).values(point, node[rows], output[rows], self.time)
        return value

    @cached_property
    def midpoint_modes(self) -> PointModes:
        """Modes at the midpoint of the box."""
        return self._modes(np.zeros((1, len(self.active))))

    def peak_over_time(self, unit: Array, between_nodes: Array) -> Array:
        """Return upper bounds of max |output| over time at one point, also between nodes, (m,).

        Rounding is not contained.

        Args:
            unit: The point, shape (d,): coordinates in [−1, 1] of the d inputs of nonzero width.
            between_nodes: Bounds of the distance of the outputs from a straight line in the step
                that ends at each of the T time nodes, shape (T, m).

        Raises:
            UnprovedError: Modes are nearly defective, or turn too far within one sample interval of
                a load.
        """
        modes = self._modes(unit[np.newaxis])
        magnitude = np.abs(modes.response(self.time)).T  # (m, T)
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
            error = modes.interpolation_error(time)
            bound = within_steps(np.abs(modes.response(time)).T, error.T)
            is_substep = np.diff(place, prepend=-1) == 1  # and no gap between divided steps
            peak = np.maximum(peak, bound[:, is_substep].max(axis=1))
        return peak

    def _modes(self, unit: Array) -> PointModes:
        """Return the modes at points with unit coordinates (S, d)."""
        return PointModes.of_system(self.system, self.names, self.inputs(unit))


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
    active = np.flatnonzero(high > low)
    radius = ((high - low) / 2)[active]
    fixed = dict(zip(names, midpoint, strict=True))
    return parameter_models(
        system, [names[i] for i in active], midpoint[active], radius, fixed=fixed
    )


def sources(system: LinearSystem, structure: ClassicalStructure) -> list[Source]:
    """Return what sets a structure with classical modes in motion, in the order of all arrays.

    They are "load" if the ground moves, then "force1", "force2", … of the distinct load histories,
    then "velocity" if some initial velocity may differ from zero in the box of the inputs, then
    "start" if some initial displacement may. A structure without any of them gives none.
    """
    displacements, velocities = structure.initial_state.magnitude()
    found = [Source.named(name, load) for name, load in histories(system).items()]
    if velocities.any():
        found.append(Source.named("velocity"))
    if displacements.any():
        found.append(Source.named("start"))
    return found


class PrunedBox(NamedTuple):
    """What remains of the box [−1, 1]^d for one peak, and bounds over what was pruned."""

    low: Array  # lower ends of what remains, (d,)
    high: Array  # upper ends
    upper: Array  # upper bounds at the given nodes over all that is pruned, (J,); −inf for nothing
    gap_fractions: Array  # fraction of the gap that each input accounts for, (d,)


def prune_ends(level: LevelModels, bounds: OutputBounds, above: Ints) -> PrunedBox:
    """Prune ends of the box [−1, 1]^d that hold no peak above the incumbent by more than the gap.

    For each input, bounds are computed over a quarter or a half of its range, at the end away from
    the best inputs found. Where the bound exceeds `bounds.attained`, the incumbent, by at most
    `bounds.wanted_gap` at every node, that end cannot hold a peak that is worth a search, and is
    pruned.

    Args:
        level: Models over the box.
        bounds: Bounds of one side of one output over the box. Not changed.
        above: Indices of the J ≥ 1 time nodes whose bounds exceed incumbent + gap, shape (J,).

    Returns:
        `low` and `high`, ends of what remains, shape (d,), −1 and 1 where nothing is pruned;
        `upper`, bounds over all that is pruned at the nodes `above`, shape (J,), −inf if that is
        nothing; and `gap_fractions`, the estimated fraction of the gap that each input accounts
        for, shape (d,).

    Raises:
        UnprovedError: Numbers of the models over a piece exceed the range of the dual function.
    """
    highest_node = int(above[bounds.upper[above].argmax()])
    best_inputs = bounds.model_inputs[highest_node]
    low = -np.ones_like(best_inputs)
    high = np.ones_like(best_inputs)
    pruned_upper = np.full(len(above), -np.inf)
    # The first pass bounds each end by one cell of the modes' ranges, which is cheap. The second
    # tries the ends that are left with many cells.
    for max_cells in (1, numbers.PRUNING_CELLS):
        for i in range(len(best_inputs)):
            if high[i] - low[i] < 2.0:  # pruned before
                continue
            prunes_upper_end = best_inputs[i] <= 0
            # A quarter of the range is tried first, and half of it if that can be pruned.
            for fraction in (0.25, 0.5):
                end = 1 - 2 * fraction if prunes_upper_end else 2 * fraction - 1
                piece_low = low.copy()
                piece_high = high.copy()
                if prunes_upper_end:
                    piece_low[i] = end
                else:
                    piece_high[i] = end
                piece = level.on_subbox(piece_low, piece_high)
                piece_upper = _bounds_over_piece(piece, bounds, above, max_cells=max_cells)
                if piece_upper.max() > bounds.attained + bounds.wanted_gap:
                    break
                pruned_upper = np.maximum(pruned_upper, piece_upper)
                if prunes_upper_end:
                    high[i] = end
                else:
                    low[i] = end
    gap_fractions = remainder_addition(bounds, highest_node).input_fractions
    return PrunedBox(low, high, pruned_upper, gap_fractions)


def _bounds_over_piece(
    piece: LevelModels, bounds: OutputBounds, above: Ints, *, max_cells: int
) -> Array:
    """Return upper bounds of one side of one output over a piece of the box, shape (J,).

    They begin at the bounds over the whole box, which hold there, too. Nodes are bounded in the
    order of these, the largest first, until one stays above `bounds.attained` +
    `bounds.wanted_gap`: then the piece cannot be pruned, and later nodes keep the bounds of the
    whole box.

    Args:
        piece: Models over the piece.
        bounds: Bounds over the whole box. Not changed.
        above: Indices of the time nodes, shape (J,).
        max_cells: Most ranges of the modes' frequencies and decays into which the piece is divided
            at a node.

    Raises:
        UnprovedError: Numbers of the models exceed the range of the dual function.
    """
    output, side = bounds.index
    inside = OutputBounds.initial(piece, output, side, bounds.wanted_gap, bounds.attained)
    inside.upper[:] = bounds.upper
    effort = inside.effort(max_cells, numbers.PRUNING_STEPS, slack_below_peak=1.0)
    for node in above[np.argsort(-bounds.upper[above])]:
        inside.improve(np.array([node]), effort)
        if inside.upper[node] > bounds.attained + bounds.wanted_gap:
            break
    return inside.upper[above]


class RemainderAddition(NamedTuple):
    """What the remainders of Taylor models add to a bound."""

    total: float  # lower estimate of the addition, in the unit of the output
    input_fractions: Array  # fraction of it that each input accounts for, (d,)


def remainder_addition(bounds: OutputBounds, node: int) -> RemainderAddition:
    """Estimate what Taylor remainders add to the bound at a node, and which inputs cause it.

    At the minimum of the dual function its multipliers are the slopes of the response by the
    variables z of the modes (frequency, decay, participation factors), and the bound contains Σ
    |slope_z| R_z with the remainders R_z of z as polynomials of the inputs. Remainders are of
    fourth degree in the inputs. Each R_z is distributed over the inputs in proportion to the
    squares of their coefficients of first and second degree in z.

    Args:
        bounds: Bounds of one side of one output over a box of d inputs, and the inputs at which the
            model is largest at each node.
        node: Index of the time node.

    Returns:
        `total`, a lower estimate of the addition in the unit of the output, with the constants of
        the bound; and `input_fractions`, the fraction that each input accounts for, shape (d,),
        which add up to 1, or are 0 if nothing is added.
    """
    data = bounds.data
    d = data.linear.shape[1]
    slope = np.zeros(len(data.linear))  # of the response by each intervening variable
    response_and_gradient(bounds.model_inputs[node], node, bounds.side, data, slope)

    # The quadratic coefficients are packed by rows i ≤ j; each counts for both of its inputs.
    upper_triangle = np.zeros((len(slope), d, d))
    row, column = np.triu_indices(d)
    upper_triangle[:, row, column] = np.abs(data.quadratic)
    of_inputs = np.abs(data.linear) + upper_triangle.sum(axis=1) + upper_triangle.sum(axis=2)
    weights = of_inputs**2

    by_variable = np.abs(slope) * data.remainder
    by_input = (by_variable / np.maximum(weights.sum(axis=1), 1e-300)) @ weights
    return RemainderAddition(
        total=float(bounds.constant[1, node] + by_variable.sum()),
        input_fractions=np.asarray(by_input / max(float(by_input.sum()), 1e-300)),
    )
