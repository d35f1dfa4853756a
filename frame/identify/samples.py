"""Points of a set that a test tells, by random walks in it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from alphacut.fuzzy.arrays import Array, Mask

STEPS = 25  # of each walk
HALVINGS = 30  # of a chord until it lies in the set


def walk(
    inside: Callable[[Array], Mask],
    start: Array,
    box: tuple[Array, Array],
    number: int,
    generator: np.random.Generator,
) -> Array:
    """Ends of walks that hit and run: a point of a random chord, again and again.

    A chord is cut by the box, then from the point that falls outside the set on (shrinking slice
    sampler; Neal, Annals of Statistics 31, 2003). It is uniform in a convex set after long walks,
    and reaches only the part of a set in which its chords lie.

    Args:
        inside: Mask of points of the set, from points (n, d).
        start: A point of the set, shape (d,).
        box: Lower and upper ends of a box that holds the set, each (d,).
        number: Walks.
        generator: Source of chance.

    Returns:
        Points of the set, shape (number, d).
    """
    lower, upper = box
    points = np.tile(np.clip(start, lower, upper), (number, 1))
    for _ in range(STEPS):
        way = generator.standard_normal(points.shape) * (upper - lower)
        with np.errstate(divide="ignore", invalid="ignore"):
            ends = np.stack([(lower - points) / way, (upper - points) / way])
        ends = np.where(way != 0, ends, [[[-np.inf]], [[np.inf]]])
        low, high = ends.min(axis=0).max(axis=1), ends.max(axis=0).min(axis=1)
        low, high = np.nan_to_num(low, neginf=0.0), np.nan_to_num(high, posinf=0.0)
        moved = np.zeros(number, bool)
        for _ in range(HALVINGS):
            share = low + (high - low) * generator.random(number)
            place = np.clip(points + share[:, None] * way, lower, upper)
            hit = inside(place) & ~moved
            points = np.where(hit[:, None], place, points)
            moved |= hit
            if moved.all():
                break
            low = np.where(~moved & (share < 0), share, low)
            high = np.where(~moved & (share >= 0), share, high)
    return points
