"""Gmsh's triangles of the cell [−1, 1]² around its particle, opposite sides matching.

Edge lengths of the planar cell: short near small particles, in gaps, and where outlines bend.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from math import hypot
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from alphacut.base.arrays import Array, Ints, Mask
from alphacut.base.user_cache import cached_arrays
from alphacut.rve.cell.outline import Outline, bend_radii, extents, is_round
from alphacut.rve.interruption import uninterrupted

Sizes = Callable[[float, float], float]
"""Edge length, over the nominal one, at a point (x1, x2)."""
EDGES = ((1, 2), (0, 2), (0, 1))
"""Edges of a triangle by their vertices, in Basix's order."""
REFINEMENTS = (0.5, 0.75, 1.1, 1.7, 2.5, 4.0)
"""Factors of `bend_grading` that are tried one after the other until all elements are valid. Tuned:
larger ones give more elements."""
PER_RADIUS = 1.4
"""Edge length on a circle over its radius, for a mesh size of 1. Tuned: it spreads the error evenly
over radii from 0.1 to 0.98."""


class Triangles(NamedTuple):
    """Straight-sided triangles of the cell.

    Args:
        points: Vertices, shape (n, 2).
        triangles: Vertices of each triangle, shape (m, 3).
        phase: Phase of each triangle, matrix 0 and particle 1, shape (m,).
    """

    points: Array
    triangles: Ints
    phase: Ints


class Edges(NamedTuple):
    """Edges of triangles.

    Args:
        ends: Both vertices of each edge, the smaller number first, shape (k, 2).
        of_triangles: Edges of each triangle in the order of `EDGES`, shape (m, 3).
        on_interface: Whether an edge lies between matrix and particle, shape (k,).
    """

    ends: Ints
    of_triangles: Ints
    on_interface: Mask


def triangles(
    size: float,
    radius: float,
    outline: Outline,
    *,
    near_particle: bool = False,
    refinement: float = 0.0,
) -> Triangles:
    """Mesh the cell by Gmsh, or take the mesh from the user's cache.

    Args:
        size: Wanted edge length, in halves of the cell's side.
        radius: Radius of the particle, 0 for none.
        outline: Outline of the particle.
        near_particle: Whether edges shorten by `particle_grading`.
        refinement: Refinement of `bend_grading`; 0: edges do not shorten at bends.
    """
    gradings: list[Sizes] = []
    if near_particle:
        gradings.append(particle_grading(outline, radius))
    if refinement:
        gradings.append(bend_grading(outline, radius, refinement))

    def min_size(x: float, y: float) -> float:
        return size * min(1.0, *(grading(x, y) for grading in gradings))

    sizes = min_size if gradings else None
    generate = partial(gmsh_triangles, size, radius, outline, sizes)

    # The key of the cache is all that Gmsh is given: the numbers, the outline at the points of its
    # spline, its bends, this file, and the version of Gmsh.
    angles: Array = np.asarray(np.linspace(0, 2 * np.pi, 4 * _spline_steps(outline) + 1), float)
    numbers = np.array([size, radius, near_particle, refinement, *extents(outline)])
    points, bends = bend_radii(outline)
    shape = np.concatenate([numbers, outline(angles), points.ravel(), bends])
    try:
        content = f"{version('gmsh')} {Path(__file__).read_text('utf-8')}".encode()
    except PackageNotFoundError:  # a Gmsh that does not say which it is
        return generate()
    vertices, cells, phase = cached_arrays("meshes", content + shape.tobytes(), generate)
    return Triangles(
        np.asarray(vertices, float), np.asarray(cells, np.int64), np.asarray(phase, np.int64)
    )


