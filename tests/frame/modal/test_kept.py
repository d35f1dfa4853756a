"""Searches that were stopped go on from what was kept; equal levels are searched once."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from alphacut.frame import StoreyFrame, envelope
from alphacut.frame.calculus.jet import Array
from alphacut.frame.modal.polish import Polish
from alphacut.fuzzy import Interval, Triangular

FRAME = StoreyFrame((2e4, 1.5e4), stiffness=(3e6, 2e6), q0=(0.1, 0.2), damping_ratio=0.02)
INPUTS = {
    name: Interval(0.7 * x, 1.3 * x) for name, x in FRAME.parameters.items() if name[0] in "km"
}
MOTION: dict[str, Any] = {"duration": 1.0, "step": 0.2, "method": "modal", "tolerance": 1e-6}
MOTION["budget"] = 30


class Memory(dict[str, dict[str, Array]]):
    """Keeps in memory; raises KeyboardInterrupt after a number of savings."""

    stop = 10_000

    def load(self, name: str) -> Mapping[str, Array] | None:
        return self.get(name)

    def save(self, name: str, found: Mapping[str, Array]) -> None:
        self[name] = {part: np.array(x) for part, x in found.items()}
        self.stop -= 1
        if self.stop == 0:
            raise KeyboardInterrupt


def test_a_search_that_was_stopped_after_any_part_ends_as_if_it_had_not_been() -> None:
    inputs = {name: Triangular(x.support[0], x.modal, x.support[1]) for name, x in INPUTS.items()}
    levels = {"alpha": (0.0, 0.5), **MOTION}
    whole = envelope(FRAME, inputs, **levels)
    assert "bounds" in whole.facts
    kept, stops = Memory(), 0
    while True:
        kept.stop = 2
        try:
            found = envelope(FRAME, inputs, kept=kept, **levels)
            break
        except KeyboardInterrupt:
            stops += 1
    assert stops >= 3
    for name in ("lower", "upper", "lower_at", "upper_at", "error"):
        assert np.array_equal(getattr(found, name), getattr(whole, name))


def test_what_is_kept_is_not_searched_again(monkeypatch: pytest.MonkeyPatch) -> None:
    kept = Memory()
    found = envelope(FRAME, INPUTS, kept=kept, alpha=(0.0,), **MOTION)
    monkeypatch.setattr(Polish, "_pass", lambda *_: pytest.fail("searched again"))
    again = envelope(FRAME, INPUTS, kept=kept, alpha=(0.0,), **MOTION)
    assert np.array_equal(found.upper, again.upper)


@pytest.mark.parametrize("options", [{}, {"method": "improved-graph-follower"}])
def test_levels_of_intervals_are_searched_once(options: dict[str, Any]) -> None:
    motion = {"duration": 1.0, "step": 0.1, **options}
    inputs = {"k1": INPUTS["k1"]}
    one = envelope(FRAME, inputs, alpha=(0.0,), **motion)
    five = envelope(FRAME, inputs, alpha=(0.0, 0.2, 0.9), **motion)
    assert five.alpha.tolist() == [0.0, 0.2, 0.9]
    assert five.trajectories == one.trajectories
    assert five.facts == one.facts
    for name in ("lower", "upper", "lower_at", "upper_at", "error"):
        for level in range(3):
            assert np.array_equal(getattr(five, name)[level], getattr(one, name)[0])
    mixed = envelope(FRAME, {**inputs, "k2": Triangular(1.9e6, 2e6, 2.1e6)}, alpha=(0, 1), **motion)
    assert (mixed.upper[0] > mixed.upper[1]).any()
