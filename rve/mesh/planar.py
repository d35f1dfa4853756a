"""Planar cell as Gmsh triangles of any order with a curved interface."""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot

import gmsh
import numpy as np
from numpy.typing import NDArray

from alphacut.rve.interruption import uninterrupted
from alphacut.rve.mesh.geometry import PeriodicSquare
from alphacut.rve.mesh.triangulation import Integers
from alphacut.rve.settings import require_mesh_size, require_radius
from alphacut.stochastic.theta.truncated_normal import Array

with uninterrupted():
    import basix

EDGES = ((1, 2), (0, 2), (0, 1))  # of a triangle, in the order of Basix
_TOUCH = 1e-6
_CLOSEST = 0.9995
_COARSEST = 0.7  # mesh size: on coarser ones small particles hide from every order


class TouchingError(RuntimeError):
    """Particles so close that the mesh between them has no end."""


@dataclass(frozen=True)
class PlanarMesh:
    """Straight-sided triangles of the cell [−1, 1]², opposite sides matching.

    Args:
        points: Vertices, shape (n, 2).
        triangles: Vertices of each triangle in rising order, shape (m, 3), so that two neighbours
            run along their edge the same way.
        inside: Whether a triangle belongs to the particle, shape (m,).
        radius: Radius of the particle.
        centre: Its centre; where the particle crosses a side it goes on at the opposite one.
    """

    points: Array
    triangles: Integers
    inside: NDArray[np.bool_]
    radius: float
    centre: tuple[float, float] = (0.0, 0.0)


def planar_mesh(
    radius: float, *, size: float, centre: tuple[float, float] = (0.0, 0.0)
) -> PlanarMesh:
    """Mesh one cell, finer where the particle is small or nearly touches its images.

    Args:
        radius: Radius of the particle over half the cell's side, in (0, 1).
        size: Wanted edge length far from the interface, in halves of the cell's side, in (0, 1].
        centre: Centre of the particle.

    Raises:
        ValueError: A value out of range, or a particle whose edge touches a side of the cell
            without crossing it.
        TouchingError: Particles nearly touch.
    """
    require_radius(radius)
    require_mesh_size(size)
    if radius > _CLOSEST:
        raise TouchingError(
            f"the radius is {radius:.6g} and planar meshes end at {_CLOSEST:g}: the gap between"
            " particles would need elements without end; lower the radius"
        )
    _refuse_touching_side(radius, centre)
    size = min(size, _COARSEST)
    gmsh.initialize(["", "-v", "1"], readConfigFiles=False, interruptible=False)
    try:
        gmsh.option.setNumber("General.NumThreads", 1)
        square = PeriodicSquare(-1.0, 1.0)
        particle = square.cut([((centre[0] + 1) % 2 - 1, (centre[1] + 1) % 2 - 1, radius)])
        square.bind_sides()
        gmsh.option.setNumber("Mesh.MeshSizeExtendFromBoundary", 0)
        gmsh.option.setNumber("Mesh.MeshSizeFromPoints", 0)
        # of the size along a curve; the default asks for thousands of points
        gmsh.option.setNumber("Mesh.LcIntegrationPrecision", 1e-4)
        gmsh.model.mesh.setSizeCallback(
            lambda dim, tag, x, y, z, lc: size * _grading(x - centre[0], y - centre[1], radius)
        )
        gmsh.model.mesh.generate(2)
        points, triangles, inside = _triangles(particle)
    finally:
        gmsh.finalize()
    return PlanarMesh(points, triangles, inside, radius, centre)


def _refuse_touching_side(radius: float, centre: tuple[float, float]) -> None:
    for c in centre:
        gaps = [abs(abs((c + shift + 1) % 2 - 1) - 1) for shift in (radius, -radius)]
        if min(gaps) < _TOUCH:
            raise ValueError(
                f"a particle of radius {radius:g} at {centre} touches a side of the cell without"
                f" crossing it; move its centre by more than {_TOUCH:g}: the moduli do not depend"
                " on it"
            )


def _grading(x: float, y: float, radius: float) -> float:
    """Local edge length over the nominal one, less near the particle and in gaps.

    The factors spread the error evenly over radii from 0.1 to 0.98. Gmsh calls this for every
    point, hence no NumPy.
    """
    x, y = abs((x + 1) % 2 - 1), abs((y + 1) % 2 - 1)
    reach = 1.4 * max(hypot(x, y), radius)
    beside = 1 - radius + y * y / (2 * radius) + max(0.0, radius - x)
    above = 1 - radius + x * x / (2 * radius) + max(0.0, radius - y)
    return min(1.0, reach, 4 * beside, 4 * above)


