"""Apollonius diagram of discs with exact cell areas (section 4.1, Fig. 10), direct neighbours.

The cell of disc i holds the points x with |x − c_i| − r_i ≤ |x − c_j| − r_j for all j. It is
star-shaped around c_i, and bounded by 1/ρ(φ) = max_j (a_j cos φ + b_j sin φ + c_j): one hyperbola
per neighbour, joined by an upper envelope (see `upper_envelopes`). In an open window the cells are
cut at the window's edges, each of which acts as the wall towards the disc's own mirror image.

This differs from the paper in: 1. No triangulation of the discs is made; every cell stands on its
own, so that touching, overlapping, and cocircular discs need no special case.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.base.errors import require
from alphacut.stochastic.particles.particles import Pairs, Particles, pairs_within
from alphacut.stochastic.tessellation.circle_envelope import (
    Arcs,
    anomaly,
    sector_area,
    upper_envelopes,
)

LAYER = 8.0  # mean spacings; no circumcircle of a packing is wider
NEAR = 3.0  # mean spacings from a disc's edge within which discs bound its cell at first
EDGES = np.array([np.pi, 0.0, -np.pi / 2, np.pi / 2])
"""Directions of the left, right, lower and upper edge."""
ANGLES = 33


@dataclass(frozen=True, eq=False)
class Apollonius:
    """Cells of discs and the arcs that bound them, those of a cell in the order of their angle.

    Args:
        discs: The discs.
        areas: Area of each cell, shape (n,), in m².
        cell: Disc whose cell each arc bounds, shape (m,), rising.
        neighbour: Disc on the other side, shape (m,); the disc itself for its own image; −1 at the
            edge of a window.
        offset: Vector from the centre to that image of the neighbour, shape (m, 2), in m.
        start: Angle at the centre where the arc begins, shape (m,).
        end: Angle where it ends, shape (m,), `start` ≤ `end` ≤ `start` + 2π.
    """

    discs: Particles
    areas: Array
    cell: Ints
    neighbour: Ints
    offset: Array
    start: Array
    end: Array

    @property
    def reduced_radii(self) -> Array:
        """r_n = r/a with a = √A/2 (section 4.1), shape (n,)."""
        return np.asarray(2 * self.discs.radii / np.sqrt(self.areas))

    def walls(self, count: int) -> tuple[Array, Array]:
        """Angle and distance (in m) of `count` points along the wall of each arc, (count, m) each.

        They are polar coordinates around the centre of the arc's cell, the arc's ends among them.
        """
        angle = np.asarray(np.linspace(self.start, self.end, count), float)
        near, far = _near_far(self.discs.radii, self.cell, self.neighbour, self.offset)
        psi = angle - np.arctan2(self.offset[:, 1], self.offset[:, 0])
        return angle, near * far / ((far - near) + (far + near) * np.cos(psi))


def apollonius(discs: Particles) -> Apollonius:
    """Return the Apollonius diagram of discs, of which none lies inside another one."""
    # Cells bounded by the discs nearby contain the true ones, and a disc j can only cut the cell of
    # i if |c_j − c_i| < 2 ρ_max,i − r_i + r_j, with ρ_max,i the largest radius of that first cell:
    # all such discs are then taken into account.
    largest_disc = float(discs.radii.max())
    rho_max = np.zeros(len(discs))
    for walls in _walls(discs, np.full(len(discs), largest_disc + NEAR * discs.spacing)):
        rho_max += walls.largest_radius()
    areas, parts = np.zeros(len(discs)), []
    for walls in _walls(discs, 2 * rho_max - discs.radii + largest_disc):
        areas += walls.areas()
        arcs, pairs = walls.arcs, walls.pairs
        neighbour, offset = pairs.second[arcs.function], pairs.offset[arcs.function]
        parts.append((arcs.owner, neighbour, offset, arcs.start, arcs.end))
    cell, neighbour, offset, start, end = map(np.concatenate, zip(*parts, strict=True))
    return Apollonius(discs, areas, cell, neighbour, offset, start, end)


def _near_far(radii: Array, first: Ints, second: Ints, offset: Array) -> tuple[Array, Array]:
    """D + Δ and d − Δ of pairs: d distance of the centres, Δ = r_first − r_second, 0 at an edge."""
    distance = np.hypot(offset[:, 0], offset[:, 1])
    difference = np.where(second < 0, 0.0, radii[first] - radii[second])
    return distance + difference, distance - difference


@dataclass(frozen=True, eq=False)
class _Walls:
    """Walls of discs towards their neighbours, `pairs`, and the arcs of them that bound cells."""

    discs: Particles
    pairs: Pairs
    arcs: Arcs

    def _anomalies(self) -> tuple[Array, Array, Array, Array]:
        """Hyperbolic anomalies at start and end of each arc, and its d + Δ and d − Δ, (m,) each."""
        arcs, pairs = self.arcs, self.pairs.select(self.arcs.function)
        near, far = _near_far(self.discs.radii, pairs.first, pairs.second, pairs.offset)
        direction = np.arctan2(pairs.offset[:, 1], pairs.offset[:, 0])
        start, end = (anomaly(angle - direction, near, far) for angle in (arcs.start, arcs.end))
        return start, end, near, far

    def areas(self) -> Array:
        """Cell areas, shape (n,)."""
        sectors = sector_area(*self._anomalies())
        return np.asarray(np.bincount(self.arcs.owner, sectors, len(self.discs)), float)

    def largest_radius(self) -> Array:
        """Upper bound of the distance from each centre to its cell's boundary, shape (n,), in m."""
        # farthest at a corner; of its two walls that with the smaller anomaly s there gives the
        # distance (d cosh s + Δ)/2; a per mille is added for round-off
        start, end, near, far = self._anomalies()
        owner = self.arcs.owner
        following = np.append(np.arange(1, len(owner)), 0)
        last = np.flatnonzero(np.append(owner[1:] != owner[:-1], True))  # arc of each cell
        following[last] = np.concatenate([[0], last[:-1] + 1])[: len(last)]
        use_following = np.abs(start[following]) < np.abs(end)
        wall = np.where(use_following, following, np.arange(len(owner)))
        s = np.where(use_following, start[following], end)
        radius = (near[wall] + far[wall]) / 4 * np.cosh(s) + (near[wall] - far[wall]) / 4
        largest = np.zeros(len(self.discs))
        np.maximum.at(largest, owner, 1.001 * radius)
        return largest


