"""Maxima of quadratics g·x + x·H·x/2 over boxes, many at once (eq. 22)."""

from __future__ import annotations

from itertools import combinations, product

import numpy as np

from alphacut.base.kernels import compiled
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
    x = np.zeros(g.shape) if start is None else np.array(start, float, order="C")
    quadratics_and_boxes = (np.ascontiguousarray(array, float) for array in (g, H, lower, upper))
    _ascend(*quadratics_and_boxes, x, rounds)
    return x


@compiled
def _ascend(g: Array, H: Array, lower: Array, upper: Array, x: Array, rounds: int) -> None:
    """Ascend to local maxima of all problems, in place, x (N, d) in the boxes."""
    for n in range(len(g)):
        value = _value(g[n], H[n], x[n])
        for _ in range(rounds):
            before = value
            for i in range(x.shape[1]):
                low, high, curvature = lower[n, i], upper[n, i], H[n, i, i]
                slope = _slope(g[n], H[n], x[n], i) - curvature * x[n, i]  # at x_i = 0
                rise = slope * (high - low) + 0.5 * curvature * (high**2 - low**2)
                x[n, i] = high if rise > 0 else low
                if curvature < 0:
                    x[n, i] = min(max(-slope / curvature, low), high)
            for _ in range(2):
                value = _newton_step(g[n], H[n], lower[n], upper[n], x[n])
            if not value - before > 1e-10 * (1e-6 + abs(before)):
                break


@compiled
def _slope(g: Array, H: Array, x: Array, i: int) -> float:
    slope = g[i]
    for j in range(len(x)):
        slope += H[i, j] * x[j]
    return float(slope)


@compiled
def _value(g: Array, H: Array, x: Array) -> float:
    value = 0.0
    for i in range(len(x)):
        value += 0.5 * x[i] * (g[i] + _slope(g, H, x, i))
    return value


@compiled
def _newton_step(g: Array, H: Array, lower: Array, upper: Array, x: Array) -> float:
    """Value after a projected Newton step of length 1, ½ or ¼ on the free axes, if it gains."""
    d, best, start, free, step = len(x), _value(g, H, x), x.copy(), H.copy(), np.empty((len(x), 1))
    for i in range(d):
        slope = _slope(g, H, x, i)
        step[i, 0] = -slope
        if (x[i] <= lower[i] and slope <= 0) or (x[i] >= upper[i] and slope >= 0):
            free[i], free[:, i], step[i, 0] = 0.0, 0.0, 0.0
            free[i, i] = -1.0
    shift = SHIFT * (np.abs(free).max() + 1e-100)  # as in `_regular`
    for k in range(d):
        free[k, k] -= shift
    solve_in_place(free, step)
    for length in (1.0, 0.5, 0.25):
        trial = np.minimum(np.maximum(start + length * step[:, 0], lower), upper)
        value = _value(g, H, trial)
        if value > best:
            best, x[:] = value, trial
    return float(best)


@compiled
def solve_in_place(matrix: Array, b: Array) -> None:
    """Overwrite b (n, m) with the solutions x of A x = b by elimination with row exchanges."""
    n, m, A = len(matrix), b.shape[1], matrix.copy()
    for k in range(n):
        pivot = k
        for i in range(k + 1, n):
            if abs(A[i, k]) > abs(A[pivot, k]):
                pivot = i
        for j in range(n):
            A[k, j], A[pivot, j] = A[pivot, j], A[k, j]
        for j in range(m):
            b[k, j], b[pivot, j] = b[pivot, j], b[k, j]
        for i in range(k + 1, n):
            factor = A[i, k] / A[k, k]
            for j in range(k, n):
                A[i, j] -= factor * A[k, j]
            for j in range(m):
                b[i, j] -= factor * b[k, j]
    for k in range(n - 1, -1, -1):
        for j in range(m):
            for i in range(k + 1, n):
                b[k, j] -= A[k, i] * b[i, j]
            b[k, j] /= A[k, k]


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
    is_upper = np.array([*product((False, True), repeat=len(fixed))], bool)  # (corners, fixed)
    points = np.zeros((len(g), len(is_upper), d))
    points[:, :, fixed] = np.where(is_upper, upper[:, None, fixed], lower[:, None, fixed])
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