def _triangles(particle: set[int]) -> tuple[Array, Integers, NDArray[np.bool_]]:
    """Vertices, triangles and the particle's triangles of the current Gmsh model."""
    tags, xyz, _ = gmsh.model.mesh.getNodes()
    number = np.zeros(int(tags.max()) + 1, np.int64)
    number[tags] = np.arange(len(tags))
    surfaces = [tag for _, tag in gmsh.model.getEntities(2)]
    blocks = [
        number[gmsh.model.mesh.getElementsByType(2, tag)[1].astype(np.int64)].reshape(-1, 3)
        for tag in surfaces
    ]
    inside = np.repeat([tag in particle for tag in surfaces], [len(b) for b in blocks])
    used, packed = np.unique(np.concatenate(blocks), return_inverse=True)
    return xyz.reshape(-1, 3)[used, :2], np.sort(packed.reshape(-1, 3), axis=1), inside


def curved_nodes(mesh: PlanarMesh, order: int) -> tuple[Array, Integers]:
    """Nodes of Lagrange triangles of `order`, the interface's edges bent onto the circle.

    Inside a triangle the bend fades with the bubble of its edge, so the map stays smooth and the
    elements keep their order.

    Returns:
        Positions (n, 2) and the nodes of each triangle (m, (order + 1)(order + 2)/2).
    """
    element = basix.create_element(
        basix.ElementFamily.P, basix.CellType.triangle, order, basix.LagrangeVariant.gll_warped
    )
    lattice: Array = np.asarray(element.points, float)
    barycentric = np.column_stack([1 - lattice.sum(axis=1), lattice])
    ends, edges = _number_edges(mesh.triangles)
    places = np.einsum("nl,eld->end", barycentric, mesh.points[mesh.triangles])
    sides = [
        np.bincount(edges[mesh.inside == flag].ravel(), minlength=len(ends))
        for flag in (False, True)
    ]
    on_interface = (sides[0] > 0) & (sides[1] > 0)
    for k, (a, b) in enumerate(EDGES):
        bent = np.flatnonzero(on_interface[edges[:, k]])
        places[bent] += _bend(mesh, mesh.triangles[bent][:, [a, b]], barycentric[:, [a, b]])
    cells = _number_nodes(
        mesh.triangles, edges, vertices=len(mesh.points), edge_count=len(ends), order=order
    )
    points = np.empty((cells.max() + 1, 2))
    points[cells] = places
    return points, cells


def _number_edges(triangles: Integers) -> tuple[Integers, Integers]:
    """The two vertices of each edge (k, 2) and the edges of each triangle (m, 3)."""
    pairs = np.stack([triangles[:, list(pair)] for pair in EDGES], axis=1)
    ends, edges = np.unique(pairs.reshape(-1, 2), axis=0, return_inverse=True)
    return ends, edges.reshape(-1, 3)


def _number_nodes(
    triangles: Integers, edges: Integers, *, vertices: int, edge_count: int, order: int
) -> Integers:
    on_edge, within = order - 1, (order - 1) * (order - 2) // 2
    along = [vertices + edges[:, [k]] * on_edge + np.arange(on_edge) for k in range(3)]
    first = vertices + edge_count * on_edge
    return np.hstack(
        [triangles, *along, first + np.arange(len(triangles))[:, None] * within + np.arange(within)]
    )


def _bend(mesh: PlanarMesh, ends: Integers, weights: Array) -> Array:
    """Displacement of all nodes of triangles with the edge `ends` (k, 2) on the circle."""
    a, b = mesh.points[ends[:, 0]], mesh.points[ends[:, 1]]
    centre = mesh.centre + 2 * np.round(((a + b) / 2 - mesh.centre) / 2)
    start, stop = (np.arctan2(p[:, 1] - centre[:, 1], p[:, 0] - centre[:, 0]) for p in (a, b))
    turn = (stop - start + np.pi) % (2 * np.pi) - np.pi
    along = (1 + weights[:, 1] - weights[:, 0]) / 2
    angle = start[:, None] + turn[:, None] * along
    circle = centre[:, None] + mesh.radius * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    chord = a[:, None] + (b - a)[:, None] * along[:, None]
    bubble = weights.prod(axis=1)
    share = np.divide(bubble, along * (1 - along), out=np.zeros_like(bubble), where=bubble > 1e-14)
    return np.asarray((circle - chord) * share[:, None])
