"""Models kept of the trajectories that attain bounds."""

import numpy as np
import pytest

from alphacut.frame import envelope, pendulum
from alphacut.frame.boxes import UnitFlow
from alphacut.frame.calculus.jet import Array, Jet
from alphacut.frame.methods.held_models import HeldModels
from alphacut.fuzzy import Triangular
from alphacut.fuzzy.campaign.memory import TooLargeError


def test_models_are_those_of_the_last_holder_at_its_nodes_and_beside() -> None:
    held, shape = HeldModels.empty((0, -1, 1), (5, 2, 2), 3), (4, 5, 2)
    random = np.random.default_rng(1)
    everywhere = tuple(np.indices((5, 2, 2)).reshape(3, -1))
    holder = np.full((5, 2, 2), -1)
    for changed in (np.ones((5, 2, 2), bool), random.random((5, 2, 2)) < 0.4):
        jet = Jet(*(random.normal(size=(*(3,) * k, *shape)) for k in range(3)))
        before = [held.models(1, everywhere)[2], holder.copy()]
        holder = np.where(changed, random.integers(0, 4, (5, 2, 2)), -1)
        held.keep(jet, holder)
        for shift in held.kept:
            t, o, side = np.nonzero(changed)
            value, first, second = held.models(shift, (t, o, side))
            near, s = np.clip(t + shift, 0, 4), holder[t, o, side]
            assert np.array_equal(value, jet.value[s, near, o])
            assert np.array_equal(first.T, jet.first[:, s, near, o])
            assert np.array_equal(np.moveaxis(second, 0, -1), jet.second[:, :, s, near, o])
    kept = ~changed.ravel()
    assert np.array_equal(held.models(1, everywhere)[2][kept], before[0][kept])


def test_models_that_do_not_fit_are_refused_before_they_are_computed() -> None:
    with pytest.raises(TooLargeError, match=r"models of 1,000,001 nodes, 8 outputs and 90 inputs"):
        HeldModels.empty((0, -1, 1), (1_000_001, 8, 2), 90)


def test_contests_and_wider_boxes_ask_kept_models_and_no_trajectory_twice(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    inputs = {"l": Triangular(0.9, 1.0, 1.1), "phi_0": Triangular(1.2, 1.5, 1.8)}
    seen: list[bytes] = []
    plain = UnitFlow.taylor

    def counted(flow: UnitFlow, unit: Array) -> Jet:
        seen.extend(row.tobytes() for row in unit)
        return plain(flow, unit)

    monkeypatch.setattr(UnitFlow, "taylor", counted)
    found = envelope(pendulum(), inputs, duration=8, step=0.02, alpha=(0, 0.5), contests=3)
    assert len(seen) == found.trajectories
    assert len(seen) - len(set(seen)) == 1  # the modal one, at both levels
