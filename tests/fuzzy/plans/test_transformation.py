"""The transformation method: its points against a closed form, its counts, its bounds."""

import numpy as np
import pytest

from alphacut.fuzzy import (
    Crisp,
    General,
    Interval,
    Nature,
    Reduced,
    Trapezoidal,
    Triangular,
    levels,
    propagate,
)
from alphacut.fuzzy.plans.transformation import _sample_count, hanss_points

PAPER = {
    "a2": Triangular(0.001, 0.1, 0.3145),
    "a4": Triangular(0.001, 0.1692, 0.9975),
    "E": Triangular(75e9, 80e9, 85e9),
}


def monotone(a2, a4, E):
    """Rises with a2 and E, falls with a4, curved: like the modulus of the cell."""
    return {"E": np.sqrt(1 + a2) * (E / 1e9) ** 0.2 / (1 + a4), "nu": a2 - a4}


def test_points_are_ends_and_midpoints_of_the_level_above():
    """By hand: the cuts are 0 … 9, 1 … 7, 2 … 5 and 3."""
    rows = hanss_points(Triangular(0, 3, 9), levels(3))
    expected = [[0, 2.25, 5.25, 9], [1, 3.5, 7], [2, 5], [3]]
    for row, points in zip(rows, expected, strict=True):
        np.testing.assert_allclose(row, points, rtol=1e-13, atol=1e-13)


def test_fuzzy_intervals_start_from_two_points_and_crisp_inputs_from_one():
    for number, counts in (
        (Trapezoidal(0, 1, 2, 4), [5, 4, 3, 2]),
        (Interval(0, 1), [5, 4, 3, 2]),
        (Crisp(1.0), [1, 1, 1, 1]),
    ):
        assert [len(points) for points in hanss_points(number, levels(3))] == counts


@pytest.mark.parametrize(("method", "evaluations"), [(General(), 225), (Reduced(), 33)])
def test_every_method_is_exact_on_a_monotone_model(method, evaluations):
    result = propagate(monotone, PAPER, method)
    assert result.evaluations == evaluations
    lower, upper = result.bounds("E")
    for level, low, high in zip(result.alpha, lower, upper, strict=True):
        a2, a4, E = (number.cut(level) for number in PAPER.values())
        assert low == monotone(a2.lower, a4.upper, E.lower)["E"]
        assert high == monotone(a2.upper, a4.lower, E.upper)["E"]
    assert result.nature is Nature.ATTAINED  # nobody stated anything


def test_bounds_are_attained_where_the_result_says():
    result = propagate(monotone, PAPER, General())
    for places, ends in ((result.lower_at, result.lower), (result.upper_at, result.upper)):
        for level in range(5):
            for column, output in enumerate(result.outputs):
                point = dict(zip(result.inputs, places[level, column], strict=True))
                assert monotone(**point)[output] == ends[level, column]


def test_points_of_inputs_without_any_sign_are_counted_once():
    """A sign gives two opposite corners; without one they are the same 2 · 3 points."""
    grids = [[[0.0, 1.0], [0.0, 0.5, 1.0]]]
    for signs, count in (([0, 0], 6), ([1, 0], 6), ([0, -1], 4), ([1, -1], 2)):
        assert _sample_count(np.array([[signs]], np.int8), grids) == count
