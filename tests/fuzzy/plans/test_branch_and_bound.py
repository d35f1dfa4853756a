"""Branch and bound near the largest numbers there are."""

import pytest

from alphacut.fuzzy import BranchAndBound, Interval, propagate


@pytest.mark.filterwarnings("error")
def test_what_overflows_in_the_search_is_no_warning():
    def steep(x):
        return 1 / x

    found = propagate(steep, {"x": Interval(1e-150, 1e10)}, BranchAndBound(steep), alpha=[1.0])
    assert found.upper[0, 0] == pytest.approx(1e150)
