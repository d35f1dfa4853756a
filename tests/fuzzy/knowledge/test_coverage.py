"""Fuzzy numbers from data hold what they claim, as often as they say."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from alphacut.fuzzy import RefusedError, from_data, propagate
from alphacut.fuzzy.knowledge.order_statistics import windows
from benchmarks.fuzzy.coverage import LAWS, held, ways
from tests.refused import refuses

SEVEN = [2.01, 1.96, 2.03, 1.88, 2.10, 1.99, 2.05]


OFTEN = ("normal", "uniform", "skewed beta", "Poisson 2", "coin 0.1")
"""Laws that few samples show always: a named one, bounded ones and discrete ones."""


@pytest.mark.parametrize(
    ("law", "samples", "far"),
    [
        *((law, 100, 6.0) for law in OFTEN),
        *(pytest.param(law, 1500, 4.5, marks=pytest.mark.slow) for law in LAWS),
    ],
)
def test_cuts_hold_what_they_claim(law, samples, far, rng):
    """So many standard errors below are what chance does not explain in a thousand comparisons."""
    for n in (1, 5, 10, 30) if samples > 1000 else (1, 8):
        for claim, way, options in ways(law, n):
            if "make" in options:  # a recipe that claims too much
                continue
            score, excess = held(law, claim, n, samples, rng, **options)
            assert score.min() > -far, (claim, n, way)
            if claim == "next value" and law not in ("Poisson 2", "coin 0.1"):
                assert excess.max() < 1 / (n + 1) + far * 0.5 / np.sqrt(samples)


@settings(deadline=None, max_examples=60)
@given(st.integers(1, 60), st.sampled_from([None, 0.5, 0.05, 0.9, 0.99]), st.data())
def test_levels_are_the_exact_probability_outside(n, quantile, data):
    rows = windows(n, quantile, data.draw(st.tuples(st.booleans(), st.booleans())))
    gaps = np.arange(n + 1)
    even = np.full(n + 1, 1 / (n + 1))
    mass = even if quantile is None else stats.binom.pmf(gaps, n, quantile)
    for level, low, high in zip(rows.level, rows.low, rows.high, strict=True):
        assert level == pytest.approx(1 - mass[low : high + 1].sum(), abs=1e-12)
    assert (np.diff(rows.low) >= 0).all()
    assert (np.diff(rows.high) <= 0).all()


@pytest.mark.parametrize(
    ("claim", "level"),
    [("next value", 2 / 8), ("median", 2**-6), ("quantile 0.9", 0.9**7 + 0.1**7)],
)
def test_the_least_level_that_values_decide(claim, level):
    number = from_data(SEVEN, claim)
    assert number.decided == pytest.approx(level, rel=1e-12)
    assert number.cut(number.decided) == (min(SEVEN), max(SEVEN))
    with pytest.raises(RefusedError) as refused:
        number.cut(0.0)
    assert f"levels from {level:.4g} on" in refused.value.allowed
    assert "give bounds=" in refused.value.cure


def test_bounds_fill_in_what_the_values_do_not_decide():
    number = from_data(SEVEN, "next value", bounds=(1, 3))
    assert number.support == (1, 3)
    assert number.cut(0.25) == (1.88, 2.10)
    assert number.cut(np.nextafter(0.25, 0)) == (1.88, 3)
    assert number.nominal == 2.01
    assert number.membership([0.5, 1.5, 1.9, 2.01]) == pytest.approx([0, 1 / 8, 3 / 8, 1])


def test_the_mean_by_student_and_within_bounds():
    bounded = from_data(SEVEN, "mean", bounds=(0, 4))
    normal = from_data(SEVEN, "mean", law="normal", bounds=(0, 4))
    assert normal.cut(0.05).width < bounded.cut(0.05).width < 4
    low, high = stats.t.interval(0.95, 6, np.mean(SEVEN), stats.sem(SEVEN))
    assert normal.cut(0.05) == pytest.approx((low, high))
    assert bounded.cut(0.0) == (0, 4)


@pytest.mark.parametrize("unit", [2.0**-1000, 2.0**1000])
def test_the_mean_of_normal_values_scales_with_their_unit(unit):
    """Squares of such values are beyond floats: the cuts were points, or not finite."""
    normal = from_data(SEVEN, "mean", law="normal")
    scaled = from_data([unit * value for value in SEVEN], "mean", law="normal")
    for alpha in (1e-9, 0.05, 0.5, 1.0):
        cut = normal.cut(alpha)
        assert scaled.cut(alpha) == (unit * cut.lower, unit * cut.upper)


@pytest.mark.parametrize("values", [[True, 0.5], [(1.0, 2.0), 0.5], [np.True_, 1.0], [10**400]])
def test_truth_values_pairs_and_numbers_beyond_floats_are_no_measurements(values):
    with refuses("value 1"):
        from_data(values, "next value")


@pytest.mark.parametrize("values", [5, None, {1.0, 2.0}, iter([1.0, 2.0])])
def test_what_has_no_order_is_no_list_of_measurements(values):
    with refuses("values"):
        from_data(values, "next value")


def test_a_column_of_pandas_is_a_list_of_measurements_and_of_levels():
    column = pd.DataFrame({"E": [3.0, 1.0, 2.0]})["E"]
    number = from_data(column, "median", bounds=(0, 9))
    assert number.cut(0.75) == from_data([1.0, 2.0, 3.0], "median", bounds=(0, 9)).cut(0.75)
    for alpha in (column.sort_values() / 3, (k / 3 for k in (1, 2, 3))):
        found = propagate(lambda x: x, {"x": number}, alpha=alpha)
        assert found.alpha.tolist() == [1 / 3, 2 / 3, 1.0]


@pytest.mark.parametrize("bounds", [5, (1,), (0, 3, 9), (3, 0)])
def test_bounds_are_two(bounds):
    with refuses("bounds"):
        from_data([1.0, 2.0], "median", bounds=bounds)
