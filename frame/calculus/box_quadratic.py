"""Maxima of quadratics g·x + x·H·x/2 over boxes, many at once (eq. 22)."""

from __future__ import annotations

from itertools import combinations, product

import numpy as np

from alphacut.frame.calculus.jet import Array

FACES_UP_TO = 6
"""Number of parameters up to which all faces of the box are enumerated."""


def gain(g: Array, H: Array, x: Array) -> Array:
    """Values of g·x + x·H·x/2, shape (N, …), for g (N, d), H (N, d, d) and x (N, …, d)."""
    slope = (
        g + 0.5 * np.matmul(H, x[..., None])[..., 0]
        if x.ndim == 2
        else g[:, None] + 0.5 * np.matmul(x, H)
    )
    return np.asarray((slope * x).sum(-1))


def local_maximum(
    g: Array, H: Array, lower: Array, upper: Array, start: Array | None = None, *, rounds: int = 6
) -> Array:
    """Local maximum uphill from `start` (or 0), shape (N, d), by axis and Newton steps.

    Args:
        g: Gradients, shape (N, d).
        H: Symmetric Hessians, shape (N, d, d).
        lower: Lower ends of the boxes, shape (N, d).
        upper: Upper ends.
        start: Where to start, inside the boxes.
        rounds: Most repetitions.
    """
    x = np.zeros_like(g) if start is None else np.ascontiguousarray(start, float).copy()
    todo: Array = np.arange(len(g))
    for _ in range(rounds):
        part = (g[todo], H[todo], lower[todo], upper[todo])
        before = gain(*part[:2], x[todo])
        moved = x[todo]
        _axes_ascent(*part, moved)
        x[todo] = _newton(*part, _newton(*part, moved))
        grown = gain(*part[:2], x[todo]) - before
        todo = todo[grown > 1e-10 * (1e-6 + np.abs(before))]
        if not len(todo):
            break
    return x


def _axes_ascent(g: Array, H: Array, lower: Array, upper: Array, x: Array) -> None:
    """Maximise g·x + x·H·x/2 along one axis after the other, in place, x (N, d) in the boxes."""
    for i in range(g.shape[1]):
        curvature = H[:, i, i]
        slope = g[:, i] + np.einsum("nj,nj->n", H[:, i], x) - curvature * x[:, i]  # at x_i = 0
        low, high = lower[:, i], upper[:, i]
        end = np.where(slope * (high - low) + 0.5 * curvature * (high**2 - low**2) > 0, high, low)
        concave = curvature < 0
        x[:, i] = np.where(
            concave, np.clip(-slope / np.where(concave, curvature, -1.0), low, high), end
        )


def _newton(g: Array, H: Array, lower: Array, upper: Array, x: Array) -> Array:
    """Points (N, d) after a projected Newton step on the free axes, halved at most twice.

    Where no length raises g·x + x·H·x/2, x stays as it is.
    """
    slope = g + np.einsum("nij,nj->ni", H, x)
    free = ~(((x <= lower) & (slope <= 0)) | ((x >= upper) & (slope >= 0)))
    eye = np.eye(g.shape[1])
    reduced = (
        np.where(free[:, :, None] & free[:, None, :], H, -eye)
        - 1e-13 * np.abs(H).max((1, 2), keepdims=True) * eye
    )
    step = -np.linalg.solve(reduced, np.where(free, slope, 0.0)[..., None])[..., 0]
    best, top = x, gain(g, H, x)
    for length in (1.0, 0.5, 0.25):
        trial = np.clip(x + length * step, lower, upper)
        value = gain(g, H, trial)
        best, top = np.where((value > top)[:, None], trial, best), np.maximum(value, top)
    return best


def global_maximum(g: Array, H: Array, lower: Array, upper: Array) -> Array:
    """Points (N, d) of the boxes where g·x + x·H·x/2 is largest, by all faces' stationary points.

    With more than `FACES_UP_TO` parameters the number of faces forbids this; then the best local
    maximum from 0 and from the corner that the gradient points to.
    """
    d = g.shape[1]
    if d > FACES_UP_TO:
        starts = [np.zeros_like(g), np.where(g > 0, upper, lower)]
        optima = np.stack([local_maximum(g, H, lower, upper, start) for start in starts], 1)
        return np.asarray(optima[np.arange(len(g)), gain(g, H, optima).argmax(1)])
    best, best_gain = np.zeros_like(g, order="C"), np.zeros(len(g))
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
    """Stationary points of faces with the same free axes, shape (N, 2^(d − free), d)."""
    d = g.shape[1]
    bound = [i for i in range(d) if i not in free]
    corners = np.array(list(product((0, 1), repeat=len(bound))), int).reshape(
        2 ** len(bound), len(bound)
    )
    points = np.zeros((len(g), len(corners), d))
    for column, i in enumerate(bound):
        points[:, :, i] = np.where(
            corners[None, :, column] == 0, lower[:, None, i], upper[:, None, i]
        )
    if free:
        f = list(free)
        block = H[:, f][:, :, f]
        block = block - 1e-13 * (np.abs(block).max((1, 2), keepdims=True) + 1e-300) * np.eye(len(f))
        slope = g[:, None, f] + np.einsum("nij,ncj->nci", H[:, f], points)
        step = -np.linalg.solve(block, slope.swapaxes(1, 2)).swapaxes(1, 2)
        points[:, :, f] = np.clip(step, lower[:, None, f], upper[:, None, f])
    return points
