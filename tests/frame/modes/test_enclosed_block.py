"""Remainders of enclosed blocks and what they rest on are hardly larger than what they bound."""

import numpy as np
import pytest
from scipy.linalg import eigh

from alphacut.frame.calculus.taylor_model import TaylorModel
from alphacut.frame.modes.blocks import (
    CentredMatrices,
    SolutionBounds,
    enclosed_block,
    max_eigenvalue_decrease,
    subspace_series,
)


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
def test_remainders_of_a_mode_are_nearly_attained(degree, rng):
    """Of a mode that the other one approaches, so that all terms beyond the degree add up.

    At degree 0 the other mode's part of the shape is a remainder alone, also in the norm.
    """
    approach, coupling, second = rng.uniform([0.05, 0.02, 2.5], [0.15, 0.05, 3.5])
    change = np.array([[approach, coupling], [coupling, -approach]])
    middle, nothing = np.diag([1.0, second]), np.zeros((2, 2))
    centre = CentredMatrices(
        mass=TaylorModel((np.eye(2)[None],), nothing, inputs=1, order=6),
        stiffness=TaylorModel((middle[None], change[None]), nothing, inputs=1, order=6),
        basis=np.eye(2),
        mode_count=2,
    )
    lowest = np.array([0])
    series = subspace_series(lowest, degree, centre)
    block = enclosed_block(lowest, np.eye(1), series, centre)
    attained = dict.fromkeys(("eigenvalue_block", "shapes", "mass_times_shapes", "modal_mass"), 0.0)
    for u in (-1.0, 1.0):
        squared, shapes = eigh(middle + u * change)
        shape = shapes[:, 0] / shapes[0, 0]
        exact = {
            "eigenvalue_block": squared[:1],
            "shapes": shape,
            "mass_times_shapes": shape,
            "modal_mass": shape @ shape,
        }
        for name in attained:
            model = getattr(block, name)
            off = np.abs(model.at(np.array([[u]]))[0] - exact[name])
            assert (off <= model.remainder + 1e-13).all(), name
            fractions = off / np.maximum(model.remainder, 1e-13)
            attained[name] = max(attained[name], fractions.max())
    assert min(attained.values()) > 0.6, attained


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_eigenvalues_drop_by_all_parts_of_a_model(sign, rng):
    """Of a number a + v u + w u² ± r, over the box |u| ≤ 1, times the square of a scale."""
    slope, bend, remainder, scale = rng.uniform(0.1, 1.0, 4)
    bend = -sign * bend  # a square that lowers sign × the number
    parts = tuple(np.full((1, 1, 1), x) for x in (2.0, slope, bend))
    model = TaylorModel(parts, np.full((1, 1), remainder), inputs=1, order=2)
    drop = max_eigenvalue_decrease(model, np.array([scale]), sign=sign)
    assert drop == pytest.approx(scale**2 * (slope + abs(bend) + remainder), rel=1e-9)


def test_solutions_are_bounded_by_those_of_the_comparison_matrix(rng):
    """All solutions of A y = r, and that of the matrix whose entries all hinder the most."""
    distance, spread = rng.uniform(1.0, 3.0, 3), rng.uniform(0.0, 0.3, (3, 3))
    hindering = np.diag(distance) - spread
    comparison = SolutionBounds(distance, spread, np.linalg.inv(hindering), min_eigenvalue=0.0)
    right = rng.uniform(0.5, 2.0, 3)
    bound = comparison.solution_bounds(right)
    np.testing.assert_allclose(bound, np.linalg.solve(hindering, right), rtol=1e-9)
    signs = rng.choice([-1.0, 1.0], (200, 3, 3))
    for A in np.diag(distance) + signs * spread:
        y = np.linalg.solve(A, right * signs[0, 0])
        assert (np.abs(y) <= bound * (1 + 1e-9)).all()
