"""Apollonius diagram of discs with exact areas of the cells (section 4.1, Fig. 10).

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
from itertools import product
from typing import NamedTuple

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
        """Reduced radii r_n = r/a with a = √A/2 of a cell with the area A (section 4.1), (n,)."""
        return np.asarray(2 * self.discs.radii / np.sqrt(self.areas))

    def walls(self, count: int) -> tuple[Array, Array]:
        """Return points along the wall of each arc, in polar coordinates around its cell's centre.

        They are at even steps of the angle, with the ends of the arc among them. A wall that does
        not close the cell has negative distances, beyond the angle where it goes to infinity.

        Args:
            count: Number of points of each arc.

        Returns:
            Angles from the x axis and distances (in m), shape (count, m) each.
        """
        angle = np.asarray(np.linspace(self.start, self.end, count), float)
        near, far = _near_far(self.discs.radii, self.cell, self.neighbour, self.offset)
        psi = angle - np.arctan2(self.offset[:, 1], self.offset[:, 0])
        return angle, near * far / ((far - near) + (far + near) * np.cos(psi))


def apollonius(discs: Particles) -> Apollonius:
    """Return the Apollonius diagram of discs, of which none lies inside another one.

    The cell of disc i holds the points x with |x − c_i| − r_i ≤ |x − c_j| − r_j for all j, in a
    periodic box or within a window. First each cell is bounded by the discs nearby alone, which
    gives a cell that contains the true one. With ρ_max,i its largest distance from c_i, a disc j
    can cut it only if |c_j − c_i| < 2 ρ_max,i − r_i + r_j. The cell is then bounded by all such
    discs.

    Args:
        discs: Discs in a periodic box or a window, at least one.

    Returns:
        Areas of the cells, and the arcs that bound them, sorted by cell and by angle.

    Raises:
        FailedError: The envelope of the walls of a cell does not close.
    """
    # The first cells are bounded by the discs within three mean spacings. With fewer the second
    # pass takes longer, with more the first.
    largest_disc = float(discs.radii.max())
    rho_max = np.zeros(len(discs))
    for walls in _walls(discs, np.full(len(discs), largest_disc + 3.0 * discs.spacing)):
        rho_max += walls.largest_radius()
    areas = np.zeros(len(discs))
    all_arcs = []
    all_pairs = []
    for walls in _walls(discs, 2 * rho_max - discs.radii + largest_disc):
        areas += walls.areas()
        all_arcs.append(walls.arcs)
        all_pairs.append(walls.pairs.select(walls.arcs.function))
    arcs = Arcs.joined(all_arcs)
    return Apollonius(
        discs=discs,
        areas=areas,
        cell=arcs.owner,
        neighbour=np.concatenate([pairs.second for pairs in all_pairs]),
        offset=np.concatenate([pairs.offset for pairs in all_pairs]),
        start=arcs.start,
        end=arcs.end,
    )


def _near_far(radii: Array, first: Ints, second: Ints, offset: Array) -> tuple[Array, Array]:
    """Return near = d + Δ and far = d − Δ of pairs of discs, in m, shape (m,) each.

    d is the distance of the centres, and Δ = r_first − r_second, or 0 at an edge. near / 2 is the
    distance of the wall's nearest point from the first centre, and far / 2 from the second. Where
    one disc lies inside the other, one of them is not positive, and there is no wall.

    Args:
        radii: Radii of all discs, in m, shape (n,).
        first: Index of the first disc of each pair, shape (m,).
        second: Index of the second disc; −1 for an edge of a window, towards the disc's mirror
            image.
        offset: Vector between the centres, in m, shape (m, 2).
    """
    distance = np.hypot(offset[:, 0], offset[:, 1])
    difference = np.where(second < 0, 0.0, radii[first] - radii[second])
    return distance + difference, distance - difference


class _ArcEnds(NamedTuple):
    """Hyperbolic anomalies at the ends of arcs, and the parameters of their walls, (m,) each."""

    start: Array
    end: Array
    near: Array
    far: Array


@dataclass(frozen=True, eq=False)
class _Walls:
    """Walls of discs towards their neighbours.

    Args:
        discs: All discs.
        pairs: The walls, each from a disc to a neighbour.
        arcs: Arcs of walls that bound cells; their functions are indices of `pairs`.
    """

    discs: Particles
    pairs: Pairs
    arcs: Arcs

    def _arc_ends(self) -> _ArcEnds:
        """Return the hyperbolic anomalies at both ends of all arcs, and near and far of the walls.

        With d the distance of the two centres and Δ the difference of the radii, near is d + Δ and
        far is d − Δ, in m. The anomaly is the parameter along the wall, 0 at its nearest point.
        """
        pairs = self.pairs.select(self.arcs.function)
        near, far = _near_far(self.discs.radii, pairs.first, pairs.second, pairs.offset)
        direction = np.arctan2(pairs.offset[:, 1], pairs.offset[:, 0])
        return _ArcEnds(
            start=anomaly(self.arcs.start - direction, near, far),
            end=anomaly(self.arcs.end - direction, near, far),
            near=near,
            far=far,
        )

    def areas(self) -> Array:
        """Return the areas of the cells, in m², shape (n,); 0 for discs without walls here."""
        ends = self._arc_ends()
        sectors = sector_area(ends.start, ends.end, ends.near, ends.far)
        return np.asarray(np.bincount(self.arcs.owner, sectors, len(self.discs)), float)

    def largest_radius(self) -> Array:
        """Return an upper bound of the distance from each centre to its cell's boundary.

        The boundary is farthest at a corner, where two walls meet. The distance there is (d cosh s
        + Δ)/2, with d the distance of the centres, Δ the difference of the radii and s the anomaly
        on one of the walls. The wall with the smaller |s| is taken, since its rounding is smaller.
        A thousandth is added for rounding.

        Returns:
            Distances in m, shape (n,); 0 for discs without walls here.
        """
        # `following` is the next arc of the same cell; after the last one comes the first.
        ends = self._arc_ends()
        owner = self.arcs.owner
        following = np.append(np.arange(1, len(owner)), 0)
        last = np.flatnonzero(np.append(owner[1:] != owner[:-1], True))
        first = np.append(0, last[:-1] + 1)
        following[last] = first[: len(last)]

        use_following = np.abs(ends.start[following]) < np.abs(ends.end)
        wall = np.where(use_following, following, np.arange(len(owner)))
        s = np.where(use_following, ends.start[following], ends.end)
        near = ends.near[wall]
        far = ends.far[wall]
        radius = (near + far) / 4 * np.cosh(s) + (near - far) / 4
        largest = np.zeros(len(self.discs))
        np.maximum.at(largest, owner, 1.001 * radius)
        return largest


def _walls(discs: Particles, reach: Array) -> Iterator[_Walls]:
    """Yield the walls of portions of the discs towards all neighbours within reach.

    Args:
        discs: The discs.
        reach: Largest distance of a neighbour's centre for each disc, in m, shape (n,).

    Yields:
        Walls of the discs of a portion, towards other discs and to their own images or the edges of
        a window, with the arcs that bound cells. Each disc is in one portion.

    Raises:
        FailedError: The envelope of the walls of a cell does not close.
    """
    for portion, neighbours in pairs_within(discs, reach):
        near, far = _near_far(discs.radii, neighbours.first, neighbours.second, neighbours.offset)
        # There is no wall where one disc lies within the other.
        walls = neighbours.select((near > 0) & (far > 0))
        pairs = walls.joined(_bounding_pairs(discs, portion))
        near, far = _near_far(discs.radii, pairs.first, pairs.second, pairs.offset)
        # Around its disc's centre, at the distance ρ and the angle φ, a wall is 1/ρ = a cos φ +
        # b sin φ + c, with 2/near towards the neighbour. The nearest wall has the largest 1/ρ.
        direction = pairs.offset / np.hypot(pairs.offset[:, 0], pairs.offset[:, 1])[:, None]
        a, b = (1 / near + 1 / far) * direction.T
        counts = np.bincount(pairs.first, minlength=len(discs))
        yield _Walls(discs, pairs, upper_envelopes(a, b, 1 / near - 1 / far, counts))


def _bounding_pairs(discs: Particles, portion: Ints) -> Pairs:
    """Return pairs that bound the cells of some discs, whatever their neighbours.

    These are pairs with their own eight images next to them, or in a window with their mirror
    images beyond the left, right, lower and upper edge, of which `second` is −1.

    Args:
        discs: All discs.
        portion: Indices of the discs whose cells are bounded, shape (k,).

    Returns:
        8 k or 4 k pairs, grouped by disc, with the vector from the disc to its image.
    """
    if discs.periodic:
        tiles = [tile for tile in product((-1, 0, 1), repeat=2) if any(tile)]
        owner = np.repeat(portion, len(tiles))
        offset = np.tile(np.array(tiles) * discs.size, (len(portion), 1))
        return Pairs(owner, owner, offset)
    # A centre on an edge is moved off it, so that there is a mirror image.
    centres = np.clip(discs.centres[portion], 1e-15 * discs.size, (1 - 1e-15) * discs.size)
    to_far_edges = discs.size - centres
    offset = np.zeros((len(portion), 4, 2))
    offset[:, 0, 0] = -2 * centres[:, 0]  # to the left
    offset[:, 1, 0] = 2 * to_far_edges[:, 0]  # right
    offset[:, 2, 1] = -2 * centres[:, 1]  # lower
    offset[:, 3, 1] = 2 * to_far_edges[:, 1]  # upper mirror image
    no_disc = np.full(4 * len(portion), -1)
    return Pairs(np.repeat(portion, 4), no_disc, offset.reshape(-1, 2))


def counted_cells(diagram: Apollonius) -> tuple[Ints, Array]:
    """Return the cells that no disc outside the window can change, and how many each stands for.

    Large cells are changed more often than small ones. So each counted cell stands for 1/p cells,
    where p is the fraction of positions in the window at which an equal cell would count (Miles
    1974, Lantuéjoul 1978). This holds for a homogeneous section, with every disc listed whose
    centre lies in the window, and no disc outside larger than the largest one inside.

    Args:
        diagram: Cells of discs in a window or in a periodic box.

    Returns:
        Indices of their discs in rising order and weights 1/p, shape (k,) each; all discs and
        weights 1 in a periodic box.

    Raises:
        RefusedError: There is no such cell.
    """
    discs = diagram.discs
    if discs.periodic:
        return np.arange(len(discs), dtype=np.intp), np.ones(len(discs))

    # No disc outside is larger than the largest one inside, so none reaches deeper into the window
    # than the largest radius R. At worst all points up to that depth are covered. The wall of a
    # cell towards them is the parabola ρ = (D + r)/(1 + cos ψ), where D is the distance from the
    # centre to the edge less R. So the cell is unchanged if ρ (1 + cos ψ) − r ≤ D all around, for
    # all four edges.
    reach = _reach(diagram)
    largest_radius = discs.radii.max()
    inner = discs.size - 2 * largest_radius
    place = discs.centres - largest_radius
    to_upper = inner - place
    columns = [place[:, 0], to_upper[:, 0], place[:, 1], to_upper[:, 1]]
    edge_distance = np.stack(columns, axis=1)  # D of the four edges
    # A cell with a wall at the edge of the window is cut.
    is_cut = np.isin(np.arange(len(discs)), diagram.cell[diagram.neighbour < 0])
    disc = np.flatnonzero((reach <= edge_distance).all(axis=1) & ~is_cut)
    value = discs.size.tolist()
    allowed = "windows in which the edge leaves a cell whole"
    require(len(disc) > 0, "size", value, allowed=allowed, cure="take a larger section")

    # p is the fraction of positions at which the reach of an equal cell stays inside: `inner` less
    # its reach to the left and right, times the same for lower and upper, over the area of the
    # window.
    extent = reach[disc].reshape(-1, 2, 2).sum(axis=2)
    return disc, discs.measure / (inner - extent).prod(axis=1)


def _reach(diagram: Apollonius) -> Array:
    """Return how far empty circles on each cell's boundary extend towards each edge.

    A boundary point at the distance ρ from the disc's centre is the centre of a circle that touches
    the disc, of radius r, and a neighbour. The circle's radius is ρ − r. With ψ the angle from the
    edge's direction it extends by ρ cos ψ + ρ − r. The maximum over 33 points of each arc is taken,
    whose error is of second order.

    Args:
        diagram: Cells of n discs.

    Returns:
        Extents from the disc's centre towards the left, right, lower and upper edge, in m, shape
        (n, 4); ∞ for a cell that is not closed, of which some ρ is negative.
    """
    angle, rho = diagram.walls(33)
    is_bounded = rho.min(axis=0) > 0
    reach = np.full((len(diagram.discs), 4), -np.inf)
    for edge, direction in enumerate((np.pi, 0.0, -np.pi / 2, np.pi / 2)):
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
    """Return the Delaunay neighbours of the disc centres.

    In a window the centres on the convex hull are not counted. A periodic section is triangulated
    with a layer of images, eight mean spacings wide. This is right if no circumcircle is wider, as
    in any packing.

    Args:
        discs: Discs in a periodic box or a window, at least one; their radii do not matter.

    Returns:
        Number of neighbours of each counted centre, and the edges from counted centres with the
        vectors to the other ends. All are empty where no triangle can be made: in a window with
        fewer than three centres, or with all of them in one line.
    """
    from scipy.spatial import Delaunay, QhullError

    tiles = (0, 1, -1) if discs.periodic else (0,)
    # Wider empty circles do not occur in a packing, so no triangle near the box has a corner beyond
    # the layer.
    layer = 8.0 * discs.spacing
    images = [discs.centres + discs.size * tile for tile in product(tiles, repeat=2)]
    points = np.concatenate(images)
    is_near = np.asarray(((points > -layer) & (points < discs.size + layer)).all(axis=1))
    is_near[: len(discs)] = True
    points = points[is_near]
    try:
        triangulation = Delaunay(points)
    except QhullError:
        return Neighbours(np.zeros(0, int), np.zeros(0, int), np.zeros((0, 2)))
    is_counted = np.arange(len(points)) < len(discs)  # no images
    is_counted[triangulation.convex_hull] = False
    start, second = triangulation.vertex_neighbor_vertices
    first = np.repeat(np.arange(len(points)), np.diff(start))
    is_from_counted = is_counted[first]
    first = first[is_from_counted]
    second = second[is_from_counted]
    number = np.bincount(first, minlength=len(points))[is_counted]
    return Neighbours(number, first, points[second] - points[first])


def neighbouring_values(diagram: Apollonius, values: Array) -> Array:
    """Return pairs of values of cells that share a wall, each pair in both orders, shape (2, m).

    Cells that share several walls, through different images, are one pair. Walls towards a cell's
    own images and walls at the edge of a window do not count.

    Args:
        diagram: The cells of n discs.
        values: A value of each cell, shape (n,).
    """
    once = diagram.neighbour > diagram.cell
    pair = np.unique(np.stack([diagram.cell[once], diagram.neighbour[once]]), axis=1)
    return np.concatenate([values[pair], values[pair[::-1]]], axis=1)
