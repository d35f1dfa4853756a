"""Apollonius diagram of discs with exact cell areas (section 4.1, Fig. 10).

The cell of disc i holds the points x with |x − c_i| − r_i ≤ |x − c_j| − r_j for all j. It is
star-shaped around c_i, and bounded by 1/ρ(φ) = max_j (a_j cos φ + b_j sin φ + c_j): one hyperbola
per neighbour (see `wall`), joined by an upper envelope (see `upper_envelopes`). In an open window
the cells are cut at the window's edges, each of which acts as the wall towards the disc's own
mirror image.

This differs from the paper in: 1. No triangulation of the discs is made; every cell stands on its
own, so that touching, overlapping, and cocircular discs need no special case.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from alphacut.fuzzy.arrays import Array, Mask, Rows
from alphacut.stochastic.particles.particles import Particles
from alphacut.stochastic.tessellation.circle_envelope import (
    Arcs,
    anomaly,
    sector_area,
    upper_envelopes,
)
from alphacut.stochastic.tessellation.surroundings import Pairs, pairs_within

NEAR = 3.0  # mean spacings from a disc's edge within which discs bound its cell at first


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
        apart: Vector from the centre to that image of the neighbour, shape (m, 2), in m.
        start: Angle at the centre where the arc begins, shape (m,).
        end: Angle where it ends, shape (m,), `start` ≤ `end` ≤ `start` + 2π.
    """

    discs: Particles
    areas: Array
    cell: Rows
    neighbour: Rows
    apart: Array
    start: Array
    end: Array

    @property
    def reduced_radii(self) -> Array:
        """r_n = r/a with a = √A/2 (section 4.1), shape (n,)."""
        return np.asarray(2 * self.discs.radii / np.sqrt(self.areas))

    @property
    def cut(self) -> Mask:
        """True if the cell touches the edge of the window, shape (n,)."""
        touched = np.zeros(len(self.discs), bool)
        touched[self.cell[self.neighbour < 0]] = True
        return touched

    def wall(self) -> tuple[Array, Array]:
        """Sums d + Δ and differences d − Δ of every arc (see `wall`), shape (m,), in m."""
        return _near_far(self.discs.radii, self.cell, self.neighbour, self.apart)

    def radius_at(self, arc: Rows, angle: Array) -> Array:
        """Distance from the centre to the wall of `arc` at `angle` (broadcast), in m."""
        near, far = (side[arc] for side in self.wall())
        psi = angle - np.arctan2(self.apart[arc, 1], self.apart[arc, 0])
        return np.asarray(near * far / ((far - near) + (far + near) * np.cos(psi)))


def apollonius(discs: Particles) -> Apollonius:
    """Apollonius diagram of `discs`, of which none lies inside another one.

    The neighbours are certain, not guessed: cells from the discs nearby bound the true ones, and a
    disc j can only cut the cell of i if |c_j − c_i| < 2 ρ_max,i − r_i + r_j; all such discs are
    then taken into account.

    Args:
        discs: Periodic box or open window.
    """
    widest = float(discs.radii.max())
    largest = np.zeros(len(discs))
    for _, walls in _walls(discs, np.full(len(discs), widest + NEAR * discs.spacing)):
        largest += walls.largest_radius()
    areas, parts = np.zeros(len(discs)), []
    for _, walls in _walls(discs, 2 * largest - discs.radii + widest):
        areas += walls.areas()
        arcs, pairs = walls.arcs, walls.pairs
        second, apart = pairs.second[arcs.function], pairs.apart[arcs.function]
        parts.append((arcs.owner, second, apart, arcs.start, arcs.end))
    columns = (np.concatenate(column) for column in zip(*parts, strict=True))
    return Apollonius(discs, areas, *columns)


def _walls(discs: Particles, reach: Array) -> Iterator[tuple[Rows, _Walls]]:
    """Cells of portions of the discs with all others within reach as their neighbours."""
    for of, pairs in pairs_within(discs, np.arange(len(discs), dtype=np.intp), reach):
        yield of, _Walls.towards(discs, pairs, of=of)


def _near_far(radii: Array, first: Rows, second: Rows, apart: Array) -> tuple[Array, Array]:
    """Sums d + Δ and differences d − Δ of pairs; a window's edge is a wall to an equal disc."""
    distance = np.hypot(apart[:, 0], apart[:, 1])
    difference = np.where(second < 0, 0.0, radii[first] - radii[second])
    return distance + difference, distance - difference


@dataclass(frozen=True, eq=False)
class _Walls:
    """Walls of every disc towards the others, and the envelopes that they form."""

    discs: Particles
    pairs: Pairs
    arcs: Arcs

    @classmethod
    def towards(cls, discs: Particles, others: Pairs, *, of: Rows) -> _Walls:
        """Cells of the discs `of` with the `others` and their own images as only neighbours."""
        near, far = _near_far(discs.radii, others.first, others.second, others.apart)
        pairs = Pairs.join([others.where((near > 0) & (far > 0)), _bounds(discs, of)])
        near, far = _near_far(discs.radii, pairs.first, pairs.second, pairs.apart)
        direction = pairs.apart / np.hypot(pairs.apart[:, 0], pairs.apart[:, 1])[:, None]
        amplitude = 1 / near + 1 / far
        arcs = upper_envelopes(
            amplitude * direction[:, 0],
            amplitude * direction[:, 1],
            1 / near - 1 / far,
            np.bincount(pairs.first, minlength=len(discs)),
        )
        return cls(discs, pairs, arcs)

    def _anomalies(self) -> tuple[Array, Array, Array, Array]:
        """Anomalies at both ends of every arc, and d + Δ, d − Δ of its wall."""
        of = self.arcs.function
        apart = self.pairs.apart[of]
        near, far = _near_far(self.discs.radii, self.pairs.first[of], self.pairs.second[of], apart)
        towards = np.arctan2(apart[:, 1], apart[:, 0])
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
        """Upper bound of the distance from the centre to the cell's boundary, shape (n,).

        Each corner is taken from that of its two walls which it lies less far out on; a per mille
        is added for round-off.
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


def _bounds(discs: Particles, of: Rows) -> Pairs:
    """Bounds of every cell: own images in a periodic box, mirror images in a window."""
    if discs.periodic:
        shifts = np.array([(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j]) * discs.size
        return Pairs(np.repeat(of, 8), np.repeat(of, 8), np.tile(shifts, (len(of), 1)))
    # off the edge, so that there is a mirror image
    centres = np.clip(discs.centres[of], 1e-15 * discs.size, (1 - 1e-15) * discs.size)
    apart = np.zeros((len(of), 4, 2))
    apart[:, 0, 0], apart[:, 1, 0] = -2 * centres[:, 0], 2 * (discs.size[0] - centres[:, 0])
    apart[:, 2, 1], apart[:, 3, 1] = -2 * centres[:, 1], 2 * (discs.size[1] - centres[:, 1])
    return Pairs(np.repeat(of, 4), np.full(4 * len(of), -1), apart.reshape(-1, 2))
