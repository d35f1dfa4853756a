"""Arrangements of the particles: the lattices of periodic cells, and the sides of the cells."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import RefusedError, is_number

Arrangement = Literal["square", "hexagonal"] | Sequence[float]
"""Arrangement of the particles by its name, or by both sides of a rectangle in any unit."""


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
    def is_isotropic(self) -> bool:
        """Whether a plane stiffness with the symmetry of the lattice is isotropic: of a hexagon."""
        return len(self.half_vectors) == 3

    @property
    def is_square(self) -> bool:
        """Whether C11 = C22 and C16 = C26 = 0 for particles with the symmetry of the lattice."""
        return self == SQUARE or self.is_isotropic

    @property
    def area(self) -> float:
        """Area of the cell; 4 for the square."""
        return float(4 * abs(np.linalg.det(self.half_vectors[:2])))

    @cached_property
    def corners(self) -> Array:
        """Corners counterclockwise, shape (4 or 6, 2), the first one between the sides −h1 and −h2.

        h1 and h2 are the first two of the half vectors.
        """
        half_vectors = np.array(self.half_vectors)
        outward = np.concatenate([-half_vectors, half_vectors])
        # Of a parallelogram the sum of two half vectors leads to a corner; in a regular hexagon the
        # corner is at 2/√3 of their length, and their sum √3 long.
        share = 1.0 if len(half_vectors) == 2 else 2 / 3
        return np.asarray(np.array(self.centre) + share * (outward + np.roll(outward, -1, axis=0)))

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
HEXAGONAL = Lattice(((1.0, 0.0), (0.5, 3**0.5 / 2), (-0.5, 3**0.5 / 2)))
"""The regular hexagon around a particle whose six neighbours are 2 away, two of them along x1."""
NAMED = {"square": SQUARE, "hexagonal": HEXAGONAL}
MAX_ASPECT = 10.0
"""Largest ratio of the sides of a rectangle. Tuned: meshes of longer ones take many elements."""


def lattice_of(arrangement: Arrangement) -> Lattice:
    """Return the cell of an arrangement, in which the nearest particles are 2 apart.

    Args:
        arrangement: "square", "hexagonal", or the two sides of a rectangle along x1 and x2, of
            which the ratio counts.

    Raises:
        RefusedError: It is none of these, a side is not positive and finite, or one is more than
            ten times the other.
    """
    if isinstance(arrangement, str):
        found = NAMED.get(arrangement)
    else:
        found = _rectangle(arrangement)
    if found is None:
        allowed = f'"square", "hexagonal" or two sides [a, b], of a ratio up to {MAX_ASPECT:g}'
        cure = "mesh another cell and give it as mesh.file"
        raise RefusedError("lattice", arrangement, allowed, cure)
    return found


def _rectangle(sides: Sequence[float]) -> Lattice | None:
    """Return the rectangle of two sides in any unit; None if they are not two allowed numbers."""
    if not isinstance(sides, Sequence) or len(sides) != 2:
        return None
    if not all(is_number(side) and 0 < side < np.inf for side in sides):
        return None
    # In units of the shorter side, which makes equal sides the square to the bit.
    width, height = (float(side) / min(sides) for side in sides)
    if max(width, height) > MAX_ASPECT:
        return None
    return Lattice(((width, 0.0), (0.0, height)))
