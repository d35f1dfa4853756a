"""Corners of boxes: bounds of motions that depend on parameters one way."""

from __future__ import annotations

import numpy as np

from alphacut.frame.boxes import UnitFlow
from alphacut.frame.calculus.jet import Array
from alphacut.frame.calculus.low_discrepancy import corners

CORNERS = 64
"""Corners of each box that are looked at, at most."""


def signs(d: int, most: int) -> Array:
    """All corners of [−1, 1]^d, or `most` of them, two opposite ones among them, shape (S, d)."""
    if 2**d <= most:
        return corners(-np.ones(d), np.ones(d))
    drawn = np.random.default_rng(7).choice([-1.0, 1.0], (most - 2, d))
    return np.vstack([-np.ones(d), np.ones(d), drawn])


def taken_in(flow: UnitFlow, bounds: Array, at: Array) -> tuple[Array, Array, Array, int]:
    """Bounds that no corner of their boxes passes.

    Args:
        flow: The trajectories.
        bounds: Upper bounds of (−output, output), shape (A, T, m, 2).
        at: Their unit coordinates, shape (A, T, m, 2, d).

    Returns:
        The bounds, their unit coordinates, by how much a corner passed those of an output on a
        level at most, shape (A, m), and the number of trajectories.
    """
    bounds, at, runs = bounds.copy(), at.copy(), 0
    missed = np.zeros((len(bounds), len(flow.outputs)))
    top, place = np.full(bounds.shape[1:], -np.inf), np.zeros(at.shape[1:])
    for level in reversed(range(len(bounds))):
        lower, upper = flow.boxes.unit(level)
        tried = np.unique(
            (lower + upper) / 2 + (upper - lower) / 2 * signs(len(lower), CORNERS), axis=0
        )
        runs += len(tried)
        for point, values in zip(tried, flow.values(tried), strict=True):
            signed = np.stack([-values, values], -1)
            better = signed > top
            top[better], place[better] = signed[better], point
        passed = top > bounds[level]
        missed[level] = np.where(passed, top - bounds[level], 0.0).max((0, 2))
        bounds[level][passed], at[level][passed] = top[passed], place[passed]
    return bounds, at, missed, runs
