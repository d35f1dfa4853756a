"""Estimates of what followers miss, by trajectories that share nothing with their search."""

from __future__ import annotations

import numpy as np

from alphacut.frame.boxes import UnitFlow
from alphacut.frame.calculus.low_discrepancy import chebyshev_points, corners
from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.progress_bar import Progress

SAMPLES = 64
"""Points of a kind on each level."""
SAFETY = 2.0
"""Factor on what they find beyond the bounds, and on what models still promise."""
MAX_RATIO = 8.0
"""Slope along a half width of the box, as a share of the output's range, from which on neighbouring
trajectories part."""


def independent_excess(flow: UnitFlow, bounds: Array, progress: Progress) -> tuple[Array, int]:
    """How far a sample of each level leaves the bounds (A, T, m, 2), shape (A, m), and its size."""
    missed, count = np.zeros((len(bounds), len(flow.outputs))), 0
    for level in range(len(bounds)):
        lower, upper = flow.boxes.unit(level)
        points = (lower + upper) / 2 + (upper - lower) / 2 * sample(len(lower), level)
        count += len(points)
        chunks = np.array_split(points, -(-len(points) // 32))
        for number, chunk in enumerate(chunks, start=1):
            values = flow.values(chunk)
            above, below = bounds[level, ..., 1], bounds[level, ..., 0]
            off = np.maximum(values.max(0) - above, -values.min(0) - below)
            missed[level] = np.maximum(missed[level], off.max(0))
            progress((level + number / len(chunks)) / len(bounds))
    return missed, count


def sample(d: int, level: int) -> Array:
    """Points of [−1, 1]^d where extremes may lie: inside, on faces and edges, at corners."""
    first = [100_003 * (level + 1) + k * SAMPLES for k in range(3)]
    inside, wide, ends = (chebyshev_points(d, SAMPLES, skip=skip) for skip in first)
    ends = np.sign(ends) if 2**d > SAMPLES else corners(-np.ones(d), np.ones(d))
    return np.concatenate([inside, np.clip(2 * wide, -1, 1), ends])


def needs_parting(steepest: Array, bounds: Array) -> bool:
    """True if trajectories part: their steepest slopes (m,) beside the range of (T, m, 2)."""
    width = (bounds[..., 0].max(0) + bounds[..., 1].max(0)) / 2
    return bool((steepest > MAX_RATIO * width).any())
