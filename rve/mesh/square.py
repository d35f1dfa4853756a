"""Gmsh's triangles of the cell [−1, 1]² around its particle, opposite sides matching."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from alphacut.fuzzy.arrays import Array, Mask, Rows
from alphacut.rve.outline import Outline, bend_radii, is_round

Triangles = tuple[Array, Rows, Rows]
RING_LAYERS = 2
"""Layers of elements across an interphase; with quadratic ones E is off by some (thickness/2)⁴."""
Sizes = Callable[[float, float], float]
EDGES = ((1, 2), (0, 2), (0, 1))
"""Of a triangle by their vertices, in Basix's order."""
SPLINE_STEPS = 16, 128
"""Fewest and most steps of the spline through a quarter of an outline; four a radian of its turn,
so that the spline keeps lobes apart. Vertices are put on the outline itself afterwards."""


def triangles(
    size: float, radius: float, outline: Outline, sizes: Sizes, thickness: float = 0.0
) -> Triangles:
    """Vertices (n, 2), triangles (m, 3) and their phases (m,): matrix 0, particle 1, interphase 2.

    Args:
        size: Edge length, in halves of the cell's side.
        radius: Radius of the particle.
        outline: Of the particle.
        sizes: Edge length at (x1, x2), in place of `size`.
        thickness: Of a ring around it, 0 for none.
    """
    with model() as gmsh:
        parts = surfaces(size, radius, outline, thickness, sizes)
        phases = [phase for phase, tags in parts.items() for _ in tags]
        grade(gmsh, sizes)
        gmsh.model.mesh.generate(2)
        tags, xyz, _ = gmsh.model.mesh.getNodes()
        number = np.zeros(int(tags.max()) + 1, np.int64)
        number[tags] = np.arange(len(tags))
        blocks = [
            number[gmsh.model.mesh.getElementsByType(2, s)[1].astype(np.int64)].reshape(-1, 3)
            for tags in parts.values()
            for s in tags
        ]
    phase = np.repeat(phases, [len(block) for block in blocks])
    # the centres of arcs are points without triangles
    used, numbers = np.unique(np.concatenate(blocks), return_inverse=True)
    return xyz.reshape(-1, 3)[used, :2], numbers.reshape(-1, 3), phase


def surfaces(
    size: float,
    radius: float,
    outline: Outline,
    thickness: float = 0.0,
    sizes: Sizes | None = None,
) -> dict[int, list[int]]:
    """Surfaces in Gmsh of each phase by its number: particle 1, matrix 0, interphase 2.

    Args:
        size: Edge length, in halves of the cell's side.
        radius: Of the particle, 0 for none.
        outline: Of the particle.
        thickness: Of a ring around it, 0 for none.
        sizes: Edge length at (x1, x2), which the arcs of a ring take; `size` if left out.
    """
    import gmsh

    geo = gmsh.model.geo
    if not radius:
        return {0: _square(geo, size)}
    if not thickness:
        particle, matrix = _particle(geo, size, radius, outline)
        return {1: [particle], 0: [matrix]}
    steps = _quarter_steps(radius, radius + thickness, sizes or (lambda x, y: size))
    return _particle_in_ring(geo, size, (radius, radius + thickness), steps)


def edges(triangles: Rows, inside: Mask) -> tuple[Rows, Rows, Mask]:
    """Edges of a mesh: their ends, those of each triangle, and which lie on the interface.

    Returns:
        Shapes (k, 2), (m, 3) in the order of `EDGES`, and (k,).
    """
    pairs = np.sort(triangles[:, EDGES].reshape(-1, 2), axis=1)
    ends, number = np.unique(pairs, axis=0, return_inverse=True)
    number = number.reshape(-1, 3)
    sides = [np.isin(np.arange(len(ends)), number[inside == flag]) for flag in (False, True)]
    return ends, number, sides[0] & sides[1]


@contextmanager
def model() -> Iterator[Any]:
    """Gmsh with an empty model, quiet, on one thread."""
    import gmsh

    gmsh.initialize(["", "-v", "1"], readConfigFiles=False, interruptible=False)
    try:
        gmsh.option.setNumber("General.NumThreads", 1)
        yield gmsh
    finally:
        gmsh.finalize()


def grade(gmsh: Any, sizes: Sizes) -> None:
    """Take edge lengths from a function alone."""
    gmsh.option.setNumber("Mesh.MeshSizeExtendFromBoundary", 0)
    gmsh.option.setNumber("Mesh.MeshSizeFromPoints", 0)
    # of the size along a curve; the default asks for thousands of points
    gmsh.option.setNumber("Mesh.LcIntegrationPrecision", 1e-4)
    gmsh.model.mesh.setSizeCallback(lambda dim, tag, x, y, z, lc: sizes(x, y))


