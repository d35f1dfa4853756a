"""Tuned numbers decide time and width of bounds, never whether they hold."""

import inspect

import numpy as np
import pytest

from alphacut.frame import Accelerogram, DualProof, Proof, StoreyFrame, envelope, numbers
from alphacut.frame.modes.modes import fitted_model
from alphacut.fuzzy import Interval
from tests.frame.motions import exact_motions, random_points, require_inside

RECORD = Accelerogram(0.05, 2 * np.sin(np.arange(30) * 0.9) * np.sin(np.arange(30) * 0.2))
FRAME = StoreyFrame(
    [2e4] * 3, stiffness=[4e7] * 3, damping_ratio=0.03, ground=RECORD, outputs=("q3",)
)
INPUTS = {"k1": Interval(3.0e7, 5.0e7), "m3": Interval(1.7e4, 2.3e4), "zeta": Interval(0.02, 0.04)}
NARROW = {**INPUTS, "k1": Interval(3.8e7, 4.2e7)}
MOTION = {"duration": 0.4, "step": 0.05, "alpha": (0,), "relative": True, "progress": False}
DUAL = DualProof(gap=1e-3, peaks=5e-3, parts=6, workers=1)
TUNED = [name for name in vars(numbers) if name.isupper()]
BRANCH_AND_BOUND = "".join(inspect.getsource(inspect.getmodule(x)) for x in (Proof, fitted_model))


@pytest.mark.parametrize("factor", [0.5, 2])
@pytest.mark.parametrize("name", TUNED)
def test_bounds_hold_with_half_and_twice_a_number(name, factor, monkeypatch):
    value, is_of_proof = getattr(numbers, name), f"numbers.{name}" in BRANCH_AND_BOUND
    monkeypatch.setattr(numbers, name, type(value)(value * factor))
    inputs = NARROW if is_of_proof else INPUTS
    found = envelope(FRAME, inputs, Proof(workers=1) if is_of_proof else DUAL, **MOTION)
    points = random_points(inputs, 60, np.random.default_rng(5))
    motions = exact_motions(FRAME, points, inputs, 0.4, 0.05)
    require_inside(motions, found, slack=1e-9)
    assert np.abs(motions).max(1).min() >= found.least_peaks.lower[0, 0]
    assert found.facts["gap_of_peaks"] < 0.2  # and are worth something
