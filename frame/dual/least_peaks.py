"""Least peaks: a lower bound of the smallest peak over a box, "must the limit be exceeded?".

A peak is the largest |output| over time, and its least value over the box is no less than

    min over cells of max over nodes t of min over u in the cell of ± output(t; u),

cells being ranges of the leading mode's frequency and damping that cover those of the box. The last
minimum is a dual bound with the leading mode's table read over the cell alone: models are not made
anew, and the other modes and the shares keep their ranges. A few nodes are tried, those at which
the motion in the middle of the cell peaks.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from alphacut.frame.dual.dual_function import Data, compiled, minimise
from alphacut.frame.dual.level import Level, Problem
from alphacut.fuzzy.arrays import Array, Rows

CELLS = 32, 4
"""Most ranges of the leading mode's frequency, and of its damping over frequency."""
TRIED = 6
"""Nodes that are tried in a cell."""
STEPS = 40
"""Most evaluations of the dual function for a node."""


def least_peak(level: Level, output: int) -> tuple[float, Array]:
    """Lower bound of an output's smallest peak over a box, 0 or more, and inputs near it.

    Returns:
        The bound, and the coordinates that the bounds of the lowest cell name, shape (d,).
    """
    sides = [Problem.of(level, output, s, 0.0) for s in (0, 1)]
    data = sides[0].data
    motion = np.einsum("ks,kstp->ktp", data.share, data.table)  # of each mode at its points
    lead = int(np.abs(motion).max((1, 2)).argmax())
    middle = [_middle(data.ends[k], int(data.points[0])) for k in range(len(motion))]
    other_modes = sum(motion[k][:, middle[k]] for k in range(len(motion)) if k != lead)
    lowest = np.inf
    at: Array = np.zeros(data.linear.shape[1])
    for cell in _cells(data.ends[lead]):
        expected = motion[lead][:, _middle(cell, int(data.points[0]))] + other_modes
        value, u = _largest_least(sides, cell, lead, expected)
        if value < lowest:
            lowest, at = value, u
    return max(lowest, 0.0), at


def _middle(ends: Array | Rows, columns: int) -> int:
    """Point of a table in the middle of first and last places along ω and q (4,)."""
    return int((ends[2] + ends[3]) // 2 * columns + (ends[0] + ends[1]) // 2)


def _cells(ends: Array) -> list[Rows]:
    """Cells (4,) that cover the places between ends (4,), neighbours sharing theirs."""
    edges = [
        np.unique(np.linspace(ends[2 * axis], ends[2 * axis + 1], most + 1).round().astype(int))
        for axis, most in enumerate(CELLS)
    ]
    pairs = [list(pairwise(x)) or [(x[0], x[0])] for x in edges]
    return [np.array([*omega, *quotient]) for omega in pairs[0] for quotient in pairs[1]]


def _largest_least(
    sides: list[Problem], cell: Rows, lead: int, expected: Array
) -> tuple[float, Array]:
    """Largest over some nodes of the least ± output in a cell, and the inputs that it names."""
    size = np.abs(expected)
    summit = np.append(True, size[1:] >= size[:-1]) & np.append(size[:-1] >= size[1:], True)
    nodes = np.argsort(np.where(summit, size, -1.0))[-TRIED:]
    best, at = -np.inf, np.zeros(sides[0].data.linear.shape[1])
    for node in nodes[::-1]:
        if size[node] <= best:
            break
        problem = sides[int(expected[node] < 0)]  # where the output is positive, of −output
        u = np.zeros_like(at)
        bound = in_cell(cell, lead, int(node), problem.side, -size[node], problem.data, u)
        least = -(bound + float(problem.constant[:, node].sum()))
        if least > best:
            best, at = least, u
    return best, at


@compiled
def in_cell(
    cell: Rows, lead: int, node: int, side: float, expected: float, data: Data, u: Array
) -> float:
    """Dual bound at a node with one mode's table read over a cell; `u` takes the inputs named."""
    slab = data.ends.astype(np.int64)
    slab[lead] = cell
    mu, weight = np.zeros(len(data.linear)), np.zeros(len(data.linear))
    return minimise(mu, slab, node, side, data, STEPS, -1e300, expected, weight, u)
