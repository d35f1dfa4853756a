"""Soundness of curved triangles: det J at their quadrature points beside its mean."""

from __future__ import annotations

import numpy as np

from alphacut.fuzzy.arrays import Array, Rows
from alphacut.rve.fenicsx import basix

LEAST_RATIO = 0.2
"""Least det J over its mean in an element. Below, shape functions are far from polynomials of x and
neither order nor mesh size tells the error; inverted elements have ratios below 0."""


def quadrature_degree(order: int) -> int:
    """Degree of the quadrature on triangles whose field and geometry are of an order."""
    return 2 * order + 1


def jacobian_ratios(nodes: Array, cells: Rows, order: int) -> Array:
    """Least det J over its mean in each isoparametric triangle, shape (m,).

    Args:
        nodes: Positions, shape (n, 2).
        cells: Nodes of each triangle in Basix's order, shape (m, (order + 1)(order + 2)/2).
        order: Polynomial degree of the geometry.
    """
    element = basix.create_element(
        basix.ElementFamily.P, basix.CellType.triangle, order, basix.LagrangeVariant.gll_warped
    )
    points, weights = basix.make_quadrature(basix.CellType.triangle, quadrature_degree(order))
    d_xi, d_eta = np.asarray(element.tabulate(1, points))[1:, :, :, 0]  # of the shape functions
    x, y = nodes[cells].transpose(2, 1, 0)
    determinants = (d_xi @ x) * (d_eta @ y) - (d_eta @ x) * (d_xi @ y)
    means = weights @ determinants / weights.sum()
    return np.asarray((determinants / means).min(axis=0))
