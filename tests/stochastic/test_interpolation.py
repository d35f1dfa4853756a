"""Curves between nodes: as good as their rule where that is a Gauss rule, without overshoot where
it is not.
"""

import numpy as np
import pytest

from alphacut.stochastic import TruncatedNormal, gauss_rule, layered_rule
from alphacut.stochastic.theta.quadrature import between_nodes

AT = np.linspace(-3, 3, 61)


def wave(theta):
    return 1 / (1 + np.exp(-theta))


@pytest.mark.parametrize(("points", "error"), [(10, 3e-3), (14, 4e-4), (20, 3e-5)])
def test_the_error_falls_with_the_nodes_of_a_gauss_rule(points, error):
    nodes = gauss_rule(TruncatedNormal(), points=points).nodes
    assert np.abs(between_nodes(nodes, wave(nodes), AT) - wave(AT)).max() < error


@pytest.mark.parametrize(
    "nodes",
    [
        layered_rule(TruncatedNormal(), layers=12, points=3).nodes,
        np.linspace(-2.9, 2.9, 25),
        AT[::10],
    ],
)
def test_other_nodes_are_joined_without_overshoot(nodes):
    curve = between_nodes(nodes, np.sign(nodes), AT)
    assert np.abs(curve[(nodes[0] <= AT) & (nodes[-1] >= AT)]).max() <= 1 + 1e-12


def test_a_curve_between_nodes_is_the_same_to_the_last_bit_each_time():
    nodes = gauss_rule(TruncatedNormal(), points=14).nodes
    curves = {between_nodes(nodes, wave(nodes), AT).tobytes() for _ in range(20)}
    assert len(curves) == 1
    assert (between_nodes(nodes, wave(nodes), nodes) == wave(nodes)).all()
