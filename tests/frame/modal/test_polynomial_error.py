"""Polynomials are judged wherever bounds come from: optima of every kind, corners, fresh points."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from alphacut.frame import Exact, LinearFlow, StoreyFrame
from alphacut.frame.boxes import boxes
from alphacut.frame.modal.fitting import fit_modes
from alphacut.frame.modal.polynomial_error import FRESH, judged_at_optima, judging_points
from alphacut.fuzzy import Interval
from benchmarks.frame.calibration import judged, random_case

FRAME = StoreyFrame((2e4, 1e4), (3.0, 3.0), 25e9, 1e-6, (100.0, 300.0), q0=(0.0, 0.01))


def test_judging_points_hold_every_optimum_and_corner() -> None:
    at = np.random.default_rng(3).uniform(-1, 1, (2, 40, 3, 2, 3))
    points = judging_points(at, 100, np.random.default_rng(1))
    apart = np.abs(points[:, None] - at.reshape(1, -1, 3)).max(-1).min(0)
    assert apart.max() <= 0.005 + 1e-12
    corners = np.array(list(product((-1.0, 1.0), repeat=3)))
    assert all((points == corner).all(1).any() for corner in corners)
    few = judging_points(at, 10**9, np.random.default_rng(1))
    assert len(few) == 2 * FRESH + 8  # a long motion has fewer of them, but not none
    many = judging_points(np.zeros((1, 9)), 100, np.random.default_rng(1))
    assert len(many) == 1 + FRESH  # of nine parameters the held-out corners must do


def test_error_holds_the_deviation_at_every_judging_point() -> None:
    inputs = {name: 0.2 * FRAME.parameters[name] for name in ("E", "m1", "d2")}
    middle = FRAME.parameters
    cuts = boxes({n: Interval(middle[n] - r, middle[n] + r) for n, r in inputs.items()}, (0,))
    flow = LinearFlow(FRAME, cuts.names, 6, 0.1, Exact())
    fitted = fit_modes(flow, cuts, tolerance=1e-3)
    unjudged = replace(fitted, error=np.zeros_like(fitted.error))
    at = np.random.default_rng(4).uniform(-1, 1, (300, 3))
    told, count = judged_at_optima(unjudged, at, 0)
    assert count == 300 + 8 + FRESH
    points = np.vstack([np.round(at, 2), list(product((-1.0, 1.0), repeat=3))])
    wrong = np.abs(fitted.values(points) - flow.values(cuts.to_physical(points))).max(0)
    assert wrong.max() > 1e-6
    assert (told.error >= wrong - 1e-15).all()


@pytest.mark.slow
def test_frame_whose_polynomials_are_worst_at_an_optimum_is_covered() -> None:
    row = judged(
        random_case(93014), method="auto", tolerance=1e-3, samples=3000, starts=8, seed=93001
    )
    assert row["error"] <= 1e-3
    assert row["above_declared"] == 0
