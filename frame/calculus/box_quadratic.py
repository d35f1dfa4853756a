"""Maxima of quadratics g·x + x·H·x/2 over boxes, many at once (eq. 22)."""

from __future__ import annotations

from itertools import combinations, product

import numpy as np

from alphacut.base.kernels import compiled
from alphacut.frame.calculus.polynomials import Array

# Fraction of max|H| by which Hessians are made more concave before they are solved. It is far above
# the unit roundoff, so that no Hessian stays singular, and far below what changes a maximum
# visibly.
SHIFT = 1e-13


def gain(g: Array, H: Array, x: Array) -> Array:
    """Return the values of N quadratics g·x + x·H·x/2 at points.

    Args:
        g: Gradients at x = 0, shape (N, d).
        H: Symmetric Hessians, shape (N, d, d).
        x: One point for each quadratic, shape (N, d), or several, shape (N, points, d).

    Returns:
        Shape (N,) or (N, points).
    """
    if x.ndim == 2:
        mean_slope = g + 0.5 * np.matmul(H, x[..., None])[..., 0]
    else:
        mean_slope = g[:, None] + 0.5 * np.matmul(x, H)
    return np.asarray((mean_slope * x).sum(-1))


def local_maximum(
    g: Array, H: Array, lower: Array, upper: Array, start: Array | None = None, *, rounds: int = 6
) -> Array:
    """Return points near local maxima of N quadratics g·x + x·H·x/2 over N boxes.

    Each round maximises along one axis after the other and then makes two projected Newton steps.
    No step goes downhill. The points need not be exact maxima.

    Args:
        g: Gradients at x = 0, shape (N, d).
        H: Symmetric Hessians, shape (N, d, d).
        lower: Lower ends of the boxes, shape (N, d).
        upper: Upper ends of the boxes, shape (N, d).
        start: Where the ascents begin, inside the boxes, shape (N, d), not changed. None stands for
            x = 0, which must lie in the boxes then.
        rounds: Largest number of rounds. An ascent ends earlier where a round gains at most 1e-10
            of the value, or 1e-16.

    Returns:
        Shape (N, d), a new array.
    """
    if start is None:
        start = np.zeros(g.shape)
    x = np.array(start, float, order="C")
    gradients = np.ascontiguousarray(g, float)
    hessians = np.ascontiguousarray(H, float)
    lower_ends = np.ascontiguousarray(lower, float)
    upper_ends = np.ascontiguousarray(upper, float)
    _ascend(gradients, hessians, lower_ends, upper_ends, x, rounds)
    return x


@compiled
def _ascend(g: Array, H: Array, lower: Array, upper: Array, x: Array, rounds: int) -> None:
    """Move N points uphill on N quadratics g·x + x·H·x/2 within their boxes, in place.

    Each round maximises along one axis after the other and then makes two projected Newton steps.
    No step goes downhill, but for rounding.

    Args:
        g: Gradients at x = 0, shape (N, d).
        H: Symmetric Hessians, shape (N, d, d).
        lower: Lower ends of the boxes, shape (N, d).
        upper: Upper ends of the boxes, shape (N, d).
        x: The points, inside the boxes, shape (N, d).
        rounds: Largest number of rounds; an ascent ends earlier where a round gains less than 1e-10
            of the value or 1e-16.
    """
    for n in range(len(g)):
        value = _value(g[n], H[n], x[n])
        for _ in range(rounds):
            before = value
            for i in range(x.shape[1]):
                low = lower[n, i]
                high = upper[n, i]
                curvature = H[n, i, i]
                # along x_i the quadratic is slope x_i + curvature x_i²/2, and `rise` is its value
                # at the upper end less that at the lower end
                slope = _slope(g[n], H[n], x[n], i) - curvature * x[n, i]
                rise = slope * (high - low) + 0.5 * curvature * (high**2 - low**2)
                # along an axis that curves upwards the maximum lies at an end; else at the
                # stationary point, or at the end next to it
                x[n, i] = high if rise > 0 else low
                if curvature < 0:
                    x[n, i] = min(max(-slope / curvature, low), high)
            for _ in range(2):
                value = _newton_step(g[n], H[n], lower[n], upper[n], x[n])
            # also where the gain is NaN, so that the loop ends
            if not value - before > 1e-10 * (1e-6 + abs(before)):
                break


