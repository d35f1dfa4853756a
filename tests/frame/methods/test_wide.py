"""Wide supports, many parameters and random frames: what `auto` and the Graph Follower promise,
against references of another kind.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from alphacut.frame import envelope
from benchmarks.frame import random_frames as frame_random
from benchmarks.frame.envelopes import FRAME, INPUTS
from benchmarks.frame.references import wide as frame_wide

LONG: dict[str, Any] = {"duration": 30, "step": 0.01, "alpha": (0,), "integrator": "exact"}


def test_the_polished_reference_is_the_certified_envelope() -> None:
    truth = frame_wide.reference(FRAME, INPUTS, duration=6, every=1.0, samples=2**10, candidates=4)
    certified = envelope(
        FRAME, INPUTS, duration=6, step=1.0, alpha=(0,), method="modal", certify=1e-7
    )
    bounds = np.stack([certified.lower[0], certified.upper[0]], -1)
    assert np.abs(truth.bounds - bounds).max() < 3e-7
    assert (truth.bounds[:, :, 1] - truth.bounds[:, :, 0]).max() > 0.05


def test_the_reference_takes_up_what_a_method_finds_and_counts_what_it_misses() -> None:
    inputs = frame_wide.wide(0.2)
    poor = frame_wide.reference(FRAME, inputs, duration=6, every=1.0, samples=16, candidates=1)
    good = frame_wide.reference(FRAME, inputs, duration=6, every=1.0, samples=2**10, candidates=4)
    found = envelope(FRAME, inputs, duration=6, step=0.1, alpha=(0,), method="auto", tolerance=1e-4)
    assert poor.errors(found).max() < 1e-4
    assert np.abs(poor.bounds - good.bounds).max() < 1e-4
    vertices = envelope(FRAME, inputs, duration=6, step=0.1, alpha=(0,), method="vertex")
    assert good.errors(vertices).max() > 0.01


def test_random_frames_keep_the_tolerance() -> None:
    rows = list(frame_random.measured([1]))
    assert len(rows) == 8
    for row in rows:
        assert row["error_m"] <= row["tolerance_m"]
        assert row["estimate_m"] <= row["tolerance_m"]
        assert row["method"] not in row["excluded"].split()


@pytest.mark.slow
def test_fifth_to_either_side() -> None:
    inputs = frame_wide.wide(0.2)
    truth = frame_wide.reference(FRAME, inputs, duration=30, every=0.2)
    for method, options, limit in (
        ("auto", {"tolerance": 5e-4}, 5e-4),
        ("improved-graph-follower", {"tolerance": 5e-4}, 3e-3),
    ):
        row = frame_wide.compared(envelope(FRAME, inputs, method=method, **options, **LONG), truth)
        assert row["error_m"] < limit
        assert row["covered"] > 0.9


@pytest.mark.slow
def test_half_to_either_side_the_estimate_covers_the_error() -> None:
    inputs = frame_wide.wide(0.5)
    truth = frame_wide.reference(FRAME, inputs, duration=30, every=0.2)
    row = frame_wide.compared(envelope(FRAME, inputs, method="auto", tolerance=1e-2, **LONG), truth)
    assert row["covered"] >= 0.95
    assert row["median_estimate_m"] < 5e-3


@pytest.mark.slow
def test_sixteen_parameters() -> None:
    frame, inputs = replace(FRAME, outputs=("q3",)), frame_wide.sixteen()
    assert len(inputs) == 16
    row = frame_wide.compared(
        envelope(frame, inputs, method="auto", tolerance=3e-4, **LONG),
        frame_wide.reference(frame, inputs, duration=30, every=1.0),
    )
    assert row["error_m"] < 3e-4
    assert row["trajectories"] < 1000
    assert row["covered"] >= 0.95


@pytest.mark.slow
def test_auto_keeps_every_tolerance_on_twenty_random_frames() -> None:
    rows = list(frame_random.measured(range(20)))
    assert len(rows) == 160
    assert [row for row in rows if not row["error_m"] <= row["tolerance_m"]] == []
