"""Levels and columns of extruded prisms, found by their vertical edges."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import TypeVar, cast

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from alphacut.base.arrays import Array, Ints
from alphacut.rve.cell.lattice import SQUARE, Lattice
from alphacut.rve.cell.outline import Outline, circle, is_round
from alphacut.rve.mesh import square
from alphacut.rve.mesh.periodicity import SAME_PLACE, MeshError
from alphacut.rve.mesh.prism_grid import NAMES, PrismGrid, Prisms, Triangulation
from alphacut.rve.mesh.square import REFINEMENTS

T = TypeVar("T")
BELOW, ABOVE = [0, 1, 2, 6, 7, 9], [3, 4, 5, 12, 13, 14]
"""Nodes of a prism's triangles in Basix's order: vertices, then edges 01, 02, 12."""
MID_LEVEL = [8, 10, 11]
"""Middles of its vertical edges, above vertices 0, 1, 2."""


def extrude(
    *,
    size: float,
    radius: float,
    layers: int,
    outline: Outline = circle,
    refinement: float = REFINEMENTS[0],
    parallel: bool = False,
    lattice: Lattice = SQUARE,
) -> PrismGrid:
    """Mesh the cell with triangles by Gmsh, and extrude them to prisms along θ.

    θ is the random number on which the radius of the particle depends; it is the third coordinate
    of the mesh. Opposite sides of the cell get the same nodes.

    Args:
        size: Wanted edge length, in halves of the cell's side, in (0, 1].
        radius: Radius of the particle whose outline the triangles follow, in halves of the cell's
            side, in (0, 1); 0 for a mesh without a particle.
        layers: Number of layers of equal height along θ, at least 1.
        outline: Distance of the particle's edge from its centre over `radius`, as a function of the
            polar angle in radians.
        refinement: Divisor of the edge length where an outline bends sharply; without effect on a
            circle and where `radius` is 0.
        parallel: Whether Gmsh runs on the first MPI rank alone, which sends the triangles to the
            others. All ranks must call.
        lattice: The cell, centred at 0.

    Returns:
        Grid of six-node triangles times layers, with the heights of its levels from 0 to 1. Its
        15-node prisms are numbered layer by layer. Where `radius` is positive, phase 0 is the
        matrix, phase 1 the inclusion, and `conforming` is true: nodes are to follow the interface.
        Else there is the phase "matrix" alone. The arguments are not checked.
    """
    has_bends = bool(radius) and not is_round(outline)
    bends = refinement if has_bends else 0.0
    make = partial(square.triangles, size, radius, outline, refinement=bends, lattice=lattice)
    points, triangles, phase = from_first_rank(make) if parallel else make()
    # Sorted by their vertices, neighbours are near one another in memory. `lexsort` sorts by its
    # last row first, so the rows are the vertices from the largest to the smallest number.
    order = np.lexsort(np.sort(triangles, axis=1).T[::-1])
    triangles = triangles[order]
    phase = phase[order]
    plane = replace(_quadratic(points, triangles, phase, radius, outline), lattice=lattice)

    # The nodes of all levels come first, then those of all mid-levels. A mid-level has nodes at the
    # vertices alone, since a serendipity prism has no node in the middle of a rectangular face.
    num_vertices = len(points)
    num_nodes = len(plane.points)
    on_levels = np.arange(layers + 1)[:, np.newaxis, np.newaxis] * num_nodes + plane.triangles
    first_on_mid_level = (layers + 1) * num_nodes + np.arange(layers) * num_vertices
    # `BELOW` and `ABOVE` are the places of a prism's lower and upper six-node triangle in Basix's
    # order, `MID_LEVEL` those of the middles of its vertical edges.
    cells = np.empty((layers, len(triangles), 15), np.int64)
    cells[..., BELOW] = on_levels[:-1]
    cells[..., ABOVE] = on_levels[1:]
    cells[..., MID_LEVEL] = first_on_mid_level[:, np.newaxis, np.newaxis] + triangles
    return PrismGrid(
        plane,
        cells=cells.reshape(-1, 15),
        heights=np.asarray(np.linspace(0, 1, layers + 1), float),
        phase=np.tile(phase, layers),
        names=NAMES if radius else NAMES[:1],
        conforming=radius > 0,
    )


def _quadratic(
    points: Array, triangles: Ints, phase: Ints, radius: float, outline: Outline
) -> Triangulation:
    """Return six-node triangles: straight ones with the midpoints of their edges as further nodes.

    Args:
        points: Vertices, shape (n, 2).
        triangles: Vertices of each triangle, shape (m, 3).
        phase: Phase of each triangle, shape (m,): matrix 0, particle 1.
        radius: Radius of the particle, 0 for none.
        outline: Distance of the particle's edge over `radius`, as a function of the polar angle.

    Returns:
        Triangulation whose nodes are the n vertices and then one midpoint for each edge. Each row
        of `triangles` has the shape (6,): vertices 0, 1, 2, then the midpoints of the edges 01, 02
        and 12. `arc` marks the nodes on edges between the two phases.
    """
    inside = phase == NAMES.index("inclusion")
    ends, edges, on_interface = square.edges(triangles, inside)
    arc = np.zeros(len(points) + len(ends), bool)
    arc[ends[on_interface]] = True
    arc[len(points) :] = on_interface
    return Triangulation(
        points=np.concatenate([points, points[ends].mean(axis=1)]),
        vertices=len(points),
        ends=ends,
        # `square.edges` gives each triangle's edges as 12, 02, 01; Basix's prism has 01, 02, 12.
        triangles=np.hstack([triangles, len(points) + edges[:, ::-1]]),
        inside=inside,
        arc=arc,
        radius=radius,
        outline=outline,
    )


def from_first_rank(make: Callable[[], T]) -> T:
    """Return on all MPI ranks what `make` returns on the first one, or raise its exception on all.

    All ranks must call; `make` is not called on the others. Its result and its exception are sent
    by pickling.

    Raises:
        Exception: Whatever `make` raised on the first rank.
    """
    from alphacut.rve.fenicsx import MPI  # not above: a single process does without MPI

    result: T | Exception | None = None
    if MPI.COMM_WORLD.rank == 0:
        try:
            result = make()
        except Exception as error:  # which the other ranks wait for
            result = error
    result = MPI.COMM_WORLD.bcast(result)
    if isinstance(result, Exception):
        raise result
    return cast("T", result)


def grid_of(prisms: Prisms) -> PrismGrid:
    """Order prisms into columns and layers, with the plane mesh below them.

    The prisms come from a file: their nodes have any numbers, and columns may be bent. A level is a
    set of nodes with the same θ (the third coordinate), a layer is the prisms between two levels.
    Each prism has 15 nodes in Basix's order: vertices 0-2 below and 3-5 above, and midpoints of
    edges.

    Args:
        prisms: The prisms; the first triangle of each must be the lower one.

    Returns:
        Grid with the nodes numbered level by level (vertices of the plane mesh first, then the
        midpoints of its edges), and after all levels the nodes half-way between two levels. Prisms
        are sorted by layer and then by triangle. `fixed` holds the coordinates of the file in the
        new order, and `heights` the θ of the levels, scaled to 0 … 1. `plane` has the coordinates
        of the lowest level and no particle: radius 0, no triangle inside.

    Raises:
        MeshError: A prism does not stand on one level with its top on the next, a column does not
            pass all levels, or the layers have different numbers of prisms.
    """
    thetas, level = _levels(prisms)
    layers = len(thetas) - 1

    # Nodes that vertical edges connect are one column: the edges of the graph are the vertical
    # edges of the prisms, cut at their middle nodes, and the links between edge midpoints above
    # one another. So columns are found whatever way they bend.
    below = prisms.cells[:, BELOW + BELOW[:3]].ravel()
    above = prisms.cells[:, ABOVE + MID_LEVEL].ravel()
    num_points = len(prisms.points)
    links = sp.coo_matrix((np.ones(len(below), np.int8), (below, above)), (num_points, num_points))
    num_columns, column = connected_components(links, directed=False)

    # Each column is a node of the plane mesh, where vertices stand before midpoints of edges.
    layer = level[prisms.cells[:, 0]]
    lowest = column[prisms.cells[layer == 0]]
    vertices = np.unique(lowest[:, :3])
    midpoints = np.setdiff1d(lowest[:, BELOW], vertices)
    planar_of_column: Ints = np.full(num_columns, -1)
    planar_of_column[vertices] = np.arange(len(vertices))
    planar_of_column[midpoints] = len(vertices) + np.arange(len(midpoints))
    planar = planar_of_column[column]
    number = _number_nodes(prisms, level, planar=planar, layers=layers, vertices=len(vertices))

    # Prisms above one triangle have the same three planar vertices, by which they are matched.
    below_prisms = np.sort(planar[prisms.cells[:, :3]], axis=1)
    triangle = np.unique(below_prisms, axis=0, return_inverse=True)[1].ravel()
    if (np.bincount(triangle) != layers).any():
        raise MeshError("layers of prisms differ", "extrude the whole plane")
    order = np.lexsort((triangle, layer))
    cells = number[prisms.cells[order]]
    fixed = np.empty_like(prisms.points)
    fixed[number] = prisms.points

    triangles = cells[: int(triangle.max()) + 1, BELOW]
    ends: Ints = np.empty((len(midpoints), 2), np.intp)
    for middle, corners in ((3, [0, 1]), (4, [0, 2]), (5, [1, 2])):
        ends[triangles[:, middle] - len(vertices)] = triangles[:, corners]
    plane = Triangulation(
        points=fixed[:num_columns, :2],
        vertices=len(vertices),
        ends=ends,
        triangles=triangles,
        inside=np.zeros(len(triangles), bool),
        arc=np.zeros(num_columns, bool),
        radius=0.0,
    )
    heights = (thetas - thetas[0]) / (thetas[-1] - thetas[0])
    return PrismGrid(plane, cells, heights, prisms.phase[order], prisms.names, fixed=fixed)


def _levels(prisms: Prisms) -> tuple[Array, Ints]:
    """Find the levels of prisms: the values of θ (the third coordinate) at which triangles lie.

    Args:
        prisms: Prisms whose first triangle is the lower one, with the nodes of each in Basix's
            order.

    Returns:
        θ of the levels in rising order, shape (levels,), and the level of each node, shape
        (nodes,): an index of the first array, or −1 for middles of vertical edges, which lie
        between levels. Nodes whose θ differ by less than 1e-8 are on one level.

    Raises:
        MeshError: A prism does not stand on one level with its top on the next.
    """
    on_levels = np.unique(prisms.cells[:, BELOW + ABOVE])
    theta = prisms.points[:, 2]
    rising = np.sort(theta[on_levels])
    thetas = rising[np.append(True, np.diff(rising) > SAME_PLACE)]
    level: Ints = np.full(len(theta), -1)
    level[on_levels] = np.searchsorted(thetas, theta[on_levels] + SAME_PLACE, side="right") - 1
    below = level[prisms.cells[:, BELOW]]
    above = level[prisms.cells[:, ABOVE]]
    lowest = below[:, :1]
    is_tilted = (below != lowest).any(axis=1) | (above != lowest + 1).any(axis=1)
    if is_tilted.any():
        x, y, z = prisms.points[prisms.cells[np.argmax(is_tilted), 0]]
        raise MeshError(
            f"the prism at ({x:.4g}, {y:.4g}, θ = {z:.4g}) does not stand on one level with its top"
            " on the next",
            "extrude the plane along θ, the third coordinate, all columns by the same layers",
        )
    return np.asarray(thetas), level


def _number_nodes(prisms: Prisms, level: Ints, *, planar: Ints, layers: int, vertices: int) -> Ints:
    """Return the new number of each node, shape (nodes,).

    First come the nodes of all levels, level by level, and then the nodes half-way between two
    levels. Within a level the order is that of the plane mesh.

    Args:
        prisms: The prisms. Of the 15 nodes of each, those at `MID_LEVEL` are the middles of the
            vertical edges above its vertices 0, 1, 2.
        level: Level of each node, counted from 0 at the lowest θ; −1 for middles of vertical edges.
        planar: Node of the plane mesh below each node, −1 where its column does not reach level 0.
        layers: Number of layers, one less than the levels.
        vertices: Number of vertices of the plane mesh, which stand before its edge midpoints.

    Raises:
        MeshError: A column does not pass all levels, so the new numbers are not 0, 1, 2, …, each
            once.
    """
    per_level = int(planar.max()) + 1
    number = level * per_level + planar
    on_mid_levels = prisms.cells[:, MID_LEVEL]
    level_below = level[prisms.cells[:, :3]]
    first_on_mid_level = (layers + 1) * per_level + level_below * vertices
    number[on_mid_levels] = first_on_mid_level + planar[on_mid_levels]
    # A column that lacks a level leaves a gap in the numbers, and two nodes of one column on the
    # same level get the same number. So all columns are whole where each number comes once.
    expected = (layers + 1) * per_level + layers * vertices
    if (planar < 0).any() or not np.array_equal(np.sort(number), np.arange(expected)):
        raise MeshError("columns of prisms do not pass all levels", "extrude the whole plane")
    return np.asarray(number)
