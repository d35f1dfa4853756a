"""Maximising quadratics g·x + x·H·x/2 over boxes, many at once (the approximate problems of eq. 22)."""

from __future__ import annotations

from itertools import combinations, product

import numpy as np

from frame.jet import Array

FACES_UP_TO = 6
"""Number of parameters up to which all faces of the box are enumerated."""


def gain(g: Array, H: Array, x: Array) -> Array:
    """g·x + x·H·x/2 for g (N, d), H (N, d, d) and x (N, …, d)."""
    total: Array = np.einsum("ni,n...i->n...", g, x) + 0.5 * np.einsum("n...i,nij,n...j->n...", x, H, x, optimize=True)
    return total


def linear_maximum(g: Array, lower: Array, upper: Array) -> Array:
    """The corner that maximises g·x, shape (N, d) (κ = 1)."""
    return np.where(g > 0, upper, lower)


def local_maximum(g: Array, H: Array, lower: Array, upper: Array, start: Array | None = None) -> Array:
    """A local maximum uphill from `start` (or 0), shape (N, d): exact steps along each axis, then Newton on the free axes.

    Args:
        g: Gradients, shape (N, d).
        H: Symmetric Hessians, shape (N, d, d).
        lower: Lower ends of the boxes, shape (N, d).
        upper: Upper ends.
        start: Where to start, inside the boxes.
    """
    x = np.zeros_like(g) if start is None else start.copy()
    for _ in range(6):
        before = gain(g, H, x)
        _axes_ascent(g, H, lower, upper, x)
        x = _newton(g, H, lower, upper, x)
        if (gain(g, H, x) - before <= 1e-12 * (1 + np.abs(before))).all():
            break
    return x


def _axes_ascent(g: Array, H: Array, lower: Array, upper: Array, x: Array) -> None:
    for i in range(g.shape[1]):
        curvature = H[:, i, i]
        slope = g[:, i] + np.einsum("nj,nj->n", H[:, i], x) - curvature * x[:, i]  # at x_i = 0
        low, high = lower[:, i], upper[:, i]
        end = np.where(slope * (high - low) + 0.5 * curvature * (high**2 - low**2) > 0, high, low)
        concave = curvature < 0
        x[:, i] = np.where(concave, np.clip(-slope / np.where(concave, curvature, -1.0), low, high), end)


def _newton(g: Array, H: Array, lower: Array, upper: Array, x: Array) -> Array:
    """One Newton step on the axes strictly inside, cut at the box, kept where it gains."""
    inside = (x > lower) & (x < upper)
    slope = np.where(inside, g + np.einsum("nij,nj->ni", H, x), 0.0)
    eye = np.eye(g.shape[1])
    reduced = np.where(inside[:, :, None] & inside[:, None, :], H, -eye) - 1e-13 * np.abs(H).max(initial=0.0) * eye
    trial = np.clip(x - np.linalg.solve(reduced, slope[..., None])[..., 0], lower, upper)
    better = gain(g, H, trial) > gain(g, H, x)
    return np.where(better[:, None], trial, x)


def global_maximum(g: Array, H: Array, lower: Array, upper: Array) -> Array:
    """The global maximum, shape (N, d), by the stationary points of all faces of the box; arguments as `local_maximum`.

    With more than `FACES_UP_TO` parameters the number of faces forbids this; then the best local maximum from 0, from the corner that
    the gradient points to, and from the ends of the axis of most gain.
    """
    d = g.shape[1]
    if d > FACES_UP_TO:
        return _best_of_starts(g, H, lower, upper)
    best, best_gain = np.zeros_like(g), np.zeros(len(g))
    for size in range(d + 1):
        for free in combinations(range(d), size):
            points = _face_points(g, H, lower, upper, free)
            values = gain(g, H, points)
            pick = values.argmax(1)
            top = values[np.arange(len(g)), pick]
            better = top > best_gain
            best[better], best_gain[better] = points[np.arange(len(g)), pick][better], top[better]
    return best


def _face_points(g: Array, H: Array, lower: Array, upper: Array, free: tuple[int, ...]) -> Array:
    """Stationary points of all faces with the same free axes, cut at the box, shape (N, 2^(d − free), d)."""
    d = g.shape[1]
    bound = [i for i in range(d) if i not in free]
    corners = np.array(list(product((0, 1), repeat=len(bound))), int).reshape(2 ** len(bound), len(bound))
    points = np.zeros((len(g), len(corners), d))
    for column, i in enumerate(bound):
        points[:, :, i] = np.where(corners[None, :, column] == 0, lower[:, None, i], upper[:, None, i])
    if free:
        f = list(free)
        block = H[:, f][:, :, f]
        block = block - 1e-13 * (np.abs(block).max((1, 2), keepdims=True) + 1e-300) * np.eye(len(f))
        slope = g[:, None, f] + np.einsum("nij,ncj->nci", H[:, f], points)
        step = -np.linalg.solve(block, slope.swapaxes(1, 2)).swapaxes(1, 2)
        points[:, :, f] = np.clip(step, lower[:, None, f], upper[:, None, f])
    return points


def _best_of_starts(g: Array, H: Array, lower: Array, upper: Array) -> Array:
    starts = [np.zeros_like(g), linear_maximum(g, lower, upper)]
    axis = np.abs(g).argmax(1)
    for end in (lower, upper):
        start = np.zeros_like(g)
        start[np.arange(len(g)), axis] = end[np.arange(len(g)), axis]
        starts.append(start)
    found = np.stack([local_maximum(g, H, lower, upper, start) for start in starts], 1)
    pick = gain(g, H, found).argmax(1)
    best: Array = found[np.arange(len(g)), pick]
    return best
