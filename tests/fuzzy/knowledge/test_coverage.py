"""Fuzzy numbers from data hold what they claim, as often as they say; the usual recipes do not."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from alphacut.fuzzy.knowledge.from_data import from_data
from alphacut.fuzzy.knowledge.order_statistics import least_alpha, values_needed, windows
from benchmarks.fuzzy.coverage import SOURCES, measure

SEVEN = [2.01, 1.96, 2.03, 1.88, 2.10, 1.99, 2.05]


def source(name):
    return next(one for one in SOURCES if one.name == name)


@pytest.mark.parametrize("name", ["normal", "Cauchy", "two peaks", "coin 0.1", "constant"])
@pytest.mark.parametrize("n", [1, 5, 30])
def test_coverage_is_as_claimed_and_the_recipes_are_not(name, n):
    rows = measure(source(name), n, 300, np.random.default_rng(n))
    own = [row for row in rows if row.method.startswith("from_data")]
    assert own
    assert not [row for row in own if not row.holds]
    if name in ("normal", "Cauchy") and n <= 5:  # the usual recipes are too narrow for few values
        assert not any(row.holds for row in rows if row not in own)


@pytest.mark.slow
@pytest.mark.parametrize("law", SOURCES, ids=lambda law: law.name)
@pytest.mark.parametrize("n", [1, 5, 10, 30, 200])
def test_coverage_over_all_laws(law, n):
    rows = measure(law, n, 1000, np.random.default_rng(n))
    assert not [row for row in rows if row.method.startswith("from_data") and not row.holds]


def test_a_cut_one_rank_too_narrow_is_seen():
    rng = np.random.default_rng(1)
    data = np.sort(rng.normal(size=(2000, 10)), axis=1)
    held = [
        low <= x <= high
        for low, high, x in zip(data[:, 1], data[:, 8], rng.normal(size=2000), strict=True)
    ]
    assert np.mean(held) < 9 / 11 - 4 * np.sqrt(
        9 * 2 / 11**2 / 2000
    )  # what the widest cut of ten values claims


@settings(deadline=None, max_examples=60)
@given(
    st.integers(1, 60),
    st.sampled_from([None, 0.5, 0.05, 0.9, 0.99]),
    st.sampled_from(["both", "upper", "lower"]),
    st.data(),
)
def test_levels_are_the_exact_probability_outside(n, quantile, side, data):
    found = windows(n, quantile, side, data.draw(st.tuples(st.booleans(), st.booleans())))
    mass = (
        np.full(n + 1, 1 / (n + 1))
        if quantile is None
        else stats.binom.pmf(np.arange(n + 1), n, quantile)
    )
    for level, low, high in zip(found.level, found.low, found.high, strict=True):
        assert level == pytest.approx(1 - mass[low : high + 1].sum(), abs=1e-12)
    assert (np.diff(found.low) >= 0).all()
    assert (np.diff(found.high) <= 0).all()


@pytest.mark.parametrize(("n", "claim", "q"), [(5, "median", 0.5), (4, "quantile 0.8", 0.8)])
def test_a_drawn_number_makes_the_coverage_exact(n, claim, q):
    rng = np.random.default_rng()
    data, alpha, truth = rng.random((4000, n)), rng.uniform(0.02, 0.98, 4000), q
    cuts = [
        from_data(row, claim, bounds=(0, 1), rng=rng).cut(a)
        for row, a in zip(data, alpha, strict=True)
    ]
    held = np.array([low <= truth <= high for low, high in cuts])
    assert abs((held - (1 - alpha)).sum()) < 4.5 * np.sqrt((alpha * (1 - alpha)).sum())
    always = [from_data(row, claim, bounds=(0, 1)).cut(0.55) for row in data[:500]]
    above = np.mean([low <= truth <= high for low, high in always]) - 0.45
    assert above > 0.1  # without it by a binomial probability, the reason for the option


def test_a_drawn_number_is_refused_where_there_is_nothing_to_draw():
    with pytest.raises(ValueError, match="rng is given, but a mean or a named law"):
        from_data(SEVEN, "mean", law="normal", rng=1)
    with pytest.raises(ValueError, match="rng is 'dice'; it must be a NumPy random generator"):
        from_data(SEVEN, "median", rng="dice")
    assert "random number drawn apart" in str(from_data(SEVEN, "median", rng=3).claim)


@pytest.mark.parametrize(
    ("claim", "side", "level"),
    [
        ("next value", "both", 2 / 8),
        ("median", "both", 2**-6),
        ("quantile 0.9", "both", 0.9**7 + 0.1**7),
    ],
)
def test_the_least_level_that_values_decide(claim, side, level):
    number = from_data(SEVEN, claim, side=side)
    assert number.decided == pytest.approx(level, rel=1e-12)
    assert number.cut(number.decided) == (min(SEVEN), max(SEVEN))
    with pytest.raises(
        ValueError,
        match=rf"decide the cuts of the {claim} from α = {level:.4g} on, not at α = 0: give bounds",
    ):
        number.support  # noqa: B018


def test_one_side_needs_half_of_it():
    assert from_data(SEVEN, "next value", side="upper", bounds=(0, None)).decided == 1 / 8
    assert least_alpha(7, side="upper") == 1 / 8
    assert from_data(SEVEN, "next value", bounds=(0, None)).decided == 1 / 8
    with pytest.raises(ValueError, match="the other end needs the lower physical bound"):
        from_data(SEVEN, "next value", side="upper")


@pytest.mark.parametrize(
    ("quantile", "side", "needed"),
    [(None, "both", 39), (None, "upper", 19), (0.5, "both", 6), (0.95, "upper", 59)],
)
def test_the_number_of_values_that_would_do(quantile, side, needed):
    assert values_needed(0.05, quantile, side) == needed
    assert least_alpha(needed, quantile, side) <= 0.05 < least_alpha(needed - 1, quantile, side)


def test_the_message_names_the_number_that_would_do():
    with pytest.raises(
        ValueError,
        match=r"enough without bounds would be 19 values for α = 0.1, 39 values for α = 0.05",
    ):
        from_data(SEVEN, "next value").cut(0.05)


def test_bounds_fill_in_what_the_values_do_not_decide():
    number = from_data(SEVEN, "next value", bounds=(1, 3))
    assert number.support == (1, 3)
    assert number.cut(0.25) == (1.88, 2.10)
    assert number.cut(np.nextafter(0.25, 0)) == (1.88, 3)
    assert number.modal == 2.01
    assert number.membership([0.5, 1.5, 1.9, 2.01]) == pytest.approx([0, 1 / 8, 3 / 8, 1])


def test_the_mean_needs_a_law_or_bounds():
    with pytest.raises(
        ValueError, match="no number of values decides a mean without a law or bounds"
    ):
        from_data(SEVEN, "mean")
    bounded, normal = (
        from_data(SEVEN, "mean", bounds=(0, 4)),
        from_data(SEVEN, "mean", law="normal", bounds=(0, 4)),
    )
    assert normal.cut(0.05).width < bounded.cut(0.05).width < 4
    low, high = stats.t.interval(0.95, 6, np.mean(SEVEN), stats.sem(SEVEN))
    assert normal.cut(0.05) == pytest.approx((low, high))
    assert bounded.cut(0.0) == (0, 4)


def test_the_bound_of_the_mean_is_no_wider_than_hoeffding():
    data = np.random.default_rng(3).random(50)
    for alpha in (0.01, 0.1, 0.5):
        reach = np.sqrt(np.log(2 / alpha) / 100)
        low, high = from_data(data, "mean", bounds=(0, 1)).cut(alpha)
        assert max(0, data.mean() - reach) <= low + 1e-12
        assert high <= min(1, data.mean() + reach) + 1e-12


@pytest.mark.parametrize("law", [None, "normal", "log-normal"])
@pytest.mark.parametrize("claim", ["next value", "median", "mean", "quantile 0.8"])
@settings(deadline=None, max_examples=12)
@given(seed=st.integers(0, 2**31))
def test_intervals_hold_the_cuts_of_all_values_inside(law, claim, seed):
    rng = np.random.default_rng(seed)
    middle = rng.uniform(3, 7, rng.integers(2, 9))
    half = rng.uniform(0, 1, len(middle))
    wide = from_data(
        np.column_stack([middle - half, middle + half]), claim, law=law, bounds=(1, 10)
    )
    inner = from_data(
        middle + half * rng.uniform(-1, 1, len(middle)), claim, law=law, bounds=(1, 10)
    )
    for alpha in (0.0, 0.1, 0.3, 0.5, 0.8):
        outer, own = wide.cut(alpha), inner.cut(alpha)
        assert outer.lower <= own.lower + 1e-9
        assert own.upper <= outer.upper + 1e-9


def test_censored_values_are_intervals_without_an_end():
    number = from_data([1.0, 2.0, (3.0, np.inf), (2.5, np.inf)], "next value", bounds=(0, None))
    with pytest.raises(ValueError, match="from α = 1 on"):
        number.cut(0.5)
    assert (
        from_data([1.0, 2.0, 2.2, 2.4, 2.5, 2.6, (3.0, np.inf)], "next value", bounds=(0, None))
        .cut(0.5)
        .upper
        == 2.6
    )
    assert from_data([1.0, 2.0, (3.0, np.inf)], "next value", bounds=(0, 9)).cut(0.5) == (1, 9)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: from_data([], "next value"), "there is no value"),
        (lambda: from_data([1, np.nan], "median"), "value 2 is nan; it must be a finite number"),
        (
            lambda: from_data([1, (3, 2)], "median"),
            r"value 2 is \[3.0, 2.0\]; it must be a finite number, or a pair",
        ),
        (lambda: from_data([1, "a"], "median"), "must be numbers, or pairs"),
        (lambda: from_data([[1, 2, 3]], "median"), "must be numbers, or pairs"),
        (
            lambda: from_data(SEVEN, "mode"),
            "the claim is 'mode'; it must be 'next value', 'mean', 'median' or 'quantile Q'",
        ),
        (lambda: from_data(SEVEN, "quantile 1.5"), "the claim is 'quantile 1.5'"),
        (
            lambda: from_data(SEVEN, "mean", law="gamma"),
            "the law is 'gamma'; it must be 'normal' or 'log-normal'",
        ),
        (lambda: from_data(SEVEN, "mean", side="left"), "the side is 'left'; it must be 'both'"),
        (
            lambda: from_data(SEVEN, "mean", bounds=(3, 2)),
            r"the bounds are \[3, 2\]; the lower one must be less",
        ),
        (lambda: from_data(SEVEN, "mean", bounds=(1, 2, 3)), r"they must be \(lower, upper\)"),
        (
            lambda: from_data(SEVEN, "mean", bounds=(2, 3)),
            r"the value 1.96 lies outside the bounds \[2, 3\]; widen them",
        ),
        (lambda: from_data([5], "mean", law="normal"), "a normal law needs 2 or more"),
        (
            lambda: from_data([5, 5, 5], "mean", law="normal"),
            "all 3 values are 5, which a normal law does not give: leave the law out, or",
        ),
        (
            lambda: from_data([-1, 5], "mean", law="log-normal"),
            "a value is -1; values of a log-normal law are positive",
        ),
        (
            lambda: from_data([1, (5, np.inf)], "mean", law="normal"),
            "a censored value has no other end",
        ),
        (lambda: from_data(SEVEN, "median", resolution=-1), "the resolution is -1"),
        (
            lambda: from_data([(-np.inf, np.inf)], "next value"),
            "the values decide no cut: give bounds",
        ),
        (lambda: values_needed(0), "no number of values decides the cut at 0"),
    ],
)
def test_bad_data_are_refused_with_the_cure(make, message):
    with pytest.raises(ValueError, match=message):
        make()
