"""Estimates of what happens between nodes."""

import numpy as np
import pytest

from alphacut.frame import Exact, LinearFlow, StoreyFrame
from alphacut.frame.checks import between_nodes
from alphacut.frame.checks.between_nodes import stray


def test_a_whole_swing_within_a_step_is_seen() -> None:
    frame = StoreyFrame((1e4,), (3.0,), 25e9, 1e-6, v0=(0.1,))
    turn = np.sqrt(24 * 25e9 * 1e-6 / 27 / 1e4)
    period = 2 * np.pi / turn
    found = stray(LinearFlow(frame, ("E",), 4 * period, period, Exact()), np.array([[25e9]]))
    assert found[0] == 0
    ratio = found[1:, 0] / (0.1 / turn)  # amplitude over the straight line, which is zero
    assert (ratio >= 1).all()
    assert (ratio <= 1.8).all()


def test_a_step_counts_its_neighbours_and_a_share_of_the_largest(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    fine = np.zeros((2, 4 * 6 + 1, 1))
    fine[1, 4 * 2 + 1, 0] = -2.0  # in the third of six steps, a quarter after its beginning
    monkeypatch.setattr(between_nodes, "_finer", lambda flow, points: (fine, 4))
    found = stray(LinearFlow.__new__(LinearFlow), np.zeros((2, 1)))
    assert found[:, 0] == pytest.approx([0, 0.3, 3, 3, 3, 0.3, 0.3])
