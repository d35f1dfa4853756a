"""Least peaks: a lower bound of the smallest peak over a box, "must the limit be exceeded?".

A peak is the largest |output| over time, and its least value over the box is no less than

    min over cells of max over nodes t of min over u in the cell of ± output(t; u),

cells being ranges of the modes' frequencies and damping that cover those of the box. The last
minimum is a dual bound with the modes' tables read over the cell alone: models are not made anew,
and the shares keep their ranges.
"""

from __future__ import annotations

from heapq import heappush, heapreplace
from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.base.kernels import compiled
from alphacut.frame import numbers
from alphacut.frame.bounds.dual_function import Data, data_without_modes, minimise
from alphacut.frame.bounds.level import LevelModels, OutputBounds


class PeakCell(NamedTuple):
    """A cell with its bound; cells are ordered by bounds, and equal ones by number."""

    bound: float  # lower bound of the peak over it
    number: int  # of the cell
    ends: Ints  # first and last point of the modes' tables along ω and q, (K, 4)
    node: int  # node of the bound
    at: Array  # coordinates that the bound names, (d,)


def least_peak(level: LevelModels, output: int) -> tuple[float, Array]:
    """Return a lower bound of an output's smallest peak over a box, by best-first bisection.

    Returned with it, 0 or more, are unit coordinates (d,) that the bound of the lowest cell names.
    """
    sides = [OutputBounds.initial(level, output, s, 0.0) for s in (0, 1)]
    both, data = (sides[0].data, sides[1].data), sides[0].data
    constants = np.stack([bounds.constant.sum(0) for bounds in sides])
    multipliers = np.zeros((constants.shape[1], len(data.linear)))  # of a node, for further cells
    tuned = numbers.LEAST_PEAK_NODES, numbers.LEAST_PEAK_STEPS, numbers.LEAST_PEAK_PATIENCE
    effort = tuple(map(int, tuned))

    def bounded_cell(ends: Ints, number: int, outer_bound: float) -> PeakCell:
        at = np.zeros(data.linear.shape[1])
        bound, node = _bound_cell(ends, both, constants, effort, multipliers, at)
        return PeakCell(max(bound, outer_bound), number, ends, node, at)

    cells = [bounded_cell(data.ends.astype(np.int64), 0, 0.0)]
    for number in range(1, 2 * int(numbers.LEAST_PEAK_BISECTIONS), 2):
        lowest = cells[0]
        halves = [
            bounded_cell(ends, number + k, lowest.bound)
            for k, ends in enumerate(_halves(lowest, data))
        ]
        if not halves:
            break
        heapreplace(cells, halves[0])
        heappush(cells, halves[1])
    return cells[0].bound, cells[0].at


@compiled
def _bound_cell(
    ends: Ints,
    sides: tuple[Data, Data],
    constants: Array,
    effort: tuple[int, int, int],
    multipliers: Array,
    at: Array,
) -> tuple[float, int]:
    """Largest dual bound over a cell at peaks of its middle's motion, and its node; writes `at`."""
    # `sides` and `constants` (2, T), added to bounds, are of −output and the output; `multipliers`
    # (T, Z) are improved
    (tries, steps, patience), data = effort, sides[0]
    motion = np.zeros(data.table.shape[2])
    for k in range(len(ends)):  # at the middle of the mode's cell
        row = (ends[k, 2] + ends[k, 3]) // 2 * int(data.points[0])
        for s in range(data.share.shape[1]):
            waves = data.table[k, s, :, row + (ends[k, 0] + ends[k, 1]) // 2]
            motion += data.share[k, s] * waves
    size, untried = np.abs(motion), np.abs(motion)  # −1 where it is no peak or tried
    for t in range(len(size)):
        if size[t] < max(size[max(t - 1, 0)], size[min(t + 1, len(size) - 1)]):
            untried[t] = -1.0
    highest, highest_node = -np.inf, 0
    u, disagreement = np.zeros(len(at)), np.empty(multipliers.shape[1])
    for _ in range(tries):
        node = int(untried.argmax())
        if untried[node] <= max(highest, -1.0):
            break
        untried[node], s = -1.0, int(motion[node] < 0)  # where it is positive, of −output
        mu, side = multipliers[node], 2.0 * s - 1.0
        dual = minimise(
            mu, ends, node, side, sides[s], steps, patience, -1e300, -size[node], disagreement, u
        )
        least = -(dual + constants[s, node])
        if least > highest:
            highest, highest_node = least, node
            at[:] = u
    return highest, highest_node


def call_bound_cell() -> None:
    """Call the kernel of `least_peak` once without a mode; see `KernelThreads`."""
    data, none = data_without_modes(), np.zeros((0, 0))
    _bound_cell(np.zeros((0, 4), np.int64), (data, data), none, (0, 0, 0), none, np.zeros(0))


def _halves(cell: PeakCell, data: Data) -> list[Ints]:
    """Ends of both halves along the ω or q over which a mode varies most; none if none is left."""
    largest, chosen, count = -1.0, (0, 0), int(data.points[0])
    for k in range(len(cell.ends)):
        first, last, low, high = map(int, cell.ends[k])
        table = data.table[k, :, cell.node].reshape(len(data.share[k]), -1, count)  # along q, ω
        response = np.tensordot(data.share[k], table[:, low : high + 1, first : last + 1], 1)
        for axis, length in ((0, last - first), (2, high - low)):
            variation = float(np.ptp(response, axis=1 - axis // 2).max())
            if length > 1 and variation > largest:
                largest, chosen = variation, (k, axis)
    if largest < 0:
        return []
    k, axis = chosen
    lower, upper = cell.ends.copy(), cell.ends.copy()
    lower[k, axis + 1] = upper[k, axis] = cell.ends[k, axis : axis + 2].sum() // 2
    return [lower, upper]
