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
from alphacut.rve.cell.lattice import SQUARE, Lattice
from alphacut.rve.cell.outline import Outline, circle, is_round, require_fit
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
    """Straight-sided triangles of the cell, opposite sides matching.

    Args:
        points: Vertices, shape (n, 2).
        triangles: Vertices of each triangle in rising order, shape (m, 3), so that two neighbours
            run along their edge the same way.
        phase: Phase of a triangle: matrix 0, particle 1, shape (m,).
        radius: Radius of the particle.
        outline: Outline of the particle.
        lattice: The cell.
    """

    points: Array
    triangles: Ints
    phase: Ints
    radius: float
    outline: Outline = circle
    lattice: Lattice = SQUARE

    @property
    def inside(self) -> Mask:
        """Whether each triangle lies in the particle, shape (m,)."""
        return np.asarray(self.phase == PARTICLE)


def plane_mesh(
    radius: float, *, size: float, outline: Outline = circle, lattice: Lattice = SQUARE
) -> PlaneMesh:
    """Mesh the cell around a centred particle with triangles by Gmsh.

    Edges are shorter where the particle is small, where it nearly touches its periodic images, and
    where its outline bends. Opposite sides have the same nodes.

    Args:
        radius: Radius of the particle, in halves of the cell's side.
        size: Edge length far from the interface, in halves of the cell's side, in (0, 1]; above 0.7
            it is taken as 0.7.
        outline: Distance of the particle's edge from its centre over `radius`, as a function of the
            polar angle in radians.
        lattice: The cell, centred at 0.

    Returns:
        Straight-sided triangles with the vertices of the interface on the outline. For an outline
        that is no circle, edges at its bends are shortened step by step until no curved triangle of
        the orders 2 to 5 is nearly folded: its smallest determinant of the Jacobian J exceeds 0.2
        of the mean.

    Raises:
        RefusedError: `size` is outside (0, 1]; the outline is not positive or not periodic;
            `radius` is not positive or the particle reaches 0.9995 of the way to a side, where the
            gap to its images would need too many elements; or the outline is so sharp that
            triangles fold at the shortest edges that are tried.
        MissingLibraryError: Gmsh is not installed, and the mesh is not in the user's cache.
    """
    require_mesh_size(size)
    # Beyond 0.9995 of half the side the gap to the images would need too many elements.
    require_fit(outline, radius, limit=0.9995, lattice=lattice)
    # On coarser meshes no order of elements resolves a small particle, and errors that are
    # estimated by comparing orders come out too small.
    size = min(size, 0.7)
    if is_round(outline):
        return _graded_mesh(radius, size, outline, lattice, refinement=0.0)
    for refinement in REFINEMENTS:
        mesh = _graded_mesh(radius, size, outline, lattice, refinement=refinement)
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


def _graded_mesh(
    radius: float, size: float, outline: Outline, lattice: Lattice, *, refinement: float
) -> PlaneMesh:
    """Mesh the cell with shorter edges near the particle, by Gmsh.

    Args:
        radius: Radius of the particle, in halves of the cell's side, positive.
        size: Edge length far from the particle, in halves of the cell's side.
        outline: Distance of the particle's edge over `radius`, as a function of the polar angle.
        lattice: The cell.
        refinement: Divisor of the edge length at bends of the outline; 0 to leave bends alone.

    Returns:
        Triangles whose vertices between matrix (phase 0) and particle (phase 1) lie on the outline.
    """
    points, triangles, phase = square.triangles(
        size, radius, outline, near_particle=True, refinement=refinement, lattice=lattice
    )
    inside = phase == PARTICLE
    on_interface = np.intersect1d(triangles[inside], triangles[~inside])
    # Gmsh puts vertices of the interface on a spline, which is only near the outline. Each is moved
    # along its ray from the centre.
    x, y = points[on_interface].T
    distance = radius * outline(np.arctan2(y, x))
    points[on_interface] *= (distance / np.hypot(x, y))[:, np.newaxis]
    return PlaneMesh(points, np.sort(triangles, axis=1), phase, radius, outline, lattice)


def _lagrange_triangle(order: int) -> Any:
    """Return Basix's Lagrange triangle of an order, with warped nodes."""
    variant = basix.LagrangeVariant.gll_warped
    return basix.create_element(basix.ElementFamily.P, basix.CellType.triangle, order, variant)


