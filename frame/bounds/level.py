"""Models of the response over one level of a box, and bounds of each output and side at all nodes.

A side of an output q is −q (number 0) or q (number 1); bounds are upper bounds of side × q.

A least peak is a lower bound of the smallest peak over a box: "must the limit be exceeded?". A peak
is the largest |output| over time, and its smallest value over the box is at least

    min over cells of max over nodes t of min over u in the cell of ± output(t; u),

where the cells are ranges of the modes' frequencies and damping that cover those of the box. The
last minimum is bounded from below by the dual function, with the modes' tables read over the cell
alone: models are not made anew, and participation factors keep their ranges over the box.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.base.kernels import compiled
from alphacut.base.progress_bar import Progress
from alphacut.frame import numbers
from alphacut.frame.bounds.dual_function import DualFunctionData, minimise, require_in_range
from alphacut.frame.bounds.node_bounds import Cells, Effort, bound_nodes, halve_cell
from alphacut.frame.calculus.polynomials import monomials
from alphacut.frame.calculus.taylor_model import TaylorModel, concatenate
from alphacut.frame.modes.modes import Modes, Oscillator
from alphacut.frame.numbers import LEAST_PEAK_NODES, LEAST_PEAK_PATIENCE, LEAST_PEAK_STEPS
from alphacut.frame.response.chord_deviation import Grid
from alphacut.frame.response.tables import (
    Oscillators,
    grid_over,
    intervals,
)


class ResponseTable(NamedTuple):
    """Responses of K oscillators to all sources, in one derivative of the displacement."""

    value: Array  # responses at the points of each mode's grid, (K, sources, T, Q W)
    max_magnitude: Array  # their largest magnitudes, (K, sources)
    error: Array  # bounds of the error of bilinear interpolation, (K, sources, T)
    # bounds of their distance from straight lines between time nodes, (K, sources, T)
    interpolation_error: Array


def response_tables(
    grids: Sequence[Grid], modes: Modes, orders: Sequence[int]
) -> dict[int, ResponseTable]:
    """Return tables of the responses of K oscillators on grids, by the order of the derivative.

    Args:
        grids: Grid over the frequency ω and the quotient q = decay/ω of each oscillator, at least
            one; all have the same numbers of points.
        modes: T time nodes and the sources, at least one.
        orders: Derivatives by time of the displacements (0, 1, 2) that outputs take, each once.

    Returns:
        For each order: `value`, responses at the grids' points, shape (K, sources, T, points) with
        ω running fastest; `max_magnitude`, shape (K, sources); `error`, bounds of the error of
        bilinear interpolation, and `interpolation_error`, bounds of the distance
        from a straight line in the step before each node, shape (K, sources, T) each.

    Raises:
        UnprovedError: A response is not finite or above 1e100, or an oscillator turns too far
            within a sample interval of a load.
    """
    time = modes.time
    by_order = {order: list[list[Array]]() for order in orders}
    for grid in grids:
        oscillators = Oscillators(grid, time, orders)
        for order, of_order in by_order.items():
            responses = [oscillators.responses(x, order) for x in modes.sources]
            value = np.array([x.value.reshape(len(time), -1) for x in responses])
            error = np.array([x.error for x in responses])
            deviation = np.array([oscillators.line_deviation(x, order) for x in modes.sources])
            of_order.append([value, np.abs(value).max(axis=(-2, -1)), error, deviation])
    tables = {}
    for order, of_order in by_order.items():
        tables[order] = ResponseTable(*map(np.stack, zip(*of_order, strict=True)))
        require_in_range({"table": tables[order].max_magnitude})
    return tables


def _table_points(oscillators: Sequence[Oscillator], time: Array) -> tuple[int, int]:
    """Return the numbers of table points along ω and along q = g/ω, the same for all modes.

    More points make the interpolation error of the tables smaller, with the square of their
    distance, and the dual function slower in proportion to their number. So 9 to 81 points are
    taken along ω and 4 to 13 along q, as many as the most demanding mode asks for; these limits are
    tuned.

    Args:
        oscillators: Modes with their ranges of ω, in rad/s, and of q.
        time: Time nodes, shape (T,), in s.
    """
    asked = []
    for mode in oscillators:
        ends = mode.omega_range, mode.quotient_range
        asked.append(intervals(*ends, time, fraction=numbers.TABLE_SPACING))
    along_omega, along_q = np.max(asked, axis=0)
    return int(np.clip(along_omega, 8, 80)) + 1, int(np.clip(along_q, 3, 12)) + 1


@dataclass(frozen=True, eq=False)
class LevelModels:
    """Models of the response over the box of one level, and response tables."""

    modes: Modes  # the response over the box
    grids: list[Grid]  # points of the tables of each oscillator
    tables: dict[int, ResponseTable]  # responses of the oscillators, by order of derivative

    def on_subbox(self, low: Array, high: Array) -> LevelModels:
        """Return the models over the sub-box low ≤ u ≤ high, with the same response tables."""
        return replace(self, modes=self.modes.on_subbox(low, high))

    @classmethod
    def from_modes(cls, modes: Modes) -> LevelModels:
        """Return modes over a box, at least one, with tables of the responses of their oscillators.

        Raises:
            UnprovedError: A response is out of the range of the tables.
        """
        points = _table_points(modes.oscillators, modes.time)
        grids = [
            grid_over(mode.omega_range, mode.quotient_range, points) for mode in modes.oscillators
        ]
        distinct_orders = [int(order) for order in np.unique(modes.orders)]
        return cls(modes, grids, response_tables(grids, modes, distinct_orders))

    def interpolation_error(self) -> Array:
        """Bound the distance of outputs from a straight line within each time step, shape (T, m).

        Row j belongs to the step that ends at node j. All is in the units of the outputs and holds
        for every input of the box.
        """
        deviations = {order: table.interpolation_error for order, table in self.tables.items()}
        return self.modes.with_deviations(deviations)


@dataclass(eq=False)
class OutputBounds:
    """Bounds of side × one output at all T nodes, over a box of d inputs."""

    index: tuple[int, int]  # number of the output in the models of the level, and of the side
    wanted_gap: float  # distance of bound and attained value that suffices
    attained: float  # largest value of side × output over time that is known to be attained
    # constants (2, T): what the response has besides the model `data`, and what an upper bound
    # adds to that for everything that is bounded by magnitude
    constant: Array
    data: DualFunctionData  # models and tables of the output
    upper: Array  # guaranteed upper bounds of side × output, (T,)
    model_value: Array  # largest values of the model that are known, not guaranteed, (T,)
    model_inputs: Array  # unit coordinates at which the model has these values, (T, d)

    @classmethod
    def initial(
        cls, level: LevelModels, output: int, side: int, wanted_gap: float, attained: float = 0.0
    ) -> OutputBounds:
        """Return bounds of one side of one output over a box that are infinite at all T time nodes.

        Args:
            level: Models of the response over the box.
            output: Index of the output in these models.
            side: 0 for −output, 1 for output.
            wanted_gap: Distance of bound and attained value that suffices, in the unit of the
                output.
            attained: Largest value of side × output over time that some trajectory is known to
                attain.

        Raises:
            UnprovedError: A number of the models exceeds the range of the dual function.
        """
        data, constant = _dual_function_data(level, output, (-1.0, 1.0)[side])
        nodes = constant.shape[1]
        return cls(
            index=(output, side),
            wanted_gap=wanted_gap,
            attained=attained,
            constant=constant,
            data=data,
            upper=np.full(nodes, np.inf),
            model_value=np.full(nodes, -1e300),  # for −∞, which kernels could not subtract
            model_inputs=np.zeros((nodes, data.linear.shape[1])),
        )

    @property
    def side(self) -> float:
        """−1 or 1."""
        return (-1.0, 1.0)[self.index[1]]

    def open_nodes(self, slack_below_peak: float) -> Ints:
        """Return nodes (J,) whose bound exceeds the model value by too much; see `Effort`."""
        peak = max(self.model_value.max(), self.attained)
        sufficient = (1 - slack_below_peak) * self.model_value + slack_below_peak * peak
        return np.flatnonzero(self.upper - self.wanted_gap > sufficient)

    def effort(
        self, cells: int, steps: int, slack_below_peak: float = 0.0, remainder_multiple: float = 0.0
    ) -> Effort:
        """Return the effort for the bound at one time node.

        Args:
            cells: Most cells, ranges of the modes' frequencies and decays, that are bounded.
            steps: Most evaluations of the dual function for a cell.
            slack_below_peak: Addition to the wanted gap of a node, as a fraction of the distance of
                its model value from the largest attained value; at 1 only bounds above the peak
                count.
            remainder_multiple: Smallest gap worth any effort, as a multiple of what the remainders
                of the Taylor models add to the bound.
        """
        return Effort(
            cells=cells,
            steps=steps,
            slack_below_peak=slack_below_peak,
            remainder_multiple=remainder_multiple,
            wanted_gap=self.wanted_gap,
            incumbent=float(max(self.model_value.max(), self.attained)),
            ascents=numbers.ASCENTS,
        )

    def improve(self, nodes: Ints, effort: Effort) -> None:
        """Lower the bounds and raise the model values at some time nodes, in place.

        Bounds never rise and model values never fall, so that any number of calls is valid. Entries
        at other nodes are neither read nor written: threads may improve different nodes at once.

        Args:
            nodes: Indices of the nodes, rising, shape (J,). Each begins at the multipliers of the
                one before.
            effort: Limits of the work for a node, and the gap that suffices.
        """
        upper_and_value = np.empty((2, len(nodes)))
        inputs = np.empty((len(nodes), self.model_inputs.shape[1]))
        bound_nodes(nodes, self.side, effort, self.constant, self.data, upper_and_value, inputs)
        new_upper, new_value = upper_and_value
        is_better = new_value > self.model_value[nodes]
        self.model_inputs[nodes[is_better]] = inputs[is_better]
        self.model_value[nodes] = np.maximum(self.model_value[nodes], new_value)
        self.upper[nodes] = np.minimum(self.upper[nodes], new_upper)

    def improve_peak(self, nodes: Ints, effort: Effort) -> None:
        """Lower the largest of the bounds at some time nodes, in place, with few of the nodes.

        Nodes are improved one by one from the highest bound down, until the next bound is not above
        the highest of those that are improved: the other nodes would not lower the largest bound.
        Without nodes nothing happens.

        Args:
            nodes: Indices of the nodes, shape (J,).
            effort: Limits of the work for a node, and the gap that suffices.
        """
        peak = -np.inf
        for node in nodes[np.argsort(-self.upper[nodes], kind="stable")]:
            if self.upper[node] <= peak:
                break
            self.improve(np.array([node]), effort)
            peak = max(peak, float(self.upper[node]))


def improve_all(
    jobs: Sequence[tuple[OutputBounds, Ints, Effort]],
    pool: Executor,
    tick: Progress,
    *,
    peaks_alone: bool = False,
) -> None:
    """Improve guaranteed bounds at time nodes by threads, in place.

    Each job is the bounds of one side of one output, the indices of the nodes at which they are
    improved, shape (J,), rising, and the effort for a node. Efforts are fixed beforehand, so that
    no bound depends on which thread ends first. Jobs without nodes are skipped.

    Args:
        jobs: The jobs; two of the same bounds must have different nodes.
        pool: Runs the tasks.
        tick: Called after each task with the completed fraction, up to 1; never without tasks. An
            exception of a task, or of `tick`, leaves this function; tasks already given to the pool
            are not cancelled.
        peaks_alone: Whether only the highest bound of each job is to fall: nodes are improved from
            the highest bound down until none is above those that are done.
    """
    futures = []
    for bounds, nodes, effort in jobs:
        if not len(nodes):
            continue
        if peaks_alone:
            futures.append(pool.submit(bounds.improve_peak, nodes, effort))
            continue
        # In a block each node begins at the multipliers of the one before. About 40 nodes make few
        # blocks begin anew, and still keep all threads busy.
        for block in np.array_split(nodes, -(-len(nodes) // 40)):
            futures.append(pool.submit(bounds.improve, block, effort))
    for done, future in enumerate(futures, start=1):
        future.result()
        tick(done / len(futures))


def _dual_function_data(
    level: LevelModels, output: int, side: float
) -> tuple[DualFunctionData, Array]:
    """Return the models and tables of one side of an output, and the constants of its bounds.

    The intervening variables of K modes, each ω, g and one participation factor for each source,
    are scaled to z = (variable − midpoint) / radius, which lies in [−1, 1] over the box.

    Returns:
        `DualFunctionData`, and the constants (2, T) of `OutputBounds.constant`.
    """
    modes = level.modes.oscillators
    table = level.tables[int(level.modes.orders[output])]
    variables = concatenate(
        [
            x
            for mode in modes
            for x in (mode.omega[None], mode.decay[None], mode.participation[:, output])
        ],
        -1,
    )
    # The lower limits keep variables finite that do not vary over the box.
    radius = np.maximum(variables.deviation(), 1e-9 * np.abs(variables.value))
    radius = np.maximum(radius, 1e-30)
    scaled = _scaled(variables, radius)
    expected_cubic = numbers.EXPECTED_CUBIC * np.asarray(np.abs(scaled.cubic).sum(axis=1))
    midpoints = variables.value.reshape(len(modes), -1)
    radii = radius.reshape(len(modes), -1)
    grids = level.grids
    omega = np.stack([np.tile(grid.omega, len(grid.quotient)) for grid in grids])
    decay = np.stack([np.outer(grid.quotient, grid.omega).ravel() for grid in grids])
    first_points = np.array([[grid.omega[0], grid.quotient[0]] for grid in grids])
    second_points = np.array([[grid.omega[1], grid.quotient[1]] for grid in grids])
    cells = [mode.table_cell(grid) for mode, grid in zip(modes, grids, strict=True)]
    participations = np.array([np.abs(mode.participation.value[:, output]) for mode in modes])
    response_scale = float((participations * table.max_magnitude).sum())
    truncated, constant = _truncated_terms(level, output, side)
    data = DualFunctionData(
        table=table.value,
        omega=(omega - midpoints[:, [0]]) / radii[:, [0]],
        decay=(decay - midpoints[:, [1]]) / radii[:, [1]],
        grid_start=first_points,
        grid_step=second_points - first_points,
        grid_points=np.array([len(grids[0].omega), len(grids[0].quotient)], float),
        cell=np.array(cells, float),
        midpoint=midpoints[:, :2].copy(),
        radius=radii[:, :2].copy(),
        participation=midpoints[:, 2:].copy(),
        participation_radius=radii[:, 2:].copy(),
        linear=scaled.linear,
        quadratic=scaled.quadratic,
        cubic=scaled.cubic,
        expected_cubic=expected_cubic,
        remainder=scaled.remainder + expected_cubic,
        truncated_response=truncated.response,
        truncated_linear=truncated.linear,
        truncated_quadratic=truncated.quadratic,
        # Far above rounding, so that units do not lead multipliers elsewhere, and far below gaps.
        multiplier_spacing=np.array([2.0**-24 * response_scale or 1.0]),
    )
    require_in_range({name: x for name, x in data._asdict().items() if name != "table"})
    return data, constant


class _TruncatedTerms(NamedTuple):
    """Terms of an output that are sums over truncated modes: response × model of the inputs."""

    response: Array  # midpoints and radii of the responses, in turn, (terms, T)
    linear: Array  # linear coefficients of their factors, (terms, inputs)
    quadratic: Array  # quadratic coefficients, packed by rows, (terms, inputs (inputs + 1)/2)


def _truncated_terms(level: LevelModels, output: int, side: float) -> tuple[_TruncatedTerms, Array]:
    """Return what truncated modes add to side × output, as terms in the inputs and as constants.

    Truncated modes, which are not enclosed one by one, add P m(t) ± R r(t): a sum P of
    participation factors and an amplitude R, both Taylor models of the d inputs, and the midpoint m
    and the radius r of the interval of their responses. An upper bound of side × output thus
    contains side P m + R r.

    Args:
        level: Models of the response over a box, with T time nodes.
        output: Index of the output.
        side: −1 or 1.

    Returns:
        The terms: `response`, m and side × r of each source in turn, shape (terms, T), and linear
        (terms, d) and quadratic (terms, d (d + 1)/2) coefficients of their factors P and R; there
        are no terms if no mode is truncated. And the constants, shape (2, T): what the terms have
        at the midpoint of the box, and a bound of everything that is bounded by magnitude: coupling
        of modes, errors of the tables of all modes, cubic terms and remainders.
    """
    modes = level.modes.oscillators
    table = level.tables[int(level.modes.orders[output])]
    constant: Array = np.zeros((2, len(level.modes.time)))
    constant[1] = level.modes.open[:, output]
    for mode, error in zip(modes, table.error, strict=True):
        constant[1] += mode.participation.magnitude()[:, output] @ error
    d = modes[0].omega.inputs
    if not level.modes.truncated:
        # no terms, whatever the node
        none = _TruncatedTerms(np.zeros((0, 1)), np.zeros((0, d)), np.zeros((0, d * (d + 1) // 2)))
        return none, constant

    responses = list[Array]()
    factors = list[TaylorModel]()
    for truncated in level.modes.truncated:
        midpoint = truncated.response_midpoint[:, output]
        radius = truncated.response_radius[:, output]
        participation = truncated.participation[:, output]
        amplitude = truncated.amplitude[:, output]
        responses += [midpoint, side * radius]
        factors += [participation, amplitude]
        constant[0] += side * participation.value @ midpoint
        constant[1] += amplitude.value @ radius
    response = np.concatenate(responses)
    scaled = _scaled(concatenate(factors, -1), np.ones(len(response)))
    # The cubic terms and the remainders of the factors are bounded by magnitude.
    constant[1] += (scaled.remainder + np.abs(scaled.cubic).sum(axis=1)) @ np.abs(response)
    return _TruncatedTerms(response, scaled.linear, scaled.quadratic), constant


class _ScaledModels(NamedTuple):
    """Coefficients of Z Taylor models of d inputs, each over its radius."""

    linear: Array  # (Z, d)
    quadratic: Array  # of u_i u_j, i ≤ j, packed by rows, (Z, d (d + 1)/2)
    cubic: Array  # (Z, monomials of third degree)
    remainder: Array  # (Z,)


def _scaled(models: TaylorModel, radius: Array) -> _ScaledModels:
    """Return the coefficients of Z Taylor models of d inputs, each divided by a radius of its own.

    Args:
        models: The Taylor models, shape (Z,).
        radius: Positive radii, shape (Z,).

    Returns:
        `linear` (Z, d), `quadratic` (Z, d (d + 1)/2), of u_i u_j for i ≤ j packed by rows, `cubic`
        (Z, monomials of third degree), and `remainder` (Z,). Constant coefficients are left out.
    """
    pairs = monomials(models.inputs, 2)
    by_rows = np.lexsort((pairs[:, 1], pairs[:, 0]))  # the order i ≤ j that the kernels use
    linear = models.homogeneous_part(1) / radius
    quadratic = models.homogeneous_part(2)[by_rows] / radius
    cubic = models.homogeneous_part(3) / radius
    return _ScaledModels(
        linear=np.ascontiguousarray(linear.T),
        quadratic=np.ascontiguousarray(quadratic.T),
        cubic=np.ascontiguousarray(cubic.T),
        remainder=models.remainder / radius,
    )


def least_peak(level: LevelModels, output: int) -> tuple[float, Array]:
    """Return a lower bound of an output's smallest peak over a box, by best-first bisection.

    The peak of a trajectory is its largest |output| over all time nodes. The bound holds for every
    input in the box; it is the smallest over cells, ranges of the modes' frequencies and decays
    that together cover those of the box. The cell of the lowest bound is halved, until it cannot be
    halved or a fixed number of bisections is reached.

    Args:
        level: Models of the response over the box of d inputs of nonzero width.
        output: Index of the output among those of `level`.

    Returns:
        The bound, 0 or more, in the unit of the output; and a point of the box in unit coordinates,
        shape (d,), at which the peak is expected to be small. Nothing is proved of this point,
        which is near the maximum over inputs in the dual function of the cell with the lowest
        bound. It is 0 where no node gave a bound.

    Raises:
        UnprovedError: A number of the models exceeds the range of the dual function.
    """
    sides = [OutputBounds.initial(level, output, side, 0.0) for side in (0, 1)]
    data_of_sides = sides[0].data, sides[1].data
    data = sides[0].data
    constants = np.stack([bounds.constant.sum(axis=0) for bounds in sides])
    # multipliers of each node, at which further cells begin
    multipliers = np.zeros((constants.shape[1], len(data.linear)))
    max_cells = 1 + numbers.LEAST_PEAK_BISECTIONS
    cells = Cells(
        ends=np.zeros((max_cells, *data.cell.shape), np.int64),
        mu=np.zeros((max_cells, 0)),  # multipliers are kept by node
        disagreement=np.zeros((max_cells, len(data.linear))),  # here the variation of responses
        value=np.zeros(max_cells),  # lower bounds of the peak over the cells
    )
    cells.ends[0] = data.cell
    at = np.zeros((max_cells, data.linear.shape[1]))

    def improve(cell: int) -> None:
        """Raise the bound of a cell, which holds already where it is that of a larger cell."""
        bound = _bound_cell(
            cells.ends[cell],
            data_of_sides,
            constants,
            multipliers,
            at[cell],
            cells.disagreement[cell],
        )
        cells.value[cell] = max(bound, cells.value[cell])

    improve(0)
    lowest = 0
    for count in range(1, max_cells):
        if not halve_cell(cells, lowest, count):
            break
        improve(lowest)
        improve(count)
        lowest = int(cells.value[: count + 1].argmin())
    return float(cells.value[lowest]), at[lowest]


@compiled
def _bound_cell(
    ends: Ints,
    sides: tuple[DualFunctionData, DualFunctionData],
    constants: Array,
    multipliers: Array,
    at: Array,
    variation: Array,
) -> float:
    """Return the largest lower bound of |output| over a cell at some time nodes.

    The nodes are peaks over time of the response at the middle of the cell, the largest first.

    Args:
        ends: Cell of the modes' tables, shape (K, 4).
        sides: Models and tables of −output and output.
        constants: What is added to the dual bounds of −output and output, shape (2, T).
        multipliers: Multipliers of each node, shape (T, Z); improved in place.
        at: Overwritten with the inputs that the dual bound names, shape (d,).
        variation: Overwritten, for the first two variables of each mode, ω and g/ω, with the
            largest change of the mode's response along them, at the node of the bound, shape (Z,).
    """
    data = sides[0]
    response = np.zeros(data.table.shape[2])  # at the middle of the cell
    for k in range(len(ends)):
        row = (ends[k, 2] + ends[k, 3]) // 2 * int(data.grid_points[0])
        for s in range(data.participation.shape[1]):
            of_mode = data.table[k, s, :, row + (ends[k, 0] + ends[k, 1]) // 2]
            response += data.participation[k, s] * of_mode
    # with what truncated modes and forces add at the midpoint, which is constant in the bounds
    magnitude = np.abs(response + (constants[1] - constants[0]) / 2)
    untried = magnitude.copy()  # −1 at nodes that are no peak over time, or were tried
    for t in range(len(magnitude)):
        if magnitude[t] < max(magnitude[max(t - 1, 0)], magnitude[min(t + 1, len(magnitude) - 1)]):
            untried[t] = -1.0
    largest = -np.inf
    best_node = 0
    u = np.zeros(len(at))
    not_used = np.empty(len(variation))
    for _ in range(LEAST_PEAK_NODES):
        node = int(untried.argmax())
        if untried[node] <= max(largest, -1.0):
            break
        untried[node] = -1.0
        # A lower bound of the output where it is positive is an upper bound of −output, number 0.
        s = int(response[node] + (constants[1, node] - constants[0, node]) / 2 < 0)
        dual_bound = minimise(
            multipliers[node],
            ends,
            node,
            2.0 * s - 1.0,
            sides[s],
            LEAST_PEAK_STEPS,
            LEAST_PEAK_PATIENCE,
            -1e300,  # no target
            (2.0 * s - 1.0) * response[node],
            not_used,
            u,
        )
        lower_bound = -(dual_bound + constants[s, node])
        if lower_bound > largest:
            largest = lower_bound
            at[:] = u
            best_node = node
    # Cells are halved where responses vary most: by the disagreement of both maxima of the dual
    # function, as at nodes, the bounds of three storeys in plan were lower by up to a fifth.
    for k in range(len(ends)):
        of_mode = _response_over_cell(data, k, ends[k], best_node)
        for axis in range(2):
            largest_change = 0.0
            for i in range(of_mode.shape[axis]):
                line = of_mode[i] if axis == 0 else of_mode[:, i]
                largest_change = max(largest_change, line.max() - line.min())
            variation[k * (len(variation) // len(ends)) + axis] = largest_change
    return largest


@compiled
def _response_over_cell(data: DualFunctionData, k: int, ends: Ints, node: int) -> Array:
    """Return a mode's response at a time node over its part of a cell, shape (points q, points ω).

    Args:
        data: Tables of the modes and their participation factors.
        k: Number of the mode.
        ends: First and last point along ω, then along q = g/ω, shape (4,).
        node: Index of the time node.
    """
    first, last, low, high = ends
    response = np.zeros((high - low + 1, last - first + 1))
    for q in range(low, high + 1):
        begin = q * int(data.grid_points[0]) + first
        for s in range(data.participation.shape[1]):
            row = data.table[k, s, node, begin : begin + last - first + 1]
            response[q - low] += data.participation[k, s] * row
    return response
