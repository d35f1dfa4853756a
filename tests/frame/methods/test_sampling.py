"""Sampled and followed envelopes: a few trajectories at a time, with progress."""

from functools import partial

import numpy as np
import pytest

from alphacut.frame import StoreyFrame, envelope
from alphacut.frame.boxes import UnitFlow
from alphacut.frame.methods import batch_graph_follower, sampling
from alphacut.fuzzy import Triangular

FRAME = StoreyFrame((2e3, 1e3), (2.5, 2.7), 24.7561e9, 1e-6, q0=(0.01, 0.03), v0=(0, -0.5))
INPUTS = {"E": Triangular(22e9, 24.7561e9, 26e9), "m1": Triangular(1.9e3, 2e3, 2.1e3)}


@pytest.mark.parametrize("method", ["vertex", "monte-carlo", "quasi-monte-carlo"])
def test_few_trajectories_at_a_time_give_the_same_bounds(method, monkeypatch):
    def found(told=False):
        return envelope(FRAME, INPUTS, duration=1, step=0.1, method=method, progress=told)

    whole, done = found(), []
    monkeypatch.setattr(sampling, "MOST", 3 * 11 * 2)  # three at a time
    few = found(done.append)
    assert np.array_equal(few.lower, whole.lower)
    assert np.array_equal(few.upper, whole.upper)
    assert done == sorted(done)
    assert done[0] == 0
    assert len(set(done)) > len(whole.alpha)


def test_few_taylor_models_at_a_time_give_the_same_bounds(monkeypatch):
    asked, plain = [], UnitFlow.taylor
    monkeypatch.setattr(UnitFlow, "taylor", lambda *of: asked.append(len(of[1])) or plain(*of))
    find = partial(envelope, FRAME, INPUTS, duration=1, step=0.1, progress=False)
    whole = find(method="improved-graph-follower")
    assert max(asked) > 5
    monkeypatch.setattr(batch_graph_follower, "MOST", 5 * 11 * 2 * 7)
    asked.clear()
    few = find(method="improved-graph-follower")
    assert max(asked) == 5
    assert np.abs(few.upper - whole.upper).max() < 1e-12
