"""Quadratics over boxes of many parameters and the
optimisers it is measured against.
"""

import numpy as np
import pytest

from alphacut.frame import LinearFlow, StoreyFrame, envelope
from alphacut.frame.boxes import UnitFlow, boxes
from alphacut.frame.calculus.box_quadratic import FACES_UP_TO, gain, global_maximum
from alphacut.fuzzy import Triangular
from benchmarks.frame.references.alpha_cut_optimisation import CutOptimisation

FRAME = StoreyFrame((3.0, 2.0), (1.0, 1.2), 5.0, 1.0, q0=(0.1, 0.0), v0=(0.0, 0.4))
INPUTS = {"E": Triangular(4, 5, 6), "m1": Triangular(2.5, 3, 3.5)}
COMMON = {"duration": 4, "step": 0.05, "alpha": (0,), "integrator": "exact"}


def test_separable_quadratics_of_many_parameters_are_solved_along_each_axis():
    rng, d = np.random.default_rng(4), FACES_UP_TO + 3
    g, curvature = rng.standard_normal((50, d)), rng.standard_normal((50, d))
    lower, upper = -np.ones((50, d)), np.ones((50, d))
    found = global_maximum(g, np.einsum("ni,ij->nij", curvature, np.eye(d)), lower, upper)
    grid = np.linspace(-1, 1, 4001)
    best = (g[..., None] * grid + 0.5 * curvature[..., None] * grid**2).max(-1).sum(-1)
    assert gain(g, np.einsum("ni,ij->nij", curvature, np.eye(d)), found) == pytest.approx(
        best, abs=1e-6
    )


def test_coupled_quadratics_of_many_parameters_are_as_good_as_a_dense_sample_of_corners():
    rng, d = np.random.default_rng(5), FACES_UP_TO + 1
    H = rng.standard_normal((20, d, d)) * 0.2
    H, g = H + H.swapaxes(1, 2), rng.standard_normal((20, d))
    found = global_maximum(g, H, -np.ones((20, d)), np.ones((20, d)))
    corners = np.array(np.meshgrid(*[[-1.0, 1.0]] * d)).reshape(d, -1).T
    sampled = gain(g, H, np.broadcast_to(corners, (20, *corners.shape))).max(1)
    assert (gain(g, H, found) > sampled - 1e-9).mean() > 0.8  # a local search: most, not all


@pytest.mark.parametrize("optimiser", ["L-BFGS-B", "differential_evolution"])
def test_optimisers_find_the_bounds_at_a_node(optimiser):
    flow = UnitFlow(LinearFlow(FRAME, ("E", "m1"), 4, 0.05), boxes(INPUTS, (0,)))
    truth = envelope(
        FRAME, INPUTS, **{**COMMON, "integrator": "midpoint"}, method="modal", tolerance=1e-9
    )
    node = 60
    found = tuple(
        CutOptimisation(optimiser).bound(flow, 0, node=node, output=1, side=side)[0]
        for side in (-1, 1)
    )
    assert found == pytest.approx((truth.lower[0, node, 1], truth.upper[0, node, 1]), abs=1e-5)
