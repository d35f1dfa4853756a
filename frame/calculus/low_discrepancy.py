"""Low-discrepancy points of Chebyshev density, denser towards the faces of the box."""

from __future__ import annotations

from itertools import product

import numpy as np

from alphacut.frame.calculus.jet import Array

SCRAMBLED = 3
"""Seed of the digits' permutations."""


def chebyshev_points(dimension: int, count: int, *, skip: int = 1) -> Array:
    """Points of [−1, 1]^d of Chebyshev density, shape (count, dimension); the first ones nested."""
    from scipy.stats import qmc  # which takes time to import

    points = qmc.Halton(dimension, rng=np.random.default_rng(SCRAMBLED)).fast_forward(skip)
    return np.asarray(-np.cos(np.pi * points.random(count)))


def corners(lower: Array, upper: Array) -> Array:
    """All corners of a box, shape (2^d, d); axes without width count once."""
    pairs = zip(lower, upper, strict=True)
    return np.array(list(product(*[dict.fromkeys(pair) for pair in pairs])))
