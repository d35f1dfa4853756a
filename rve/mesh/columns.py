"""Levels and columns of extruded prisms, found by their vertical edges."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TypeVar, cast

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from alphacut.base.arrays import Array, Ints
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
) -> PrismGrid:
    """Mesh the cell by Gmsh's triangles, opposite sides matching, and extrude them over θ.

    Args:
        size: Wanted edge length, in halves of the cell's side, in (0, 1].
        radius: Radius of the particle in the mesh, in (0, 1), or 0 for a mesh that knows nothing of
            it.
        layers: Along θ, at least 1.
        outline: Of the particle.
        refinement: Of the edges along an outline that is not round; see `bend_grading`.
        parallel: Whether Gmsh runs on the first MPI rank, for all of them.
    """
    has_bends = bool(radius) and not is_round(outline)
    bends = refinement if has_bends else 0.0
    make = partial(square.triangles, size, radius, outline, refinement=bends)
    points, triangles, phase = from_first_rank(make) if parallel else make()
    order = np.lexsort(np.sort(triangles, axis=1).T[::-1])  # neighbours are near in memory
    triangles, phase = triangles[order], phase[order]
    plane = _quadratic(points, triangles, phase, radius, outline)
    # nodes level by level, then mid-level by mid-level
    on_levels = np.arange(layers + 1)[:, None, None] * len(plane.points) + plane.triangles
    first_on_mid_level = (layers + 1) * len(plane.points) + np.arange(layers) * len(points)
    cells = np.empty((layers, len(triangles), 15), np.int64)
    cells[..., BELOW], cells[..., ABOVE] = on_levels[:-1], on_levels[1:]
    cells[..., MID_LEVEL] = first_on_mid_level[:, None, None] + triangles
    names = NAMES if radius else NAMES[:1]
    heights: Array = np.asarray(np.linspace(0, 1, layers + 1), float)
    prism_phase = np.tile(phase, layers)
    return PrismGrid(plane, cells.reshape(-1, 15), heights, prism_phase, names, radius > 0)


def _quadratic(
    points: Array, triangles: Ints, phase: Ints, radius: float, outline: Outline
) -> Triangulation:
    """Triangulation of straight-sided triangles with the middles of their edges."""
    inside = phase == NAMES.index("inclusion")
    ends, edges, on_interface = square.edges(triangles, inside)
    nodes = np.hstack([triangles, len(points) + edges[:, ::-1]])  # edges 01, 02, 12
    arc = np.zeros(len(points) + len(ends), bool)
    arc[ends[on_interface]] = True
    arc[len(points) :] = on_interface
    positions = np.concatenate([points, points[ends].mean(axis=1)])
    return Triangulation(positions, len(points), ends, nodes, inside, arc, radius, outline)


def from_first_rank(make: Callable[[], T]) -> T:
    """Result of `make` on the first MPI rank, sent to all; its exception is raised on all."""
    from alphacut.rve.fenicsx import MPI  # which meshes of one process do without

    result: T | Exception | None = None
    if MPI.COMM_WORLD.rank == 0:
        try:
            result = make()
        except Exception as error:  # the other ranks wait for it
            result = error
    result = MPI.COMM_WORLD.bcast(result)
    if isinstance(result, Exception):
        raise result
    return cast("T", result)


def grid_of(prisms: Prisms) -> PrismGrid:
    """Grid of prisms where they are, their nodes numbered level by level, and the mesh below them.

    Raises:
        MeshError: They do not lie in columns, or a column does not pass all levels.
    """
    thetas, level = _levels(prisms)
    # columns are what the vertical edges connect
    below = prisms.cells[:, BELOW + BELOW[:3]].ravel()
    above = prisms.cells[:, ABOVE + MID_LEVEL].ravel()
    links = np.ones(len(below), np.int8), (below, above)
    graph = sp.coo_matrix(links, (len(prisms.points),) * 2)
    num_columns, column = connected_components(graph, directed=False)
    layer = level[prisms.cells[:, 0]]
    lowest = column[prisms.cells[layer == 0]]
    # planar nodes are the columns, vertices before edge midpoints
    vertices = np.unique(lowest[:, :3])
    midpoints = np.setdiff1d(lowest[:, BELOW], vertices)
    planar_of_column: Ints = np.full(num_columns, -1)
    planar_of_column[vertices] = np.arange(len(vertices))
    planar_of_column[midpoints] = len(vertices) + np.arange(len(midpoints))
    planar = planar_of_column[column]
    number = _number_nodes(prisms, level, planar, len(thetas) - 1, len(vertices))
    below_prisms = np.sort(planar[prisms.cells[:, :3]], axis=1)
    triangle = np.unique(below_prisms, axis=0, return_inverse=True)[1].ravel()
    if (np.bincount(triangle) != len(thetas) - 1).any():
        raise MeshError("layers of prisms differ", "extrude the whole plane")
    order = np.lexsort((triangle, layer))
    cells, fixed = number[prisms.cells[order]], np.empty_like(prisms.points)
    fixed[number] = prisms.points
    triangles = cells[: int(triangle.max()) + 1, BELOW]
    ends: Ints = np.empty((len(midpoints), 2), np.intp)
    for middle, corners in zip((3, 4, 5), ([0, 1], [0, 2], [1, 2]), strict=True):
        ends[triangles[:, middle] - len(vertices)] = triangles[:, corners]
    inside, arc = (np.zeros(count, bool) for count in (len(triangles), num_columns))
    lowest_points = fixed[:num_columns, :2]
    plane = Triangulation(lowest_points, len(vertices), ends, triangles, inside, arc, radius=0.0)
    heights = (thetas - thetas[0]) / (thetas[-1] - thetas[0])
    return PrismGrid(plane, cells, heights, prisms.phase[order], prisms.names, fixed=fixed)


def _levels(prisms: Prisms) -> tuple[Array, Ints]:
    """θ of the k levels, rising, and the level of each node, −1 on mid-levels, shape (n,)."""
    on_levels = np.unique(prisms.cells[:, BELOW + ABOVE])
    theta = prisms.points[:, 2]
    rising = np.sort(theta[on_levels])
    thetas = rising[np.append(True, np.diff(rising) > SAME_PLACE)]
    level: Ints = np.full(len(theta), -1)
    level[on_levels] = np.searchsorted(thetas, theta[on_levels] + SAME_PLACE, side="right") - 1
    below, above = level[prisms.cells[:, BELOW]], level[prisms.cells[:, ABOVE]]
    is_tilted = (below != below[:, :1]).any(axis=1) | (above != below[:, :1] + 1).any(axis=1)
    if is_tilted.any():
        x, y, z = prisms.points[prisms.cells[np.argmax(is_tilted), 0]]
        raise MeshError(
            f"the prism at ({x:.4g}, {y:.4g}, θ = {z:.4g}) does not stand on one level with its top"
            " on the next",
            "extrude the plane along θ, all columns by the same layers",
        )
    return np.asarray(thetas), level


def _number_nodes(prisms: Prisms, level: Ints, planar: Ints, layers: int, vertices: int) -> Ints:
    """New number of each node, (n,): all levels, then the mid-levels, vertices first."""
    per_level = int(planar.max()) + 1
    number = level * per_level + planar
    half = prisms.cells[:, MID_LEVEL]
    below = level[prisms.cells[:, :3]]
    number[half] = (layers + 1) * per_level + below * vertices + planar[half]
    expected = (layers + 1) * per_level + layers * vertices
    if (planar < 0).any() or not np.array_equal(np.sort(number), np.arange(expected)):
        raise MeshError("columns of prisms do not pass all levels", "extrude the whole plane")
    return np.asarray(number)
