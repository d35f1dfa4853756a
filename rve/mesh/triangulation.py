"""Planar mesh under the prisms: Gmsh triangles at a reference radius."""

from __future__ import annotations

import os
from dataclasses import dataclass
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from alphacut.rve.settings import require_mesh_size
from alphacut.stochastic import RadiusMap, require_map
from alphacut.stochastic.theta.truncated_normal import Array

Integers = NDArray[np.int64]
Triangles = tuple[Array, Integers, NDArray[np.bool_]]


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
    """

    points: Array
    vertices: int
    ends: Integers
    triangles: Integers
    inside: NDArray[np.bool_]
    arc: NDArray[np.bool_]
    radius: float


def reference_radius(radius_map: RadiusMap) -> float:
    """Radius of the planar mesh: the middle of the map's range, rounded, in [0.1, 0.9].

    Raises:
        ValueError: The map gives radii outside (0, 1), or its law of θ is none.
    """
    require_map(radius_map)
    law = radius_map.distribution
    radii = radius_map(np.linspace(law.lower, law.upper, 65))
    return float(np.clip(np.round((radii.min() + radii.max()) * 10) / 20, 0.1, 0.9))


def triangulate(*, size: float, radius: float, cache: Path | None = None) -> Triangulation:
    """Mesh the cell with triangles of about `size`, opposite sides matching.

    Args:
        size: Wanted edge length, in halves of the cell's side, in (0, 1].
        radius: Radius of the particle in the mesh, in (0, 1), or 0 for a mesh that knows nothing of
            it.
        cache: Folder where what Gmsh makes is kept; None to ask it every time.

    Raises:
        ValueError: `size` or `radius` out of range.
    """
    require_mesh_size(size)
    if not 0 <= radius < 1:
        raise ValueError(f"the reference radius is {radius:g}; it must lie in [0, 1)")
    points, triangles, inside = _triangles(size, radius, cache)
    return _add_midpoints(*_neighbours_near(points, triangles, inside), radius)


def _neighbours_near(points: Array, triangles: Integers, inside: NDArray[np.bool_]) -> Triangles:
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


def _triangles(size: float, radius: float, cache: Path | None) -> Triangles:
    """As `_gmsh_triangles`, from the cache where an equal Gmsh was asked the same before."""
    found = find_spec("gmsh")
    if cache is None or found is None or found.origin is None:
        return _gmsh_triangles(size, radius)
    about = Path(found.origin).stat()
    code = Path(__file__).read_text(encoding="utf-8")
    made_by = size, radius, found.origin, about.st_size, about.st_mtime_ns, code
    cache.mkdir(parents=True, exist_ok=True)
    kept = cache / f"mesh-{sha256(repr(made_by).encode()).hexdigest()[:24]}.npz"
    try:
        with np.load(kept, allow_pickle=False) as archive:
            return archive["points"], archive["triangles"], archive["inside"]
    except (OSError, ValueError, KeyError, EOFError, BadZipFile):
        points, triangles, inside = _gmsh_triangles(size, radius)
    partial = kept.with_suffix(f".{os.getpid()}.npz")
    np.savez(partial, points=points, triangles=triangles, inside=inside)
    partial.replace(kept)
    return points, triangles, inside


def _gmsh_triangles(size: float, radius: float) -> Triangles:
    """Vertices (n, 2), triangles (m, 3) and the particle's triangles (m,), by Gmsh."""
    import gmsh  # here as below: loading it takes a tenth of a second

    gmsh.initialize(["", "-v", "1"], readConfigFiles=False, interruptible=False)
    try:
        gmsh.option.setNumber("General.NumThreads", 1)
        surfaces = _square_with_disc(size, radius) if radius else _square(size)
        gmsh.model.mesh.generate(2)
        tags, xyz, _ = gmsh.model.mesh.getNodes()
        number = np.zeros(int(tags.max()) + 1, np.int64)
        number[tags] = np.arange(len(tags))
        blocks = [
            number[gmsh.model.mesh.getElementsByType(2, s)[1].astype(np.int64)].reshape(-1, 3)
            for s in surfaces
        ]
    finally:
        gmsh.finalize()
    inside = np.concatenate([np.full(len(b), radius > 0 and k == 0) for k, b in enumerate(blocks)])
    triangles = np.concatenate(blocks)
    # the centres of the arcs are points without triangles
    used, packed = np.unique(triangles, return_inverse=True)
    return xyz.reshape(-1, 3)[used, :2], packed.reshape(-1, 3), inside


def _outline(size: float) -> int:
    """Curve loop of the square with opposite sides periodic."""
    import gmsh

    geo = gmsh.model.geo
    corners = [geo.addPoint(x, y, 0, size) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    sides = [geo.addLine(corners[k], corners[(k + 1) % 4]) for k in range(4)]
    geo.synchronize()
    for first, second, shift in ((sides[3], sides[1], (2, 0)), (sides[0], sides[2], (0, 2))):
        affine = np.eye(4)
        affine[:2, 3] = shift
        gmsh.model.mesh.setPeriodic(1, [second], [first], affine.ravel().tolist())
    return int(geo.addCurveLoop(sides))


def _square(size: float) -> tuple[int]:
    """The cell without a particle: its surface."""
    import gmsh

    surface = gmsh.model.geo.addPlaneSurface([_outline(size)])
    gmsh.model.geo.synchronize()
    return (surface,)


def _square_with_disc(size: float, radius: float) -> tuple[int, int]:
    """Cell with its particle bounded by four arcs: surfaces of particle and matrix."""
    import gmsh

    geo = gmsh.model.geo
    centre = geo.addPoint(0, 0, 0, size)
    poles = [
        geo.addPoint(radius * x, radius * y, 0, size) for x, y in ((1, 0), (0, 1), (-1, 0), (0, -1))
    ]
    arcs = [geo.addCircleArc(poles[k], centre, poles[(k + 1) % 4]) for k in range(4)]
    disc = geo.addCurveLoop(arcs)
    particle, matrix = geo.addPlaneSurface([disc]), geo.addPlaneSurface([_outline(size), disc])
    geo.synchronize()
    gmsh.model.mesh.embed(0, [centre], 2, particle)
    return particle, matrix


def _add_midpoints(
    points: Array, triangles: Integers, inside: NDArray[np.bool_], radius: float
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
    )
