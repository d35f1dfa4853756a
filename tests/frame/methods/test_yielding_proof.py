"""Proof of one yielding storey: guaranteed peaks, and what is refused with the input to change."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from alphacut.base.progress_bar import EnoughError
from alphacut.frame import Limit, StoreyFrame, decide, envelope, peaks
from alphacut.frame.analyses.limits import thresholds_of
from alphacut.frame.analyses.peaks import close_peaks
from alphacut.frame.bounds.interpolated_box import InterpolatedFrame
from alphacut.frame.boxes import UnitFlow, boxes
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.dynamics.yielding import YieldingFlow
from alphacut.frame.methods.yielding_proof import _what_is_known, prove_yielding
from alphacut.frame.threshold import Threshold
from alphacut.fuzzy import Interval, Nature, Triangular
from tests.frame.bounds.test_interpolated_box import isolated_building
from tests.frame.bounds.test_single_storey import random_storey

SHORT = {"duration": 2.5, "step": 0.05, "progress": False}


def test_auto_guarantees_the_peaks_of_a_yielding_storey(rng):
    frame = random_storey(rng, outputs=("q1", "ductility1", "dissipated1"))
    k, fy = frame.parameters["k1"], frame.parameters["fy1"]
    inputs = {"k1": Triangular(0.97 * k, k, 1.03 * k), "fy1": Interval(0.99 * fy, 1.01 * fy)}
    found = envelope(frame, inputs, alpha=[0, 1], **SHORT)
    assert found.nature is Nature.GUARANTEED
    assert found.facts["gap_of_peaks"] <= 0.1
    points = rng.uniform([0.97 * k, 0.99 * fy], [1.03 * k, 1.01 * fy], (200, 2))
    flow = YieldingFlow(frame, tuple(inputs), 2.5, 0.05)
    values, largest = flow.values_and_peaks(points)
    assert (found.lower[0] <= values).all()
    assert (values <= found.upper[0]).all()
    for column, peak in enumerate(peaks(found).values()):
        assert peak.nature is Nature.GUARANTEED
        assert largest[:, column].max() <= peak.proved[0] <= 1.1 * peak.reached[0]
        assert (np.diff(peak.proved) <= 0).all()
        at = np.array([list(peak.reached_at.values())])
        assert flow.values_and_peaks(at)[1][0, column] == pytest.approx(peak.reached[0], rel=1e-8)


def test_a_proof_keeps_its_gap_and_signed_peaks(rng):
    frame = random_storey(rng, outputs=("q1",), damping_ratio=0.05)
    k = frame.parameters["k1"]
    inputs = {"k1": Interval(0.99 * k, 1.01 * k)}
    found = envelope(frame, inputs, "proof", gap=0.02, alpha=[0], **SHORT)
    assert found.facts["gap_of_peaks"] <= 0.02
    signed = peaks(found, ["max q1", "min q1"])
    finer = YieldingFlow(frame, ("k1",), 2.5, 0.005).values(
        np.linspace(0.99, 1.01, 21)[:, None] * k
    )
    assert finer.max() <= signed["max q1"].proved[0]
    assert finer.min() >= signed["min q1"].proved[0]


def test_what_cannot_be_proved_names_the_input_or_is_searched(rng):
    frame = random_storey(rng, outputs=("q1",))
    p = frame.parameters
    names = ("k1", "fy1", "hardening1", "l1")
    inputs = {name: Interval(0.95 * p[name], 1.05 * p[name]) for name in names}
    with pytest.raises(UnprovedError, match="take l1 as a crisp number"):
        envelope(frame, inputs, "proof", alpha=[0], **SHORT)
    two = StoreyFrame([4e4] * 2, stiffness=[2e6] * 2, yield_force=[1e4] * 2, ground=frame.ground)
    found = envelope(two, {"k1": Interval(2e6, 2.01e6)}, alpha=[0], duration=0.5, step=0.05)
    assert "one storey can be proved" in found.notes[0]
    assert found.nature is Nature.ATTAINED


def test_what_stays_at_zero_is_bounded_beside_what_moves(rng):
    frame = random_storey(rng, outputs=("drift1", "residual1", "dissipated1"))
    strong = replace(frame, yield_force=[1e3 * frame.parameters["fy1"]])
    k = frame.parameters["k1"]
    inputs = {"k1": Interval(0.98 * k, 1.02 * k)}
    found = envelope(strong, inputs, alpha=[0], **SHORT)
    assert found.nature is Nature.GUARANTEED
    flow = UnitFlow(YieldingFlow(strong, ("k1",), 2.5, 0.05), boxes(inputs, [0.0]))
    residual = peaks(found)["residual1"]
    gap = found.facts["gap_of_peaks"]
    assert residual.proved[0] - residual.reached[0] <= 1.001 * gap * flow.peak[1]
    assert gap * flow.peak[1] <= 0.01 * flow.peak[0]


def test_limits_of_an_isolated_building_are_answered_without_closing_gaps(rng):
    frame = isolated_building(rng, 1, outputs=("q1",))
    k = frame.parameters["k1"]
    fy = frame.parameters["fy1"]
    supports = {"k1": Interval(0.98 * k, 1.02 * k), "fy1": Interval(0.99 * fy, 1.01 * fy)}
    names = tuple(supports)
    flow = UnitFlow(YieldingFlow(frame, names, 1.5, 0.05), boxes(supports, [0.0]))
    points = rng.uniform([0.98 * k, 0.99 * fy], [1.02 * k, 1.01 * fy], (100, 2))
    values, reached = flow.flow.values_and_peaks(points)
    largest = reached.max()
    gap = 0.01 * flow.peak
    kept = Threshold("q1", 1.5 * largest)
    found = prove_yielding(flow, "proof", gap, budget=60, thresholds=[kept])
    assert found.facts["closed_fraction"] == 1
    assert (found.lower[0] <= values).all()
    assert (values <= found.upper[0]).all()
    assert largest <= peaks(found)["q1"].proved[0] <= 1.5 * largest


def test_a_decision_says_where_a_bound_was_sought_no_closer_than_its_limit(rng):
    frame = isolated_building(rng, 1, outputs=("q1",))
    k = frame.parameters["k1"]
    inputs = {"k1": Interval(0.98 * k, 1.02 * k)}
    motion = {"duration": 1.5, "step": 0.05, "alpha": [0.0]}
    flow = YieldingFlow(frame, ("k1",), 1.5, 0.05)
    values, reached = flow.values_and_peaks(np.linspace(0.98 * k, 1.02 * k, 21)[:, np.newaxis])
    at_nodes = np.abs(values).max(axis=1)  # least peaks are bounded by values at nodes
    for value, verdict in (
        (1.5 * reached.max(), "not exceeded"),
        ((reached.min() + reached.max()) / 2, "can be exceeded"),
        (0.7 * at_nodes.min(), "exceeded"),
    ):
        limit = Limit("q1", float(value))
        asked = thresholds_of(frame, [limit])
        found = close_peaks(frame, inputs, ["q1"], thresholds=asked, progress=False, **motion)
        decision = decide(found, limit)
        assert decision.limits["q1"].verdict == verdict
        assert found["q1"].proved[0] >= reached.max()
        assert "not sought closer" in str(decision.table())


def test_a_message_names_open_ranges_and_bounds_in_their_units():
    frame = StoreyFrame(
        masses=[4e5], stiffness=[1.2e7], yield_force=[2e5], hardening=[0.1], v0=[2.0],
        outputs=("q1",), damping_ratio=0.02,
    )  # fmt: skip
    inputs = {"k1": Interval(0.6e7, 2.4e7), "fy1": Interval(1e5, 4e5)}
    with pytest.raises(UnprovedError) as refused:
        envelope(
            frame, inputs, "proof", boxes=1, alpha=[0], duration=4.0, step=0.05, progress=False
        )
    ranges = "k1 from 15.000 MN/m to 24.000 MN/m and fy1 from 100.00 kN to 400.00 kN"
    assert ranges in str(refused.value)


def test_where_no_plan_succeeds_the_bounds_are_those_without_one(rng, monkeypatch):
    def without_plan(self, low, high, allowed=None):
        return bounds(self, low, high) if allowed is None else self.infinite

    frame = isolated_building(rng, 1, outputs=("q1",))
    k = frame.parameters["k1"]
    bounds = InterpolatedFrame.bounds
    monkeypatch.setattr(InterpolatedFrame, "bounds", without_plan)
    inputs = {"k1": Interval(0.9999 * k, 1.0001 * k)}
    motion = {"duration": 1.5, "step": 0.05, "progress": False}
    found = envelope(frame, inputs, "proof", boxes=4, alpha=[0], **motion)
    assert found.facts["closed_fraction"] == 0
    flow = YieldingFlow(frame, ("k1",), 1.5, 0.05)
    values, reached = flow.values_and_peaks(rng.uniform(0.9999 * k, 1.0001 * k, (50, 1)))
    assert (found.lower[0] <= values).all()
    assert (values <= found.upper[0]).all()
    assert reached.max() <= peaks(found)["q1"].proved[0]


def test_a_progress_function_ends_the_effort_with_what_is_known(rng):
    def end(done):
        raise EnoughError

    frame = isolated_building(rng, 1, outputs=("q1",))
    k = frame.parameters["k1"]
    inputs = {"k1": Interval(0.9999 * k, 1.0001 * k)}
    motion = {"duration": 1.5, "step": 0.05, "progress": end}
    found = envelope(frame, inputs, "proof", gap=1e-9, boxes=500, alpha=[0], **motion)
    assert found.facts["boxes"] < 10
    assert found.facts["closed_fraction"] < 1


def test_what_a_message_guarantees_is_rounded_up():
    flow = SimpleNamespace(
        flow=SimpleNamespace(outputs=("q1",)), boxes=SimpleNamespace(names=("k1",)), units=("m",)
    )
    search = SimpleNamespace(
        open=[],
        count=3,
        open_ranges=lambda names: "nothing",
        closed_fraction=0.5,
        finite_peaks=np.array([[0.0, 1.000001]]),
    )
    assert "q1 ≤ 1.0001 m" in _what_is_known(flow, search)
