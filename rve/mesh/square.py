"""Gmsh's triangles of the cell around its particle, opposite sides matching.

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
from alphacut.base.errors import FailedError
from alphacut.base.extras import extra_named
from alphacut.base.user_cache import cached_arrays
from alphacut.rve.cell.lattice import SQUARE, Lattice
from alphacut.rve.cell.outline import ANGLES, Outline, bend_radii, extents, is_round
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
    lattice: Lattice = SQUARE,
) -> Triangles:
    """Mesh a cell around its particle by Gmsh, or take the mesh from the user's cache.

    The centre of the cell is that of the particle. Opposite sides have the same nodes.

    Args:
        size: Wanted edge length, in halves of the cell's side, positive.
        radius: Radius of the particle, in halves of the cell's side; 0 for none.
        outline: Distance of the particle's edge over `radius`, as a function of the polar angle in
            radians; it must fit into the cell.
        near_particle: Whether edges shorten near a small particle and in gaps between it and the
            sides; `radius` must then be positive.
        refinement: Divisor of the edge length at bends of the outline; 0 not to shorten edges
            there.
        lattice: The cell, centred at 0.

    Returns:
        Vertices, shape (n, 2); vertices of each triangle, shape (m, 3); and phase of each triangle,
        shape (m,): matrix 0, particle 1. Vertices of the interface are near the outline, on a
        spline.

    Raises:
        MissingLibraryError: Gmsh is not installed, and the mesh is not in the cache.
        Exception: Whatever Gmsh raises if it cannot mesh the cell.
    """
    gradings: list[Sizes] = []
    if near_particle:
        gradings.append(particle_grading(outline, radius, lattice))
    if refinement:
        gradings.append(bend_grading(outline, radius, refinement))

    def min_size(x: float, y: float) -> float:
        """Return the shortest of `size` and the edge lengths of the gradings at a point."""
        return size * min(1.0, min(grading(x, y) for grading in gradings))

    sizes = min_size if gradings else None
    generate = partial(gmsh_triangles, size, radius, outline, sizes, lattice)

    # The key of the cache stands for all that Gmsh is given: the numbers, the outline at the points
    # of its spline, its bends, this file, and the version of Gmsh. `outline` is a function and
    # cannot be hashed, so its values are.
    angles: Array = np.asarray(np.linspace(0, 2 * np.pi, 4 * _spline_steps(outline) + 1), float)
    numbers = np.array([size, radius, near_particle, refinement, *extents(outline, lattice)])
    points, bends = bend_radii(outline)
    sides = lattice.normals.ravel()
    shape = np.concatenate([numbers, sides, outline(angles), points.ravel(), bends])
    try:
        content = f"{version('gmsh')} {Path(__file__).read_text('utf-8')}".encode()
    except PackageNotFoundError:  # a Gmsh that does not say which it is
        return generate()
    vertices, cells, phase = cached_arrays("meshes", content + shape.tobytes(), generate)
    return Triangles(
        np.asarray(vertices, float), np.asarray(cells, np.int64), np.asarray(phase, np.int64)
    )


def gmsh_triangles(
    size: float,
    radius: float,
    outline: Outline,
    sizes: Sizes | None,
    lattice: Lattice = SQUARE,
) -> Triangles:
    """Mesh a cell around its particle by Gmsh.

    Args:
        size: Wanted edge length, in halves of the cell's side.
        radius: Radius of the particle, in halves of the cell's side; 0 for none.
        outline: Distance of the particle's edge over `radius`, as a function of the polar angle.
        sizes: Edge length in halves of the cell's side as a function of x1 and x2, in place of
            `size`; None for `size` everywhere.
        lattice: The cell, centred at 0.

    Returns:
        Vertices that triangles use, shape (n, 2); vertices of each triangle, shape (m, 3); and
        phase of each triangle, shape (m,): matrix 0, particle 1, particle first.

    Raises:
        Exception: Whatever Gmsh raises if it cannot mesh the cell, such as an outline that
            crosses itself or a side.
    """
    with open_gmsh() as gmsh:
        phase_surfaces = surfaces(size, radius, outline, lattice)
        if sizes is not None:
            # Nothing else sets the edge lengths.
            gmsh.option.setNumber("Mesh.MeshSizeExtendFromBoundary", 0)
            gmsh.option.setNumber("Mesh.MeshSizeFromPoints", 0)
            # Precision of the integral of 1/size along a curve. The default asks for the size at
            # thousands of points.
            gmsh.option.setNumber("Mesh.LcIntegrationPrecision", 1e-4)
            gmsh.model.mesh.setSizeCallback(lambda dim, tag, x, y, z, lc: sizes(x, y))
        gmsh.model.mesh.generate(2)
        # Tags of nodes need not be consecutive, so a table leads from a tag to its row in `xyz`.
        node_tags, xyz, _ = gmsh.model.mesh.getNodes()
        number = np.zeros(int(node_tags.max()) + 1, np.int64)
        number[node_tags] = np.arange(len(node_tags))
        cells, phases = [], []
        for phase, surface in phase_surfaces.items():
            # 2 is Gmsh's number of the type of three-node triangles.
            _, vertex_tags = gmsh.model.mesh.getElementsByType(2, surface)
            cells.append(number[vertex_tags.astype(np.int64)].reshape(-1, 3))
            phases.append(np.full(len(cells[-1]), phase))
    # The centres of arcs are points without triangles.
    used, compact = np.unique(np.concatenate(cells), return_inverse=True)
    points = xyz.reshape(-1, 3)[used, :2]
    return Triangles(points, compact.reshape(-1, 3), np.concatenate(phases))


def surfaces(
    size: float, radius: float, outline: Outline, lattice: Lattice = SQUARE
) -> dict[int, int]:
    """Add a cell and its particle to the current, empty Gmsh model.

    Args:
        size: Edge length of elements, in halves of the cell's side.
        radius: Radius of the particle, in halves of the cell's side; 0 for none.
        outline: Distance of the particle's edge over `radius`, as a function of the polar angle.
        lattice: The cell, centred at 0.

    Returns:
        Gmsh's tags of the surfaces by the number of the phase: particle 1 first, if there is one,
        then matrix 0.
    """
    import gmsh

    geo = gmsh.model.geo
    if not radius:
        surface = geo.addPlaneSurface([_cell_loop(geo, size, lattice)])
        geo.synchronize()
        return {0: surface}
    particle, matrix = _particle(geo, size, radius, outline, lattice)
    return {1: particle, 0: matrix}


def edges(triangles: Ints, inside: Mask) -> Edges:
    """Find the edges of triangles, each once.

    Args:
        triangles: Vertices of each triangle, shape (m, 3).
        inside: Whether a triangle lies in the particle, shape (m,).

    Returns:
        `ends`, both vertices of each edge, the smaller number first, shape (edges, 2);
        `of_triangles`, the edges of each triangle as indices of `ends`, shape (m, 3), in the order:
        opposite vertex 0, opposite vertex 1, opposite vertex 2; and `on_interface`, whether an edge
        has a triangle of the particle and one of the matrix, shape (edges,).
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
def open_gmsh() -> Iterator[Any]:
    """Open Gmsh with an empty model, and close it when the `with` block ends or raises.

    Gmsh prints nothing and uses one thread. Ctrl-C takes effect at the end of the block; a second
    one ends the process at once.

    Yields:
        The module `gmsh`, initialised.

    Raises:
        MissingLibraryError: Gmsh is not installed.
        FailedError: Gmsh is open already: its model would be mixed with the one of the block.
    """
    with extra_named():
        import gmsh

    if gmsh.isInitialized():
        raise FailedError("Gmsh is open in this process already", "call gmsh.finalize() before")
    # Gmsh loses exceptions of functions that it calls, KeyboardInterrupt among them.
    with uninterrupted(second_ends=True):
        gmsh.initialize(["", "-v", "0"], readConfigFiles=False, interruptible=False)
        try:
            gmsh.option.setNumber("General.NumThreads", 1)
            yield gmsh
        finally:
            gmsh.finalize()


