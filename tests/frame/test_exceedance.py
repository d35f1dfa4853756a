"""Fuzzy peaks and probabilities of exceedance."""

from __future__ import annotations

import numpy as np
import pytest

from alphacut.frame import LinearFlow, StoreyFrame, envelope
from alphacut.frame.boxes import boxes
from alphacut.frame.dynamics.integrators import Exact
from alphacut.frame.exceedance import exceedance, peaks, tried_peaks
from alphacut.fuzzy import Triangular

FRAME = StoreyFrame(
    (9e3, 7e3),
    (2.4, 3.0),
    25e9,
    1e-6,
    (90, 60),
    "storey",
    (0.05, 0.0),
    (0.0, 0.4),
    outputs=("q1", "drift2", "base_shear"),
)
INPUTS = {"E": Triangular(23e9, 25e9, 26e9), "m2": Triangular(6.8e3, 7e3, 7.3e3)}


def test_no_trajectory_peaks_outside_the_fuzzy_peak() -> None:
    found = peaks(envelope(FRAME, INPUTS, duration=5, step=0.02))
    rng = np.random.default_rng(0)
    points = np.column_stack([rng.uniform(*INPUTS[name].cut(0), 500) for name in INPUTS])
    sampled = np.abs(LinearFlow(FRAME, tuple(INPUTS), 5, 0.02, Exact()).values(points)).max(1)
    assert (sampled <= found.upper[0] * (1 + 1e-5)).all()
    assert (sampled >= found.lower[0] * (1 - 1e-5)).all()
    assert (found.upper[-1] <= found.upper[0]).all()
    assert found.upper[-1] == pytest.approx(found.lower[-1])


def test_probability_of_exceedance_is_fuzzy_and_nested() -> None:
    def speed(rng: np.random.Generator, count: int) -> np.ndarray:
        return rng.normal(0.4, 0.1, count)

    found = exceedance(
        FRAME,
        INPUTS,
        {"v2_0": speed},
        limit=0.16,
        duration=4,
        step=0.05,
        alpha=(0, 0.5, 1),
        spread=16,
    )
    assert (np.diff(found.upper) <= 0).all()
    assert (np.diff(found.lower) >= 0).all()
    assert 0.02 < found.upper[-1] < 0.98
    assert found.lower[-1] == found.upper[-1]
    assert found.upper[0] > found.lower[0]
    with pytest.raises(ValueError, match="both fuzzy and random"):
        exceedance(FRAME, INPUTS, {"E": speed}, limit=0.2, duration=4, step=0.05)


def test_the_least_peak_tried_lies_between_the_bounds_and_is_attained() -> None:
    found = envelope(FRAME, INPUTS, duration=5, step=0.02, alpha=(0, 0.5, 1))
    cuts, flow = boxes(INPUTS, (0, 0.5, 1)), LinearFlow(FRAME, tuple(INPUTS), 5, 0.02, Exact())
    tried, of = tried_peaks(flow, cuts), peaks(found)
    assert (tried >= of.lower * (1 - 1e-5)).all()
    assert (tried <= of.upper * (1 + 1e-5)).all()
    assert (np.diff(tried, axis=0) >= 0).all()
    assert tried[-1] == pytest.approx(of.upper[-1])
    points = np.column_stack(
        [np.random.default_rng(1).uniform(*INPUTS[name].cut(0), 3000) for name in INPUTS]
    )
    dense = np.abs(flow.values(points)).max(1).min(0)
    assert (tried[0] <= dense * 1.01).all()
    assert (of.lower[0] < dense).all()


@pytest.mark.parametrize(("limit", "share"), [(1e9, 0), (1e-9, 1)])
def test_few_draws_leave_the_probability_uncertain(limit: float, share: float) -> None:
    def speed(rng: np.random.Generator, count: int) -> np.ndarray:
        return rng.normal(0.4, 0.1, count)

    one, many = (
        exceedance(
            FRAME, INPUTS, {"v2_0": speed}, limit=limit, duration=1, step=0.1, alpha=(0,), samples=n
        )
        for n in (1, 400)
    )
    assert one.lower[0] == one.upper[0] == many.upper[0] == share
    assert one.deviation > 0.2
    assert 0 < many.deviation < 0.01
