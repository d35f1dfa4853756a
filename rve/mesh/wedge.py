"""Quadratic 15-node serendipity wedge of the product space (section 3.1, eq. 3).

Span: P2(x1, x2) ⊗ {1, ζ} plus ζ² P1(x1, x2). One degree of freedom at every vertex and at every
edge midpoint. Basix has no serendipity element on prisms, so the element is handed to it as a
custom one.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from alphacut.base.arrays import Array
from alphacut.rve.fenicsx import basix

SLICES_PER_LAYER = 3  # Gauss points along θ
POINTS_PER_SLICE = 6  # quadrature points of each slice of a wedge
PRISM = basix.CellType.prism


def _span(points: Array) -> Array:
    """Return the 15 functions that span the serendipity space of a prism, at points, shape (15, n).

    They are 1, x, y, x², x y, y², each of them times z, and z², x z², y z². So the space is
    quadratic in the plane and contains z² times linear functions.

    Args:
        points: Points (x, y, z) of the reference prism, shape (n, 3).
    """
    x, y, z = points.T
    linear = [np.ones_like(x), x, y]
    quadratic = [*linear, x * x, x * y, y * y]
    times_z = [function * z for function in quadratic]
    times_z_squared = [function * z * z for function in linear]
    return np.array(quadratic + times_z + times_z_squared)


def _points_by_entity() -> list[list[Array]]:
    """Return the points at which degrees of freedom evaluate a function, in the layout of Basix.

    Returns:
        Four lists, for the vertices, edges, faces and the interior of the reference prism, with one
        array of shape (points, 3) for each entity. A vertex has itself, an edge its midpoint; faces
        and the interior have no points, arrays of shape (0, 3).
    """
    vertices = basix.geometry(PRISM)
    topology = basix.topology(PRISM)
    none = np.zeros((0, 3))
    corners = [vertex[np.newaxis, :] for vertex in vertices]
    midpoints = [vertices[edge].mean(axis=0, keepdims=True) for edge in topology[1]]
    return [corners, midpoints, [none] * len(topology[2]), [none]]


@cache
def wedge(components: int) -> Any:
    """Return the UFL element of the 15-node serendipity prism, made once for each argument.

    Basix has no serendipity element on prisms, so it is given as a custom element: the span of the
    functions {1, x, y, x², x y, y²} ⊗ {1, z} and z² {1, x, y}, with the values at the six vertices
    and the nine edge midpoints as degrees of freedom, in this order.

    Args:
        components: Number of values at each node, at least 1; the element is blocked.
    """
    # Basix wants the span as rows of coefficients in its orthonormal polynomials of degree 2 on the
    # prism, shape (15, 18). A coefficient is the integral of a function of the span times a
    # polynomial; the rule of degree 4 is exact for it. QR makes the rows orthonormal, which keeps
    # Basix's inversion well conditioned.
    at, weights = basix.make_quadrature(PRISM, 4)
    orthonormal = basix.tabulate_polynomials(basix.PolynomialType.legendre, PRISM, 2, at)
    coefficients = np.linalg.qr((_span(at) * weights @ orthonormal.T).T)[0].T
    points = _points_by_entity()
    # Degrees of freedom are point values: one evaluation with weight 1 each.
    evaluations = [
        [np.eye(len(p)).reshape(len(p), 1, len(p), 1) for p in entity] for entity in points
    ]
    scalar = basix.ufl.custom_element(
        cell_type=PRISM,
        reference_value_shape=[],
        wcoeffs=np.ascontiguousarray(coefficients),
        x=points,
        M=evaluations,
        interpolation_nderivs=0,
        map_type=basix.MapType.identity,
        sobolev_space=basix.SobolevSpace.H1,
        discontinuous=False,
        embedded_subdegree=1,
        embedded_superdegree=2,
        polyset_type=basix.PolysetType.standard,
    )
    return basix.ufl.blocked_element(scalar, shape=(components,))


@cache
def prism_rule() -> tuple[Array, Array]:
    """Return the quadrature of the reference prism: six points in the triangle times three along z.

    The rule is exact for polynomials of degree 4 in the triangle and of degree 5 along z.

    Returns:
        Points (x, y, z), shape (18, 3), six at the lowest z first, then six at the middle one, then
        six at the highest; and weights, shape (18,), whose sum is the volume 1/2.
    """
    triangle, planar_weights = basix.make_quadrature(basix.CellType.triangle, 4)
    z, line_weights = basix.make_quadrature(basix.CellType.interval, 5)
    order = np.argsort(z[:, 0])
    heights = np.repeat(z[order, 0], len(triangle))
    points = np.column_stack([np.tile(triangle, (len(order), 1)), heights])
    return points, np.outer(line_weights[order], planar_weights).ravel()


def slice_weights() -> Array:
    """Return the weights of the points of each slice of the reference prism, shape (3, 6).

    Their sum over a slice is the area 1/2.
    """
    weights = prism_rule()[1].reshape(SLICES_PER_LAYER, -1)
    return np.asarray(weights / (2 * weights.sum(axis=1, keepdims=True)))


def vertices_and_midpoints() -> Array:
    """Return the 15 nodes of the reference prism, shape (15, 3)."""
    vertices, midpoints, _, _ = _points_by_entity()  # faces and the interior have none
    return np.concatenate(vertices + midpoints)
