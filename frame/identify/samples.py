"""Points of a set in a box: a first one by least squares, the others by random walks from it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.optimize import least_squares

from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.result import Ends

STEPS = 60  # of each walk
WALKS = 100  # at least: they show one another the way
TRIES = 50  # of a step
STARTS = 10  # of the search
MARGINS = (1.0, 0.5, 0.1, 1e-2, 1e-4)  # that the search asks for in turn; 1 is the middle

Violation = Callable[[Array], Array]
"""Distance of points (n, d) beyond each range of the set, (n, q), in half widths; <= 0 inside."""


def inner_point(violation: Violation, box: Ends, rng: np.random.Generator) -> Array | None:
    """Return a point (d,) at which no range is violated, by least squares; None if none is found.

    Args:
        violation: Violation of the ranges at points.
        box: Lower and upper ends of the box, shape (d,) each.
        rng: Random number generator.
    """
    for start in range(STARTS):
        unit_point = rng.random(len(box.lower)) if start else 0.5  # the middle first
        point = box.lower + (box.upper - box.lower) * unit_point
        for margin in MARGINS:
            fitted = least_squares(
                lambda x, margin=margin: np.maximum(violation(x[None])[0] + margin, 0.0),
                point,
                bounds=(box.lower - 1e-9, box.upper + 1e-9),  # a side may have no width
                max_nfev=30,
            )
            point = np.clip(fitted.x, *box)
            if (violation(point[None]) <= 0).all():
                return np.asarray(point)
    return None


def random_walks(
    violation: Violation, start: Array, box: Ends, number: int, rng: np.random.Generator
) -> Array:
    """Return points (number, d) of a set in a box, reached by random walks (hit and run).

    Each step is a point of a random chord, cut at points outside the set (shrinking slice sampler;
    Neal, Annals of Statistics 31, 2003). Every second chord points from one walk to another, as
    long and thin sets need (ter Braak, Statistics and Computing 16, 2006). The points become
    uniform in a convex set; in others they reach the part in which such chords lie.

    Args:
        violation: Violation of the ranges at points; the set is where none is positive.
        start: A point of the set, shape (d,).
        box: Lower and upper corner of the box, shape (d,) each.
        number: Number of points.
        rng: Random number generator.
    """
    points, width = np.tile(start, (max(number, WALKS), 1)), box.upper - box.lower
    chord_ends: Array = np.tile([[-1.0], [1.0]], len(points))
    for step in range(STEPS):
        direction = rng.standard_normal(points.shape) * width
        if step % 2:
            direction = rng.permutation(points) - rng.permutation(points)
        longest = np.abs(direction / np.where(width > 0, width, 1.0)).max(axis=1, keepdims=True)
        direction /= np.where(longest > 0, longest, 1.0)  # now as long as the box
        (low, high), has_moved = chord_ends, np.full(len(points), False)
        for _ in range(TRIES):
            position = rng.uniform(low, high)  # on the chord, 0 at the point itself
            candidate = points + position[:, None] * direction
            is_inside = ((box.lower <= candidate) & (candidate <= box.upper)).all(axis=1)
            is_accepted = is_inside & (violation(candidate) <= 0).all(axis=1) & ~has_moved
            points[is_accepted], has_moved[is_accepted] = candidate[is_accepted], True
            if has_moved.all():
                break
            low = np.where(position < 0, position, low)
            high = np.where(position < 0, high, position)
    return points[:number]
