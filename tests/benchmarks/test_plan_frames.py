"""Random frames in plan over all angles: no exact response leaves a bound, none is far from it."""

import numpy as np
import pytest

from benchmarks.frame.plan_frames import bounded, largest_motion, random_plan, validation


# The worst angle of seed 3 lies between the first directions.
@pytest.mark.parametrize("seed", [3, None])
def test_a_frame_in_plan_stays_within_its_bound_over_all_angles(seed, rng):
    if seed is not None:
        rng = np.random.default_rng(seed)
    plan = random_plan(rng, storeys=2, count=2, duration=2.0)
    row = bounded(plan)
    largest = largest_motion(plan, rng, 300)
    assert row["nature"] == "guaranteed"
    assert 0.9 * row["bound [m]"] < largest <= row["bound [m]"]
    assert row["gap"] < 0.02


@pytest.mark.slow
def test_thirty_frames_in_plan_stay_within_their_bounds(rng):
    rows = list(validation(int(rng.integers(2**32)), 30, 2000))
    assert all(row["inside"] for row in rows)
    proved = [row for row in rows if row["nature"] == "guaranteed"]
    assert len(proved) >= 25
    assert np.median([row["gap"] for row in proved]) < 0.02