def _cell_loop(geo: Any, size: float, lattice: Lattice) -> int:
    """Add the boundary of a cell to the current Gmsh model; return the tag of its curve loop.

    Opposite sides are made periodic, so that Gmsh gives them the same nodes.

    Args:
        geo: Gmsh's built-in kernel of geometry, `gmsh.model.geo`.
        size: Edge length at the corners, in halves of the cell's side.
        lattice: The cell.
    """
    import gmsh

    corners = [geo.addPoint(x, y, 0, size) for x, y in lattice.corners]
    count = len(corners)
    sides = [geo.addLine(corners[side], corners[(side + 1) % count]) for side in range(count)]
    # The model knows curves of the kernel only after it is synchronised.
    geo.synchronize()
    # The last side, of a square the left one, belongs to the first half vector, the first side to
    # the second half vector, and so on.
    for side, half_vector in enumerate(lattice.half_vectors, start=-1):
        # Gmsh takes the map from the first side to the second as a matrix of 4 × 4, row by row.
        affine = np.eye(4)
        affine[:2, 3] = 2 * np.array(half_vector)
        opposite = sides[side + count // 2]
        gmsh.model.mesh.setPeriodic(1, [opposite], [sides[side]], affine.ravel().tolist())
    return int(geo.addCurveLoop(sides))


def _spline_steps(outline: Outline) -> int:
    """Return the number of steps of the spline through each quarter of an outline, a multiple of 4.

    It is 4 ⌈q⌉, at least 16 and at most 128. q is the largest value on the outline of the distance
    from the centre over the bend radius. So there are about four steps for each radian by which the
    outline turns, which keeps lobes apart.

    Args:
        outline: Distance of the edge over the radius, as a function of the polar angle in radians.
    """
    points, radii = bend_radii(outline)
    largest_ratio = float((np.hypot(points[:, 0], points[:, 1]) / radii).max())
    return int(np.clip(4 * np.ceil(largest_ratio), 16, 128))


def _particle(
    geo: Any, size: float, radius: float, outline: Outline, lattice: Lattice
) -> tuple[int, int]:
    """Add a particle bounded by four curves, and the matrix around it, to the current Gmsh model.

    A circle is made of four arcs, any other outline of four splines between the axes.

    Args:
        geo: Gmsh's built-in kernel of geometry, `gmsh.model.geo`.
        size: Edge length of elements, in halves of the cell's side.
        radius: Radius of the particle, in halves of the cell's side, positive.
        outline: Distance of the particle's edge over `radius`, as a function of the polar angle in
            radians.
        lattice: The cell.

    Returns:
        Tags of the surfaces of the particle and of the matrix. The centre becomes a vertex of the
        mesh.
    """
    import gmsh

    def add_point(angle: float) -> int:
        """Add the point of the outline at a polar angle in radians, and return Gmsh's tag of it."""
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
    matrix = geo.addPlaneSurface([_cell_loop(geo, size, lattice), loop])
    geo.synchronize()
    gmsh.model.mesh.embed(0, [centre], 2, particle)
    return particle, matrix


def particle_grading(outline: Outline, radius: float, lattice: Lattice = SQUARE) -> Sizes:
    """Return a function of x1 and x2 that shortens edges near a particle and in gaps.

    The function gives the wanted edge length over the nominal one, in (0, 1]: the smallest of 1,
    1.4 times the distance from the centre (at least that of the nearest point of the outline), and
    four times the width of the gap to the sides of the cell.

    Args:
        outline: Distance of the particle's edge over `radius`, as a function of the polar angle; it
            must fit into the cell.
        radius: Radius of the particle, in halves of the cell's side, positive.
        lattice: The cell, centred at 0.
    """
    min_distance = radius * float(outline(ANGLES).min())
    # Of each pair of sides: the unit normal, the distance of a side from the centre, and how far
    # the particle extends towards it.
    distances = 1 / np.hypot(lattice.normals[:, 0], lattice.normals[:, 1])
    normals = lattice.normals * distances[:, np.newaxis]
    reaches = radius * np.array(extents(outline, lattice)) * distances
    table = np.column_stack([normals, distances, reaches])
    rows = [tuple(map(float, row)) for row in table]

    def over_nominal(x: float, y: float) -> float:
        """Return the edge length at a point over the nominal one, in (0, 1]."""
        # Gmsh asks for a point at a time, where NumPy would be slower.
        smallest = min(1.0, PER_RADIUS * max(hypot(x, y), min_distance))
        for n1, n2, distance, extent in rows:
            # Coordinates across and along the side. Beside a circle of the radius a, which extends
            # to a of the side's distance d, the gap at the height y is d − a + y²/(2 a) to second
            # order, and the last term lets it grow inside the particle.
            across = abs(n1 * x + n2 * y)
            along = abs(n1 * y - n2 * x)
            gap = distance - extent + along * along / (2 * extent) + max(0.0, extent - across)
            smallest = min(smallest, 4 * gap)
        return smallest

    return over_nominal


def bend_grading(outline: Outline, radius: float, refinement: float) -> Sizes:
    """Return a function of x1 and x2 that shortens edges where an outline bends.

    The function gives the wanted edge length over the nominal one, which may exceed 1. It is 1.4 /
    `refinement` times the smallest sum of two lengths over 720 points of the outline: the bend
    radius there, and the distance of (x1, x2) from there. So edges grow with the distance from the
    outline.

    Args:
        outline: Distance of the particle's edge over `radius`, as a function of the polar angle.
        radius: Radius of the particle, in halves of the cell's side, positive.
        refinement: Divisor of the edge length, positive.
    """
    points, unit_bend_radii = bend_radii(outline)
    px, py = radius * points.T
    radii = radius * unit_bend_radii
    factor = PER_RADIUS / refinement

    def over_nominal(x: float, y: float) -> float:
        """Return the edge length at a point over the nominal one."""
        return factor * float((radii + np.hypot(px - x, py - y)).min())

    return over_nominal
