"""Outlines of the particle: the distance s(φ) from the centre over the radius ρ(θ) of the map."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import RefusedError, array_of_call, checked_number
from alphacut.rve.cell.lattice import SQUARE, Lattice

Outline = Callable[[Array], Array]
"""Takes angles φ of any shape, gives s(φ) > 0 of the same; smooth, of period 2π."""
ANGLES: Array = np.asarray(np.linspace(0, 2 * np.pi, 721), float)
"""Angles at which outlines are looked at, from 0 to 2π."""


def circle(angle: Array) -> Array:
    """Return the outline of a circle, s = 1, which is the default."""
    return np.ones_like(angle)


@dataclass(frozen=True)
class Ellipse:
    """An ellipse of the area of the circle, π ρ².

    Args:
        aspect: One semi-axis over the other, in [1/4, 4].
        turn: Angle from x1 to the first, counterclockwise, in degrees.
    """

    aspect: float
    turn: float = 0.0

    def __post_init__(self) -> None:
        """Check the arguments.

        Raises:
            RefusedError: `aspect` is no number in [0.25, 4], or `turn` is no finite number.
        """
        checked_number("aspect of the ellipse", self.aspect, least=0.25, most=4)
        checked_number("turn of the ellipse", self.turn)

    def __call__(self, angle: Array) -> Array:
        """Return the distances over ρ at angles."""
        # The semi-axes are √a and 1/√a for the aspect a, so that their product is 1.
        turned = angle - np.radians(self.turn)
        along = np.cos(turned) ** 2 / self.aspect
        across = np.sin(turned) ** 2 * self.aspect
        return np.asarray(1 / np.sqrt(along + across))


def require_outline(outline: object) -> None:
    """Refuse what is no function of an array of angles that gives as many distances."""
    allowed = "a function of an array of angles that gives as many distances over r, or Ellipse"
    array_of_call("outline", outline, ANGLES, allowed=allowed)


def is_round(outline: Outline) -> bool:
    """Return whether an outline is a circle, but for round-off."""
    # A circle of another radius than 1 counts as well.
    return bool(np.ptp(outline(ANGLES)) < 1e-12)


def area(outline: Outline) -> float:
    """Return the area for ρ = 1, ∮ s²/2 dφ: π for a circle."""
    # The trapezoidal rule of a smooth periodic function converges faster than any power. The last
    # angle is the first one once more.
    return float(np.mean(outline(ANGLES[:-1]) ** 2) * np.pi)


def extents(outline: Outline, lattice: Lattice = SQUARE) -> tuple[float, ...]:
    """Return the largest side coordinates of an outline, one for each pair of sides, for ρ = 1.

    On the square they are the largest |x1| and |x2|.

    Args:
        outline: Distance of the edge from the centre over the radius, as a function of the polar
            angle in radians; it is taken at 720 even steps.
        lattice: The cell around the particle, at whose sides the side coordinates are 1.
    """
    directions = np.stack([np.cos(ANGLES), np.sin(ANGLES)], axis=1)
    coordinates = outline(ANGLES)[:, np.newaxis] * abs(directions @ lattice.normals.T)
    return tuple(coordinates.max(axis=0).tolist())


def reach(outline: Outline, lattice: Lattice = SQUARE) -> float:
    """Return the largest side coordinate on the outline for ρ = 1: below 1/ρ the particle fits."""
    return max(extents(outline, lattice))


def require_fit(
    outline: Outline, radius: float, limit: float = 1.0, lattice: Lattice = SQUARE
) -> None:
    """Raise for a particle that does not fit into its cell, or for what is no outline.

    Args:
        outline: Distance of the edge from the centre over `radius`, as a function of the polar
            angle in radians; it is taken at 720 even steps.
        radius: Radius of the particle, in halves of the cell's side.
        limit: What the largest side coordinate of the particle must stay below.
        lattice: The cell.

    Raises:
        RefusedError: A distance is not positive or the outline not periodic; `radius` is not
            positive; or the particle reaches `limit`.
    """
    distances = outline(ANGLES)
    is_periodic = abs(distances[0] - distances[-1]) <= 1e-9 * distances[0]
    if not (distances > 0).all() or not is_periodic:
        raise RefusedError("outline", distances.min(), "positive distances of period 2π")
    largest = limit / reach(outline, lattice)
    if not radius > 0 or radius * reach(outline, lattice) >= limit:
        allowed = f"values in (0, {largest:.4g}), in halves of the cell's side"
        raise RefusedError("radius", f"{radius:g}", allowed)


def bend_radii(outline: Outline) -> tuple[Array, Array]:
    """Return points of an outline with their bend radii, for the radius 1.

    The bend radius is |x'|²/|x''| with derivatives in the polar angle φ, by central differences. It
    is the radius of curvature where |x'| is constant along the outline, and less elsewhere.

    Args:
        outline: Distance of the edge from the centre over the radius, as a function of the polar
            angle in radians, of period 2π.

    Returns:
        Points x(φ) at 720 even steps of φ from 0, shape (720, 2), and their bend radii, positive,
        shape (720,).
    """
    count = 720
    step = 2 * np.pi / count
    angles: Array = np.asarray(np.arange(count) * step, float)
    directions = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    points = outline(angles)[:, np.newaxis] * directions
    before = np.roll(points, 1, axis=0)
    after = np.roll(points, -1, axis=0)
    first = (after - before) / (2 * step)
    second = (after - 2 * points + before) / step**2
    # x'' may vanish on a straight part; the bend radius is then huge and not 1/0.
    length = np.hypot(second[:, 0], second[:, 1])
    second_norm = np.maximum(length, 1e-12)
    return points, np.asarray((first**2).sum(axis=1) / second_norm)
