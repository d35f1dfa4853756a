"""The transformation method: its points against a closed form, its counts, its bounds."""

from math import comb

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
from alphacut.fuzzy.plans.transformation import hanss_points

PAPER = {
    "a2": Triangular(0.001, 0.1, 0.3145),
    "a4": Triangular(0.001, 0.1692, 0.9975),
    "E": Triangular(75e9, 80e9, 85e9),
}


def monotone(a2, a4, E):
    """Rises with a2 and E, falls with a4, curved: like the modulus of the cell."""
    return {"E": np.sqrt(1 + a2) * (E / 1e9) ** 0.2 / (1 + a4), "nu": a2 - a4}


def first_passage(number, level, index, alpha):
    """Point `index` of `level` as a mean of cut ends: a walk up the levels, left or right with
    probability ½, until it meets an end.

    The walk from (level, index) has met neither end before it stops at level q with r steps to the
    right; the ballot count of such walks is the number of lattice paths that leave the strip for
    the first time, here by the reflection-free recurrence on free paths.
    """
    top = len(alpha) - 1
    ends = [number.cut(a) for a in alpha]
    if index in (0, top - level):
        return ends[level].lower if index == 0 else ends[level].upper
    total = 0.0
    # stops at level q at its left end (after `index` steps left) or at its right end
    for q in range(level + 1, top + 1):
        steps = q - level
        to_left, to_right = index, top - level - index
        # the last step is a left one; before it, to_left − 1 left ones and too few right ones to stop
        if 0 <= steps - to_left < to_right:
            total += comb(steps - 1, to_left - 1) / 2**steps * ends[q].lower
        if 0 <= steps - to_right < to_left:
            total += comb(steps - 1, to_right - 1) / 2**steps * ends[q].upper
    return total


@pytest.mark.parametrize("number", [*PAPER.values(), Triangular(-3.0, 1.0, 1.5)])
@pytest.mark.parametrize("steps", [1, 4, 7])
def test_points_are_first_passage_means_of_the_cut_ends(number, steps):
    alpha = levels(steps)
    for level, points in enumerate(hanss_points(number, alpha)):
        assert len(points) == steps + 1 - level
        expected = [first_passage(number, level, index, alpha) for index in range(len(points))]
        np.testing.assert_allclose(points, expected, rtol=1e-13)


@pytest.mark.timeout(60)  # 45,000 points; comparing each with all others takes minutes
def test_points_of_many_levels_take_no_time():
    points = hanss_points(Triangular(0.0, 0.3, 1.0), levels(300))
    assert [len(row) for row in points] == list(range(301, 0, -1))


def test_fuzzy_intervals_start_from_two_points_and_crisp_inputs_from_one():
    for number, counts in (
        (Trapezoidal(0, 1, 2, 4), [5, 4, 3, 2]),
        (Interval(0, 1), [5, 4, 3, 2]),
        (Crisp(1.0), [1, 1, 1, 1]),
    ):
        assert [len(points) for points in hanss_points(number, levels(3))] == counts


@pytest.mark.parametrize(("method", "evaluations"), [(General(), 225), (Reduced(), 33)])
def test_counts_of_the_papers_case(method, evaluations):
    assert propagate(monotone, PAPER, method).evaluations == evaluations


@pytest.mark.parametrize("method", [General(), Reduced()])
def test_every_method_is_exact_on_a_monotone_model(method):
    result = propagate(monotone, PAPER, method)
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


def test_corners_alone_are_no_recursion():
    number, alpha = Triangular(0, 1, 3), levels(3000)
    rows = hanss_points(number, alpha, inner=False)
    assert [tuple(row) for row in rows[:-1]] == [tuple(number.cut(level)) for level in alpha[:-1]]
    assert rows[-1] == [1.0]
