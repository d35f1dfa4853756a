"""Maxima of quadratics g·x + x·H·x/2 over boxes, many at once (eq. 22)."""

from __future__ import annotations

from itertools import combinations, product

import numpy as np

from alphacut.frame.calculus.jet import Array

FACES_UP_TO = 6
"""Number of parameters up to which all faces of the box are enumerated."""
SHIFT = 1e-13
"""Share of |H| by which a block is made more concave before it is solved, so that it is regular."""


def gain(g: Array, H: Array, x: Array) -> Array:
    """Values of g·x + x·H·x/2, shape (N, …), for g (N, d), H (N, d, d) and x (N, …, d)."""
    if x.ndim == 2:
        mean_slope = g + 0.5 * np.matmul(H, x[..., None])[..., 0]
    else:
        mean_slope = g[:, None] + 0.5 * np.matmul(x, H)
    return np.asarray((mean_slope * x).sum(-1))


def local_maximum(
    g: Array, H: Array, lower: Array, upper: Array, start: Array | None = None, *, rounds: int = 6
) -> Array:
    """Points (N, d) near local maxima of g·x + x·H·x/2 over boxes, uphill from `start` (or 0).

    Each round ascends along one axis after the other, then by two Newton steps.

    Args:
        g: Gradients, shape (N, d).
        H: Symmetric Hessians, shape (N, d, d).
        lower: Lower ends of the boxes, shape (N, d).
        upper: Upper ends.
        start: Where to start, inside the boxes.
        rounds: Most rounds; one that gains next to nothing is a problem's last.
    """
    x = np.zeros_like(g) if start is None else np.ascontiguousarray(start, float).copy()
    open_problems: Array = np.arange(len(g))
    for _ in range(rounds):
        quadratics = g[open_problems], H[open_problems]
        boxes = lower[open_problems], upper[open_problems]
        trial = x[open_problems]
        before = gain(*quadratics, trial)
        _axes_ascent(*quadratics, *boxes, trial)
        for _ in range(2):
            trial = _newton(*quadratics, *boxes, trial)
        x[open_problems] = trial
        increase = gain(*quadratics, trial) - before
        open_problems = open_problems[increase > 1e-10 * (1e-6 + np.abs(before))]
        if not len(open_problems):
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
    """Points (N, d) after a projected Newton step of length 1, ½ or ¼ on the free axes, or x."""
    slope = g + np.einsum("nij,nj->ni", H, x)
    free = ~(((x <= lower) & (slope <= 0)) | ((x >= upper) & (slope >= 0)))
    eye = np.eye(g.shape[1])
    reduced = _regular(np.where(free[:, :, None] & free[:, None, :], H, -eye))
    step = -np.linalg.solve(reduced, np.where(free, slope, 0.0)[..., None])[..., 0]
    best, top = x, gain(g, H, x)
    for length in (1.0, 0.5, 0.25):
        trial = np.clip(x + length * step, lower, upper)
        value = gain(g, H, trial)
        best, top = np.where((value > top)[:, None], trial, best), np.maximum(value, top)
    return best


def global_maximum(g: Array, H: Array, lower: Array, upper: Array) -> Array:
    """Points (N, d) of boxes where g·x + x·H·x/2 is largest, among all faces' stationary points.

    With more than `FACES_UP_TO` parameters there are too many faces: then the better of the local
    maxima from 0 and from the corner that the gradient points to.
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
            highest = np.arange(len(g)), values.argmax(1)
            better = values[highest] > best_gain
            best[better], best_gain[better] = points[highest][better], values[highest][better]
    return best


def _face_points(g: Array, H: Array, lower: Array, upper: Array, free: tuple[int, ...]) -> Array:
    """Stationary points (N, 2^(d − free), d) on faces with these free axes, clipped to them."""
    d = g.shape[1]
    fixed = [i for i in range(d) if i not in free]
    ends = list(product((0, 1), repeat=len(fixed)))  # 0: lower, 1: upper
    corners = np.array(ends, int).reshape(len(ends), len(fixed))
    points = np.zeros((len(g), len(corners), d))
    for column, i in enumerate(fixed):
        points[:, :, i] = np.where(
            corners[None, :, column] == 0, lower[:, None, i], upper[:, None, i]
        )
    if free:
        f = list(free)
        block = _regular(H[:, f][:, :, f])
        slope = g[:, None, f] + np.einsum("nij,ncj->nci", H[:, f], points)
        stationary = -np.linalg.solve(block, slope.swapaxes(1, 2)).swapaxes(1, 2)
        points[:, :, f] = np.clip(stationary, lower[:, None, f], upper[:, None, f])
    return points


def _regular(H: Array) -> Array:
    """Symmetric matrices (N, k, k) a little more concave, and by rounding not singular."""
    # also where H is zero: then a slope of any size leads out of the box, and is clipped to it
    size = np.abs(H).max((1, 2), keepdims=True) + 1e-100
    return np.asarray(H - SHIFT * size * np.eye(H.shape[-1]))
