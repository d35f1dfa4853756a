"""Bounds that are proved: enclosures hold every value and slope, branch and bound closes in from
outside.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from alphacut.fuzzy import (
    BranchAndBound,
    Interval,
    Known,
    Linear,
    Signed,
    Triangular,
    levels,
    propagate,
)
from alphacut.fuzzy.knowledge.enclosure import Enclosed, gradient_range
from alphacut.fuzzy.samples.nature import Nature
from tests.fuzzy.plans.test_plans import PROBLEMS, brute_force, random_problem

FUNCTIONS = {
    "polynomial": lambda x, y: 1 - 2 * x + x**2 * y - y**3 / 3,
    "quotient": lambda x, y: (x + 1) / (y**2 + 0.1) - 2 / (4 + x),
    "waves": lambda x, y: np.sin(3 * x) * np.cos(y - x) + np.tanh(x),
    "growth": lambda x, y: np.exp(-(x**2)) * np.log(y**2 + 1) + np.sqrt(x + 4) - (y + 5) ** 0.7,
    "powers": lambda x, y: (x - y) ** 4 + (y + 5) ** -2 + np.square(x) - np.power(y, 3),
}
ends = st.floats(-3, 3)


@pytest.mark.parametrize("name", FUNCTIONS)
@settings(deadline=None)
@given(a=ends, b=ends, c=ends, d=ends)
def test_enclosures_hold_values_and_slopes(name, a, b, c, d):
    function = FUNCTIONS[name]
    lower, upper = np.array([min(a, b), min(c, d)]), np.array([max(a, b), max(c, d)])
    found = Enclosed(function, ("x", "y"))(lower[None], upper[None])["y"]
    unit = np.array([[0, 0], [1, 1], [0, 1], [1, 0], [0.5, 0.5], [0.3, 0.9], [0.71, 0.13]])
    points = lower + unit * (upper - lower)
    values = function(*points.T)
    assert (values >= found.value[0] - 1e-12).all()
    assert (values <= found.value[1] + 1e-12).all()
    for i in range(2):
        step = 1e-6 * np.eye(2)[i]
        slopes = (function(*(points + step).T) - function(*(points - step).T)) / 2e-6
        slack = 1e-5 * (1 + np.abs(slopes))
        assert (slopes >= found.slope[0][i] - slack).all()
        assert (slopes <= found.slope[1][i] + slack).all()


def test_a_point_is_enclosed_to_round_off():
    point = np.array([[0.3, 0.7]])
    for function in FUNCTIONS.values():
        found = Enclosed(function, ("x", "y"))(point, point)["y"]
        assert 0 < found.value[1][0] - found.value[0][0] < 1e-13


@pytest.mark.parametrize("problem", PROBLEMS)
def test_branch_and_bound_proves_bounds_to_its_gap(problem):
    function, inputs = PROBLEMS[problem]
    result = propagate(function, inputs, BranchAndBound(function, tolerance=1e-3), vectorised=True)
    lower, upper = brute_force(function, inputs, levels(4), 61)
    assert result.nature is Nature.GUARANTEED
    assert (result.bounds()[0] <= lower).all()
    assert (result.bounds()[1] >= upper).all()
    span = result.upper[0, 0] - result.lower[0, 0]
    assert (result.error <= 2e-3 * span).all()
    result.number()  # the proved cuts are nested


def check_guarantee(seed):
    """Proved bounds hold a grid of values and are hardly wider."""
    function, inputs, _ = random_problem(np.random.default_rng(seed))
    alpha = (0.0, 0.5, 1.0)

    def named(**x):
        return function(*x.values())

    result = propagate(
        named, inputs, BranchAndBound(named, tolerance=3e-2), alpha=alpha, vectorised=True
    )
    lower, upper = brute_force(function, inputs, alpha, 15)
    assert (result.bounds()[0] <= lower).all(), seed
    assert (result.bounds()[1] >= upper).all(), seed
    allowed = 0.15 * (upper[0] - lower[0]) + 1e-9  # the grid is coarse
    assert (result.lower[:, 0] >= lower - allowed).all(), seed
    assert (result.upper[:, 0] <= upper + allowed).all(), seed


def test_no_guaranteed_bound_lies_inside_the_truth():
    for seed in range(3000, 3012):
        check_guarantee(seed)


@pytest.mark.slow
def test_no_guaranteed_bound_lies_inside_the_truth_of_a_thousand_problems():
    for seed in range(3000, 4000):
        check_guarantee(seed)


def test_a_spent_budget_widens_the_bounds_but_proves_them():
    function, inputs = PROBLEMS["ishigami"]
    wide = propagate(function, inputs, BranchAndBound(function, budget=50), vectorised=True)
    fine = propagate(function, inputs, BranchAndBound(function), vectorised=True)
    assert (wide.lower <= fine.lower + 1e-9).all()
    assert wide.error.max() > 10 * fine.error.max()
    assert wide.nature is Nature.GUARANTEED


def test_the_signed_plan_proves_signs_by_the_function_itself():
    def modulus(a2, a4, E):
        return np.sqrt(1 + a2) * E**0.2 / (1 + a4)

    inputs = {
        "a2": Triangular(0.001, 0.1, 0.3145),
        "a4": Triangular(0.001, 0.1692, 0.9975),
        "E": Triangular(75, 80, 85),
    }
    result = propagate(
        modulus,
        inputs,
        Signed(),
        known=Known(gradient_range=gradient_range(modulus, tuple(inputs))),
    )
    assert (result.runs, result.verification_runs, result.nature) == (9, 0, Nature.GUARANTEED)


def test_wrong_plans_are_refused():
    with pytest.raises(ValueError, match="tolerance and budget are 0 and 50000"):
        BranchAndBound(FUNCTIONS["waves"], tolerance=0)
    with pytest.raises(ValueError, match="BranchAndBound plan cannot respect interactions"):
        propagate(
            lambda x: x,
            {"x": Triangular(0, 1, 2)},
            BranchAndBound(lambda x: x),
            interactions=[Linear({"x": 1}, 1.0)],
        )


POSITIVE = {"x": Triangular(0, 1, 2), "y": Triangular(1, 2, 4)}


def late(x, y):
    """x y, but only below 3.9 in y: where the modal value, the corners and the middle of the
    support do not lie.
    """
    return np.where((np.asarray(y) > 3.5) & (np.asarray(y) < 4), -9.0, 0.0) + x * y


@pytest.mark.parametrize("model", [lambda x, y: x * y, lambda x, y: x + 1e-6 * y])
def test_another_function_than_the_model_proves_nothing(model):
    with pytest.raises(
        ValueError,
        match=(
            r"BranchAndBound gives output y = 1 where the model gives .*, at x = 1, y = 2: it must"
            r" be the model"
        ),
    ):
        propagate(model, POSITIVE, BranchAndBound(lambda x, y: x))


def test_a_model_that_differs_somewhere_is_seen_at_the_samples_that_are_run():
    with pytest.raises(ValueError, match=r"where the model gives .*: it must be the model itself"):
        propagate(
            late,
            {"x": Interval(1, 2), "y": Triangular(1, 2, 4)},
            BranchAndBound(lambda x, y: x * y),
            alpha=(0.0, 0.1),
        )


def test_outputs_that_the_function_has_not_are_named():
    with pytest.raises(
        ValueError, match="the function of BranchAndBound has no output z, as the model has"
    ):
        propagate(lambda x, y: {"z": x * y}, POSITIVE, BranchAndBound(lambda x, y: x * y))


@pytest.mark.parametrize(
    "function", [lambda x, y: [x * y, x - y], lambda x, y: {"v": np.array([x, y]), "w": x}]
)
def test_lists_are_enclosed_entry_by_entry(function):
    result = propagate(function, POSITIVE, BranchAndBound(function))
    assert result.nature is Nature.GUARANTEED
    reference = propagate(function, POSITIVE)
    assert result.outputs == reference.outputs
    np.testing.assert_allclose(result.upper, reference.upper, atol=2e-3)


def test_what_a_guarantee_rests_on_is_named_in_the_same_breath():
    def function(x, y):
        return x * y

    proved = propagate(function, POSITIVE, BranchAndBound(function))
    assert str(proved).startswith(
        "guaranteed bounds (given that the enclosed function is the model, as at all"
    )
    facts = Known(signs={"x": 1}, monotone=("y",), source="by theory")
    stated = propagate(function, POSITIVE, known=facts)
    assert stated.worth == (
        "bounds guaranteed: proved to hold the true range (given that the signs of x hold,"
        " by theory and the outputs are monotone in y, by theory)"
    )
    ranges = Known(gradient_range=gradient_range(function, ("x", "y")))
    signed = propagate(function, POSITIVE, Signed(), known=ranges)
    assert "given that the range of the gradient holds, as stated by the caller" in str(signed)
    assert "given" not in str(propagate(function, POSITIVE))
