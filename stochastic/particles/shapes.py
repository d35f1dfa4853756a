"""Kinds of particles, discs and spheres: how much of its cell a particle of a radius fills."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from alphacut.base.arrays import Array


@dataclass(frozen=True)
class Shape:
    """Particles of one kind in their cells, of two or three dimensions.

    Args:
        particles: Name of the particles: discs or spheres.
        cells: Measure of a cell: area or volume.
        dimensions: 2 or 3.
        factor: Fraction of a cell of side 2 that a particle of radius 1 takes.
        reach: Largest reduced radius r_n that a map may have: the particle almost touches the sides
            of its cell.
        sequential: Fraction of the box up to which random sequential addition is quick.
        densest: Fraction of the box that packed particles may take, below random close packing.
    """

    particles: str
    cells: str
    dimensions: int
    factor: float
    reach: float
    sequential: float
    densest: float

    @property
    def largest(self) -> float:
        """Reduced radius r_n of a particle that fills its cell."""
        return float(self.factor ** (-1 / self.dimensions))

    def fractions(self, radii: ArrayLike) -> Array:
        """Return the area or volume fraction of a cell that particles of reduced radii fill."""
        return np.asarray(self.factor * np.asarray(radii, float) ** self.dimensions)

    def reduced_radius(self, fraction: float) -> float:
        """Return the reduced radius of a particle that takes a fraction of its cell."""
        return float((fraction / self.factor) ** (1 / self.dimensions))

    def measure(self, radii: ArrayLike) -> Array:
        """Return the area in m² or the volume in m³ of particles, of radii in m of any shape."""
        return self.fractions(radii) * 2.0**self.dimensions


DISCS = Shape(
    particles="discs",
    cells="area",
    dimensions=2,
    factor=np.pi / 4,  # π 1² over 2²
    reach=0.99,
    sequential=0.45,
    densest=0.82,
)
"""Discs in a plane, as of fibres or of a plane section."""
SPHERES = Shape(
    particles="spheres",
    cells="volume",
    dimensions=3,
    factor=np.pi / 6,  # 4/3 π 1³ over 2³
    reach=0.97,
    sequential=0.25,
    densest=0.58,
)
"""Spheres in space."""
