"""Random and fuzzy at once, shares of width, interaction."""

import numpy as np
import pytest
from scipy.stats import norm

from alphacut.fuzzy import (
    Chebyshev,
    Crisp,
    Ellipsoidal,
    Extended,
    General,
    Interval,
    IntervalQuasiMonteCarlo,
    Known,
    Linear,
    MonteCarlo,
    Optimisation,
    QuasiMonteCarlo,
    RandomInput,
    Reduced,
    Signed,
    Triangular,
    levels,
    propagate,
    width_shares,
)
from alphacut.fuzzy.random_response import RandomResponse
from alphacut.fuzzy.samples.nature import Nature

MEAN, SPREAD = Triangular(9.0, 10.0, 12.0), Triangular(1.0, 2.0, 2.5)
NODES = np.linspace(-4, 4, 41)


@pytest.fixture(scope="module")
def response():
    """A normal response with fuzzy mean and spread."""
    result = propagate(
        lambda m, s: {"theta": NODES, "y": m + s * NODES}, {"m": MEAN, "s": SPREAD}, Reduced()
    )
    return RandomResponse.from_curves(result, "y", theta="theta", quantile=norm.ppf)


def cuts():
    return [(MEAN.cut(level), SPREAD.cut(level)) for level in levels(4)]


def test_fuzzy_mean_is_the_fuzzy_parameter(response):
    lower, upper = response.mean().bounds("mean[0]")
    np.testing.assert_allclose(lower, [mean.lower for mean, _ in cuts()], rtol=1e-12)
    np.testing.assert_allclose(upper, [mean.upper for mean, _ in cuts()], rtol=1e-12)


@pytest.mark.parametrize("probability", [0.05, 0.5, 0.95])
def test_fuzzy_quantiles(response, probability):
    lower, upper = response.quantile(probability).bounds("quantile[0]")
    z = norm.ppf(probability)
    corners = [[m + s * z for m in mean for s in spread] for mean, spread in cuts()]
    np.testing.assert_allclose(lower, np.min(corners, axis=1), rtol=2e-4)
    np.testing.assert_allclose(upper, np.max(corners, axis=1), rtol=2e-4)


def test_p_box_and_exceedance_hold_every_distribution_of_the_cut(response):
    at = np.array([8.0, 10.0, 13.0])
    box, over = response.p_box(at), response.exceedance(at)
    np.testing.assert_allclose(over.lower, 1 - box.upper, atol=1e-12)
    for level, (mean, spread) in enumerate(cuts()):
        corners = np.array([norm.cdf(at, m, s) for m in mean for s in spread])
        np.testing.assert_allclose(box.lower[level], corners.min(axis=0), atol=1e-3)
        np.testing.assert_allclose(box.upper[level], corners.max(axis=0), atol=1e-3)
    assert response.p_box(-100.0).upper.max() == 0
    assert response.p_box(100.0).lower.min() == 1


def test_probabilities_must_be_some(response):
    with pytest.raises(
        ValueError, match=r"probability of a quantile is \[1.0\]; it must lie inside \(0, 1\)"
    ):
        response.quantile(1.0)


def test_shares_of_width():
    inputs = {"a": Triangular(-1, 0, 1), "b": Triangular(-2, 0, 2), "c": Triangular(0, 1, 2)}

    def bounds(fuzzy):
        return propagate(lambda a, b, c: a + b + 0 * c, fuzzy, Reduced()).bounds()

    found = width_shares(bounds, inputs)
    assert found.names == ("a", "b", "c")
    np.testing.assert_allclose(
        found.share[:, :-1], np.array([[1 / 3] * 4, [2 / 3] * 4, [0] * 4]), atol=1e-12
    )
    assert (found.share[:, -1] == 0).all()
    grouped = width_shares(bounds, inputs, groups={"both": ("a", "b")})
    np.testing.assert_allclose(grouped.lost[0], grouped.width)
    with pytest.raises(ValueError, match="groups name d; the fuzzy inputs are a, b, c"):
        width_shares(bounds, inputs, groups={"x": ("d",)})


SQUARE = {"a": Interval(0.0, 1.0), "b": Interval(0.0, 1.0)}
SEARCHING = (Optimisation(), Chebyshev(), Chebyshev(confirm=False))


@pytest.mark.parametrize("plan", SEARCHING)
def test_linear_interaction_cuts_the_box(plan):
    result = propagate(
        lambda a, b: a * b, SQUARE, plan, alpha=[0.0], interactions=[Linear({"a": 1, "b": 1}, 1.2)]
    )
    assert result.bounds()[1][0] == pytest.approx(0.36, abs=1e-6)
    assert result.upper_at[0, 0] == pytest.approx([0.6, 0.6], abs=1e-3)