@compiled
def _slope(g: Array, H: Array, x: Array, i: int) -> float:
    """Return the derivative (g + H x)_i of g·x + x·H·x/2 by x_i; g and x have shape (d,)."""
    slope = g[i]
    for j in range(len(x)):
        slope += H[i, j] * x[j]
    return float(slope)


@compiled
def _value(g: Array, H: Array, x: Array) -> float:
    """Return g·x + x·H·x/2 = Σ_i x_i (g_i + (g + H x)_i)/2."""
    value = 0.0
    for i in range(len(x)):
        value += 0.5 * x[i] * (g[i] + _slope(g, H, x, i))
    return value


@compiled
def _newton_step(g: Array, H: Array, lower: Array, upper: Array, x: Array) -> float:
    """Make a projected Newton step on a quadratic within a box, and return its value afterwards.

    The quadratic is g·x + x·H·x/2. An axis is held where x is at an end of the box beyond which the
    quadratic rises. The step is tried in its full length, in half and in a quarter, each clipped to
    the box; x moves, in place, to the best of these points that gains, and stays if none does.

    Loops stand in place of NumPy's expressions, which Numba takes ten times as long to compile.

    Args:
        g: Gradient at x = 0, shape (d,).
        H: Symmetric Hessian, shape (d, d); it may be singular.
        lower: Lower ends of the box, shape (d,).
        upper: Upper ends of the box, shape (d,).
        x: The point, inside the box, shape (d,).
    """
    d = len(x)
    best = _value(g, H, x)
    start = x.copy()
    free = H.copy()
    step = np.empty((len(x), 1))
    for i in range(d):
        slope = _slope(g, H, x, i)
        step[i, 0] = -slope
        if (x[i] <= lower[i] and slope <= 0) or (x[i] >= upper[i] and slope >= 0):
            # the equation of a held axis becomes −step_i = 0
            for j in range(d):
                free[i, j] = 0.0
                free[j, i] = 0.0
            step[i, 0] = 0.0
            free[i, i] = -1.0
    # The Hessian is made more concave by 1e-13 of its largest entry, so that it is not singular; a
    # zero one as well. The Newton step is then an ascent direction of a concave quadratic.
    largest = 1e-100
    for i in range(d):
        for j in range(d):
            largest = max(largest, abs(free[i, j]))
    for k in range(d):
        free[k, k] -= SHIFT * largest
    solve_in_place(free, step)
    trial = np.empty(d)
    length = 1.0
    while length >= 0.25:
        for i in range(d):
            trial[i] = min(max(start[i] + length * step[i, 0], lower[i]), upper[i])
        value = _value(g, H, trial)
        if value > best:
            best = value
            for i in range(d):
                x[i] = trial[i]
        length /= 2
    return float(best)


@compiled
def solve_in_place(matrix: Array, b: Array) -> None:
    """Overwrite b with the solutions of A x = b by Gaussian elimination with partial pivoting.

    Args:
        matrix: A, shape (n, n); it is not changed. If it is singular, b receives infinities or NaN.
        b: Right-hand sides as columns, shape (n, m).
    """
    n = len(matrix)
    m = b.shape[1]
    A = matrix.copy()
    # elimination below the diagonal, with the largest entry of each column as the pivot
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
    # back substitution
    for k in range(n - 1, -1, -1):
        for j in range(m):
            for i in range(k + 1, n):
                b[k, j] -= A[k, i] * b[i, j]
            b[k, j] /= A[k, k]