def gmsh_triangles(size: float, radius: float, outline: Outline, sizes: Sizes | None) -> Triangles:
    """Mesh the cell by Gmsh.

    Args:
        size: Wanted edge length, in halves of the cell's side.
        radius: Radius of the particle, 0 for none.
        outline: Outline of the particle.
        sizes: Edge length at a point (x1, x2), in place of `size`.
    """
    with model() as gmsh:
        phase_surfaces = surfaces(size, radius, outline)
        if sizes is not None:
            # Nothing else sets the edge lengths.
            gmsh.option.setNumber("Mesh.MeshSizeExtendFromBoundary", 0)
            gmsh.option.setNumber("Mesh.MeshSizeFromPoints", 0)
            # Precision of the integral of 1/size along a curve. The default asks for the size at
            # thousands of points.
            gmsh.option.setNumber("Mesh.LcIntegrationPrecision", 1e-4)
            gmsh.model.mesh.setSizeCallback(lambda dim, tag, x, y, z, lc: sizes(x, y))
        gmsh.model.mesh.generate(2)
        node_tags, xyz, _ = gmsh.model.mesh.getNodes()
        number = np.zeros(int(node_tags.max()) + 1, np.int64)
        number[node_tags] = np.arange(len(node_tags))
        cells, phases = [], []
        for phase, surface in phase_surfaces.items():
            vertex_tags = gmsh.model.mesh.getElementsByType(2, surface)[1].astype(np.int64)
            cells.append(number[vertex_tags].reshape(-1, 3))
            phases.append(np.full(len(cells[-1]), phase))
    # The centres of arcs are points without triangles.
    used, compact = np.unique(np.concatenate(cells), return_inverse=True)
    points = xyz.reshape(-1, 3)[used, :2]
    return Triangles(points, compact.reshape(-1, 3), np.concatenate(phases))


def surfaces(size: float, radius: float, outline: Outline) -> dict[int, int]:
    """Add the cell's geometry to the current Gmsh model; return its surfaces by phase.

    Args:
        size: Edge length of elements.
        radius: Radius of the particle, 0 for none.
        outline: Outline of the particle.

    Returns:
        Tags of the surfaces by the number of the phase: matrix 0, and particle 1 if there is one.
    """
    import gmsh

    geo = gmsh.model.geo
    if not radius:
        surface = geo.addPlaneSurface([_square_loop(geo, size)])
        geo.synchronize()
        return {0: surface}
    particle, matrix = _particle(geo, size, radius, outline)
    return {1: particle, 0: matrix}


def edges(triangles: Ints, inside: Mask) -> Edges:
    """Return the edges of triangles.

    Args:
        triangles: Vertices of each triangle, shape (m, 3).
        inside: Whether a triangle lies in the particle, shape (m,).
    """
    vertex_pairs = np.sort(triangles[:, EDGES].reshape(-1, 2), axis=1)
    ends, number = np.unique(vertex_pairs, axis=0, return_inverse=True)
    of_triangles = number.reshape(-1, 3)
    in_particle = np.zeros(len(ends), bool)
    in_particle[of_triangles[inside]] = True
    in_matrix = np.zeros(len(ends), bool)
    in_matrix[of_triangles[~inside]] = True
    return Edges(ends, of_triangles, in_particle & in_matrix)


@contextmanager
def model() -> Iterator[Any]:
    """Context of Gmsh with an empty model, quiet, on one thread; Ctrl-C waits for its end."""
    import gmsh

    with uninterrupted(second_ends=True):  # Gmsh loses exceptions of functions that it calls
        gmsh.initialize(["", "-v", "0"], readConfigFiles=False, interruptible=False)
        try:
            gmsh.option.setNumber("General.NumThreads", 1)
            yield gmsh
        finally:
            gmsh.finalize()


