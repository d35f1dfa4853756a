"""Prism mesh of the product space: a planar mesh at a reference radius, extruded over θ.

Nodes are numbered level by level: on each of the layers + 1 levels of θ all planar nodes, then
the vertices on the mid-levels, half-way between two levels (a serendipity wedge has no midpoints
there).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from alphacut.base.arrays import Array, Ints, Mask
from alphacut.base.errors import RefusedError, array_of_call
from alphacut.rve.cell.lattice import SQUARE, Lattice
from alphacut.rve.cell.outline import Outline, circle, reach, require_fit
from alphacut.stochastic import RadiusMap, ThetaDistribution, require_map

NAMES = "matrix", "inclusion"
"""Names of the phases in their order, where no file gives them."""


@dataclass(frozen=True, eq=False)
class Triangulation:
    """Six-node triangles of the cell, vertices numbered before edge midpoints.

    Args:
        points: Positions of all nodes, shape (n, 2), edge midpoints at the middle of their straight
            edge.
        vertices: Number of vertices; node k is a vertex when k < vertices.
        ends: The two vertices of each midpoint's edge, shape (n − vertices, 2).
        triangles: Nodes of each triangle: three vertices, then the midpoints of edges (0, 1), (0,
            2), (1, 2); shape (m, 6).
        inside: Whether a triangle belongs to the particle, shape (m,).
        arc: Whether a node lies on the interface, shape (n,).
        radius: Radius of the particle in this mesh, 0 if the mesh has none.
        outline: Of the particle.
        lattice: The cell.
    """

    points: Array
    vertices: int
    ends: Ints
    triangles: Ints
    inside: Mask
    arc: Mask
    radius: float
    outline: Outline = circle
    lattice: Lattice = SQUARE


@dataclass(frozen=True, eq=False)
class Elements:
    """Elements of a mesh of the user, of one kind, each of one phase.

    Args:
        points: Three coordinates of all nodes, shape (n, 3).
        cells: Nodes of each element as indices of `points`, shape (m, nodes of an element).
        phase: Phase of each element, an index of `names`, shape (m,).
        names: Names of the phases.
    """

    points: Array
    cells: Ints
    phase: Ints
    names: tuple[str, ...]


class Prisms(Elements):
    """Prisms of 15 nodes in Basix's order; the third coordinate is θ."""


def reference_radius(
    radius_map: RadiusMap, outline: Outline = circle, lattice: Lattice = SQUARE
) -> float:
    """Choose the radius of a particle at which its planar mesh is made, to be moved to other radii.

    It is the midpoint of the range of the map's radii, rounded to 1/20, so that many maps share one
    mesh. It is then clipped to 0.1 … 0.9 / (largest side coordinate of the outline of radius 1),
    where the mesh leaves room inside the particle and between the particle and the side.

    Args:
        radius_map: Function r(θ), in halves of the cell's side, with the distribution of θ; its
            range is taken from 65 points.
        outline: Distance of the particle's edge over r, as a function of the polar angle in
            radians.
        lattice: The cell.

    Raises:
        RefusedError: `radius_map` is no such map or leaves (0, 1), the outline is not positive and
            periodic, or the largest particle does not fit into the cell.
    """
    require_map(radius_map)
    distribution = radius_map.distribution
    radii = radius_map(np.linspace(distribution.lower, distribution.upper, 65))
    require_fit(outline, float(radii.max()), lattice=lattice)
    midpoint = np.round((radii.min() + radii.max()) * 10) / 20
    return float(np.clip(midpoint, 0.1, 0.9 / reach(outline, lattice)))


@dataclass(frozen=True)
class FixedCell:
    """The law of θ where no radius follows from it."""

    distribution: ThetaDistribution

    def __call__(self, theta: ArrayLike) -> Array:
        """No radius."""
        return np.full(np.shape(np.asarray(theta)), np.nan)


LevelFunction = Callable[[Array, Array, Array], Array]
"""Takes x1, x2 and θ of one shape, gives z of it; z < 0 in the particles."""


