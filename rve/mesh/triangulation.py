"""Planar mesh under the prisms, at a reference radius."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alphacut.fuzzy.arrays import Array, Mask, Rows
from alphacut.rve.outline import Outline, circle, reach, require_fit
from alphacut.stochastic import RadiusMap, require_map

RING_THICKNESS = 0.05
"""Of an interphase in the mesh that is moved to all others, in halves of the cell's side."""


@dataclass(frozen=True, eq=False)
class Ring:
    """Interphase around a round particle in a planar mesh.

    Args:
        thickness: In this mesh, in halves of the cell's side.
        nodes: Whether a node belongs to it, its edges included, shape (n,).
    """

    thickness: float
    nodes: Mask


@dataclass(frozen=True, eq=False)
class Triangulation:
    """Six-node triangles of the cell [−1, 1]², vertices numbered before edge midpoints.

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
        ring: Interphase around it, if there is one.
    """

    points: Array
    vertices: int
    ends: Rows
    triangles: Rows
    inside: Mask
    arc: Mask
    radius: float
    outline: Outline = circle
    ring: Ring | None = None


def reference_radius(
    radius_map: RadiusMap, outline: Outline = circle, thickness: float = 0.0
) -> float:
    """Radius of the particle in the planar mesh, which is then moved to all radii of a map.

    The middle of the map's range, rounded to 1/20, in [0.1, 0.9 / reach of the outline].

    Raises:
        ValueError: The map gives radii outside (0, 1), or its law of θ is none.
    """
    require_map(radius_map)
    law = radius_map.distribution
    radii = radius_map(np.linspace(law.lower, law.upper, 65))
    require_fit(outline, float(radii.max()) + thickness)
    middle = np.round((radii.min() + radii.max()) * 10) / 20
    return float(np.clip(middle, 0.1, 0.9 / reach(outline)))
