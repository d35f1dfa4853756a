"""Least peaks: a lower bound of the smallest peak over a box, "must the limit be exceeded?".

A peak is the largest |output| over time, and its smallest value over the box is at least

    min over cells of max over nodes t of min over u in the cell of ± output(t; u),

where the cells are ranges of the modes' frequencies and damping that cover those of the box. The
last minimum is bounded from below by the dual function, with the modes' tables read over the cell
alone: models are not made anew, and participation factors keep their ranges over the box.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.base.kernels import compiled
from alphacut.frame import numbers
from alphacut.frame.bounds.dual_function import DualFunctionData, minimise
from alphacut.frame.bounds.level import LevelModels, OutputBounds
from alphacut.frame.bounds.node_bounds import Cells, halve_cell


class CellEffort(NamedTuple):
    """Effort that a cell is worth."""

    nodes: int  # most time nodes that are tried
    steps: int  # most evaluations of the dual function for each
    patience: int  # steps of `minimise` after which less is expected


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
    effort = CellEffort(
        nodes=numbers.LEAST_PEAK_NODES,
        steps=numbers.LEAST_PEAK_STEPS,
        patience=numbers.LEAST_PEAK_PATIENCE,
    )
    max_cells = 1 + numbers.LEAST_PEAK_BISECTIONS
    cells = Cells(
        ends=np.zeros((max_cells, *data.cell.shape), np.int64),
        mu=np.zeros((max_cells, 0)),  # multipliers are kept by node
        disagreement=np.zeros((max_cells, len(data.linear))),
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
            effort,
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
    effort: CellEffort,
    multipliers: Array,
    at: Array,
    disagreement: Array,
) -> float:
    """Return the largest lower bound of |output| over a cell at some time nodes.

    The nodes are peaks over time of the response at the middle of the cell, the largest first.

    Args:
        ends: Cell of the modes' tables, shape (K, 4).
        sides: Models and tables of −output and output.
        constants: What is added to the dual bounds of −output and output, shape (2, T).
        effort: What the cell is worth.
        multipliers: Multipliers of each node, shape (T, Z); improved in place.
        at: Overwritten with the inputs that the dual bound names, shape (d,).
        disagreement: Overwritten with that of the variables at the node of the bound, see
            `minimise`, shape (Z,).
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
    u = np.zeros(len(at))
    of_node = np.empty(len(disagreement))
    for _ in range(effort.nodes):
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
            effort.steps,
            effort.patience,
            -1e300,  # no target
            (2.0 * s - 1.0) * response[node],
            of_node,
            u,
        )
        lower_bound = -(dual_bound + constants[s, node])
        if lower_bound > largest:
            largest = lower_bound
            at[:] = u
            disagreement[:] = of_node
    return largest
