"""Optima from which a proof starts: one quick pass, since boxes find what it misses."""

from __future__ import annotations

import numpy as np

from alphacut.frame.calculus.jet import Array
from alphacut.frame.calculus.low_discrepancy import chebyshev_points
from alphacut.frame.modal.model import ModalModel
from alphacut.frame.modal.newton import refine
from alphacut.frame.modal.optima import Optima, problems
from alphacut.frame.modal.starting_points import trajectories

SAMPLES = 256
"""Trajectories of the modal model."""
PHASE = 0.5
"""Phase of the fastest mode (rad) between nodes at which Newton's method begins with samples."""
LEFT = 0.02
"""Share of the gap that Newton's method may leave."""
SHIFTS = (1, 2, 4, 8, 16)
"""Distances of the nodes that try each other's points."""


def first_optima(model: ModalModel, lower: Array, upper: Array, gap: float) -> Optima:
    """Good points of all nodes, outputs and sides in the box [lower, upper].

    Args:
        model: The modal model.
        lower: Lower ends, shape (d,).
        upper: Upper ends.
        gap: What the bounds may miss, in units of the outputs.
    """
    columns, total = 2 * len(model.outputs), len(model.time)
    optima, grid = _sampled(model, lower, upper), np.arange(columns * total).reshape(total, -1)
    if not (upper > lower).any():
        return optima
    fastest = float(np.abs(model.eigenvalue.coefficients[0]).max())
    stride = max(1, int(PHASE / (fastest * model.flow.step)))
    nodes = np.unique(np.append(np.arange(0, total, stride), total - 1))
    refine(model, optima, grid[nodes].ravel(), lower, upper, LEFT * gap)
    for shift in SHIFTS:
        for here, there in ((shift, 0), (0, shift)):
            count = max(len(nodes) - shift, 0)
            to, of = (grid[nodes[k : k + count]].ravel() for k in (here, there))
            optima.offer(model, optima.point[of], to)
    right = np.searchsorted(nodes, np.arange(total))
    for near in (right, np.maximum(right - 1, 0)):
        optima.offer(model, optima.point[grid[nodes[near]].ravel()], grid.ravel())
    refine(model, optima, grid.ravel(), lower, upper, LEFT * gap)
    return optima


def _sampled(model: ModalModel, lower: Array, upper: Array) -> Optima:
    """The best points of a sample for every problem."""
    d, optima = len(lower), problems(np.arange(len(model.time)), len(model.outputs), len(lower))
    unit = np.vstack([np.zeros((1, d)), chebyshev_points(d, SAMPLES)])
    points = (lower + upper) / 2 + (upper - lower) / 2 * unit
    values = trajectories(model, points)  # (S, T, m)
    best = np.stack([values.argmin(0), values.argmax(0)], axis=-1)  # (T, m, 2)
    optima.point[:] = points[best.ravel()]
    optima.value[:] = np.stack([-values.min(0), values.max(0)], axis=-1).ravel()
    return optima