def global_maximum(g: Array, H: Array, lower: Array, upper: Array) -> Array:
    """Return the points of N boxes where N quadratics g·x + x·H·x/2 are largest.

    A maximum over a box is a stationary point on the interior of one of its 3^d faces. Up to six
    parameters all faces are searched. With more, which are too many faces, the better of two local
    maxima is taken, uphill from 0 and from the corner that the gradient points to; this need not be
    the largest one.

    Args:
        g: Gradients at x = 0, shape (N, d).
        H: Symmetric Hessians, shape (N, d, d).
        lower: Lower ends of the boxes, which hold x = 0, shape (N, d).
        upper: Upper ends of the boxes, shape (N, d).

    Returns:
        Shape (N, d). The quadratic is not negative there; where no point has a positive value it is
        x = 0, for d ≤ 6.
    """
    d = g.shape[1]
    problems = np.arange(len(g))
    if d > 6:
        corners = np.where(g > 0, upper, lower)
        from_zero = local_maximum(g, H, lower, upper, np.zeros_like(g))
        from_corner = local_maximum(g, H, lower, upper, corners)
        optima = np.stack([from_zero, from_corner], 1)
        return np.asarray(optima[problems, gain(g, H, optima).argmax(1)])
    best = np.zeros_like(g, order="C")
    best_gain = np.zeros(len(g))
    for size in range(d + 1):
        for free in combinations(range(d), size):
            points = _face_points(g, H, lower, upper, free)
            values = gain(g, H, points)
            highest = values.argmax(1)
            highest_values = values[problems, highest]
            is_better = highest_values > best_gain
            best[is_better] = points[problems, highest][is_better]
            best_gain[is_better] = highest_values[is_better]
    return best


def _face_points(g: Array, H: Array, lower: Array, upper: Array, free: tuple[int, ...]) -> Array:
    """Return stationary points of N quadratics on all faces of their boxes with the same free axes.

    The quadratics are g·x + x·H·x/2.

    Args:
        g: Gradients at x = 0, shape (N, d).
        H: Symmetric Hessians, shape (N, d, d). Over the free axes they are shifted by 1e-13 of
            their largest entry, so that a stationary point exists.
        lower: Lower ends of the boxes, shape (N, d).
        upper: Upper ends of the boxes, shape (N, d).
        free: Indices of the axes along which these faces extend, rising; along the others they lie
            at an end of the box. Without free axes the faces are the corners.

    Returns:
        The points, clipped to their faces, shape (N, 2^(d − len(free)), d). The last fixed axis
        changes its end fastest, and lower ends come first.
    """
    d = g.shape[1]
    fixed = [i for i in range(d) if i not in free]
    is_upper = np.array(list(product((False, True), repeat=len(fixed))), bool)  # (faces, fixed)
    points = np.zeros((len(g), len(is_upper), d))
    points[:, :, fixed] = np.where(is_upper, upper[:, None, fixed], lower[:, None, fixed])
    if free:
        f = list(free)
        hessian = _regular(H[:, f][:, :, f])
        # The points are still zero along the free axes, so that this is the slope at the place
        # where the face meets them, and one linear system leads to the stationary point.
        slope = g[:, None, f] + np.einsum("nij,ncj->nci", H[:, f], points)
        stationary = -np.linalg.solve(hessian, slope.swapaxes(1, 2)).swapaxes(1, 2)
        points[:, :, f] = np.clip(stationary, lower[:, None, f], upper[:, None, f])
    return points


def _regular(H: Array) -> Array:
    """Return symmetric matrices, shape (N, k, k), shifted so that none is singular.

    The shift takes 1e-13 of the largest entry from the diagonal, which makes the quadratics more
    concave. A matrix of zeros is shifted as well: then a slope of any size leads out of the box,
    and the point is clipped to it.
    """
    magnitude = np.abs(H).max((1, 2), keepdims=True) + 1e-100
    return np.asarray(H - SHIFT * magnitude * np.eye(H.shape[-1]))
