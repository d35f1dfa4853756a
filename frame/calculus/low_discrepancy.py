"""Low-discrepancy points of Chebyshev density, denser towards the faces of the box."""

from __future__ import annotations

import numpy as np

from alphacut.frame.calculus.jet import Array


def primes(count: int) -> list[int]:
    """The first `count` primes."""
    found: list[int] = []
    candidate = 2
    while len(found) < count:
        if all(candidate % p for p in found):
            found.append(candidate)
        candidate += 1
    return found


def halton(dimension: int, count: int, *, skip: int = 1) -> Array:
    """Halton points in (0, 1), shape (count, dimension), digits scrambled."""
    out = np.zeros((count, dimension))
    for axis, base in enumerate(primes(dimension)):
        multiplier = max(1, round(base * 0.618))
        weight = 1.0 / base
        rest: Array = np.arange(skip, skip + count)
        while rest.any():
            rest, digit = np.divmod(rest, base)
            out[:, axis] += (digit * multiplier % base) * weight
            weight /= base
    return out


def chebyshev_points(dimension: int, count: int, *, skip: int = 1) -> Array:
    """Points of [−1, 1]^d of Chebyshev density, shape (count, dimension)."""
    return -np.cos(np.pi * halton(dimension, count, skip=skip))


def corners(lower: Array, upper: Array) -> Array:
    """All corners of a box, shape (2^d, d); axes without width count once."""
    axes = [(low,) if low == high else (low, high) for low, high in zip(lower, upper, strict=True)]
    return np.array(np.meshgrid(*axes, indexing="ij")).reshape(len(axes), -1).T
