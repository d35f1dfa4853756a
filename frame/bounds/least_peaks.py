"""Least peaks: a lower bound of the smallest peak over a box, "must the limit be exceeded?".

A peak is the largest |output| over time, and its least value over the box is no less than

    min over cells of max over nodes t of min over u in the cell of ± output(t; u),

cells being ranges of the modes' frequencies and damping that cover those of the box. The last
minimum is a dual bound with the modes' tables read over the cell alone: models are not made anew,
and the shares keep their ranges. A few nodes are tried, those at which the motion in the middle of
the cell peaks. The cell with the lowest bound is bisected, along the range over which a mode's
motion varies most at the node of that bound.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from heapq import heappop, heappush

import numpy as np

from alphacut.frame.bounds.dual_function import Data, minimise
from alphacut.frame.bounds.level import LevelModels, OutputBounds
from alphacut.frame.calculus.kernels import compiled
from alphacut.fuzzy.arrays import Array, Rows

BISECTIONS = 48
"""Most bisections of cells; three times as many raise the bounds of six storeys by 2 %."""
TRIED = 6
"""Nodes that are tried in a cell."""
STEPS = 80
"""Most evaluations of the dual function for a node."""


@dataclass(order=True)
class PeakCell:
    """A cell with its bound.

    Args:
        bound: Lower bound of the peak over it.
        number: Of the cell, which decides between equal bounds.
        places: First and last place of the modes' tables along ω and q, shape (K, 4).
        node: Node of the bound.
        at: Coordinates that the bound names, shape (d,).
    """

    bound: float
    number: int
    places: Rows = field(compare=False)
    node: int = field(compare=False)
    at: Array = field(compare=False)


def least_peak(level: LevelModels, output: int) -> tuple[float, Array]:
    """Lower bound of an output's smallest peak over a box, by best-first bisection.

    Returns:
        The bound, 0 or more, and coordinates that the dual bound of the lowest cell names, a guess
        at those of the smallest peak, shape (d,).
    """
    sides = [OutputBounds.initial(level, output, s, 0.0) for s in (0, 1)]
    data = sides[0].data
    motion = np.einsum("ks,kstp->ktp", data.share, data.table)  # of each mode at its points
    motion = motion.reshape(*motion.shape[:2], -1, int(data.points[0]))  # along q, along ω
    cells = [_bounded(sides, motion, data.ends.astype(np.intp), 0, 0.0)]
    for number in range(1, 2 * BISECTIONS, 2):  # numbers of cells: two a bisection
        lowest = cells[0]
        halves = _halves(lowest, motion)
        if not halves:
            break
        heappop(cells)
        for k, places in enumerate(halves):
            heappush(cells, _bounded(sides, motion, places, number + k, lowest.bound))
    return cells[0].bound, cells[0].at


def _halves(cell: PeakCell, motion: Array) -> list[Rows]:
    """Halves of a cell along the ω or q = g/ω over which a mode varies most at the cell's node.

    `motion` holds each mode's response over its table, shape (K, T, Q, W).

    Returns:
        Places of the lower and upper half, (K, 4) each, which share the middle place; an empty list
        where no range has a place between its ends.
    """
    largest, chosen = -1.0, (0, 0)
    for k in range(len(cell.places)):
        first, last, low, high = (int(place) for place in cell.places[k])
        response = motion[k, cell.node, low : high + 1, first : last + 1]
        for axis, length in ((0, last - first), (2, high - low)):
            variation = float(np.ptp(response, axis=1 - axis // 2).max())
            if length > 1 and variation > largest:
                largest, chosen = variation, (k, axis)
    if largest < 0:
        return []
    k, axis = chosen
    lower, upper = cell.places.copy(), cell.places.copy()
    lower[k, axis + 1] = upper[k, axis] = cell.places[k, axis : axis + 2].sum() // 2
    return [lower, upper]


def _bounded(
    sides: list[OutputBounds], motion: Array, places: Rows, number: int, known: float
) -> PeakCell:
    """Cell of ranges of the modes' ω and q, with a lower bound of the output's peak over it.

    It is the largest, over a few nodes where the motion in the middle of the cell peaks, of a dual
    lower bound of + or − output; at least `known`, that of a cell around it.
    """
    middle = [(low + high) // 2 for low, high in places.reshape(-1, 2).tolist()]
    omega, q = middle[::2], middle[1::2]
    expected: Array = motion[np.arange(len(motion)), :, q, omega].sum(0)
    size = np.abs(expected)
    is_peak = np.append(True, size[1:] >= size[:-1]) & np.append(size[:-1] >= size[1:], True)
    nodes = np.argsort(np.where(is_peak, size, -1.0))[-TRIED:][::-1]
    cell = PeakCell(-np.inf, number, places, int(nodes[0]), np.zeros(sides[0].data.linear.shape[1]))
    for node in map(int, nodes):
        if size[node] <= cell.bound:
            break
        problem = sides[int(expected[node] < 0)]  # where the output is positive, of −output
        u = np.zeros_like(cell.at)
        bound = _on_slab(places, node, problem.side, -size[node], problem.data, u)
        least = -(bound + float(problem.constant[:, node].sum()))
        if least > cell.bound:
            cell = PeakCell(least, number, places, node, u)
    cell.bound = max(cell.bound, known)
    return cell


@compiled
def _on_slab(slab: Rows, node: int, side: float, expected: float, data: Data, u: Array) -> float:
    """Dual bound at a node with all tables read over a slab; `u` takes the inputs named."""
    mu, weight = np.zeros(len(data.linear)), np.zeros(len(data.linear))
    return minimise(mu, slab, node, side, data, STEPS, -1e300, expected, weight, u)
