"""What judges a Graph Follower's envelope where neither a proof nor the modes do."""

import numpy as np
import pytest

from alphacut.frame.methods.judged import SAMPLES, sample


@pytest.mark.parametrize("d", [1, 3, 7, 9, 14])
def test_it_looks_inside_on_faces_and_at_corners(d):
    points = sample(d, 2)
    assert np.abs(points).max() <= 1
    at_ends = (np.abs(points) == 1).sum(axis=1)
    assert np.count_nonzero(at_ends == 0) >= SAMPLES
    assert np.count_nonzero(at_ends == d) >= min(2**d, SAMPLES)
    if d > 1:
        assert np.count_nonzero((at_ends > 0) & (at_ends < d)) >= SAMPLES / 5
    if 2**d <= SAMPLES:
        assert len(np.unique(points[at_ends == d], axis=0)) == 2**d
    else:
        assert len(np.unique(points[at_ends == d], axis=0)) > 0.9 * SAMPLES


def test_levels_are_judged_by_points_of_their_own():
    first, second = ({tuple(x) for x in sample(14, level)} for level in (0, 1))
    assert len(first & second) < 8
