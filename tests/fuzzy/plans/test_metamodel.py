"""The metamodel of the bounds and interval quasi-Monte Carlo."""

import numpy as np
import pytest
from scipy.stats import norm

from alphacut.fuzzy import (
    BranchAndBound,
    General,
    IntervalQuasiMonteCarlo,
    Metamodel,
    Optimisation,
    RandomInput,
    Reduced,
    Trapezoidal,
    Triangular,
    levels,
    propagate,
)
from alphacut.fuzzy.campaign.call import Call
from alphacut.fuzzy.campaign.campaign import Campaign
from alphacut.fuzzy.samples.nature import Nature
from alphacut.fuzzy.sets.boxes import Domain

INPUTS = {"a": Triangular(0.0, 0.4, 1.0), "b": Triangular(1.0, 1.5, 3.0)}


def rising(a, b):
    return {"y": np.exp(a) * b, "z": a - b**2}


def test_predicted_bounds_lie_within_their_stated_error():
    true = propagate(rising, INPUTS, Reduced(), vectorised=True)
    result = propagate(rising, INPUTS, Metamodel(), vectorised=True)
    assert result.nature is Nature.SEARCHED
    assert (np.abs(result.lower - true.lower) <= result.error).all()
    assert (np.abs(result.upper - true.upper) <= result.error).all()
    assert (result.error < 0.02 * (true.upper[0] - true.lower[0])).all()
    assert "of held-out boxes by up to" in result.notes[0]
    assert "Reduced has the corners alone, widened by the samples of other boxes" in result.notes[2]


def test_more_boxes_make_it_better():
    errors = [
        propagate(rising, INPUTS, Metamodel(boxes=boxes), vectorised=True).error.max()
        for boxes in (20, 80, 320)
    ]
    assert errors[0] > 2 * errors[1] > 4 * errors[2]


def test_a_trained_metamodel_serves_other_inputs_without_a_run():
    calls = []

    def counted(a, b):
        calls.append(len(np.atleast_1d(a)))
        return rising(a, b)

    campaign = Campaign(Call(counted, ("a", "b"), vectorised=True))
    trained = Metamodel().train(campaign, Domain(INPUTS, levels(4)))
    spent = sum(calls)
    other = {"a": Trapezoidal(0.1, 0.2, 0.5, 0.9), "b": Triangular(1.2, 2.0, 2.5)}
    found = trained.bounds(Domain(other, levels(4)))
    assert sum(calls) == spent == trained.runs
    true = propagate(rising, other, Reduced(), vectorised=True)
    assert (np.abs(found.lower - true.lower) <= found.error).all()
    with pytest.raises(
        ValueError,
        match=(
            r"leave the support that the metamodel was trained on, \[0.0, 1.0\] to \[1.0, 3.0\];"
            r" train it anew"
        ),
    ):
        trained.bounds(Domain(INPUTS | {"a": Triangular(0, 1, 2)}, levels(4)))


def test_it_learns_from_a_teacher_that_sees_optima_inside():
    def hump(x):
        return -((x - 0.3) ** 2)

    inputs = {"x": Triangular(-1.0, 0.0, 1.0)}
    taught = Metamodel(boxes=100, teacher=Optimisation(starts=1, look=4))
    corners, seen, true = (
        propagate(hump, inputs, plan, alpha=levels(1), vectorised=True)
        for plan in (Metamodel(boxes=100), taught, Optimisation())
    )
    for found in (corners, seen):
        assert (np.abs(found.upper - true.upper) <= found.error).all()
    assert np.abs(seen.upper - true.upper).max() < 0.02


INSIDE = {  # with optima inside the box, and their true bounds there
    "bowl": (lambda x, y: (x - 0.37) ** 2 + (y + 0.21) ** 2, (0.0, 1.37**2 + 1.71**2)),
    "kink": (lambda x, y: abs(x - 0.3) + abs(y - 0.6) / 2, (0.0, 1.3 + 0.8)),
    "peak": (lambda x, y: 1 / (1 + 25 * (x - 0.2) ** 2 + 10 * (y - 0.4) ** 2), (1 / 56.6, 1.0)),
    "saddle": (lambda x, y: x**2 - y**2, (-2.25, 1.0)),
}


