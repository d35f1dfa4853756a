"""Tuned numbers decide time and width of bounds, never whether they hold."""

import numpy as np
import pytest

from alphacut.frame import Accelerogram, DualProof, StoreyFrame, envelope, numbers
from alphacut.frame.dynamics.flow import LinearFlow
from alphacut.frame.dynamics.integrators import Exact
from alphacut.fuzzy import Interval

RECORD = Accelerogram(0.05, 2 * np.sin(np.arange(30) * 0.9) * np.sin(np.arange(30) * 0.2))
FRAME = StoreyFrame(
    [2e4] * 3, stiffness=[4e7] * 3, damping_ratio=0.03, ground=RECORD, outputs=("q3",)
)
INPUTS = {
    "k1": Interval(3.0e7, 5.0e7),
    "m3": Interval(1.7e4, 2.3e4),
    "zeta": Interval(0.02, 0.04),
}
MOTION = {"duration": 0.8, "step": 0.05, "alpha": (0,), "relative": True, "progress": False}
PROOFS = (DualProof(gap=1e-3, peaks=1e-3, parts=6, workers=1),)
TUNED = [name for name in vars(numbers) if name.isupper()]


@pytest.fixture(scope="module")
def exact():
    """Exact motions of the corners and of points of the box, shape (S, T)."""
    low, high = np.array([number.support for number in INPUTS.values()]).T
    unit = np.random.default_rng(5).random((600, len(low)))
    unit[::2] = unit[::2].round()
    flow = LinearFlow(FRAME, tuple(INPUTS), 0.8, 0.05, Exact())
    return flow.values(low + unit * (high - low))[..., 0]


@pytest.mark.parametrize("factor", [0.5, 2])
@pytest.mark.parametrize("name", TUNED)
@pytest.mark.parametrize("proof", PROOFS, ids=lambda proof: proof.name)
def test_bounds_hold_with_half_and_twice_a_number(proof, name, factor, exact, monkeypatch):
    value = getattr(numbers, name)
    monkeypatch.setattr(numbers, name, type(value)(value * factor))
    found = envelope(FRAME, INPUTS, proof, **MOTION)
    peak = np.abs(exact).max()
    assert (exact <= found.upper[0, :, 0] + 1e-9 * peak).all()
    assert (exact >= found.lower[0, :, 0] - 1e-9 * peak).all()
    assert np.abs(exact).max(1).min() >= found.least_peaks.lower[0, 0]
    assert found.facts["gap_of_peaks"] < 0.2  # and are worth something
