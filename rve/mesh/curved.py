"""Two-dimensional cell of Gmsh triangles of any order with a curved interface.

Soundness of curved triangles: det J at their quadrature points beside its mean.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alphacut.base.arrays import Array, Ints, Mask
from alphacut.base.errors import RefusedError
from alphacut.rve.cell.cell import require_mesh_size
from alphacut.rve.cell.outline import CLOSEST, Outline, circle, is_round, require_fit
from alphacut.rve.fenicsx import basix
from alphacut.rve.mesh import square
from alphacut.rve.mesh.square import REFINEMENTS

PARTICLE = 1  # number of its phase; the matrix is 0
COARSEST = 0.7  # mesh size: on coarser ones small particles hide from every order

ORDERS = 2, 3, 4, 5
"""Polynomial degrees for which meshes about particles that are not round are valid."""


@dataclass(frozen=True)
class PlaneMesh:
    """Straight-sided triangles of the cell [−1, 1]², opposite sides matching.

    Args:
        points: Vertices, shape (n, 2).
        triangles: Vertices of each triangle in rising order, shape (m, 3), so that two neighbours
            run along their edge the same way.
        phase: Phase of a triangle: matrix 0, particle 1, shape (m,).
        radius: Radius of the particle.
        outline: Of the particle.
    """

    points: Array
    triangles: Ints
    phase: Ints
    radius: float
    outline: Outline = circle

    @property
    def inside(self) -> Mask:
        """Mask of the triangles in the particle."""
        return np.asarray(self.phase == PARTICLE)


def plane_mesh(radius: float, *, size: float, outline: Outline = circle) -> PlaneMesh:
    """Mesh one cell, finer where the particle is small or nearly touches its images.

    `size` is the edge length far from the interface, in (0, 1]; lengths are in halves of the side.

    Raises:
        RefusedError: Particles nearly touch, so that the mesh between them would have no end; or an
            outline is so sharp that elements fold however short they are.
    """
    require_mesh_size(size)
    require_fit(outline, radius, CLOSEST)
    size = min(size, COARSEST)
    if is_round(outline):
        return _graded_mesh(radius, size, outline, 0.0)
    for refinement in REFINEMENTS:
        mesh = _graded_mesh(radius, size, outline, refinement)
        ratios = (jacobian_ratios(*curved_nodes(mesh, order), order) for order in ORDERS)
        if all((ratio > MIN_JACOBIAN_RATIO).all() for ratio in ratios):
            return mesh
    raise RefusedError(
        "outline",
        "so sharp that curved elements fold",
        f"outlines with det J > {MIN_JACOBIAN_RATIO} of its mean",
        "round its corners, or take an image of it as the cell",
    )


def _graded_mesh(radius: float, size: float, outline: Outline, refinement: float) -> PlaneMesh:
    """Mesh with shorter edges near the particle, the interface's vertices on the outline."""
    points, triangles, phase = square.triangles(
        size, radius, outline, near_particle=True, refinement=refinement
    )
    inside = phase == PARTICLE
    on_interface = np.intersect1d(triangles[inside], triangles[~inside])
    x, y = points[on_interface].T  # Gmsh's splines are near the outline only
    on_outline = radius * outline(np.arctan2(y, x))
    points[on_interface] *= (on_outline / np.hypot(x, y))[:, None]
    return PlaneMesh(points, np.sort(triangles, axis=1), phase, radius, outline)


def curved_nodes(mesh: PlaneMesh, order: int) -> tuple[Array, Ints]:
    """Nodes (n, 2) and cells of Lagrange triangles of `order`, bent onto the outline."""
    element = basix.create_element(
        basix.ElementFamily.P, basix.CellType.triangle, order, basix.LagrangeVariant.gll_warped
    )
    lattice: Array = np.asarray(element.points, float)
    barycentric = np.column_stack([1 - lattice.sum(axis=1), lattice])
    ends, edges, on_interface = square.edges(mesh.triangles, mesh.inside)
    positions = np.einsum("nl,eld->end", barycentric, mesh.points[mesh.triangles])
    for k, (a, b) in enumerate(square.EDGES):
        bent = np.flatnonzero(on_interface[edges[:, k]])
        edge_ends = mesh.triangles[bent][:, [a, b]]
        positions[bent] += _bend_onto_outline(mesh, edge_ends, barycentric[:, [a, b]])
    cells = _lagrange_nodes(mesh.triangles, edges, (len(mesh.points), len(ends)), order)
    points = np.empty((cells.max() + 1, 2))
    points[cells] = positions
    return points, cells


def _lagrange_nodes(triangles: Ints, edges: Ints, counts: tuple[int, int], order: int) -> Ints:
    """Nodes of Lagrange triangles in Basix's order, from vertices and edges, (m, 3) each."""
    # numbered first are vertices, then the nodes inside edges, then inside triangles
    vertices, edge_count = counts
    per_edge, per_triangle = order - 1, (order - 1) * (order - 2) // 2
    on_edges = [vertices + edges[:, [k]] * per_edge + np.arange(per_edge) for k in range(3)]
    first = vertices + edge_count * per_edge + np.arange(len(triangles)) * per_triangle
    return np.hstack([triangles, *on_edges, first[:, None] + np.arange(per_triangle)])


def _bend_onto_outline(mesh: PlaneMesh, ends: Ints, weights: Array) -> Array:
    """Displacements that bend an edge of k triangles, `ends` (k, 2), onto the outline."""
    # inside a triangle they fade with the bubble of the edge, so that the map stays smooth and the
    # elements keep their order; `weights` are the nodes' barycentric coordinates at its ends
    a, b = mesh.points[ends[:, 0]], mesh.points[ends[:, 1]]
    angle_a, angle_b = (np.arctan2(p[:, 1], p[:, 0]) for p in (a, b))
    difference = (angle_b - angle_a + np.pi) % (2 * np.pi) - np.pi  # across ±π too
    along = (1 + weights[:, 1] - weights[:, 0]) / 2  # from 0 at a to 1 at b
    angle = angle_a[:, None] + difference[:, None] * along
    distance = mesh.radius * np.asarray(mesh.outline(angle))
    arc = distance[..., None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    chord = a[:, None] + (b - a)[:, None] * along[:, None]
    bubble = weights.prod(axis=1)
    fade = np.divide(bubble, along * (1 - along), out=np.zeros_like(bubble), where=bubble > 1e-14)
    return np.asarray((arc - chord) * fade[:, None])


MIN_JACOBIAN_RATIO = 0.2
"""Least det J over its mean in an element. Below, shape functions are far from polynomials of x and
neither order nor mesh size tells the error; inverted elements have ratios below 0."""


def quadrature_degree(order: int) -> int:
    """Degree of the quadrature on triangles whose field and geometry are of an order."""
    return 2 * order + 1


def jacobian_ratios(nodes: Array, cells: Ints, order: int) -> Array:
    """Least det J over its mean in each isoparametric triangle of `order`, shape (m,)."""
    element = basix.create_element(
        basix.ElementFamily.P, basix.CellType.triangle, order, basix.LagrangeVariant.gll_warped
    )
    points, weights = basix.make_quadrature(basix.CellType.triangle, quadrature_degree(order))
    d_xi, d_eta = np.asarray(element.tabulate(1, points))[1:, :, :, 0]  # of the shape functions
    x, y = nodes[cells].transpose(2, 1, 0)
    determinants = (d_xi @ x) * (d_eta @ y) - (d_eta @ x) * (d_xi @ y)
    means = weights @ determinants / weights.sum()
    return np.asarray((determinants / means).min(axis=0))
