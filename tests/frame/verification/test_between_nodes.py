"""Estimates of what happens between nodes."""

from types import SimpleNamespace

import numpy as np
import pytest

from alphacut.frame import Exact, LinearFlow, StoreyFrame, envelope
from alphacut.frame.structures.linear import frequencies
from alphacut.frame.verification import step_error
from alphacut.frame.verification.step_error import node_deviation
from alphacut.fuzzy import Interval


def test_a_whole_swing_within_a_step_is_seen() -> None:
    frame = StoreyFrame((1e4,), (3.0,), 25e9, 1e-6, v0=(0.1,))
    turn = np.sqrt(24 * 25e9 * 1e-6 / 27 / 1e4)
    period = 2 * np.pi / turn
    found = node_deviation(
        LinearFlow(frame, ("E",), 4 * period, period, Exact()), np.array([[25e9]])
    )
    assert found[0] == 0
    ratio = found[1:, 0] / (0.1 / turn)  # amplitude over the straight line, which is zero
    assert (ratio >= 1).all()
    assert (ratio <= 1.8).all()


@pytest.mark.parametrize("seed", range(16))
def test_modes_that_turn_several_times_within_a_step_are_seen(seed: int) -> None:
    random = np.random.default_rng(seed)
    stiffness, start = 10 ** random.uniform(5, 6.5, 3), 0.01 * random.normal(size=3)
    frame = StoreyFrame((1e4,) * 3, stiffness=tuple(stiffness), q0=tuple(start), damping_ratio=0.01)
    step, point = random.uniform(15, 50) / frequencies(frame)[-1], np.empty((1, 0))
    found = node_deviation(LinearFlow(frame, (), 12 * step, step, Exact()), point)
    fine = LinearFlow(frame, (), 12 * step, step / 100, Exact()).values(point)[0]
    share = np.linspace(0, 1, 101)[:, None]
    for j in range(12):
        inner = fine[100 * j : 100 * (j + 1) + 1]
        off = abs(inner - inner[0] * (1 - share) - inner[-1] * share).max(0)
        assert (off <= found[j + 1]).all()
    assert found.max() < 4 * abs(fine).max()


def test_the_last_of_many_trajectories_counts() -> None:
    frame = StoreyFrame((1e4,), stiffness=(1e6,), q0=(0.1,))
    flow = LinearFlow(frame, ("q1_0",), 1.0, 0.1, Exact())
    points = np.zeros((40, 1))
    points[-1] = 0.1
    assert node_deviation(flow, points) == pytest.approx(node_deviation(flow, points[-1:]))
    assert node_deviation(flow, points).max() > 0


def test_trajectories_halfway_to_the_corners_are_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    looked: list[float] = []

    def kept(flow: LinearFlow, points: np.ndarray) -> np.ndarray:
        looked.extend(points[:, 0])
        return np.zeros((len(flow.time), len(flow.outputs)))

    monkeypatch.setattr(step_error, "node_deviation", kept)
    frame = StoreyFrame((1e4,), stiffness=(1e6,), q0=(0.1,))
    envelope(
        frame, {"k1": Interval(0.8e6, 1.2e6)}, duration=0.4, step=0.01, method="quasi-monte-carlo"
    )
    assert sorted({round(k / 1e5) for k in looked}) == [8, 9, 10, 11, 12]


def test_a_step_counts_its_neighbours_and_a_share_of_the_largest() -> None:
    fine = np.zeros((2, 4 * 6 + 1, 1))
    fine[1, 4 * 2 + 1, 0] = -2.0  # in the third of six steps, a quarter after its beginning
    flow = SimpleNamespace(finer=lambda: (SimpleNamespace(values=lambda points: fine), 4))
    found = node_deviation(flow, np.zeros((2, 1)))
    assert found[:, 0] == pytest.approx([0, 0.3, 3, 3, 3, 0.3, 0.3])
