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
from typing import Any

import numpy as np

from alphacut.base.arrays import Array, Ints, Mask
from alphacut.base.user_cache import cached_arrays
from alphacut.rve.cell.outline import Outline, bend_radii, extents, is_round
from alphacut.rve.interruption import uninterrupted

Triangles = tuple[Array, Ints, Ints]
Sizes = Callable[[float, float], float]
EDGES = ((1, 2), (0, 2), (0, 1))
"""Edges of a triangle by their vertices, in Basix's order."""
SPLINE_STEPS = 16, 128
"""Fewest and most steps of the spline through a quarter of an outline; four a radian of its turn,
so that the spline keeps lobes apart. Vertices are put on the outline itself afterwards."""


def triangles(
    size: float,
    radius: float,
    outline: Outline,
    *,
    near_particle: bool = False,
    refinement: float = 0.0,
) -> Triangles:
    """Triangles of the cell by Gmsh, from the user's cache where it has meshed the same before.

    Args:
        size: Wanted edge length, in halves of the cell's side.
        radius: Radius of the particle, 0 for none.
        outline: Of the particle.
        near_particle: Whether edges shorten by `particle_grading`.
        refinement: Of `bend_grading`; 0: edges do not shorten at bends.

    Returns:
        Vertices, shape (n, 2), triangles, (m, 3), and their phases, (m,): matrix 0, particle 1.
    """
    gradings = [particle_grading(outline, radius)] if near_particle else []
    gradings += [bend_grading(outline, radius, refinement)] if refinement else []

    def least_size(x: float, y: float) -> float:
        return size * min(1.0, *(grading(x, y) for grading in gradings))

    sizes = least_size if gradings else None
    generate = partial(gmsh_triangles, size, radius, outline, sizes)
    angles: Array = np.asarray(np.linspace(0, 2 * np.pi, 4 * _spline_steps(outline) + 1), float)
    numbers = [size, radius, near_particle, refinement, *extents(outline), *outline(angles)]
    shape = np.concatenate([numbers, *map(np.ravel, bend_radii(outline))])
    try:
        content = f"{version('gmsh')} {Path(__file__).read_text('utf-8')}".encode()
    except PackageNotFoundError:  # a Gmsh that does not say which it is
        return generate()
    points, cells, phases = cached_arrays("meshes", content + shape.tobytes(), generate)
    return np.asarray(points, float), np.asarray(cells, np.int64), np.asarray(phases, np.int64)


def gmsh_triangles(size: float, radius: float, outline: Outline, sizes: Sizes | None) -> Triangles:
    """Mesh the cell by Gmsh; arguments and result as of `triangles`.

    `sizes` is the edge length at (x1, x2) in place of `size`.
    """
    with model() as gmsh:
        phase_surfaces = surfaces(size, radius, outline)
        if sizes:  # alone set the edge lengths
            gmsh.option.setNumber("Mesh.MeshSizeExtendFromBoundary", 0)
            gmsh.option.setNumber("Mesh.MeshSizeFromPoints", 0)
            # of the size along a curve; the default asks for thousands of points
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
    # the centres of arcs are points without triangles
    used, compact = np.unique(np.concatenate(cells), return_inverse=True)
    return xyz.reshape(-1, 3)[used, :2], compact.reshape(-1, 3), np.concatenate(phases)


def surfaces(size: float, radius: float, outline: Outline) -> dict[int, int]:
    """Add the cell's geometry to the current Gmsh model; tags of its surfaces by phase number.

    Matrix 0, particle 1 unless its `radius` is 0; `size` is the edge length of elements.
    """
    import gmsh

    geo = gmsh.model.geo
    if not radius:
        surface = geo.addPlaneSurface([_square_loop(geo, size)])
        geo.synchronize()
        return {0: surface}
    particle, matrix = _particle(geo, size, radius, outline)
    return {1: particle, 0: matrix}