def curved_nodes(mesh: PlaneMesh, order: int) -> tuple[Array, Ints]:
    """Return the nodes of Lagrange triangles; those at the particle are bent onto its outline.

    Args:
        mesh: Straight-sided triangles with the vertices of the interface on the outline.
        order: Polynomial degree of the elements, at least 1.

    Returns:
        Positions of the nodes, shape (n, 2): vertices of the mesh first, then nodes inside edges,
        then nodes inside triangles. And the nodes of each triangle, shape (m, nodes of a triangle),
        as indices of the positions: its three vertices, the nodes of its edges 12, 02 and 01, and
        those inside it, which is the order of the library Basix.
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
    # Triangles that share an edge agree on its nodes, so either of them may write the position.
    points = np.empty((cells.max() + 1, 2))
    points[cells] = positions
    return points, cells


def _lagrange_nodes(mesh: PlaneMesh, edges: Ints, *, order: int, num_edges: int) -> Ints:
    """Number the nodes of Lagrange triangles, shape (m, nodes of a triangle).

    The vertices of the mesh come first, then the order − 1 nodes inside each edge, and then the
    nodes inside each triangle. A row holds the nodes of a triangle in the order of the library
    Basix: three vertices, nodes of the edges 12, 02 and 01, nodes inside.

    Args:
        mesh: Straight-sided triangles, m of them, each with its vertices in rising order.
        edges: Numbers of the edges 12, 02 and 01 of each triangle, shape (m, 3).
        order: Polynomial degree of the elements, at least 1.
        num_edges: Number of edges of the mesh.
    """
    num_vertices = len(mesh.points)
    per_edge = order - 1
    per_triangle = (order - 1) * (order - 2) // 2
    # The vertices of a triangle have rising numbers, so both triangles at an edge run along it in
    # the same direction and have its nodes in the same order.
    on_edges = num_vertices + edges[:, :, np.newaxis] * per_edge + np.arange(per_edge)
    first_inside = num_vertices + num_edges * per_edge
    first_of_triangle = first_inside + np.arange(len(mesh.triangles)) * per_triangle
    inside = first_of_triangle[:, np.newaxis] + np.arange(per_triangle)
    return np.hstack([mesh.triangles, on_edges.reshape(len(mesh.triangles), -1), inside])


def _bend_onto_outline(mesh: PlaneMesh, ends: Ints, weights: Array) -> Array:
    """Return displacements of the nodes of k triangles that bend one edge of each onto the outline.

    A node at the parameter s of the edge (0 at the first end, 1 at the second) moves by the
    distance from the chord x(s) to the outline at the angle (1 − s) φ₀ + s φ₁, where φ₀, φ₁ are the
    polar angles of the ends. Inside the triangle this displacement is multiplied by λ₀ λ₁ / (s (1 −
    s)) with the barycentric coordinates λ₀, λ₁ of the ends and s = (1 + λ₁ − λ₀) / 2. The factor is
    1 on the edge and 0 on both other edges, so neighbours stay joined.

    Args:
        mesh: The mesh, with `radius` and `outline` of the particle.
        ends: Vertices at both ends of the edge of each triangle, shape (k, 2), on the outline.
        weights: Barycentric coordinates λ₀, λ₁ of the reference nodes, shape (nodes, 2).

    Returns:
        Displacements, shape (k, nodes, 2), in halves of the cell's side.
    """
    first = mesh.points[ends[:, 0]]
    second = mesh.points[ends[:, 1]]
    first_angle = np.arctan2(first[:, 1], first[:, 0])
    second_angle = np.arctan2(second[:, 1], second[:, 0])
    # The edge is the shorter way round, also where it crosses the angle ±π.
    difference = (second_angle - first_angle + np.pi) % (2 * np.pi) - np.pi
    along = (1 + weights[:, 1] - weights[:, 0]) / 2  # from 0 at the first end to 1 at the second
    angle = first_angle[:, np.newaxis] + difference[:, np.newaxis] * along
    distance = mesh.radius * np.asarray(mesh.outline(angle))
    arc = distance[..., np.newaxis] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    chord = first[:, np.newaxis] + (second - first)[:, np.newaxis] * along[:, np.newaxis]
    # The product λ₀ λ₁ is zero at the ends and on both other edges, where 0/0 must give 0.
    bubble = weights.prod(axis=1)
    on_edge = along * (1 - along)
    fade = np.divide(bubble, on_edge, out=np.zeros_like(bubble), where=bubble > 1e-14)
    return np.asarray((arc - chord) * fade[:, np.newaxis])


def quadrature_degree(order: int) -> int:
    """Degree of the quadrature on triangles whose field and geometry are of an order."""
    return 2 * order + 1


def jacobian_ratios(nodes: Array, cells: Ints, order: int) -> Array:
    """Return the smallest det J over its mean in each curved triangle, shape (m,).

    J is the Jacobian matrix of the isoparametric map from the reference triangle. The minimum is
    taken over the quadrature points of degree 2 · order + 1, the mean over the reference triangle.
    A ratio of 1 means straight sides; below 0 the triangle is folded.

    Args:
        nodes: Positions of all nodes, shape (n, 2).
        cells: Nodes of each triangle in Basix's order (vertices, nodes on the edges 12, 02, 01,
            nodes inside), shape (m, nodes of a triangle).
        order: Polynomial degree of the triangles.
    """
    points, weights = basix.make_quadrature(basix.CellType.triangle, quadrature_degree(order))
    shape_functions = _lagrange_triangle(order).tabulate(1, points)
    # Basix gives values, ∂/∂X and ∂/∂Y along the first axis; then points, nodes, one component.
    _, by_first, by_second = np.asarray(shape_functions)[:, :, :, 0]
    x, y = nodes[cells].transpose(2, 1, 0)
    determinants = (by_first @ x) * (by_second @ y) - (by_second @ x) * (by_first @ y)
    means = weights @ determinants / weights.sum()
    return np.asarray((determinants / means).min(axis=0))