@dataclass(frozen=True)
class LevelSet(FixedCell):
    """Particles where z is negative, on a mesh that ignores them, with the law of θ."""

    z: LevelFunction

    def values(self, points: Array) -> Array:
        """Return the values of the level set function z at points, shape (…).

        Args:
            points: Points (x1, x2, θ), shape (…, 3), with θ the random number of the cell.

        Returns:
            z: negative in the particles, positive or zero in the matrix. Infinite values are kept.

        Raises:
            RefusedError: z is no function, raises an exception itself, returns Booleans, another
                shape, something else than numbers, or NaN.
        """
        kinds: list[bool] = []

        # `array_of_call` makes floats of what z returns. A mask of the particles would become zeros
        # and ones, so no particle at all; `noted` sees the type before.
        def noted(*coordinates: Array) -> Array:
            """Return the values of z at points; note in `kinds` whether they are Booleans."""
            found = np.asarray(self.z(*coordinates))
            kinds.append(found.dtype == bool)
            return found

        z = noted if callable(self.z) else self.z
        allowed = "a function of three arrays x1, x2 and θ that gives a number at each point"
        values = array_of_call("level set", z, *np.moveaxis(points, -1, 0), allowed=allowed)
        if any(kinds):
            raise _sign_error("a mask of True and False")
        if np.isnan(values).any():
            raise RefusedError("level set", "NaN", allowed)
        return np.asarray(values)

    def require_both_signs(self, lowest: float, highest: float) -> None:
        """Raise unless a level set function has both signs, so that the cell has two materials.

        Args:
            lowest: Smallest value in the whole cell; particles are where the function is negative.
            highest: Largest value in the whole cell.

        Raises:
            RefusedError: `lowest` is not negative (no particle), or `highest` is (no matrix), or
                one of them is NaN.
        """
        if not lowest < 0 <= highest:
            what = f"from {lowest:g} to {highest:g} in the whole cell, without a change of sign"
            raise _sign_error(what)


def _sign_error(value: str) -> RefusedError:
    """Return the error of a level set whose values have no useful signs."""
    allowed = "numbers that are negative in the particles and positive in the matrix"
    cure = "return a distance such as np.hypot(x1, x2) - radius; of a mask of particles 0.5 - mask"
    return RefusedError("level set", value, allowed, cure)


