"""Apollonius diagram of discs with exact cell areas (section 4.1, Fig. 10).

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

from alphacut.fuzzy.arrays import Array, Rows
from alphacut.fuzzy.refused import require
from alphacut.stochastic.particles.neighbour_search import Pairs, pairs_within
from alphacut.stochastic.particles.particles import Particles
from alphacut.stochastic.tessellation.circle_envelope import (
    Arcs,
    anomaly,
    sector_area,
    upper_envelopes,
)

NEAR = 3.0  # mean spacings from a disc's edge within which discs bound its cell at first
EDGES = np.array([np.pi, 0.0, -np.pi / 2, np.pi / 2])
"""Directions of the left, right, lower and upper edge."""
ANGLES = 33


@dataclass(frozen=True, eq=False)
class Apollonius:
    """Cells of discs and the arcs that bound them.

    Args:
        discs: The discs.
        areas: Area of each cell, shape (n,), in m².
        cell: Disc whose cell each arc bounds, shape (m,), rising; arcs of a cell in the order of
            their angle.
        neighbour: Disc on the other side, shape (m,); the disc itself for its own image; −1 at the
            edge of a window.
        offset: Vector from the centre to that image of the neighbour, shape (m, 2), in m.
        start: Angle at the centre where the arc begins, shape (m,).
        end: Angle where it ends, shape (m,), `start` ≤ `end` ≤ `start` + 2π.
    """

    discs: Particles
    areas: Array
    cell: Rows
    neighbour: Rows
    offset: Array
    start: Array
    end: Array

    @property
    def reduced_radii(self) -> Array:
        """r_n = r/a with a = √A/2 (section 4.1), shape (n,)."""
        return np.asarray(2 * self.discs.radii / np.sqrt(self.areas))

    def walls(self, count: int) -> tuple[Array, Array]:
        """Return points along the wall of each arc in polar coordinates of its cell's centre.

        Args:
            count: Number of points on each arc, its ends among them.

        Returns:
            Angle and distance, the latter in m, two arrays of shape (count, m).
        """
        angle = np.asarray(np.linspace(self.start, self.end, count), float)
        near, far = _near_far(self.discs.radii, self.cell, self.neighbour, self.offset)
        psi = angle - np.arctan2(self.offset[:, 1], self.offset[:, 0])
        return angle, near * far / ((far - near) + (far + near) * np.cos(psi))


def apollonius(discs: Particles) -> Apollonius:
    """Return the Apollonius diagram of discs, of which none lies inside another one.

    Cells bounded by the discs nearby contain the true ones, and a disc j can only cut the cell of i
    if |c_j − c_i| < 2 ρ_max,i − r_i + r_j, with ρ_max,i the largest radius of that first cell; all
    such discs are then taken into account.

    Args:
        discs: Periodic box or open window.
    """
    widest = float(discs.radii.max())
    largest = np.zeros(len(discs))
    for walls in _walls(discs, np.full(len(discs), widest + NEAR * discs.spacing)):
        largest += walls.largest_radius()
    areas, parts = np.zeros(len(discs)), []
    for walls in _walls(discs, 2 * largest - discs.radii + widest):
        areas += walls.areas()
        arcs, pairs = walls.arcs, walls.pairs
        second, offset = pairs.second[arcs.function], pairs.offset[arcs.function]
        parts.append((arcs.owner, second, offset, arcs.start, arcs.end))
    columns = (np.concatenate(column) for column in zip(*parts, strict=True))
    return Apollonius(discs, areas, *columns)


def _near_far(radii: Array, first: Rows, second: Rows, offset: Array) -> tuple[Array, Array]:
    """Return d + Δ and d − Δ of pairs, (m,): d distance of the centres, Δ = r_first − r_second.

    At a window's edge, where `second` is −1, Δ is 0.
    """
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
        """Return hyperbolic anomalies at start and end of each arc, d + Δ and d − Δ; all (m,)."""
        wall = self.arcs.function
        offset = self.pairs.offset[wall]
        near, far = _near_far(
            self.discs.radii, self.pairs.first[wall], self.pairs.second[wall], offset
        )
        towards = np.arctan2(offset[:, 1], offset[:, 0])
        return (
            anomaly(self.arcs.start - towards, near, far),
            anomaly(self.arcs.end - towards, near, far),
            near,
            far,
        )

    def areas(self) -> Array:
        """Cell areas, shape (n,)."""
        sectors = sector_area(*self._anomalies())
        return np.asarray(np.bincount(self.arcs.owner, sectors, len(self.discs)), float)

    def largest_radius(self) -> Array:
        """Return an upper bound of the distance from each centre to its cell's boundary, (n,).

        The boundary is farthest at a corner. Of its two walls the one with the smaller anomaly
        there gives the distance; a per mille is added for round-off.
        """
        start, end, near, far = self._anomalies()
        owner = self.arcs.owner
        following = np.append(np.arange(1, len(owner)), 0)
        last = np.flatnonzero(np.append(owner[1:] != owner[:-1], True))
        following[last] = np.concatenate([[0], last[:-1] + 1])[: len(last)]
        ahead = np.abs(start[following]) < np.abs(end)
        on = np.where(ahead, following, np.arange(len(owner)))
        out = np.where(ahead, start[following], end)
        radius = (near[on] + far[on]) / 4 * np.cosh(out) + (near[on] - far[on]) / 4
        largest = np.zeros(len(self.discs))
        np.maximum.at(largest, owner, 1.001 * radius)
        return largest


def _walls(discs: Particles, reach: Array) -> Iterator[_Walls]:
    """Yield the walls of portions of the discs: envelopes of all neighbours within reach.

    Args:
        discs: The discs.
        reach: Distance up to which other discs count as neighbours, shape (n,), in m.
    """
    for portion, neighbours in pairs_within(discs, reach):
        near, far = _near_far(discs.radii, neighbours.first, neighbours.second, neighbours.offset)
        walls = neighbours.where((near > 0) & (far > 0))
        pairs = Pairs.join([walls, _bounds(discs, portion)])
        near, far = _near_far(discs.radii, pairs.first, pairs.second, pairs.offset)
        direction = pairs.offset / np.hypot(pairs.offset[:, 0], pairs.offset[:, 1])[:, None]
        amplitude = 1 / near + 1 / far
        arcs = upper_envelopes(
            amplitude * direction[:, 0],
            amplitude * direction[:, 1],
            1 / near - 1 / far,
            np.bincount(pairs.first, minlength=len(discs)),
        )
        yield _Walls(discs, pairs, arcs)


def _bounds(discs: Particles, portion: Rows) -> Pairs:
    """Return the pairs that bound every cell: a disc and its own images, or its mirror images.

    In a periodic box these are the eight nearest images, in a window the mirror images at its four
    edges, with `second` −1.
    """
    if discs.periodic:
        shifts = np.array([(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j]) * discs.size
        return Pairs(
            np.repeat(portion, 8), np.repeat(portion, 8), np.tile(shifts, (len(portion), 1))
        )
    # off the edge, so that there is a mirror image
    centres = np.clip(discs.centres[portion], 1e-15 * discs.size, (1 - 1e-15) * discs.size)
    offset = np.zeros((len(portion), 4, 2))
    offset[:, 0, 0], offset[:, 1, 0] = -2 * centres[:, 0], 2 * (discs.size[0] - centres[:, 0])
    offset[:, 2, 1], offset[:, 3, 1] = -2 * centres[:, 1], 2 * (discs.size[1] - centres[:, 1])
    return Pairs(np.repeat(portion, 4), np.full(4 * len(portion), -1), offset.reshape(-1, 2))


def counted_cells(diagram: Apollonius) -> tuple[Rows, Array]:
    """Return the cells that no disc outside the window can change, and their weights.

    A disc beyond the window's edge, if none is larger than the largest one seen, shows no deeper in
    the window than that one's radius; taking all that lies beyond for one such disc, the wall
    towards it is a parabola, ρ = (D + r)/(1 + cos ψ), D the distance from the centre to the edge
    less the largest radius: the cell is unchanged if ρ (1 + cos ψ) − r ≤ D all around, for all four
    edges. Large cells fail this more often than small ones; each counted cell therefore stands for
    1/p cells, p the fraction of places in the window where its like would count (Miles 1974,
    Lantuéjoul 1978). This holds for a section that looks the same everywhere, with every disc
    listed whose centre lies in the window.

    Returns:
        Indices of their discs, shape (k,), and the number of cells that each stands for, shape
        (k,); all and 1 in a periodic box.

    Raises:
        RefusedError: There is no such cell.
    """
    discs = diagram.discs
    if discs.periodic:
        return np.arange(len(discs), dtype=np.intp), np.ones(len(discs))
    reach = _reach(diagram)
    inner, (x, y) = discs.size - 2 * discs.radii.max(), discs.centres.T - discs.radii.max()
    room = np.stack([x, inner[0] - x, y, inner[1] - y], axis=1)
    touching = np.isin(np.arange(len(discs)), diagram.cell[diagram.neighbour < 0])
    disc = np.flatnonzero((reach <= room).all(axis=1) & ~touching)
    allowed = "windows in which the edge leaves a cell whole"
    require(
        len(disc) > 0,
        "size",
        value=discs.size.tolist(),
        allowed=allowed,
        cure="take a larger section",
    )
    taken = reach[disc].reshape(-1, 2, 2).sum(axis=2)  # across and along
    return disc, discs.measure / (inner - taken).prod(axis=1)


def _reach(diagram: Apollonius) -> Array:
    """Return max ρ (1 + cos ψ) − r over each cell's boundary for the four edges, (n, 4), in m.

    ρ is the distance from the centre and ψ the angle from the edge's direction. The maximum over
    `ANGLES` points of each arc is taken, whose error is of second order.
    """
    angle, rho = diagram.walls(ANGLES)
    reach = np.full((len(diagram.discs), 4), -np.inf)
    for edge, direction in enumerate(EDGES):
        out = (rho * (1 + np.cos(angle - direction))).max(axis=0)
        np.maximum.at(reach[:, edge], diagram.cell, np.where(rho.min(axis=0) > 0, out, np.inf))
    return reach - diagram.discs.radii[:, None]
