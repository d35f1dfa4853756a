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

from alphacut.frame import numbers
from alphacut.frame.bounds.dual_function import minimise
from alphacut.frame.bounds.level import LevelModels, OutputBounds
from alphacut.fuzzy.arrays import Array, Ints


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
    data = sides[0].data
    motion = np.einsum("ks,kstp->ktp", data.share, data.table)  # of each mode at its points
    motion = motion.reshape(*motion.shape[:2], -1, int(data.points[0]))  # along q, along ω
    multipliers = dict[int, Array]()  # multipliers by node, at which bounds of further cells begin
    cells = [_bounded_cell(sides, motion, data.ends.astype(np.intp), 0, 0.0, multipliers)]
    for number in range(1, 2 * int(numbers.LEAST_PEAK_BISECTIONS), 2):
        lowest = cells[0]
        halves = [
            _bounded_cell(sides, motion, ends, number + k, lowest.bound, multipliers)
            for k, ends in enumerate(_halves(lowest, motion))
        ]
        if not halves:
            break
        heapreplace(cells, halves[0])
        heappush(cells, halves[1])
    return cells[0].bound, cells[0].at


def _bounded_cell(
    sides: list[OutputBounds],
    motion: Array,
    ends: Ints,
    number: int,
    outer_bound: float,
    multipliers: dict[int, Array],
) -> PeakCell:
    """Cell with the largest dual bound of nodes where its middle's motion peaks.

    It is the bound of a cell around it at least; `multipliers` (Z,) by node are improved.
    """
    omega, q = ends[:, :2].sum(1) // 2, ends[:, 2:].sum(1) // 2  # points in the middle
    expected: Array = motion[np.arange(len(motion)), :, q, omega].sum(0)
    size = np.abs(expected)
    is_peak = np.append(True, size[1:] >= size[:-1]) & np.append(size[:-1] >= size[1:], True)
    peaks = np.flatnonzero(is_peak)
    nodes = peaks[np.argsort(size[peaks])[-int(numbers.LEAST_PEAK_NODES) :][::-1]]
    highest, highest_node, at = -np.inf, int(nodes[0]), np.zeros(sides[0].at.shape[1])
    for node in map(int, nodes):
        if size[node] <= highest:
            break
        bounds = sides[int(expected[node] < 0)]  # where the output is positive, of −output
        mu = multipliers.setdefault(node, np.zeros(len(bounds.data.linear)))
        weight = np.zeros_like(mu)
        u, steps = np.zeros_like(at), int(numbers.LEAST_PEAK_STEPS)
        dual = minimise(
            *(mu, ends, node, bounds.side, bounds.data, steps, int(numbers.LEAST_PEAK_PATIENCE)),
            *(-1e300, -size[node], weight, u),
        )
        least = -(dual + float(bounds.constant[:, node].sum()))
        if least > highest:
            highest, highest_node, at = least, node, u
    return PeakCell(max(highest, outer_bound), number, ends, highest_node, at)


def _halves(cell: PeakCell, motion: Array) -> list[Ints]:
    """Ends of both halves of a cell along the ω or q over which a mode varies most at its node.

    They share the middle point; none where no range has a point between its ends. `motion` holds
    each mode's response over its table, shape (K, T, Q, W).
    """
    largest, chosen = -1.0, (0, 0)
    for k in range(len(cell.ends)):
        first, last, low, high = map(int, cell.ends[k])
        response = motion[k, cell.node, low : high + 1, first : last + 1]
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
