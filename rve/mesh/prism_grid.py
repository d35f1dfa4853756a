"""Prism mesh of the product space: the planar mesh extruded over θ around the cone.

Nodes are numbered level by level: on each of the layers + 1 levels of θ all planar nodes, then,
half-way between levels, the planar vertices (a serendipity wedge has no midpoints there).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from alphacut.rve.mesh.triangulation import Integers, Triangulation
from alphacut.stochastic import RadiusMap, ThetaLaw
from alphacut.stochastic.theta.law import Array


def moved(mesh: Triangulation, radius: float) -> Array:
    """Positions of all nodes, shape (n, 2), curved edges on the circle of `radius`.

    Nodes slide along rays from the centre: inside the particle in proportion, outside between the
    circle and the side of the square. Edge midpoints slide too, so that the layers between a large
    particle and the side bend with it; only an edge across a diagonal of the square, where sliding
    has a kink, stays straight.
    """
    (distance, side, straight), old = _rays(mesh), mesh.radius
    with np.errstate(divide="ignore", invalid="ignore"):
        outer = (radius + (distance - old) * (side - radius) / (side - old)) / distance
    points = mesh.points * np.where(distance <= old * (1 + 1e-9), radius / old, outer)[:, None]
    points[straight] = points[mesh.ends[straight - mesh.vertices]].mean(axis=1)
    # z = 0 of eq. 14
    points[mesh.arc] *= radius / np.linalg.norm(points[mesh.arc], axis=1, keepdims=True)
    return np.asarray(points)


@lru_cache(maxsize=4)
def _rays(mesh: Triangulation) -> tuple[Array, Array, Integers]:
    """Distances of nodes and of the square's side along rays, (n,), and midpoints kept straight."""
    distance = np.linalg.norm(mesh.points, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        side = distance / abs(mesh.points).max(axis=1)
    x, y = mesh.points[mesh.ends].transpose(2, 1, 0)
    across = ((x - y).prod(axis=0) < -1e-12) | ((x + y).prod(axis=0) < -1e-12)
    return distance, side, np.flatnonzero(across) + mesh.vertices


@dataclass(frozen=True)
class PrismGrid:
    """Wedges over a planar mesh; topology only, positions follow from a radius map.

    Args:
        plane: The planar mesh.
        layers: Number of equal layers in θ, at least 1.
        conforming: Whether the nodes follow the cone; if not they stay where the planar mesh has
            them.
        wedges: Numbers of the wedges of one rank, layer by layer; None: all. Nodes, cells and
            positions are those of the layers that they lie in.
    """

    plane: Triangulation
    layers: int
    conforming: bool = True
    wedges: range | None = None

    def __post_init__(self) -> None:
        if self.layers < 1:
            raise ValueError(f"the number of layers is {self.layers}; at least 1 is needed")

    @property
    def own(self) -> range:
        """Numbers of the wedges."""
        return (
            range(self.layers * len(self.plane.triangles)) if self.wedges is None else self.wedges
        )

    @property
    def span(self) -> range:
        """Layers that the wedges lie in."""
        triangles = len(self.plane.triangles)
        return range(self.own.start // triangles, -(-self.own.stop // triangles))

    def within(self, layer: int) -> tuple[slice, slice]:
        """The wedges in a layer: their triangles, and their places among the wedges."""
        first, own = layer * len(self.plane.triangles), self.own
        stop = first + len(self.plane.triangles)
        part = range(max(first, own.start), min(stop, own.stop))
        triangles, places = (slice(part.start - k, part.stop - k) for k in (first, own.start))
        return triangles, places

    @property
    def inside(self) -> NDArray[np.bool_]:
        """Mask of the wedges in the particle."""
        triangles = [self.within(layer)[0] for layer in self.span]
        return np.concatenate([self.plane.inside[part] for part in triangles])

    @property
    def nodes(self) -> int:
        """Number of nodes in all."""
        layers = len(self.span)
        return (layers + 1) * len(self.plane.points) + layers * self.plane.vertices

    @cached_property
    def cells(self) -> Integers:
        """Nodes of each wedge in Basix's order, shape (wedges, 15), layer by layer."""
        planar = len(self.plane.points)
        t = self.plane.triangles
        v0, v1, v2, e01, e02, e12 = t.T
        layer = np.arange(len(self.span))[:, None]
        below, above = planar * layer, planar * (layer + 1)
        middle = planar * (len(self.span) + 1) + self.plane.vertices * layer
        columns = [v0 + below, v1 + below, v2 + below, v0 + above, v1 + above, v2 + above]
        columns += [
            e01 + below,
            e02 + below,
            v0 + middle,
            e12 + below,
            v1 + middle,
            v2 + middle,
            e01 + above,
            e02 + above,
            e12 + above,
        ]
        first = self.span.start * len(t)
        return np.stack(columns, axis=-1).reshape(-1, 15)[self.own.start - first :][: len(self.own)]

    def levels(self, law: ThetaLaw) -> Array:
        """θ of all levels, shape (layers + 1,)."""
        return np.linspace(law.lower, law.upper, self.layers + 1)

    def planes(self, radius: RadiusMap) -> tuple[Array, Array]:
        """Positions on the levels, shape (span + 1, n, 2), and half-way, shape (span, n, 2).

        Half-way the wedges have nodes on vertices only; the midpoints are where their shape
        functions carry them.
        """
        levels, v, (a, b) = self._own_levels(radius), self.plane.vertices, self.plane.ends.T
        full = self._at(radius, levels)
        half = self._at(radius, (levels[1:] + levels[:-1]) / 2).copy()
        mean = (full[1:] + full[:-1]) / 2
        half[:, v:] = mean[:, v:] + (half[:, a] + half[:, b] - mean[:, a] - mean[:, b]) / 2
        return full, half

    def _own_levels(self, radius: RadiusMap) -> Array:
        return self.levels(radius.distribution)[self.span.start : self.span.stop + 1]

    def _at(self, radius: RadiusMap, theta: Array) -> Array:
        if not self.conforming:
            return np.broadcast_to(self.plane.points, (len(theta), *self.plane.points.shape))
        return np.array([moved(self.plane, float(r)) for r in radius(theta)])

    def part(self, positions: Array, of: PrismGrid) -> Array:
        """Positions of the nodes from those of a grid of more layers."""
        first = self.span.start - of.span.start
        sizes = len(self.plane.points), self.plane.vertices
        counts = len(self.span) + 1, len(self.span)
        both = np.split(positions, [(len(of.span) + 1) * sizes[0]])
        parts = zip(both, sizes, counts, strict=True)
        return np.concatenate([one[first * size :][: count * size] for one, size, count in parts])

    def positions(self, radius: RadiusMap) -> Array:
        """(x1, x2, θ) of all nodes, shape (nodes, 3)."""
        full, half = self.planes(radius)
        theta = self._own_levels(radius)
        middle = (theta[1:] + theta[:-1]) / 2
        half = half[:, : self.plane.vertices]
        stacked = [
            np.dstack([xy, np.broadcast_to(t[:, None, None], (*xy.shape[:2], 1))])
            for xy, t in ((full, theta), (half, middle))
        ]
        return np.concatenate([s.reshape(-1, 3) for s in stacked])
