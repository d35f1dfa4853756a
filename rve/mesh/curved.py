"""Two-dimensional cell of Gmsh triangles of any order with a curved interface.

Soundness of curved triangles: det J at their quadrature points beside its mean.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from alphacut.base.arrays import Array, Ints, Mask
from alphacut.base.errors import RefusedError
from alphacut.rve.cell.cell import require_mesh_size
from alphacut.rve.cell.outline import CLOSEST, Outline, circle, is_round, require_fit
from alphacut.rve.fenicsx import basix
from alphacut.rve.mesh import square
from alphacut.rve.mesh.square import REFINEMENTS

PARTICLE = 1
"""Number of the phase of the particle; the matrix is 0."""
MIN_JACOBIAN_RATIO = 0.2
"""Smallest det J over its mean in a valid element. Below, shape functions are far from polynomials
of x and neither order nor mesh size tells the error; inverted elements have ratios below 0. Tuned:
a larger one takes more elements at the bends of an outline."""


@dataclass(frozen=True)
class PlaneMesh:
    """Straight-sided triangles of the cell [−1, 1]², opposite sides matching.

    Args:
        points: Vertices, shape (n, 2).
        triangles: Vertices of each triangle in rising order, shape (m, 3), so that two neighbours
            run along their edge the same way.
        phase: Phase of a triangle: matrix 0, particle 1, shape (m,).
        radius: Radius of the particle.
        outline: Outline of the particle.
    """

    points: Array
    triangles: Ints
    phase: Ints
    radius: float
    outline: Outline = circle

    @property
    def inside(self) -> Mask:
        """Whether each triangle lies in the particle, shape (m,)."""
        return np.asarray(self.phase == PARTICLE)


def plane_mesh(radius: float, *, size: float, outline: Outline = circle) -> PlaneMesh:
    """Mesh one cell, finer where the particle is small or nearly touches its images.

    Args:
        radius: Radius of the particle, in halves of the cell's side.
        size: Edge length far from the interface, in halves of the cell's side, in (0, 1].
        outline: Outline of the particle.

    Raises:
        RefusedError: Particles nearly touch, so that the mesh between them would have no end; or an
            outline is so sharp that elements fold however short they are.
    """
    require_mesh_size(size)
    require_fit(outline, radius, CLOSEST)
    size = min(size, 0.7)  # on coarser meshes small particles hide from every order
    if is_round(outline):
        return _graded_mesh(radius, size, outline, refinement=0.0)
    for refinement in REFINEMENTS:
        mesh = _graded_mesh(radius, size, outline, refinement=refinement)
        if all(_is_valid(mesh, order) for order in (2, 3, 4, 5)):
            return mesh
    raise RefusedError(
        "outline",
        "so sharp that curved elements fold",
        f"outlines with det J > {MIN_JACOBIAN_RATIO} of its mean",
        "round its corners, or take an image of it as the cell",
    )


def _is_valid(mesh: PlaneMesh, order: int) -> bool:
    """Whether no triangle of a polynomial degree, bent onto the outline, is nearly folded."""
    nodes, cells = curved_nodes(mesh, order)
    return bool((jacobian_ratios(nodes, cells, order) > MIN_JACOBIAN_RATIO).all())


def _graded_mesh(radius: float, size: float, outline: Outline, *, refinement: float) -> PlaneMesh:
    """Mesh with shorter edges near the particle, the interface's vertices on the outline."""
    points, triangles, phase = square.triangles(
        size, radius, outline, near_particle=True, refinement=refinement
    )
    inside = phase == PARTICLE
    on_interface = np.intersect1d(triangles[inside], triangles[~inside])
    # Gmsh puts them on a spline, which is only near the outline.
    x, y = points[on_interface].T
    distance = radius * outline(np.arctan2(y, x))
    points[on_interface] *= (distance / np.hypot(x, y))[:, np.newaxis]
    return PlaneMesh(points, np.sort(triangles, axis=1), phase, radius, outline)


def _lagrange_triangle(order: int) -> Any:
    """Return Basix's Lagrange triangle of an order, with warped nodes."""
    variant = basix.LagrangeVariant.gll_warped
    return basix.create_element(basix.ElementFamily.P, basix.CellType.triangle, order, variant)


