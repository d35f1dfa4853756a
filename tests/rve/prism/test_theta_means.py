"""Guaranteed integrals over slices of prisms and over θ."""

import numpy as np
import pytest

pytest.importorskip("alphacut.rve.fenicsx")

from alphacut.rve.mesh.wedge import vertices_and_midpoints
from alphacut.rve.prism.theta_means import (
    InverseDeterminant,
    chebyshev_points,
    determinant_ranges,
    mean_over_theta,
    planar_slopes,
)
from alphacut.stochastic import TruncatedNormal


@pytest.mark.parametrize("ratio", [1 + 1e-8, 1.3, 2.0, 30.0])
def test_the_inverse_is_near_and_its_error_is_reached(ratio, rng):
    low = rng.uniform(0.1, 10)
    inverse = InverseDeterminant.of_ends(np.array([[low], [ratio * low]]), ratio)
    places = low * np.linspace(1, ratio, 2001)[np.newaxis]
    errors = abs(places * inverse(places) - 1)
    assert errors.max() <= inverse.errors[0] + 1e-13
    assert errors.max() >= 0.99 * inverse.errors[0] or inverse.errors[0] < 1e-11
    assert inverse.errors[0] < 1e-6 or ratio == 30


def test_determinants_lie_in_their_ranges(rng):
    nodes = vertices_and_midpoints()[:, :2] + 0.1 * rng.normal(size=(20, 15, 2))
    low, high = np.sort(rng.random(2))
    ends = determinant_ranges(nodes, low, high)
    triangle = rng.dirichlet(np.ones(3), 500)[:, :2]
    corners = [(0, 0), (1, 0), (0, 1), (0.5, 0), (0, 0.5), (0.5, 0.5)]

    def values_at(triangle, heights):
        points = np.column_stack([triangle, np.broadcast_to(heights, len(triangle))])
        first, second = planar_slopes(points)[:, np.newaxis] @ nodes
        return first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0]

    values = values_at(triangle, rng.uniform(low, high, 500))
    assert (ends[0] <= values.min(axis=1)).all()
    assert (values.max(axis=1) <= ends[1]).all()
    # In one slice the ends are those of the coefficients of Bernstein and Bézier.
    x, y = np.transpose(corners)
    z = 1 - x - y
    basis = np.column_stack([z * z, x * x, y * y, 2 * x * z, 2 * y * z, 2 * x * y])
    coefficients = np.linalg.solve(basis, values_at(corners, low).T)
    found = determinant_ranges(nodes, low, low)
    assert found[0] == pytest.approx(coefficients.min(axis=0), abs=1e-7)
    assert found[1] == pytest.approx(coefficients.max(axis=0), abs=1e-7)


def test_means_over_theta_hold_those_by_quadrature(rng):
    law = TruncatedNormal(-2.0, 3.0)
    polynomials = [np.polynomial.Polynomial(rng.normal(size=9)) for _ in range(3)]
    levels = [-2.0, -0.5, 1.0, 3.0]
    total = np.zeros(2)
    largest = 0.0
    for low, high, polynomial in zip(levels[:-1], levels[1:], polynomials, strict=True):
        values = polynomial(low + chebyshev_points(12) * (high - low))
        total += mean_over_theta(law, low, high, values)
        largest = max(largest, abs(values).max())
    exact = 0.0
    for low, high, polynomial in zip(levels[:-1], levels[1:], polynomials, strict=True):
        x, weights = np.polynomial.legendre.leggauss(40)
        theta = low + (x + 1) / 2 * (high - low)
        exact += (high - low) / 2 * weights @ (polynomial(theta) * law.pdf(theta))
    assert abs(total[0] - exact) < total[1]
    assert total[1] < 1e-3 * largest
