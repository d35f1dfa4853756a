"""Lines through the optima found, in search of basins beside them that no start has met."""

from __future__ import annotations

import numpy as np

from alphacut.frame.calculus.jet import Array
from alphacut.frame.modal.model import ModalModel
from alphacut.frame.modal.newton import refine
from alphacut.frame.modal.optima import Optima, Response

POINTS = 9
"""Points on a line from face to face, both included."""
LINES = 6
"""Most lines through an optimum; of more parameters some are drawn."""
BEHIND = 0.1
"""Share of the largest bound by which a rival may lie behind before it is refined."""
PIECE = 200_000
"""Points whose values are computed together."""


def probe(
    model: Response,
    guide: ModalModel,
    found: Optima,
    lower: Array,
    upper: Array,
    small: float,
    rng: np.random.Generator,
) -> Array:
    """Refine the best other hill on the lines through each optimum along the axes.

    Args:
        model: What the optima are of.
        guide: Polynomials whose values choose the hill, in the same units.
        found: All problems, node by node, which keep what is better.
        lower: Lower ends of the box, shape (d,).
        upper: Upper ends.
        small: Gain that Newton's method leaves.
        rng: Draws lines where the parameters are many.

    Returns:
        The problems that improved.
    """
    rival = found.take(np.arange(len(found.value)))
    for piece in np.array_split(np.arange(len(rival.value)), _pieces(rival)):
        part = rival.take(piece)
        rival.point[piece], rival.value[piece] = _best_hills(guide, part, lower, upper, rng)
    near = rival.value > found.value - BEHIND * np.abs(found.value).max()
    chosen = np.flatnonzero(near)
    rival.value[:] = -np.inf
    rival.offer(model, rival.point[chosen], chosen)
    refine(model, rival, chosen, lower, upper, small)
    return found.offer(model, rival.point[chosen], chosen)


def _pieces(rival: Optima) -> int:
    return -(-len(rival.value) * min(rival.point.shape[1], LINES) * POINTS // PIECE)


def _best_hills(
    guide: ModalModel, optima: Optima, lower: Array, upper: Array, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Best hill away from each optimum on its lines: points (N, d) and values, −∞ if none."""
    n, d = optima.point.shape
    count, rows = min(d, LINES), np.arange(n)
    axes = rng.permuted(np.tile(np.arange(d), (n, 1)), axis=1)[:, :count]
    share = np.linspace(0, 1, POINTS)
    places = (lower + share[:, None] * (upper - lower)).T[axes]  # (N, count, K)
    points = np.broadcast_to(optima.point[:, None, None], (n, count, POINTS, d)).copy()
    np.put_along_axis(points, axes[:, :, None, None], places[..., None], 3)
    owner = np.repeat(rows, count * POINTS)
    flat = guide.value_at(points.reshape(-1, d), optima.node[owner], optima.output[owner])
    value = optima.side[:, None, None] * flat.reshape(n, count, POINTS)
    own = np.take_along_axis(optima.point, axes, 1)[..., None]
    spacing = ((upper - lower) / (POINTS - 1))[axes][..., None]
    hill = _hills(value) & (np.abs(places - own) >= spacing) & (spacing > 0)
    best = np.where(hill, value, -np.inf).reshape(n, -1)
    at = best.argmax(1)
    return points.reshape(n, -1, d)[rows, at], best[rows, at]


def _hills(value: Array) -> Array:
    """Where values (…, K) are no less than those beside them."""
    padded = np.pad(value, [(0, 0)] * (value.ndim - 1) + [(1, 1)], constant_values=-np.inf)
    rises: Array = (value >= padded[..., :-2]) & (value >= padded[..., 2:])
    return rises
