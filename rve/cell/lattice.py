"""Arrangements of the particles: the lattices of periodic cells, and the sides of the cells."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from alphacut.base.arrays import Array


@dataclass(frozen=True)
class Lattice:
    """A periodic cell with two pairs of opposite sides, or with three as a regular hexagon.

    The side coordinate of a pair is −1 on its first side, 1 on its second one, and linear between.

    Args:
        half_vectors: For each pair half the vector of the lattice from the first side to the second
            one, (x1, x2). Those of a hexagon stand at right angles to its sides.
        centre: Centre of the cell, (x1, x2).
    """

    half_vectors: tuple[tuple[float, float], ...]
    centre: tuple[float, float] = (0.0, 0.0)

    @cached_property
    def normals(self) -> Array:
        """Gradients of the side coordinates, shape (pairs, 2)."""
        half_vectors = np.array(self.half_vectors)
        if len(half_vectors) == 2:
            # A half vector changes its own side coordinate by 1 and leaves the other one.
            return np.asarray(np.linalg.inv(half_vectors).T)
        return np.asarray(half_vectors / (half_vectors**2).sum(axis=1, keepdims=True))

    @property
    def area(self) -> float:
        """Area of the cell; 4 for the square."""
        return float(4 * abs(np.linalg.det(self.half_vectors[:2])))

    def side_coordinates(self, points: Array) -> Array:
        """Return the side coordinates of points, shape (…, 2), in the shape (…, pairs)."""
        return np.asarray((points - np.array(self.centre)) @ self.normals.T)

    def along_sides(self, points: Array, pair: int) -> Array:
        """Return a coordinate along the sides of a pair, equal at periodic partners.

        Args:
            points: Points, shape (n, 2).
            pair: Number of the pair of sides.
        """
        # The side coordinate of another pair, less what it changes from a side to the other.
        other = self.normals[pair - 1]
        tangent = other - (other @ np.array(self.half_vectors[pair])) * self.normals[pair]
        return np.asarray((points - np.array(self.centre)) @ tangent)


SQUARE = Lattice(((1.0, 0.0), (0.0, 1.0)))
"""The cell [−1, 1]²."""
