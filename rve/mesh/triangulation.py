"""Planar mesh under the prisms: Gmsh triangles at a reference radius."""

from __future__ import annotations

import os
from dataclasses import dataclass
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from alphacut.fuzzy.arrays import Array, Mask, Rows
from alphacut.rve.mesh import square
from alphacut.rve.mesh.outline import Outline, circle, reach, require_fit
from alphacut.rve.mesh.square import Triangles
from alphacut.stochastic import RadiusMap, require_map


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
    """

    points: Array
    vertices: int
    ends: Rows
    triangles: Rows
    inside: Mask
    arc: Mask
    radius: float
    outline: Outline = circle


def reference_radius(radius_map: RadiusMap, outline: Outline = circle) -> float:
    """Radius of the planar mesh: the middle of the map's range, rounded, in [0.1, 0.9 / reach].

    Raises:
        ValueError: The map gives radii outside (0, 1), or its law of θ is none.
    """
    require_map(radius_map)
    law = radius_map.distribution
    radii = radius_map(np.linspace(law.lower, law.upper, 65))
    require_fit(outline, float(radii.max()))
    middle = np.round((radii.min() + radii.max()) * 10) / 20
    return float(np.clip(middle, 0.1, 0.9 / reach(outline)))


def triangulate(*, size: float, radius: float, outline: Outline = circle) -> Triangulation:
    """Mesh the cell with triangles of about `size`, opposite sides matching.

    Args:
        size: Wanted edge length, in halves of the cell's side, in (0, 1].
        radius: Radius of the particle in the mesh, in (0, 1), or 0 for a mesh that knows nothing of
            it.
        outline: Of the particle.
    """
    points, triangles, inside = _kept_triangles(size, radius, outline)
    return _add_midpoints(*_neighbours_near(points, triangles, inside), radius, outline)


def _neighbours_near(points: Array, triangles: Rows, inside: Mask) -> Triangles:
    """The mesh with neighbours near in memory: in order along a Z-curve through the cell."""
    grid = ((points[triangles].mean(axis=1) + 1) / 2 * 2**15).astype(np.int64)
    code = np.zeros(len(triangles), np.int64)
    for bit in range(15):
        for axis in range(2):
            code |= (grid[:, axis] >> bit & 1) << (2 * bit + axis)
    order = np.argsort(code, kind="stable")
    triangles, inside = triangles[order], inside[order]
    _, first = np.unique(triangles, return_index=True)
    along = np.argsort(first)
    place = np.empty_like(along)
    place[along] = np.arange(len(along))
    return points[along], place[triangles], inside


def _kept_triangles(size: float, radius: float, outline: Outline) -> Triangles:
    """Gmsh's triangles, from the cache where an equal Gmsh was called with the same."""
    origin, folder = find_spec("gmsh"), cache_folder()
    if folder is None or origin is None or origin.origin is None or outline is not circle:
        return square.triangles(size, radius, outline)
    about, code = Path(origin.origin).stat(), Path(square.__file__).read_text(encoding="utf-8")
    made_by = size, radius, origin.origin, about.st_size, about.st_mtime_ns, code
    kept = folder / f"mesh-{sha256(repr(made_by).encode()).hexdigest()[:24]}.npz"
    try:
        with np.load(kept, allow_pickle=False) as archive:
            return archive["points"], archive["triangles"], archive["inside"]
    except (OSError, ValueError, KeyError, EOFError, BadZipFile):
        points, triangles, inside = square.triangles(size, radius, outline)
    partial = kept.with_suffix(f".{os.getpid()}.npz")
    np.savez(partial, points=points, triangles=triangles, inside=inside)
    partial.replace(kept)
    return points, triangles, inside


def cache_folder() -> Path | None:
    """Folder of meshes that Gmsh need not make again; None if it cannot be made."""
    caches = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    folder = Path(os.environ.get("ALPHACUT_CACHE") or Path(caches) / "alphacut") / "meshes"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return None
    return folder if os.access(folder, os.W_OK) else None


def _add_midpoints(
    points: Array, triangles: Rows, inside: Mask, radius: float, outline: Outline
) -> Triangulation:
    """Number the edges and put a node on each; find the nodes of the interface."""
    corners = triangles[:, [[0, 1], [0, 2], [1, 2]]]
    low, high = np.sort(corners.reshape(-1, 2), axis=1).T
    keys, edge = np.unique(low * len(points) + high, return_inverse=True)
    ends, edge = np.column_stack(np.divmod(keys, len(points))), edge.reshape(-1, 3)
    sides = np.stack(
        [np.bincount(edge[inside == flag].ravel(), minlength=len(ends)) for flag in (False, True)]
    )
    arc_edge = (sides > 0).all(axis=0)  # an edge between a particle triangle and a matrix triangle
    arc = np.zeros(len(points) + len(ends), bool)
    arc[: len(points)][ends[arc_edge].ravel()] = True
    arc[len(points) :] = arc_edge
    return Triangulation(
        np.concatenate([points, points[ends].mean(axis=1)]),
        len(points),
        ends,
        np.hstack([triangles, len(points) + edge]),
        inside,
        arc,
        radius,
        outline,
    )
