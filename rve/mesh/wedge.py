"""Quadratic 15-node serendipity wedge of the product space (section 3.1).

Span: P2(x1, x2) ⊗ {1, ζ} plus ζ² P1(x1, x2). One degree of freedom at every vertex and at every
edge midpoint. Basix has no serendipity element on prisms, so the element is handed to it as a
custom one.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from alphacut.rve.interruption import uninterrupted
from alphacut.stochastic.theta.truncated_normal import Array

with uninterrupted():
    import basix

NODES = 15
PRISM = basix.CellType.prism


def _span(points: Array) -> Array:
    """The 15 spanning functions at `points`, shape (n, 3); returns shape (15, n)."""
    x, y, z = points.T
    linear = [np.ones_like(x), x, y]
    quadratic = [*linear, x * x, x * y, y * y]
    return np.array([*quadratic, *(f * z for f in quadratic), *(f * z * z for f in linear)])


def _coefficients() -> Array:
    """Rows: the span in the orthonormal polynomials of degree 2 on the prism, shape (15, 18)."""
    points, weights = basix.make_quadrature(PRISM, 4)
    orthonormal = basix.tabulate_polynomials(basix.PolynomialType.legendre, PRISM, 2, points)
    return np.ascontiguousarray(np.linalg.qr((_span(points) * weights @ orthonormal.T).T)[0].T)


def _points_by_entity() -> list[list[Array]]:
    """Evaluation points for every vertex, edge, face and the cell, as Basix wants them."""
    vertices, none = basix.geometry(PRISM), np.zeros((0, 3))
    topology = basix.topology(PRISM)
    midpoints = [vertices[edge].mean(axis=0, keepdims=True) for edge in topology[1]]
    return [[v[None, :] for v in vertices], midpoints, [none] * len(topology[2]), [none]]


@cache
def wedge() -> basix.finite_element.FiniteElement:
    """The scalar element."""
    points = _points_by_entity()
    evaluations = [
        [np.eye(len(p)).reshape(len(p), 1, len(p), 1) for p in entity] for entity in points
    ]
    kind = 0, basix.MapType.identity, basix.SobolevSpace.H1, False, 1, 2, basix.PolysetType.standard
    return basix.create_custom_element(PRISM, [], _coefficients(), points, evaluations, *kind)


def slab_rule(*, planar_degree: int = 4, layer_points: int = 3) -> tuple[Array, Array]:
    """Quadrature on the reference prism: a triangle rule times Gauss–Legendre along ζ.

    Returns:
        Points, shape (layer_points · m, 3), ordered by ζ first, and weights of the same length,
        their sum 1/2.
    """
    triangle, planar_weights = basix.make_quadrature(basix.CellType.triangle, planar_degree)
    z, line_weights = basix.make_quadrature(basix.CellType.interval, 2 * layer_points - 1)
    order = np.argsort(z[:, 0])
    points = np.array([[*xy, z[k, 0]] for k in order for xy in triangle])
    return points, np.outer(line_weights[order], planar_weights).ravel()


def tabulate(points: Array, *, derivatives: bool = False) -> Array:
    """Shape functions at `points`, shape (n, 15), or their derivatives, shape (3, n, 15)."""
    table = wedge().tabulate(1 if derivatives else 0, points)
    return np.asarray(table[1:] if derivatives else table[0]).reshape(-1, len(points), NODES)[
        slice(None) if derivatives else 0
    ]