def nodes_at_radii(mesh: Triangulation, radii: Array) -> Array:
    """Move the nodes of a planar mesh of the cell to other radii of its particle.

    Nodes slide along rays from the centre. Inside the particle their distance grows with the
    radius. Outside, a node keeps its fraction of the way along its ray from the outline to the side
    of the cell. Midpoints of edges slide too, so edges bend. Only an edge across a ray to a corner,
    where sliding has a kink, stays straight, unless it lies on the outline.

    Args:
        mesh: Six-node triangles at the radius `mesh.radius`, which is positive.
        radii: Radii in halves of the cell's side, shape (k,), positive and so small that the
            particle fits into the cell; this is not checked.

    Returns:
        Positions (x1, x2), shape (k, nodes, 2).
    """
    radius = radii[:, np.newaxis]
    x, y = mesh.points.T
    distance = np.hypot(x, y)
    outline = np.asarray(mesh.outline(np.arctan2(y, x)))
    in_particle = np.zeros(len(distance), bool)
    in_particle[mesh.triangles[mesh.inside]] = True
    old_edge = mesh.radius * outline
    new_edge = radius * outline
    with np.errstate(divide="ignore", invalid="ignore"):  # at the centre, which is in the particle
        # Distance of the cell's side on the ray.
        side = distance / abs(mesh.lattice.side_coordinates(mesh.points)).max(axis=1)
        stretch = (side - new_edge) / (side - old_edge)
        outer_scale = (new_edge + (distance - old_edge) * stretch) / distance
        scale = np.where(in_particle, radius / mesh.radius, outer_scale)
        # Nodes on the interface are put on the outline itself (z = 0 of eq. 14). Midpoints of its
        # edges lie on the chord in the planar mesh, so scaling alone would leave them inside.
        scale = np.where(mesh.arc, radius * outline / distance, scale)
    points = mesh.points * scale[..., np.newaxis]

    # An edge crosses the line through two opposite corners where its ends are on both sides of it.
    # The tolerance keeps edges that end on the line from counting by round-off.
    corners = mesh.lattice.corners
    first, second = corners[: len(corners) // 2].T
    x, y = mesh.points[mesh.ends, np.newaxis].transpose(3, 1, 0, 2)
    crosses = (x * second - y * first).prod(axis=0) < -1e-12
    is_straight = crosses.any(axis=1) & ~mesh.arc[mesh.vertices :]
    straight = np.flatnonzero(is_straight)
    points[:, mesh.vertices + straight] = points[:, mesh.ends[straight]].mean(axis=2)
    return np.asarray(points)


@dataclass(frozen=True, eq=False)
class PrismGrid:
    """Prisms over a planar mesh; topology only, positions follow from a radius map.

    Args:
        plane: The planar mesh.
        cells: Nodes of each prism in Basix's order, shape (prisms, 15), layer by layer, in each in
            the order of the triangles.
        heights: Positions of the levels in the support of θ, from 0 to 1, shape (layers + 1,).
        phase: Phase of each prism, an index of `names`, shape (prisms,).
        names: Names of the phases.
        conforming: Whether the phases are those of the prisms and the nodes follow the cone; if not
            they stay where the planar mesh has them.
        fixed: Positions of all nodes where a file gives them, whatever the map, shape (nodes, 3).
    """

    plane: Triangulation
    cells: Ints
    heights: Array
    phase: Ints
    names: tuple[str, ...]
    conforming: bool = True
    fixed: Array | None = None

    @property
    def layers(self) -> int:
        """Number of layers in θ."""
        return len(self.heights) - 1

    @property
    def nodes(self) -> int:
        """Number of nodes in all."""
        return (self.layers + 1) * len(self.plane.points) + self.layers * self.plane.vertices

    def level_thetas(self, law: ThetaDistribution) -> Array:
        """θ of all levels over the support of a law, shape (layers + 1,)."""
        return np.asarray(law.lower + self.heights * (law.upper - law.lower))

    def positions(self, radius_map: RadiusMap) -> Array:
        """Return (x1, x2, θ) of all nodes for a map of the particle's radius, shape (nodes, 3).

        The nodes of all levels of θ come first, level by level, then those half-way between two
        levels. Positions that a file gave are returned as they are, whatever the map. In a grid
        whose phases are not those of the prisms (`conforming` is false) x1 and x2 do not depend on
        the map.

        Args:
            radius_map: Function of θ with the distribution of θ, whose support the levels span.
        """
        if self.fixed is not None:
            return self.fixed
        levels = self.level_thetas(radius_map.distribution)
        on_levels, on_mid_levels = self.positions_by_level(radius_map)
        mid_levels = (levels[1:] + levels[:-1]) / 2
        return np.concatenate(
            [_at_heights(on_levels, levels), _at_heights(on_mid_levels, mid_levels)]
        )

    def positions_by_level(self, radius_map: RadiusMap) -> tuple[Array, Array]:
        """Return (x1, x2) of the nodes of all levels of θ and of all mid-levels between two levels.

        Positions that a file gave are not looked at: call it only where `fixed` is None.

        Args:
            radius_map: Map r(θ) of the particle's radius, with the distribution of θ.

        Returns:
            Positions on levels, shape (layers + 1, nodes of the plane mesh, 2), and on mid-levels,
            where only vertices have nodes, shape (layers, vertices of the plane mesh, 2).
        """
        levels = self.level_thetas(radius_map.distribution)
        mid_levels = (levels[1:] + levels[:-1]) / 2
        on_mid_levels = self._plane_at(radius_map, mid_levels)[:, : self.plane.vertices]
        return self._plane_at(radius_map, levels), on_mid_levels

    def _plane_at(self, radius_map: RadiusMap, theta: Array) -> Array:
        """Return the positions of the plane mesh at each θ, shape (θ, nodes, 2)."""
        if self.conforming:
            return nodes_at_radii(self.plane, radius_map(theta))
        return np.broadcast_to(self.plane.points, (len(theta), *self.plane.points.shape))


def _at_heights(positions: Array, theta: Array) -> Array:
    """Return positions (x1, x2, θ) from (x1, x2) on levels of θ, shape (levels · nodes, 3)."""
    heights = np.broadcast_to(theta[:, np.newaxis, np.newaxis], (*positions.shape[:2], 1))
    return np.concatenate([positions, heights], axis=2).reshape(-1, 3)
