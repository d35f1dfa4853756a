"""Motion of a planar mesh from its reference radius to any other."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from alphacut.rve.mesh.triangulation import Triangulation
from alphacut.stochastic.theta.truncated_normal import Array


def moved(mesh: Triangulation, radius: float) -> Array:
    """Positions of all nodes, shape (n, 2), curved edges on the circle of `radius`.

    Nodes slide along rays from the centre: inside the particle in proportion, outside between the
    circle and the side of the square. Edge midpoints slide too, so that the layers between a large
    particle and the side bend with it; only an edge across a diagonal of the square, where sliding
    has a kink, stays straight.
    """
    points = _slide(mesh.points, mesh.radius, radius)
    straight = np.flatnonzero(_across_diagonal(mesh)) + mesh.vertices
    points[straight] = points[mesh.ends[straight - mesh.vertices]].mean(axis=1)
    # z = 0 of eq. 14
    points[mesh.arc] *= radius / np.linalg.norm(points[mesh.arc], axis=1, keepdims=True)
    return np.asarray(points)


def _across_diagonal(mesh: Triangulation) -> NDArray[np.bool_]:
    """Mask of edges outside the particle that cross a diagonal, shape (edges,)."""
    x, y = mesh.points[mesh.ends].transpose(2, 1, 0)
    crossed = ((x - y).prod(axis=0) < -1e-12) | ((x + y).prod(axis=0) < -1e-12)
    return np.asarray(crossed)


def _slide(points: Array, old: float, new: float) -> Array:
    """Move along rays, shape (n, 2), from the circle of radius `old` to `new`; sides stay."""
    reach = abs(points).max(axis=1)  # 1 on the square's sides
    distance = np.linalg.norm(points, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        side = distance / reach  # distance of the square's side along the ray
        outer = (new + (distance - old) * (side - new) / (side - old)) / distance
    return np.asarray(points * np.where(distance <= old * (1 + 1e-9), new / old, outer)[:, None])