def _walls(discs: Particles, reach: Array) -> Iterator[_Walls]:
    """Yield the walls of portions of the discs towards all neighbours within `reach` (n,), in m."""
    for portion, neighbours in pairs_within(discs, reach):
        near, far = _near_far(discs.radii, neighbours.first, neighbours.second, neighbours.offset)
        walls = neighbours.select((near > 0) & (far > 0))  # neither disc contains the other
        pairs = walls.joined(_bounding_pairs(discs, portion))
        near, far = _near_far(discs.radii, pairs.first, pairs.second, pairs.offset)
        direction = pairs.offset / np.hypot(pairs.offset[:, 0], pairs.offset[:, 1])[:, None]
        a, b = (1 / near + 1 / far) * direction.T
        counts = np.bincount(pairs.first, minlength=len(discs))
        yield _Walls(discs, pairs, upper_envelopes(a, b, 1 / near - 1 / far, counts))


def _bounding_pairs(discs: Particles, portion: Ints) -> Pairs:
    """Pairs that bound every cell: own images, or in a window mirror images (`second` is −1)."""
    if discs.periodic:
        shifts = np.array([(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j]) * discs.size
        owner = np.repeat(portion, 8)
        return Pairs(owner, owner, np.tile(shifts, (len(portion), 1)))
    # off the edge, so that there is a mirror image
    centres = np.clip(discs.centres[portion], 1e-15 * discs.size, (1 - 1e-15) * discs.size)
    (x, y), (width, height) = centres.T, discs.size
    offset = np.zeros((len(portion), 4, 2))  # to the left, right, lower and upper mirror image
    offset[:, 0, 0], offset[:, 1, 0] = -2 * x, 2 * (width - x)
    offset[:, 2, 1], offset[:, 3, 1] = -2 * y, 2 * (height - y)
    return Pairs(np.repeat(portion, 4), np.full(4 * len(portion), -1), offset.reshape(-1, 2))


def counted_cells(diagram: Apollonius) -> tuple[Ints, Array]:
    """Cells that no disc outside the window can change, and the number that each stands for.

    Large cells are changed more often than small ones; each counted cell therefore stands for 1/p
    cells, p the fraction of positions in the window where an equal cell would count (Miles 1974,
    Lantuéjoul 1978). This holds for a homogeneous section, with every disc listed whose centre lies
    in the window.

    Returns:
        Indices of their discs and weights, shape (k,) each; all and 1 in a periodic box.

    Raises:
        RefusedError: There is no such cell.
    """
    # A disc beyond the window's edge, no larger than the largest one seen, cannot reach deeper into
    # the window than that one's radius. If all beyond the edge were one such disc, the wall towards
    # it would be a parabola, ρ = (D + r)/(1 + cos ψ), D the distance from the centre to the edge
    # less the largest radius: the cell is unchanged if ρ (1 + cos ψ) − r ≤ D all around, for all
    # four edges
    discs = diagram.discs
    if discs.periodic:
        return np.arange(len(discs), dtype=np.intp), np.ones(len(discs))
    reach = _reach(diagram)
    inner, (x, y) = discs.size - 2 * discs.radii.max(), discs.centres.T - discs.radii.max()
    edge_distance = np.stack([x, inner[0] - x, y, inner[1] - y], axis=1)  # D of the four edges
    is_cut = np.isin(np.arange(len(discs)), diagram.cell[diagram.neighbour < 0])
    disc = np.flatnonzero((reach <= edge_distance).all(axis=1) & ~is_cut)
    value, allowed = discs.size.tolist(), "windows in which the edge leaves a cell whole"
    require(len(disc) > 0, "size", value=value, allowed=allowed, cure="take a larger section")
    extent = reach[disc].reshape(-1, 2, 2).sum(axis=2)  # of each cell, across and along
    return disc, discs.measure / (inner - extent).prod(axis=1)


def _reach(diagram: Apollonius) -> Array:
    """How far empty circles on each cell's boundary extend towards each edge, (n, 4), in m."""
    # from the disc's centre; ∞ for a cell that is not closed, of which some ρ is negative. The
    # circle about a boundary point at the distance ρ touches the disc of radius r and a neighbour:
    # its radius is ρ − r, and it extends by ρ cos ψ + ρ − r, ψ the angle from the edge's direction.
    # The maximum over `ANGLES` points of each arc has an error of second order
    angle, rho = diagram.walls(ANGLES)
    is_bounded = rho.min(axis=0) > 0
    reach = np.full((len(diagram.discs), 4), -np.inf)
    for edge, direction in enumerate(EDGES):
        arc_reach = (rho * (1 + np.cos(angle - direction))).max(axis=0)
        np.maximum.at(reach[:, edge], diagram.cell, np.where(is_bounded, arc_reach, np.inf))
    return reach - diagram.discs.radii[:, None]


@dataclass(frozen=True, eq=False)
class Neighbours:
    """Delaunay neighbours of disc centres.

    Args:
        number: Neighbours of each centre that is counted, shape (n,).
        first: Centre at one end of each edge, shape (m,); each edge appears once from either end.
        offset: Vector to the other end, shape (m, 2), in m.
    """

    number: Ints
    first: Ints
    offset: Array

    @property
    def distances(self) -> Array:
        """Distances of the centres, shape (m,), in m."""
        return np.asarray(np.hypot(self.offset[:, 0], self.offset[:, 1]))


def neighbours(discs: Particles) -> Neighbours:
    """Delaunay neighbours of the disc centres; in a window, those on the hull are not counted."""
    # a periodic section is triangulated with a layer of images: its triangles are those of the
    # plane if no circumcircle is wider, as in any packing
    from scipy.spatial import Delaunay, QhullError

    tiles = (0, 1, -1) if discs.periodic else (0,)
    layer = LAYER * discs.spacing
    points = np.concatenate([discs.centres + discs.size * (i, j) for i in tiles for j in tiles])
    is_near = np.asarray(((points > -layer) & (points < discs.size + layer)).all(axis=1))
    is_near[: len(discs)] = True
    points = points[is_near]
    try:
        triangulation = Delaunay(points)
    except QhullError:  # fewer than three, or all in one line
        return Neighbours(np.zeros(0, int), np.zeros(0, int), np.zeros((0, 2)))
    is_counted = np.arange(len(points)) < len(discs)  # no images
    is_counted[triangulation.convex_hull] = False
    start, second = triangulation.vertex_neighbor_vertices
    first = np.repeat(np.arange(len(points)), np.diff(start))
    first, second = first[is_counted[first]], second[is_counted[first]]
    number = np.bincount(first, minlength=len(points))[is_counted]
    return Neighbours(number, first, points[second] - points[first])


def neighbouring_values(diagram: Apollonius, values: Array) -> Array:
    """Return pairs of `values` of cells that share a wall, in both orders, shape (2, m)."""
    once = diagram.neighbour > diagram.cell
    pair = np.unique(np.stack([diagram.cell[once], diagram.neighbour[once]]), axis=1)
    return np.concatenate([values[pair], values[pair[::-1]]], axis=1)
