"""Direct neighbours by the Delaunay triangulation (section 4.1, Figs. 5–7)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alphacut.stochastic.particles.discs import Discs
from alphacut.stochastic.tessellation.apollonius import Apollonius
from alphacut.stochastic.theta.truncated_normal import Array


@dataclass(frozen=True, eq=False)
class Neighbours:
    """Delaunay neighbours of disc centres.

    Args:
        number: Neighbours of each centre that is counted, shape (n,).
        first: Centre at one end of each edge, shape (m,); each edge appears once from either end.
        apart: Vector to the other end, shape (m, 2), in m.
    """

    number: Array
    first: Array
    apart: Array

    @property
    def distances(self) -> Array:
        """Distances of the centres, shape (m,), in m."""
        return np.asarray(np.hypot(self.apart[:, 0], self.apart[:, 1]))


def hexagonal_order(found: Neighbours) -> float:
    """Order of the bonds between neighbours as in a triangular lattice, |⟨e^{6iφ}⟩|, 0 … 1.

    1 in one crystal; about 1/√m of m bonds at random directions (Nelson and Halperin 1979).
    """
    angle = np.arctan2(found.apart[:, 1], found.apart[:, 0])
    return float(abs(np.exp(6j * angle).mean())) if len(angle) else 0.0


def neighbours(discs: Discs) -> Neighbours:
    """Delaunay neighbours, on a torus or of centres in a window that are sure of theirs.

    A triangle is the torus's own if its circumcircle lies where images have been laid out; the
    layer of images grows until all are. In a window only those centres count whose triangles all
    have their circumcircle inside it.

    Raises:
        ValueError: There are fewer than three centres, or all in one line.
    """
    from scipy.spatial import Delaunay, QhullError

    margin = 4 * np.sqrt(discs.area / len(discs))
    while True:
        points = _with_images(discs, margin if discs.periodic else 0.0)
        try:
            triangulation = Delaunay(points)
        except QhullError as error:
            raise ValueError(
                f"{len(discs)} centres have no triangulation: it takes three that are not in one"
                " line"
            ) from error
        corners = triangulation.simplices
        circle, radius = _circumcircles(points[corners])
        base = corners < len(discs)
        if not discs.periodic or 2 * radius[base.any(axis=1)].max() < margin:
            break
        margin *= 2
    counted = np.ones(len(discs), bool)
    if not discs.periodic:
        inside = ((circle - radius[:, None] >= 0) & (circle + radius[:, None] <= discs.size)).all(
            axis=1
        )
        counted[corners[~inside]] = False
        counted[triangulation.convex_hull] = False
    start, other = triangulation.vertex_neighbor_vertices
    first = np.repeat(np.arange(len(points)), np.diff(start))
    keep = (first < len(discs)) & counted[np.minimum(first, len(discs) - 1)]
    first, other = first[keep], other[keep]
    return Neighbours(
        np.bincount(first, minlength=len(discs))[counted], first, points[other] - points[first]
    )


def neighbouring_values(diagram: Apollonius, values: Array) -> Array:
    """Pairs of `values` of cells that share a wall, either way round, shape (2, m)."""
    beyond = (
        (diagram.neighbour > diagram.cell)
        & np.isfinite(values[diagram.cell])
        & np.isfinite(values[diagram.neighbour])
    )
    pair = np.unique(np.stack([diagram.cell[beyond], diagram.neighbour[beyond]]), axis=1)
    return np.concatenate([values[pair], values[pair[::-1]]], axis=1)


def cell_correlation(diagram: Apollonius, values: Array) -> float:
    """Correlation of `values`, shape (n,), between cells that share a wall."""
    return float(np.corrcoef(neighbouring_values(diagram, values))[0, 1])


def _with_images(discs: Discs, margin: float) -> Array:
    """Centres of the discs, then of their images within `margin` of the box, shape (m, 2)."""
    points = [discs.centres]
    tiles = np.ceil(margin / discs.size).astype(int)
    for i in range(-tiles[0], tiles[0] + 1):
        for j in range(-tiles[1], tiles[1] + 1):
            image = discs.centres + discs.size * (i, j)
            near = ((image > -margin) & (image < discs.size + margin)).all(axis=1) & bool(i or j)
            points.append(image[near])
    return np.concatenate(points)


def _circumcircles(triangles: Array) -> tuple[Array, Array]:
    """Centres (m, 2) and radii (m,) of the circles through three points each (m, 3, 2)."""
    b, c = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    twice = 2 * (b[:, 0] * c[:, 1] - b[:, 1] * c[:, 0])
    bb, cc = (b**2).sum(axis=1), (c**2).sum(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        apart = (
            np.stack([c[:, 1] * bb - b[:, 1] * cc, b[:, 0] * cc - c[:, 0] * bb], axis=1)
            / twice[:, None]
        )
    return triangles[:, 0] + apart, np.hypot(apart[:, 0], apart[:, 1])
