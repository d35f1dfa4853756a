"""Points of a box from which searches begin, and their trajectories."""

from __future__ import annotations

import numpy as np

from alphacut.frame.calculus.jet import Array
from alphacut.frame.modal.optima import Response

NEAR, DECADES = 8, 8.0
"""One in how many fresh points lies near the faces, and how near: decades of the box's width."""


def fresh_points(rng: np.random.Generator, lower: Array, upper: Array, size: int) -> Array:
    """Random points of a box, many with coordinates on or near faces, shape (size, d)."""
    pool = rng.uniform(lower, upper, (size, len(lower)))
    faces = rng.random(pool.shape) < rng.choice([0.0, 0.3, 0.6], (size, 1))
    nearest = np.where(rng.random(pool.shape) < 0.5, lower, upper)
    near = np.arange(size) % NEAR == 0  # where an extreme beside a face would be too thin to meet
    away = 10.0 ** rng.uniform(-DECADES, 0, (int(near.sum()), 1))
    pool[near] = nearest[near] + away * (pool[near] - nearest[near])
    pool[faces] = nearest[faces]
    return pool


def trajectories(model: Response, points: Array, nodes: Array | None = None) -> Array:
    """Values of the model at points (P, d) and the nodes, all unless given, shape (P, T, m)."""
    wanted = slice(None) if nodes is None else nodes
    return np.concatenate(
        [model.values(points[k : k + 64])[:, wanted] for k in range(0, len(points), 64)]
    )
