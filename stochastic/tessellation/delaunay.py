"""Direct neighbours by the Delaunay triangulation (section 4.1, Figs. 5–7)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alphacut.fuzzy.arrays import Array, Rows
from alphacut.stochastic.particles.particles import Particles
from alphacut.stochastic.tessellation.apollonius import Apollonius

LAYER = 8.0  # mean spacings; no circumcircle of a packing is wider


@dataclass(frozen=True, eq=False)
class Neighbours:
    """Delaunay neighbours of disc centres.

    Args:
        number: Neighbours of each centre that is counted, shape (n,).
        first: Centre at one end of each edge, shape (m,); each edge appears once from either end.
        offset: Vector to the other end, shape (m, 2), in m.
    """

    number: Rows
    first: Rows
    offset: Array

    @property
    def distances(self) -> Array:
        """Distances of the centres, shape (m,), in m."""
        return np.asarray(np.hypot(self.offset[:, 0], self.offset[:, 1]))


def neighbours(discs: Particles) -> Neighbours:
    """Delaunay neighbours of the disc centres: their number and the offset of each.

    A periodic section is triangulated with a layer of images, `LAYER` mean spacings wide: its
    triangles are those of the periodic plane if no circumcircle is wider, as in any packing. In a
    window, centres on the convex hull are not counted.
    """
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
