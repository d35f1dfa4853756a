"""Random frames: a part of the benchmark, in which no exact motion may leave its bounds."""

import pytest

from benchmarks.frame.random_frames import KINDS, Motions, outside, rows


@pytest.mark.slow
def test_no_motion_of_a_frame_of_each_kind_is_outside(rng):
    found = list(rows(int(rng.integers(2**31)), 0, len(KINDS), 20, ["auto"]))
    assert [row["kind"] for row in found] == list(KINDS)
    for row in found:
        assert row["result"] in ("guaranteed", "estimated")
        assert row.get("outside", 0) == 0


def test_a_motion_above_a_bound_at_a_node_or_between_is_seen(rng, monkeypatch):
    monkeypatch.setattr("benchmarks.frame.random_frames.DURATION", 0.25)
    seen = []

    def moved(found, motions):
        for place in (3, 4):  # a node, and a time within a step
            values = motions.values.copy()
            values[0, place] += 10 * abs(found.upper).max()
            seen.append(outside(found, Motions(values, motions.rounding, motions.step)))
        return outside(found, motions)

    monkeypatch.setattr("benchmarks.frame.random_frames.outside", moved)
    list(rows(int(rng.integers(2**31)), 1, 1, 5, ["dual"]))
    assert all(count >= 1 for count in seen)
