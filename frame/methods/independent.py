"""Estimates of what followers miss, by trajectories that share nothing with their search."""

from __future__ import annotations

import numpy as np

from alphacut.frame.boxes import UnitFlow
from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.progress_bar import Progress
from alphacut.fuzzy.sets.boxes import chebyshev_points, corners

SAMPLES = 64
"""Points of a kind on each level."""
SAFETY = 2.0
"""Factor on what they find beyond the bounds, and on the gain that models still predict."""
MAX_RATIO = 8.0
"""Slope along a half width of the box, as a share of the output's range, from which on neighbouring
trajectories part."""


def independent_excess(flow: UnitFlow, bounds: Array, progress: Progress) -> tuple[Array, int]:
    """Return how far outputs of an independent sample exceed the bounds on each level.

    Args:
        flow: The motion and its boxes.
        bounds: Upper bounds of (−output, output), shape (A, T, m, 2).
        progress: Called with the completed fraction.

    Returns:
        Largest excess of each output over time, shape (A, m), and the number of motions.
    """
    largest, count = np.zeros((len(bounds), len(flow.outputs))), 0
    for level in range(len(bounds)):
        lower, upper = flow.boxes.unit(level)
        points = (lower + upper) / 2 + (upper - lower) / 2 * sample(len(lower), level)
        count += len(points)
        chunks = np.array_split(points, -(-len(points) // 32))
        for number, chunk in enumerate(chunks, start=1):
            values = flow.values(chunk)
            above, below = bounds[level, ..., 1], bounds[level, ..., 0]
            excess = np.maximum(values.max(0) - above, -values.min(0) - below)
            largest[level] = np.maximum(largest[level], excess.max(0))
            progress((level + number / len(chunks)) / len(bounds))
    return largest, count


def sample(d: int, level: int) -> Array:
    """Return sample points (S, d) of [−1, 1]^d: inside, on faces and edges, and corners."""
    first = [100_003 * (level + 1) + k * SAMPLES for k in range(3)]
    inside, wide, ends = (chebyshev_points(d, SAMPLES, skip=skip) for skip in first)
    ends = np.sign(ends) if 2**d > SAMPLES else corners(-np.ones(d), np.ones(d))
    return np.concatenate([inside, np.clip(2 * wide, -1, 1), ends])


def trajectories_diverge(steepest: Array, bounds: Array) -> bool:
    """Return whether neighbouring trajectories diverge, so that Taylor models predict nothing.

    Args:
        steepest: Largest slope of each output along a unit coordinate, shape (m,).
        bounds: Upper bounds of (−output, output), shape (T, m, 2).
    """
    width = (bounds[..., 0].max(0) + bounds[..., 1].max(0)) / 2
    return bool((steepest > MAX_RATIO * width).any())