@pytest.mark.parametrize("plan", SEARCHING)
@pytest.mark.parametrize("scale", [1e-13, 1e13])
def test_the_units_of_inputs_under_an_interaction_do_not_matter(plan, scale):
    inputs = {"a": Interval(0.0, scale), "b": Interval(0.0, scale)}
    result = propagate(
        lambda a, b: a + 2 * b,
        inputs,
        plan,
        alpha=[0.0],
        interactions=[Linear({"a": 1, "b": 1}, 1.2 * scale)],
    )
    assert result.bounds()[1][0] == pytest.approx(2.2 * scale, rel=1e-6)


@pytest.mark.parametrize("plan", SEARCHING)
@pytest.mark.parametrize("correlation", [0.0, 0.6, -0.6])
def test_ellipsoidal_interaction_of_a_sum(plan, correlation):
    inputs = {"a": Triangular(-1.0, 0.0, 1.0), "b": Triangular(-1.0, 0.0, 1.0)}
    interaction = Ellipsoidal({("a", "b"): correlation})
    result = propagate(lambda a, b: a + b, inputs, plan, interactions=[interaction])
    # support function of the ellipse
    expected = (1 - np.array(levels(4))) * np.sqrt(2 + 2 * correlation)
    np.testing.assert_allclose(result.bounds()[1], expected, atol=2e-5)
    np.testing.assert_allclose(result.bounds()[0], -expected, atol=2e-5)


@pytest.mark.parametrize("plan", [MonteCarlo(400), QuasiMonteCarlo(400)])
def test_samples_fulfil_the_interactions(plan):
    inputs = {"a": Triangular(-1.0, 0.0, 1.0), "b": Triangular(-1.0, 0.0, 1.0)}
    result = propagate(
        lambda a, b: a + b, inputs, plan, interactions=[Ellipsoidal(), Linear({"a": 1}, 0.5)]
    )
    assert (result.points[:, 0] <= 0.5 + 1e-9).all()
    assert (np.hypot(*result.points.T) <= 1 + 1e-9).all()
    assert 0.9 < result.bounds()[1][0] < 0.5 + np.sqrt(0.75)


@pytest.mark.parametrize(
    "plan", [General(), Reduced(), Extended(), Signed(), Optimisation("direct")]
)
def test_plans_that_cannot_respect_interactions_refuse(plan):
    with pytest.raises(
        ValueError,
        match=r"plan cannot respect interactions between inputs \(here: Linear\); take MonteCarlo",
    ):
        propagate(lambda a, b: a, SQUARE, plan, interactions=[Linear({"a": 1}, 0.5)])


def test_wrong_interactions_are_refused():
    with pytest.raises(ValueError, match="linear interaction names c; the fuzzy inputs are a, b"):
        propagate(lambda a, b: a, SQUARE, MonteCarlo(), interactions=[Linear({"c": 1}, 0.5)])
    with pytest.raises(ValueError, match="correlation of a and b is 1; it must lie inside"):
        Ellipsoidal({("a", "b"): 1.0})
    with pytest.raises(ValueError, match="names an input that is not among"):
        Ellipsoidal({("a", "b"): 0.1}, among=("a",))
    with pytest.raises(ValueError, match=r"weights \{'a': 1\} and bound nan; all must be finite"):
        Linear({"a": 1}, np.nan)
    three = SQUARE | {"c": Crisp(1.0)}
    impossible = Ellipsoidal({("a", "b"): 0.9, ("b", "c"): 0.9, ("a", "c"): -0.9})
    with pytest.raises(ValueError, match="contradict each other"):
        propagate(lambda a, b, c: a, three, MonteCarlo(), interactions=[impossible])
    with pytest.raises(
        ValueError,
        match="no sample lies in the cut at α = 0: its interactions leave too little room",
    ):
        propagate(lambda a, b: a, SQUARE, MonteCarlo(10), interactions=[Linear({"a": 1}, -0.5)])
    with pytest.raises(ValueError, match="no point of the cut at α = 1 fulfils its interactions"):
        propagate(lambda a, b: a, SQUARE, Optimisation(), interactions=[Linear({"a": 1}, -0.5)])


def test_a_response_of_random_inputs_says_what_its_bounds_are_worth():
    random = {"r": RandomInput(lambda u, m: m + u, {"m": Triangular(-0.6, -0.5, -0.4)})}
    plan = IntervalQuasiMonteCarlo(8)
    turning = plan.run(lambda r, x: r + x**2, random, {"x": Interval(-1, 1)}, alpha=levels(1))
    assert turning.nature is Nature.INNER
    assert turning.notes[-1].startswith(
        "the bounds are inner: too narrow where the model turns between the samples"
    )
    rising = plan.run(
        lambda r, x: r + x,
        random,
        {"x": Interval(-1, 1)},
        alpha=levels(1),
        known=Known({"r": 1, "x": 1}),
    )
    assert (rising.nature, rising.notes) == (Nature.GUARANTEED, ())
