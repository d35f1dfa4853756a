"""Splitting of touching and overlapping round particles in a labelled image."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from alphacut.stochastic.theta.truncated_normal import Array

Labels = NDArray[np.intp]

MOST = 8  # particles that one connected piece is split into at most
GAIN = 0.1  # of roundness that a split must bring
ROUNDS = 25  # of the assignment of pixels to circles


def roundness(rows: Array, columns: Array) -> float:
    """Share of the smallest round hull (diameter = longest chord) that pixels fill, about 0 … 1.

    Args:
        rows: Rows of the pixels, shape (n,).
        columns: Their columns, shape (n,).
    """
    from scipy.spatial import ConvexHull, QhullError

    points = np.stack([rows, columns], axis=1).astype(float)
    try:
        corners = points[ConvexHull(points).vertices]
    except QhullError:  # pixels of one line
        corners = points
    chord = np.hypot(*(corners[:, None] - corners[None]).T).max() + 1  # pixels have a width
    return float(len(points) / (np.pi / 4 * chord**2))


def split(rows: Array, columns: Array, least: float, smallest: float) -> Labels:
    """Parts of a piece that is not round, if they are rounder than the piece.

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
    best, parts_of = roundness(rows, columns), np.zeros(len(points), np.intp)
    if best >= least:
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
