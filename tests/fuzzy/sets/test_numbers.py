"""Fuzzy numbers: cuts and membership."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from alphacut.fuzzy import Crisp, Interval, PiecewiseLinear, Trapezoidal, Triangular
from alphacut.fuzzy.sets.numbers import outer_steps

finite = st.floats(-1e6, 1e6, allow_nan=False)
NUMBERS = [
    Crisp(1.0),
    Interval(2.0, 3.0),
    Triangular(4.0, 4.5, 5.5),
    Trapezoidal(6.0, 6.5, 7.5, 8.0),
    PiecewiseLinear((0.0, 0.3, 1.0), (1.0, 2.0, 2.0), (5.0, 4.0, 2.5)),
]


@pytest.mark.parametrize("number", NUMBERS, ids=lambda number: type(number).__name__)
def test_cuts_are_nested_and_reach_from_support_to_modal_value(number):
    cuts = [number.cut(level) for level in np.linspace(0, 1, 41)]
    assert cuts[0] == number.support
    assert all(a.lower <= b.lower <= b.upper <= a.upper for a, b in itertools.pairwise(cuts))
    assert cuts[-1].lower <= number.nominal <= cuts[-1].upper


@pytest.mark.parametrize("number", NUMBERS, ids=lambda number: type(number).__name__)
def test_membership_is_the_highest_level_whose_cut_holds_the_point(number):
    levels = np.linspace(0, 1, 301)
    for x in np.linspace(number.support.lower - 1, number.support.upper + 1, 29):
        holding = [a for a in levels if number.cut(a).lower <= x <= number.cut(a).upper]
        assert number.membership(x) == pytest.approx(max(holding, default=0.0), abs=4e-3)


@settings(deadline=None)
@given(st.lists(finite, min_size=3, max_size=3).map(sorted))
def test_triangle_meets_its_three_values_exactly(values):
    triangle = Triangular(*values)
    assert triangle.cut(0) == (values[0], values[2])
    assert triangle.cut(1) == (values[1], values[1])
    assert triangle.nominal == values[1]


def test_what_is_no_number_has_no_grade():
    grades = Triangular(1, 2, 3).membership([0, 1.5, np.nan, np.inf])
    np.testing.assert_array_equal(grades, [0, 0.5, np.nan, 0])
    assert Crisp(1.0).membership([0.999, 1.0, 1.001]).tolist() == [0, 1, 0]


def test_a_level_beside_a_decimal_by_rounding_is_that_decimal():
    grid = np.linspace(0, 1, 11)
    steps = outer_steps(grid, grid, 3 - grid)
    for k in range(11):
        assert steps.cut(k / 10) == steps.cut(float(grid[k])) == (grid[k], 3 - grid[k])
    assert steps.cut(0.35) == steps.cut(0.3)  # the wider one
