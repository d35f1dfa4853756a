"""Rounding of bounds in the direction that keeps what they promise."""

import pytest

from alphacut.base.nature import rounded
from alphacut.fuzzy import Nature


@pytest.mark.parametrize("value", [5e-324, 3.33333e-310, -1.23456e-306, 1.23456e-300, 1.23456e308])
def test_bounds_of_any_magnitude_stay_bounds(value):
    assert rounded(value, "upper", Nature.GUARANTEED) >= value
    assert rounded(value, "lower", Nature.GUARANTEED) <= value
    assert rounded(value, "upper", Nature.ATTAINED) <= value
    assert rounded(value, "lower", Nature.ATTAINED) >= value