def edges(triangles: Ints, inside: Mask) -> tuple[Ints, Ints, Mask]:
    """Vertices of edges, (k, 2), edges of triangles, (m, 3), and mask of the interface, (k,)."""
    vertex_pairs = np.sort(triangles[:, EDGES].reshape(-1, 2), axis=1)
    ends, number = np.unique(vertex_pairs, axis=0, return_inverse=True)
    number = number.reshape(-1, 3)
    all_edges = np.arange(len(ends))
    is_interface = np.isin(all_edges, number[inside]) & np.isin(all_edges, number[~inside])
    return ends, number, is_interface


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
    """Add the boundary of the square, opposite sides periodic; tag of its curve loop."""
    import gmsh

    corners = [geo.addPoint(x, y, 0, size) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    sides = [geo.addLine(corners[k], corners[(k + 1) % 4]) for k in range(4)]
    geo.synchronize()
    bottom, right, top, left = sides
    for first, second, shift in ((left, right, (2, 0)), (bottom, top, (0, 2))):
        affine = np.eye(4)
        affine[:2, 3] = shift
        gmsh.model.mesh.setPeriodic(1, [second], [first], affine.ravel().tolist())
    return int(geo.addCurveLoop(sides))


def _spline_steps(outline: Outline) -> int:
    """Steps of the spline through a quarter of an outline."""
    points, radii = bend_radii(outline)
    largest_ratio = float((np.hypot(*points.T) / radii).max())
    return int(np.clip(4 * np.ceil(largest_ratio), *SPLINE_STEPS))


def _particle(geo: Any, size: float, radius: float, outline: Outline) -> tuple[int, int]:
    """Add a particle bounded by four curves and the matrix around it; tags of both surfaces."""
    import gmsh

    def add_point(angle: float) -> int:
        distance = radius * float(outline(np.array(angle)))
        return int(geo.addPoint(distance * np.cos(angle), distance * np.sin(angle), 0, size))

    centre, quarters = geo.addPoint(0, 0, 0, size), np.arange(4) * np.pi / 2
    if is_round(outline):
        # points on the axes are exact, so that meshes are the same everywhere
        reach = radius * float(outline(np.array(0.0)))
        axes = ((1, 0), (0, 1), (-1, 0), (0, -1))
        poles = [geo.addPoint(reach * x, reach * y, 0, size) for x, y in axes]
        curves = [geo.addCircleArc(poles[k], centre, poles[(k + 1) % 4]) for k in range(4)]
    else:
        poles = [add_point(angle) for angle in quarters]
        steps = np.linspace(0, np.pi / 2, _spline_steps(outline) + 1)[1:-1]
        inner = [[add_point(angle + step) for step in steps] for angle in quarters]
        curves = [geo.addSpline([poles[k], *inner[k], poles[(k + 1) % 4]]) for k in range(4)]
    loop = geo.addCurveLoop(curves)
    particle = geo.addPlaneSurface([loop])
    matrix = geo.addPlaneSurface([_square_loop(geo, size), loop])
    geo.synchronize()
    gmsh.model.mesh.embed(0, [centre], 2, particle)
    return particle, matrix


_PER_RADIUS = 1.4
"""Edge length on a circle over its radius, for a mesh size of 1: spreads the error evenly over
radii from 0.1 to 0.98."""


REFINEMENTS = (0.5, 0.75, 1.1, 1.7, 2.5, 4.0)
"""Factors of `bend_grading` that are tried one after the other until all elements are valid."""


def particle_grading(outline: Outline, radius: float) -> Sizes:
    """Edge length at (x1, x2) near a particle and in gaps, over the nominal one."""
    half_width, half_height, min_distance = (radius * extent for extent in extents(outline))

    def over_nominal(x: float, y: float) -> float:  # Gmsh asks a point at a time: no NumPy
        x, y = abs(x), abs(y)
        by_distance = _PER_RADIUS * max(hypot(x, y), min_distance)
        # width of the gap to the cell's side, which grows along it as beside a circle
        gap_beside = 1 - half_width + y * y / (2 * half_width) + max(0.0, half_width - x)
        gap_above = 1 - half_height + x * x / (2 * half_height) + max(0.0, half_height - y)
        return min(1.0, by_distance, 4 * gap_beside, 4 * gap_above)

    return over_nominal


def bend_grading(outline: Outline, radius: float, refinement: float) -> Sizes:
    """Edge length at (x1, x2) by the bends of an outline, over the nominal one times `refinement`.

    It is proportional to the least sum of bend radius and distance over the outline's points, so
    that on a circle it is the same at all of them and grows with the distance.
    """
    points, unit_bend_radii = bend_radii(outline)
    px, py = radius * points.T
    radii = radius * unit_bend_radii
    factor = _PER_RADIUS / refinement
    return lambda x, y: factor * float((radii + np.hypot(px - x, py - y)).min())
