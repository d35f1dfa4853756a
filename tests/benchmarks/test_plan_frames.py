"""Random frames in plan over all angles: no exact response leaves a bound, none is far from it."""

import numpy as np
import pytest

from benchmarks.frame.plan_frames import bounded, largest_motion, random_plan, validation


def test_a_frame_whose_worst_angle_lies_between_the_first_directions():
    row = stays_within_its_bound(np.random.default_rng(3), storeys=2, duration=2.0)
    assert row["gap"] < 0.02  # which does not hold of every plan


def test_a_frame_in_plan_stays_within_its_bound_over_all_angles(rng):
    stays_within_its_bound(rng, storeys=1, duration=1.0)


def stays_within_its_bound(rng, storeys, duration):
    plan = random_plan(rng, storeys, count=2, duration=duration)
    row = bounded(plan)
    largest = largest_motion(plan, rng, 300)
    assert row["nature"] == "guaranteed"
    assert 0.9 * row["bound [m]"] < largest <= row["bound [m]"]
    return row


@pytest.mark.slow
def test_thirty_frames_in_plan_stay_within_their_bounds(rng):
    rows = list(validation(int(rng.integers(2**32)), 30, 2000))
    assert all(row["inside"] for row in rows)
    proved = [row for row in rows if row["nature"] == "guaranteed"]
    assert len(proved) >= 25
    assert np.median([row["gap"] for row in proved]) < 0.02