def _sides(geo: Any, size: float) -> int:
    """Curve loop of the square with opposite sides periodic."""
    import gmsh

    corners = [geo.addPoint(x, y, 0, size) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    sides = [geo.addLine(corners[k], corners[(k + 1) % 4]) for k in range(4)]
    geo.synchronize()
    for first, second, shift in ((sides[3], sides[1], (2, 0)), (sides[0], sides[2], (0, 2))):
        affine = np.eye(4)
        affine[:2, 3] = shift
        gmsh.model.mesh.setPeriodic(1, [second], [first], affine.ravel().tolist())
    return int(geo.addCurveLoop(sides))


def _square(geo: Any, size: float) -> list[int]:
    """The cell without a particle: its surface."""
    surface = geo.addPlaneSurface([_sides(geo, size)])
    geo.synchronize()
    return [surface]


def _quarter_steps(inner: float, outer: float, sizes: Sizes) -> int:
    """Elements along a quarter of a ring: the shortest edge that is wanted on its outer circle."""
    angles = np.linspace(0, np.pi / 2, 181)
    least = min(sizes(outer * np.cos(angle), outer * np.sin(angle)) for angle in angles)
    return max(2, int(np.ceil(np.pi / 2 * inner / least)))


def _particle_in_ring(
    geo: Any, size: float, radii: tuple[float, float], steps: int
) -> dict[int, list[int]]:
    """Cell with a round particle in a ring of structured layers: surfaces of each phase."""
    import gmsh

    axes, centre = ((1, 0), (0, 1), (-1, 0), (0, -1)), geo.addPoint(0, 0, 0, size)
    poles = [[geo.addPoint(r * x, r * y, 0, size) for x, y in axes] for r in radii]
    turns = [(k, (k + 1) % 4) for k in range(4)]
    arcs = [[geo.addCircleArc(circle[a], centre, circle[b]) for a, b in turns] for circle in poles]
    spokes = [geo.addLine(*ends) for ends in zip(*poles, strict=True)]
    loops = [geo.addCurveLoop(circle) for circle in arcs]
    particle = geo.addPlaneSurface([loops[0]])
    matrix = geo.addPlaneSurface([_sides(geo, size), loops[1]])
    ring = [
        geo.addPlaneSurface([geo.addCurveLoop([spokes[a], arcs[1][a], -spokes[b], -arcs[0][a]])])
        for a, b in turns
    ]
    for curve in (*arcs[0], *arcs[1]):
        geo.mesh.setTransfiniteCurve(curve, steps + 1)
    for curve in spokes:
        geo.mesh.setTransfiniteCurve(curve, RING_LAYERS + 1)
    for surface in ring:
        geo.mesh.setTransfiniteSurface(surface)
    geo.synchronize()
    gmsh.model.mesh.embed(0, [centre], 2, particle)
    return {1: [particle], 0: [matrix], 2: ring}


def _spline_steps(outline: Outline) -> int:
    """Steps of the spline through a quarter of an outline."""
    points, bends = bend_radii(outline)
    sharpest = float((np.hypot(*points.T) / bends).max())
    return int(np.clip(4 * np.ceil(sharpest), *SPLINE_STEPS))


def _particle(geo: Any, size: float, radius: float, outline: Outline) -> tuple[int, int]:
    """Cell with its particle bounded by four curves: surfaces of particle and matrix."""
    import gmsh

    def point(angle: float) -> int:
        distance = radius * float(outline(np.array(angle)))
        return int(geo.addPoint(distance * np.cos(angle), distance * np.sin(angle), 0, size))

    centre, quarters = geo.addPoint(0, 0, 0, size), np.arange(4) * np.pi / 2
    if is_round(outline):  # exact zeros, so that meshes are the same everywhere
        axes = ((1, 0), (0, 1), (-1, 0), (0, -1))
        r = radius * float(outline(np.array(0.0)))
        poles = [geo.addPoint(r * x, r * y, 0, size) for x, y in axes]
        arcs = [geo.addCircleArc(poles[k], centre, poles[(k + 1) % 4]) for k in range(4)]
    else:
        poles = [point(angle) for angle in quarters]
        turns = np.linspace(0, np.pi / 2, _spline_steps(outline) + 1)[1:-1]
        between = [[point(angle + turn) for turn in turns] for angle in quarters]
        arcs = [geo.addSpline([poles[k], *between[k], poles[(k + 1) % 4]]) for k in range(4)]
    loop = geo.addCurveLoop(arcs)
    particle, matrix = geo.addPlaneSurface([loop]), geo.addPlaneSurface([_sides(geo, size), loop])
    geo.synchronize()
    gmsh.model.mesh.embed(0, [centre], 2, particle)
    return particle, matrix
