"""First optima of all bounds on a box, from a sample of it: Newton's method, then neighbours.

Envelopes consist of segments of graphs (the idea of the Graph Follower), so that what is best at
one node is tried at the nodes around.
"""

from __future__ import annotations

import numpy as np

from alphacut.frame.calculus.low_discrepancy import chebyshev_points
from alphacut.frame.modal.newton import refine
from alphacut.frame.modal.optima import Optima, Response, best_of, trajectories
from alphacut.fuzzy.arrays import Array, Mask, Rows

SAMPLES = 256
"""Trajectories of the model."""
PHASE = 0.5
"""Phase of the fastest mode (rad) between nodes at which Newton's method begins with samples."""
SHIFTS = (1, 2, 4, 8, 16)
"""Distances of the nodes that try each other's points."""


def first_optima(
    model: Response, lower: Array, upper: Array, small: float, points: Array | None = None
) -> Optima:
    """Good points of all nodes, outputs and sides in the box [lower, upper].

    Args:
        model: The modal model.
        lower: Lower ends, shape (d,).
        upper: Upper ends.
        small: What Newton's method may leave, in units of the outputs.
        points: The sample, shape (P, d); of Chebyshev's density if not given.
    """
    if points is None:
        unit = np.vstack([np.zeros((1, len(lower))), chebyshev_points(len(lower), SAMPLES)])
        points = (lower + upper) / 2 + (upper - lower) / 2 * unit
    total = len(model.time)
    optima = best_of(points, trajectories(model, points), np.arange(total))
    if not (upper > lower).any():
        return optima
    grid = np.arange(len(optima.value)).reshape(total, -1)
    stride = max(1, int(PHASE / (model.fastest * (model.time[1] - model.time[0]))))
    nodes = np.unique(np.append(np.arange(0, total, stride), total - 1))
    refine(model, optima, grid[nodes].ravel(), lower, upper, small)
    exchange(model, optima, grid[nodes])
    right = np.searchsorted(nodes, np.arange(total))
    for near in (right, np.maximum(right - 1, 0)):
        optima.offer(model, optima.point[grid[nodes[near]].ravel()], grid.ravel())
    refine(model, optima, grid.ravel(), lower, upper, small)
    return optima


def exchange(model: Response, optima: Optima, grid: Rows, fresh: Mask | None = None) -> Rows:
    """Try at each row of `grid` (nodes, 2 m) the points of rows near by; problems that improved.

    Args:
        model: The model.
        optima: All problems.
        grid: Their numbers at the nodes that take part.
        fresh: Problems whose points are tried, shape (N,); all unless given.
    """
    better = []
    for shift in SHIFTS:
        count = max(len(grid) - shift, 0)
        for here, there in ((shift, 0), (0, shift)):
            to, of = (grid[k : k + count].ravel() for k in (here, there))
            if fresh is not None:
                to, of = to[fresh[of]], of[fresh[of]]
            better.append(optima.offer(model, optima.point[of], to))
    return np.unique(np.concatenate(better))