@pytest.mark.parametrize("name", INSIDE)
def test_samples_of_other_boxes_show_what_the_corners_of_one_miss(name):
    function, (lower, upper) = INSIDE[name]
    inputs = {"x": Triangular(-1, 0.1, 1), "y": Triangular(-1, 0.2, 1.5)}
    found = propagate(function, inputs, Metamodel(), alpha=[0, 1], vectorised=True)
    assert found.nature is Nature.SEARCHED
    assert abs(found.lower[0, 0] - lower) <= found.error[0, 0]
    assert abs(found.upper[0, 0] - upper) <= found.error[0, 0]


def test_bounds_of_a_proved_teacher_are_estimated():
    function = lambda x: x * (1 - x)  # noqa: E731
    plan = Metamodel(20, 5, teacher=BranchAndBound(function))
    found = propagate(function, {"x": Triangular(0, 0.4, 1)}, plan, alpha=[0, 1])
    assert found.nature is Nature.ESTIMATED
    assert abs(found.upper[0, 0] - 0.25) <= found.error[0, 0]


def normal(u, m, s):
    return norm.ppf(u, m, s)


MEAN, SPREAD = Triangular(9.0, 10.0, 12.0), Triangular(1.0, 2.0, 2.5)


@pytest.fixture(scope="module")
def response():
    random = {"x": RandomInput(normal, {"m": MEAN, "s": SPREAD})}
    plan = IntervalQuasiMonteCarlo(points=1024)
    return plan.run(
        lambda x, b: x + b, random, {"b": Triangular(-1, 0, 1)}, alpha=levels(2), vectorised=True
    )


def test_bounds_of_the_mean_have_their_closed_form(response):
    lower, upper = response.mean()
    for level, alpha in enumerate(levels(2)):
        m, s, b = MEAN.cut(alpha), SPREAD.cut(alpha), Triangular(-1, 0, 1).cut(alpha)
        # each quantile takes the spread that suits it: E max(s z) = s̄ E z⁺ − s̲ E z⁻
        half = s.width / np.sqrt(2 * np.pi)
        assert lower[level] == pytest.approx(m.lower + b.lower - half, abs=5e-3)
        assert upper[level] == pytest.approx(m.upper + b.upper + half, abs=5e-3)


def test_p_box_quantiles_and_exceedance_agree(response):
    at = np.array([8.0, 11.0])
    lower, upper = response.p_box(at)
    for level, alpha in enumerate(levels(2)):
        m, s, b = MEAN.cut(alpha), SPREAD.cut(alpha), Triangular(-1, 0, 1).cut(alpha)
        corners = np.array(
            [norm.cdf(at, mean + shift, spread) for mean in m for spread in s for shift in b]
        )
        np.testing.assert_allclose(lower[level], corners.min(axis=0), atol=3e-3)
        np.testing.assert_allclose(upper[level], corners.max(axis=0), atol=3e-3)
    over = response.exceedance(at)
    np.testing.assert_allclose(over[0], 1 - upper)
    least, most = response.quantile([0.5])
    assert (least[0] < least[-1]).all()
    assert most[-1, 0] == pytest.approx(10.0, abs=0.02)
    with pytest.raises(ValueError, match="no output 'w'; there are y"):
        response.mean("w")


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Metamodel(boxes=1), "metamodel has 1 boxes and 50 held out"),
        (lambda: IntervalQuasiMonteCarlo(points=0), "quasi-random points is 0"),
        (
            lambda: propagate(lambda x: x, {"x": 1.0}, Metamodel()),
            "no input has a width, so there is nothing to train",
        ),
        (
            lambda: IntervalQuasiMonteCarlo().run(
                abs, {"x": RandomInput(normal, {"m": MEAN})}, {"x": MEAN}, alpha=levels(1)
            ),
            "x is named among the random and the fuzzy inputs",
        ),
    ],
)
def test_wrong_plans_are_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_any_plan_can_bound_the_points():
    random = {"x": RandomInput(normal, {"m": MEAN, "s": SPREAD})}
    plans = [IntervalQuasiMonteCarlo(points=16, plan=plan) for plan in (Reduced(), General())]
    by_corners, by_grid = (
        plan.run(lambda x: (x - 10) ** 2, random, {}, alpha=levels(2)) for plan in plans
    )
    assert (by_grid.lower <= by_corners.lower).all()
    assert (by_grid.lower < by_corners.lower).any()
