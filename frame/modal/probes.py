"""Lines through the optima found, in search of basins beside them that no start has met."""

from __future__ import annotations

import numpy as np

from alphacut.frame.calculus.jet import Array
from alphacut.frame.calculus.threads import each
from alphacut.frame.modal.model import PIECE, ModalModel
from alphacut.frame.modal.newton import refine
from alphacut.frame.modal.optima import Optima, Response

POINTS = 9
"""Points on a line from face to face, both included."""
LINES = 6
"""Most lines through an optimum; of more parameters some are drawn."""
BEHIND = 0.1
"""Share of the largest bound by which a rival may lie behind before it is refined."""
COMPARED = 200_000
"""Points whose values are compared together."""


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
    count = len(rival.value) * min(rival.point.shape[1], LINES) * POINTS
    for piece in np.array_split(np.arange(len(rival.value)), -(-count // COMPARED)):
        part = rival.take(piece)
        rival.point[piece], rival.value[piece] = _best_hills(guide, part, lower, upper, rng)
    near = rival.value > found.value - BEHIND * np.abs(found.value).max()
    chosen = np.flatnonzero(near)
    rival.value[:] = -np.inf
    rival.offer(model, rival.point[chosen], chosen)
    refine(model, rival, chosen, lower, upper, small)
    return found.offer(model, rival.point[chosen], chosen)


def _best_hills(
    guide: ModalModel, optima: Optima, lower: Array, upper: Array, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Best hill away from each optimum on its lines: points (N, d) and values, −∞ if none."""
    n, d = optima.point.shape
    count, rows = min(d, LINES), np.arange(n)
    axes = rng.permuted(np.tile(np.arange(d), (n, 1)), axis=1)[:, :count]
    share = np.linspace(0, 1, POINTS)
    places = (lower + share[:, None] * (upper - lower)).T[axes]  # (N, count, K)
    own = np.take_along_axis(optima.point, axes, 1)[..., None]
    flat = along(guide, optima, axes, places - own)
    value = optima.side[:, None, None] * flat
    spacing = ((upper - lower) / (POINTS - 1))[axes][..., None]
    hill = _hills(value) & (np.abs(places - own) >= spacing) & (spacing > 0)
    best = np.where(hill, value, -np.inf).reshape(n, -1)
    at = best.argmax(1)
    points, line = optima.point.copy(), axes[rows, at // POINTS]
    points[rows, line] = places.reshape(n, -1)[rows, at]
    return points, best[rows, at]


def _hills(value: Array) -> Array:
    """Where values (…, K) are no less than those beside them."""
    padded = np.pad(value, [(0, 0)] * (value.ndim - 1) + [(1, 1)], constant_values=-np.inf)
    return (value >= padded[..., :-2]) & (value >= padded[..., 2:])


def along(model: Response, at: Optima, axes: Array, moved: Array) -> Array:
    """Each problem's output on lines through its point, shape (N, L, K).

    Args:
        model: What the outputs are of.
        at: N problems and their points.
        axes: Directions of each point's lines, shape (N, L).
        moved: Distances from the point along its lines, shape (N, L, K).
    """
    values, order = np.empty(moved.shape), np.argsort(at.output, kind="stable")

    def piece(rows: Array) -> None:
        given = at.take(rows), axes[rows], moved[rows]
        if isinstance(model, ModalModel) and model.degree <= 2:
            values[rows] = _quadratic(model, *given)
        else:
            values[rows] = _pointwise(model, *given)

    each(piece, np.array_split(order, -(-moved.size // PIECE) or 1))
    return values


def _pointwise(model: Response, at: Optima, axes: Array, moved: Array) -> Array:
    points = np.broadcast_to(at.point[:, None, None], (*moved.shape, at.point.shape[1])).copy()
    own = np.take_along_axis(at.point, axes, 1)[..., None] + moved
    np.put_along_axis(points, axes[:, :, None, None], own[..., None], 3)
    owner = np.repeat(np.arange(len(at.point)), moved[0].size)
    flat = points.reshape(len(owner), -1)
    return model.value_at(flat, at.node[owner], at.output[owner]).reshape(moved.shape)


def _quadratic(model: ModalModel, at: Optima, axes: Array, moved: Array) -> Array:
    """From values and slopes at the points alone, where polynomials are of degree 2 or less."""
    rate = model.eigenvalue.along(at.point, axes, moved)
    owner = np.repeat(np.arange(len(at.point)), moved[0].size)
    waves = model.waves_alone(rate.reshape(len(owner), -1), at.node[owner])
    values = np.zeros(moved.shape)
    for o in np.unique(at.output):
        rows = np.flatnonzero(at.output == o)
        for share, wave in zip(model.shares[o], waves, strict=False):
            if wave is not None:
                own = share.along(at.point[rows], axes[rows], moved[rows])
                seen = wave.reshape(rate.shape)[rows]
                values[rows] += 2 * (own.real * seen.real - own.imag * seen.imag).sum(-1)
    return values
