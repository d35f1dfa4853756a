"""Discs in a rectangle and spheres in a box, periodic or seen through an open window."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from alphacut.fuzzy.arrays import Array, Mask, Rows
from alphacut.fuzzy.refused import require


@dataclass(frozen=True)
class Shape:
    """Particles of one kind in their cells, of two or three dimensions.

    Args:
        particles: discs or spheres.
        cells: Measure of a cell: area or volume.
        dimensions: 2 or 3.
        factor: Share of a cell of side 2 that a particle of radius 1 takes.
        reach: Greatest r_n that a map may have: the particle almost touches its cell's sides.
        sequential: Share of the box up to which random sequential addition is quick.
        densest: Share of the box that packed particles may take, below random close packing.
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
        """r_n of a particle that fills its cell."""
        return float(self.factor ** (-1 / self.dimensions))

    def fractions(self, radii: ArrayLike) -> Array:
        """Return the area or volume fraction of a cell that particles of reduced radii fill."""
        return np.asarray(self.factor * np.asarray(radii, float) ** self.dimensions)

    def reduced_radius(self, fraction: float) -> float:
        """Reduced radius of a particle that takes a share of its cell."""
        return float((fraction / self.factor) ** (1 / self.dimensions))

    def measure(self, radii: ArrayLike) -> Array:
        """Area in m² or volume in m³ of particles, of radii in m of any shape."""
        return self.fractions(radii) * 2.0**self.dimensions


DISCS = Shape("discs", "area", 2, np.pi / 4, 0.99, 0.45, 0.82)
SPHERES = Shape("spheres", "volume", 3, np.pi / 6, 0.97, 0.25, 0.58)


@dataclass(frozen=True, eq=False)
class Particles:
    """Discs in the rectangle [0, width] × [0, height], or spheres in a box.

    Args:
        centres: shape (n, 2) or (n, 3), in m, inside the rectangle or box.
        radii: shape (n,), in m, not negative.
        size: Sides of the rectangle or box, shape (2,) or (3,), in m.
        periodic: Whether it repeats itself; otherwise it is a window on a larger section.

    Raises:
        RefusedError: A shape is wrong, a number is not finite, or a particle lies outside.
    """

    centres: Array
    radii: Array
    size: Array
    periodic: bool = True

    def __post_init__(self) -> None:
        size = np.array(self.size, float).ravel()
        centres: Array = np.array(self.centres, float).reshape(-1, len(size))
        radii = np.array(self.radii, float).ravel()
        value = f"{len(radii)} numbers"
        allowed = f"{len(centres)} positions, of one particle or more"
        require(0 < len(radii) == len(centres), "radii", value=value, allowed=allowed)
        _require_all((size > 0) & (size < np.inf), "size", size, "positive, finite lengths in m")
        _require_all(np.isfinite(centres).all(axis=1), "centres", centres, "finite lengths in m")
        is_length = (radii >= 0) & (radii < np.inf)
        _require_all(is_length, "radii", radii, "finite lengths from 0 m on")
        if self.periodic:
            wrapped = np.mod(centres, size)
            centres = np.where(wrapped < size, wrapped, 0.0)
        else:
            is_inside = ((centres >= 0) & (centres <= size)).all(axis=1)
            allowed = f"places in the window of {size.tolist()} m"
            _require_all(is_inside, "centres", centres, allowed)
        for name, array in (("centres", centres), ("radii", radii), ("size", size)):
            object.__setattr__(self, name, array)

    def __len__(self) -> int:
        return len(self.radii)

    @property
    def shape(self) -> Shape:
        """Kind of the particles."""
        return DISCS if len(self.size) == 2 else SPHERES

    @property
    def measure(self) -> float:
        """Area of the rectangle in m², or volume of the box in m³."""
        return float(self.size.prod())

    @property
    def fraction(self) -> float:
        """Measure of all particles over that of the rectangle or box."""
        return float(self.shape.measure(self.radii).sum() / self.measure)

    @property
    def spacing(self) -> float:
        """Side of the square or cube of one particle's share, in m."""
        return float((self.measure / len(self)) ** (1 / len(self.size)))

    def separation(self, first: Rows, second: Rows) -> Array:
        """Return vectors from centres `first` to the nearest images of `second`, (…, d), in m."""
        offset: Array = self.centres[second] - self.centres[first]
        return nearest_image(offset, self.size) if self.periodic else offset


def nearest_image(offset: Array, size: Array) -> Array:
    """Return vectors between centres (…, d) to the nearest image in a periodic box of `size`."""
    return np.asarray(offset - size * np.round(offset / size))


def _require_all(is_allowed: Mask | np.bool_, name: str, values: Array, allowed: str) -> None:
    """Refuse an array of which some values are not allowed; the message names the first of them."""
    row = int(np.argmin(is_allowed))
    require(is_allowed.all(), f"{name}[{row}]", value=values[row].tolist(), allowed=allowed)
