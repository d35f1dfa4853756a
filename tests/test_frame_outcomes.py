"""Fuzzy peaks and probabilities of exceedance."""

from __future__ import annotations

import numpy as np
import pytest

from frame import LinearFlow, StoreyFrame, envelope
from frame.integrators import Exact
from frame.outcomes import exceedance, peaks
from fuzzy import Triangular

FRAME = StoreyFrame((9e3, 7e3), (2.4, 3.0), 25e9, 1e-6, (90, 60), "storey", (0.05, 0.0), (0.0, 0.4), outputs=("q1", "drift2", "base_shear"))
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

    found = exceedance(FRAME, INPUTS, {"v2_0": speed}, limit=0.16, duration=4, step=0.05, alpha=(0, 0.5, 1), spread=16)
    assert (np.diff(found.upper) <= 0).all()
    assert (np.diff(found.lower) >= 0).all()
    assert 0.02 < found.upper[-1] < 0.98
    assert found.lower[-1] == found.upper[-1]
    assert found.upper[0] > found.lower[0]
    with pytest.raises(ValueError, match="both fuzzy and random"):
        exceedance(FRAME, INPUTS, {"E": speed}, limit=0.2, duration=4, step=0.05)
