"""Splitting of touching and overlapping round particles in a labelled image."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from alphacut.stochastic.theta.truncated_normal import Array

Labels = NDArray[np.intp]

MOST = 8  # particles that one connected piece is split into at most
CONVEX = 0.95  # convexity above which a piece has no neck to split it at
GAIN = 0.1  # of roundness that a split must bring
PUSHES = 60  # rounds of moving circles apart
ROUNDS = 25  # of the assignment of pixels to circles


def roundness(rows: Array, columns: Array) -> float:
    """Share of the smallest round hull (diameter = longest chord) that pixels fill, about 0 … 1.

    Args:
        rows: Rows of the pixels, shape (n,).
        columns: Their columns, shape (n,).
    """
    corners = _hull(rows, columns)
    chord = np.hypot(*(corners[:, None] - corners[None]).T).max()
    return float(len(rows) / (np.pi / 4 * chord**2))


def convexity(rows: Array, columns: Array) -> float:
    """Share of their convex hull that pixels fill, in (0, 1]."""
    x, y = _hull(rows, columns).T
    return float(len(rows) / (abs(x @ np.roll(y, 1) - y @ np.roll(x, 1)) / 2))


def _hull(rows: Array, columns: Array) -> Array:
    """Corners of the convex hull of pixels, each half a pixel wide to every side, in order."""
    from scipy.spatial import ConvexHull

    sides = np.array([[-0.5, 0], [0.5, 0], [0, -0.5], [0, 0.5]])
    points = (np.stack([rows, columns], axis=1)[:, None] + sides).reshape(-1, 2)
    return np.asarray(points[ConvexHull(points).vertices])


def split(rows: Array, columns: Array, least: float, smallest: float) -> Labels:
    """Parts of a piece that is neither round nor convex, if they are rounder than the piece.

    Every pixel goes to the circle whose edge it lies deepest inside; each circle takes the centroid
    and the area of its pixels, until nothing moves. Of two to eight parts the number is taken whose
    least round part is roundest.

    Args:
        rows: Rows of the piece's pixels, shape (n,).
        columns: Their columns, shape (n,).
        least: Roundness above which a piece is one particle.
        smallest: Least number of pixels of a part.

    Returns:
        Number of the part of each pixel, from 0, shape (n,); all 0 where the piece stays whole.
    """
    points = np.stack([rows, columns], axis=1).astype(float)
    best = roundness(rows, columns)
    parts_of: Labels = np.zeros(len(points), np.intp)
    if best >= least or convexity(rows, columns) >= CONVEX:
        return parts_of
    best += GAIN
    for parts in range(2, MOST + 1):
        found = _assigned(points, parts)
        if np.bincount(found, minlength=parts).min() < smallest:
            break
        worst = min(roundness(*points[found == part].T) for part in range(parts))
        if worst > best:
            best, parts_of = worst, found
    return parts_of


def _assigned(points: Array, parts: int) -> Labels:
    """Pixels to circles, from centres far apart."""
    centres = _far_apart(points, parts)
    radii = np.full(parts, np.sqrt(len(points) / parts / np.pi))
    found = np.full(len(points), -1, np.intp)
    for _ in range(ROUNDS):
        before = found
        inside = np.hypot(*(points[:, None] - centres[None]).transpose(2, 0, 1)) - radii
        found = np.argmin(inside, axis=1)
        if np.array_equal(found, before):
            break
        for part in range(parts):
            mine = points[found == part]
            if len(mine):
                centres[part] = mine.mean(0)
                radii[part] = np.sqrt(len(mine) / np.pi)
    return found


def _far_apart(points: Array, parts: int) -> Array:
    """Pixels that lie far from each other, the first one far from the centroid."""
    far = np.hypot(*(points - points.mean(0)).T)
    chosen = [points[np.argmax(far)]]
    for _ in range(parts - 1):
        nearest = np.min([np.hypot(*(points - one).T) for one in chosen], axis=0)
        chosen.append(points[np.argmax(nearest)])
    return np.array(chosen)


def pushed_apart(centres: Array, radii: Array) -> Array:
    """Centres of circles moved apart until none overlap, or as far as `PUSHES` rounds take them.

    Circles of the area of touching parts overlap a little where their parts are flat. Each round
    moves both circles of a pair by half of their overlap.

    Args:
        centres: shape (n, 2), in m.
        radii: shape (n,), in m.

    Returns:
        New centres, shape (n, 2), in m.
    """
    from scipy.spatial import cKDTree

    moved = centres.copy()
    for _ in range(PUSHES):
        pairs = cKDTree(moved).query_pairs(2 * radii.max(), output_type="ndarray")
        first, second = pairs.T
        line = moved[second] - moved[first]
        distance = np.hypot(*line.T)
        overlap = radii[first] + radii[second] - distance
        meet = overlap > 0
        if not meet.any():
            break
        push = (overlap[meet] / 2 / distance[meet])[:, None] * line[meet]
        np.add.at(moved, first[meet], -push)
        np.add.at(moved, second[meet], push)
    return moved