def curved_nodes(mesh: PlaneMesh, order: int) -> tuple[Array, Ints]:
    """Return the nodes of Lagrange triangles that are bent onto the outline.

    Args:
        mesh: Straight-sided triangles.
        order: Polynomial degree of the elements.

    Returns:
        Positions of the nodes, shape (n, 2), and the nodes of each triangle in Basix's order, shape
        (m, nodes of a triangle).
    """
    lattice: Array = np.asarray(_lagrange_triangle(order).points, float)
    barycentric = np.column_stack([1 - lattice.sum(axis=1), lattice])
    ends, edges, on_interface = square.edges(mesh.triangles, mesh.inside)
    positions = np.einsum("nl,eld->end", barycentric, mesh.points[mesh.triangles])
    for number, vertices in enumerate(square.EDGES):
        bent = np.flatnonzero(on_interface[edges[:, number]])
        edge_ends = mesh.triangles[bent][:, vertices]
        positions[bent] += _bend_onto_outline(mesh, edge_ends, barycentric[:, vertices])
    cells = _lagrange_nodes(mesh, edges, order=order, num_edges=len(ends))
    points = np.empty((cells.max() + 1, 2))
    points[cells] = positions
    return points, cells


def _lagrange_nodes(mesh: PlaneMesh, edges: Ints, *, order: int, num_edges: int) -> Ints:
    """Return the nodes of Lagrange triangles in Basix's order, shape (m, nodes of a triangle).

    Numbered are first the vertices, then the nodes inside edges, and then those inside triangles.

    Args:
        mesh: Straight-sided triangles.
        edges: Numbers of the edges of each triangle, shape (m, 3).
        order: Polynomial degree of the elements.
        num_edges: Number of edges of the mesh.
    """
    num_vertices = len(mesh.points)
    per_edge = order - 1
    per_triangle = (order - 1) * (order - 2) // 2
    on_edges = num_vertices + edges[:, :, np.newaxis] * per_edge + np.arange(per_edge)
    first_inside = num_vertices + num_edges * per_edge
    first_of_triangle = first_inside + np.arange(len(mesh.triangles)) * per_triangle
    inside = first_of_triangle[:, np.newaxis] + np.arange(per_triangle)
    return np.hstack([mesh.triangles, on_edges.reshape(len(mesh.triangles), -1), inside])


def _bend_onto_outline(mesh: PlaneMesh, ends: Ints, weights: Array) -> Array:
    """Return displacements of the nodes of k triangles that bend one edge of each onto the outline.

    On the edge they take the chord to the outline. Inside the triangle they fade with the bubble of
    the edge, so that the map stays smooth and the elements keep their order.

    Args:
        mesh: The mesh.
        ends: Vertices at both ends of the edge of each triangle, shape (k, 2).
        weights: Barycentric coordinates of the nodes at these ends, shape (nodes, 2).

    Returns:
        Displacements, shape (k, nodes, 2).
    """
    first = mesh.points[ends[:, 0]]
    second = mesh.points[ends[:, 1]]
    first_angle = np.arctan2(first[:, 1], first[:, 0])
    second_angle = np.arctan2(second[:, 1], second[:, 0])
    difference = (second_angle - first_angle + np.pi) % (2 * np.pi) - np.pi  # across ±π too
    along = (1 + weights[:, 1] - weights[:, 0]) / 2  # from 0 at the first end to 1 at the second
    angle = first_angle[:, np.newaxis] + difference[:, np.newaxis] * along
    distance = mesh.radius * np.asarray(mesh.outline(angle))
    arc = distance[..., np.newaxis] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    chord = first[:, np.newaxis] + (second - first)[:, np.newaxis] * along[:, np.newaxis]
    # The bubble over its value on the edge is 1 there and 0 on both other edges.
    bubble = weights.prod(axis=1)
    on_edge = along * (1 - along)
    fade = np.divide(bubble, on_edge, out=np.zeros_like(bubble), where=bubble > 1e-14)
    return np.asarray((arc - chord) * fade[:, np.newaxis])


def quadrature_degree(order: int) -> int:
    """Degree of the quadrature on triangles whose field and geometry are of an order."""
    return 2 * order + 1


def jacobian_ratios(nodes: Array, cells: Ints, order: int) -> Array:
    """Return the smallest det J over its mean in each isoparametric triangle, shape (m,).

    Args:
        nodes: Positions of all nodes, shape (n, 2).
        cells: Nodes of each triangle in Basix's order, shape (m, nodes of a triangle).
        order: Polynomial degree of the triangles.
    """
    points, weights = basix.make_quadrature(basix.CellType.triangle, quadrature_degree(order))
    shape_functions = _lagrange_triangle(order).tabulate(1, points)
    _, by_first, by_second = np.asarray(shape_functions)[:, :, :, 0]  # derivatives
    x, y = nodes[cells].transpose(2, 1, 0)
    determinants = (by_first @ x) * (by_second @ y) - (by_second @ x) * (by_first @ y)
    means = weights @ determinants / weights.sum()
    return np.asarray((determinants / means).min(axis=0))
