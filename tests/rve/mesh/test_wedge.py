"""The serendipity wedge: nodes, span and quadrature."""

import numpy as np
import pytest

wedge = pytest.importorskip("alphacut.rve.mesh.wedge")


def shapes(points):
    return wedge.wedge(1).tabulate(0, points)[0].reshape(len(points), 15)


def test_shape_functions_are_one_at_their_node_and_zero_at_the_others():
    assert abs(shapes(wedge.vertices_and_midpoints()) - np.eye(15)).max() < 1e-13


@pytest.mark.parametrize(
    ("power", "inside"),
    [
        ((2, 0, 1), True),
        ((1, 1, 1), True),
        ((1, 0, 2), True),
        ((2, 0, 2), False),
        ((0, 0, 3), False),
    ],
)
def test_span_is_quadratic_in_the_plane_times_linear_and_linear_times_quadratic(power, inside):
    points = np.random.default_rng(3).dirichlet(np.ones(4), 20)[:, :3]
    values = (wedge.vertices_and_midpoints() ** power).prod(axis=1)
    error = abs(shapes(points) @ values - (points**power).prod(axis=1)).max()
    assert (error < 1e-12) == inside


def test_prism_rule_is_exact_to_its_degrees():
    points, weights = wedge.prism_rule()
    moment = weights @ (points[:, 0] ** 2 * points[:, 1] ** 2 * points[:, 2] ** 5)
    # ∫x²y² over the triangle is 2!2!/6!, ∫ζ⁵ is 1/6
    assert moment == pytest.approx(2 * 2 / 720 / 6, rel=1e-12)
    assert (np.diff(points[:, 2]) >= 0).all()
