"""Fuzzy sets that are no numbers, arithmetic and pictures."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from alphacut.fuzzy import Crisp, Interval, Reduced, Triangular, apply, levels, propagate
from alphacut.fuzzy.plots import FuzzySet, figure_36, figure_37, plot_membership
from alphacut.fuzzy.sets.arithmetic import DependencyError

TWO_HUMPS = FuzzySet((0, 1, 2, 3, 4), (0, 0.8, 0.3, 0.6, 0))
triangles = (
    st.lists(st.floats(0.1, 100), min_size=3, max_size=3).map(sorted).map(lambda v: Triangular(*v))
)


def test_cuts_of_a_non_convex_set_are_several_intervals():
    low, high = TWO_HUMPS.cut(0.5)
    assert (low.lower, low.upper, high.lower, high.upper) == pytest.approx(
        (0.625, 1.6, 8 / 3, 3 + 1 / 6)
    )
    assert len(TWO_HUMPS.cut(0.2)) == 1
    assert TWO_HUMPS.cut(0.9) == ()
    assert TWO_HUMPS.height == 0.8
    assert not TWO_HUMPS.convex


@settings(deadline=None)
@given(st.floats(0.01, 1.0), st.floats(-1, 5))
def test_a_point_is_in_a_cut_exactly_if_its_grade_reaches_it(alpha, x):
    inside = any(cut.lower - 1e-9 <= x <= cut.upper + 1e-9 for cut in TWO_HUMPS.cut(alpha))
    grade = float(TWO_HUMPS.membership(x))
    if abs(grade - alpha) > 1e-6:
        assert inside == (grade >= alpha)


def test_sets_that_are_no_numbers_are_refused_for_arithmetic_with_the_reason():
    with pytest.raises(
        ValueError, match=r"subnormal and cannot be computed with: its highest grade is 0.8"
    ):
        TWO_HUMPS + Crisp(1.0)
    hollow = FuzzySet((0, 1, 2, 3, 4), (0, 1, 0.3, 1, 0))
    with pytest.raises(
        ValueError, match="not convex and cannot be computed with: its grades fall and rise again"
    ):
        1.0 * hollow
    with pytest.raises(ValueError, match=r"take its to_number\(\)"):
        FuzzySet((0, 1, 2), (0, 1, 0)) + 1.0


def test_convex_normal_sets_become_numbers():
    number = FuzzySet((0, 1, 2, 3), (0.2, 1, 1, 0)).to_number()
    assert number.cut(0) == (0, 3)
    assert number.cut(0.2) == pytest.approx((0, 2.8))
    assert number.cut(1) == (1, 2)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: FuzzySet((0,), (1,)), "1 points and 1 grades"),
        (lambda: FuzzySet((1, 0), (0, 1)), "must be finite and not fall"),
        (lambda: FuzzySet((0, 1), (0, 1.2)), r"must lie in \[0, 1\]"),
        (lambda: FuzzySet((0, 1), (0, 1)).cut(0), r"α of a cut is 0; it must lie in \(0, 1\]"),
    ],
)
def test_wrong_sets_are_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()


@settings(deadline=None)
@given(triangles, triangles)
def test_arithmetic_agrees_with_the_corners_of_the_cuts(a, b):
    for expression, function in (
        (a + b, lambda a, b: a + b),
        (a - b, lambda a, b: a - b),
        (a * b, lambda a, b: a * b),
        (a / b, lambda a, b: a / b),
        (2 - a * b, lambda a, b: 2 - a * b),
        ((a**2 + 1) / b, lambda a, b: (a**2 + 1) / b),
    ):
        lower, upper = propagate(function, {"a": a, "b": b}, Reduced(), alpha=levels(3)).bounds()
        cuts = np.array([expression.cut(level) for level in levels(3)])
        np.testing.assert_allclose(cuts[:, 0], lower, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(cuts[:, 1], upper, rtol=1e-9, atol=1e-9)


def test_powers_and_functions_know_where_they_turn():
    x = Triangular(-1.0, 0.5, 2.0)
    assert (x**2).cut(0) == (0, 4)
    assert (x**3).cut(0) == (-1, 8)
    assert (-x).cut(0) == (-2, 1)
    assert apply(np.exp, x).cut(1) == (math.exp(0.5),) * 2
    assert apply(np.cos, Interval(0.0, 1.0), falls=True).cut(0) == (math.cos(1), 1)
    assert float((x**3).membership(0.125)) == pytest.approx(1)


def test_the_dependency_problem_is_named():
    x, y = Triangular(1, 2, 3), Triangular(1, 2, 3)
    with pytest.raises(
        DependencyError,
        match=r"Triangular\(lower=1, modal=2, upper=3\) occurs on both sides of .*use propagate",
    ):
        x - x
    with pytest.raises(DependencyError, match="use propagate on the whole expression"):
        (x + y) / (x * 2)
    assert (x - y).cut(0) == (-2, 2)
    lower, upper = propagate(lambda x: x - x, {"x": x}).bounds()
    assert (lower == 0).all()
    assert (upper == 0).all()


def test_division_by_zero_and_broken_powers_are_refused():
    with pytest.raises(ValueError, match="support that holds 0; its quotient has no bounds"):
        1 / Triangular(-1, 0.5, 2)
    with pytest.raises(ValueError, match=r"exponent is 0\.5; it must be a whole number"):
        Triangular(1, 2, 3) ** 0.5


def test_functions_that_turn_and_numbers_too_large_are_refused():
    with pytest.raises(
        ValueError,
        match=(
            r"sin does not rise throughout \[0\.0, 3\.0\]; give falls=True, or use propagate if it"
            r" turns"
        ),
    ):
        apply(np.sin, Triangular(0, 1, 3))
    with pytest.raises(ValueError, match="exp does not fall throughout"):
        apply(np.exp, Triangular(0, 1, 3), falls=True)
    large = Triangular(1e200, 2e200, 3e200) * Triangular(1e200, 2e200, 4e200)
    with pytest.raises(ValueError, match=r"at α = 1 is \[inf, inf\]: the numbers are too large"):
        large.cut(1)


def test_pictures_show_every_set_with_its_name_and_axis():
    figure = figure_36()
    axes = figure.axes[0]
    assert [text.get_text() for text in axes.get_legend().get_texts()][:2] == [
        "crisp number",
        "crisp interval",
    ]
    assert len(axes.lines) == 5
    assert axes.get_ylabel() == "membership μ"
    cuts = figure_37().axes[0]
    assert len(cuts.lines) == 1 + 6
    plot_membership(cuts, {"E": Triangular(75, 80, 85)}, quantity="E in GPa")
    assert cuts.get_xlabel() == "E in GPa"