def _square_loop(geo: Any, size: float) -> int:
    """Add the boundary of the square, opposite sides periodic; return the tag of its curve loop."""
    import gmsh

    corners = [geo.addPoint(x, y, 0, size) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    sides = [geo.addLine(corners[side], corners[(side + 1) % 4]) for side in range(4)]
    geo.synchronize()
    bottom, right, top, left = sides
    for first, second, shift in ((left, right, (2, 0)), (bottom, top, (0, 2))):
        affine = np.eye(4)
        affine[:2, 3] = shift
        gmsh.model.mesh.setPeriodic(1, [second], [first], affine.ravel().tolist())
    return int(geo.addCurveLoop(sides))


def _spline_steps(outline: Outline) -> int:
    """Return the number of steps of the spline through a quarter of an outline.

    There are about four for a radian of its turn, so that the spline keeps lobes apart, and 16 to
    128. Vertices are put on the outline itself afterwards.
    """
    points, radii = bend_radii(outline)
    largest_ratio = float((np.hypot(*points.T) / radii).max())
    return int(np.clip(4 * np.ceil(largest_ratio), 16, 128))


def _particle(geo: Any, size: float, radius: float, outline: Outline) -> tuple[int, int]:
    """Add a particle bounded by four curves and the matrix around it.

    Args:
        geo: Gmsh's kernel of geometry.
        size: Edge length of elements.
        radius: Radius of the particle.
        outline: Outline of the particle.

    Returns:
        Tags of the surfaces of the particle and of the matrix.
    """
    import gmsh

    def add_point(angle: float) -> int:
        distance = radius * float(outline(np.array(angle)))
        return int(geo.addPoint(distance * np.cos(angle), distance * np.sin(angle), 0, size))

    centre = geo.addPoint(0, 0, 0, size)
    curves = []
    if is_round(outline):
        # The points on the axes are exact, so that meshes are the same on every machine.
        reach = radius * float(outline(np.array(0.0)))
        axes = ((1, 0), (0, 1), (-1, 0), (0, -1))
        poles = [geo.addPoint(reach * x, reach * y, 0, size) for x, y in axes]
        for quarter in range(4):
            curves.append(geo.addCircleArc(poles[quarter], centre, poles[(quarter + 1) % 4]))
    else:
        starts = np.arange(4) * np.pi / 2
        poles = [add_point(angle) for angle in starts]
        steps = np.linspace(0, np.pi / 2, _spline_steps(outline) + 1)[1:-1]
        for quarter in range(4):
            inner = [add_point(starts[quarter] + step) for step in steps]
            curves.append(geo.addSpline([poles[quarter], *inner, poles[(quarter + 1) % 4]]))
    loop = geo.addCurveLoop(curves)
    particle = geo.addPlaneSurface([loop])
    matrix = geo.addPlaneSurface([_square_loop(geo, size), loop])
    geo.synchronize()
    gmsh.model.mesh.embed(0, [centre], 2, particle)
    return particle, matrix


def particle_grading(outline: Outline, radius: float) -> Sizes:
    """Return the edge length near a particle and in gaps, over the nominal one, by the point."""
    unit = extents(outline)
    half_width = radius * unit.half_width
    half_height = radius * unit.half_height
    min_distance = radius * unit.min_distance

    def over_nominal(x: float, y: float) -> float:  # Gmsh asks a point at a time: no NumPy
        x, y = abs(x), abs(y)
        by_distance = PER_RADIUS * max(hypot(x, y), min_distance)
        # Width of the gap to the cell's side, which grows along the side as beside a circle.
        gap_beside = 1 - half_width + y * y / (2 * half_width) + max(0.0, half_width - x)
        gap_above = 1 - half_height + x * x / (2 * half_height) + max(0.0, half_height - y)
        return min(1.0, by_distance, 4 * gap_beside, 4 * gap_above)

    return over_nominal


def bend_grading(outline: Outline, radius: float, refinement: float) -> Sizes:
    """Return the edge length by the bends of an outline, over the nominal one, by the point.

    It is proportional to the smallest sum of bend radius and distance over the outline's points, so
    that on a circle it is the same at all of them and grows with the distance.

    Args:
        outline: Outline of the particle.
        radius: Radius of the particle.
        refinement: Divisor of the edge length.
    """
    points, unit_bend_radii = bend_radii(outline)
    px, py = radius * points.T
    radii = radius * unit_bend_radii
    factor = PER_RADIUS / refinement

    def over_nominal(x: float, y: float) -> float:
        return factor * float((radii + np.hypot(px - x, py - y)).min())

    return over_nominal
