"""Every method against brute force; natures, budgets, units, and samples that fail."""

import numpy as np
import pytest

from alphacut.fuzzy import (
    Automatic,
    FailedError,
    General,
    Interval,
    Knowledge,
    Nature,
    Reduced,
    Signed,
    Triangular,
    levels,
    propagate,
    width_fractions,
)
from tests.refused import refuses


def test_eight_inputs_of_stated_signs_are_proved_by_their_corners():
    inputs = {f"x{i}": Triangular(0.5, 1.0, 2.0) for i in range(8)}
    knowledge = Knowledge(dict.fromkeys(inputs, 1), source="a product of positive factors")

    def product(**x):
        return np.prod(list(x.values()), axis=0)

    result = propagate(product, inputs, Reduced(), vectorised=True, knowledge=knowledge)
    cuts = np.array([inputs["x0"].cut(level) for level in levels(4)])
    np.testing.assert_allclose(result.bounds(), cuts.T**8, rtol=1e-12)
    tests = 16 + 3 * 4  # points of the narrowest cut that has a width, and of three wider ones
    assert result.evaluations == 4 * 256 + 1 + tests
    assert result.nature is Nature.GUARANTEED
    assert "a product of positive factors" in result.basis[0]
    assert (result.attained.upper == result.upper).all()
    alone = propagate(product, inputs, knowledge=knowledge)
    assert (alone.nature, alone.evaluations) == (Nature.GUARANTEED, 4 * 256 + 1 + tests)


def curved(a, b):
    return {"up": a**3 + b, "turns": (a - 0.2) ** 2 + b}


INPUTS = {"a": Triangular(-1.0, 0.1, 1.0), "b": Triangular(0.0, 0.5, 1.0)}


def test_only_outputs_whose_signs_are_stated_are_guaranteed():
    stated = propagate(curved, INPUTS, Signed(), knowledge=Knowledge({"a": {"up": 1}, "b": 1}))
    assert stated.natures == (Nature.GUARANTEED, Nature.ATTAINED)
    assert stated.nature is Nature.ATTAINED
    assert any("turns is not monotone in input a" in note for note in stated.notes)

    assert len(stated.basis) == 1
    assert stated.basis[0].startswith("the signs of a, b hold, as stated by the caller")
    assert f"which {len(stated.samples.points)} samples do not contradict" in stated.basis[0]
    seen = propagate(curved, INPUTS, Signed())
    assert seen.nature is Nature.ATTAINED
    np.testing.assert_allclose(seen.bounds("up"), stated.bounds("up"))


@pytest.mark.parametrize(
    ("function", "seen"),
    [
        (lambda x: x**2 / 2 + 0.06 * x, True),
        (lambda x: x**2 / 2 + 0.04 * x, False),  # least slope below a twentieth of their spread
        (lambda x: x - 0.2 * np.tanh(20 * (x - 0.75)), False),  # falls near one probe alone
    ],
)
def test_a_sign_is_seen_at_every_probe_and_with_a_margin(function, seen):
    result = propagate(function, {"x": Interval(0, 1)}, Signed(), alpha=[0.0])
    assert bool(result.notes) is not seen


@pytest.mark.parametrize(
    ("method", "wrong"),
    [
        (Signed(), {"a": -1, "b": -1}),
        (Reduced(), {"a": 1, "b": 1}),
        (General(), {"a": 1, "b": 1}),
        (Automatic(), {"a": 1, "b": 1}),
    ],
)
@pytest.mark.parametrize("small", [1.0, 1e-6])
def test_wrong_signs_are_contradicted_by_the_samples(method, wrong, small):
    """Also those of small effects, which no corner of the right signs of large ones shows."""
    large = next(name for name in wrong if wrong[name] == {"a": 1, "b": -1}[name])
    sizes = {name: 1.0 if name == large else small for name in wrong}
    with refuses("knowledge of y") as refused:
        propagate(
            lambda a, b: sizes["a"] * a - sizes["b"] * b, INPUTS, method, knowledge=Knowledge(wrong)
        )
    assert refused.value.key == "knowledge of y"
    assert "signs of a, b" in refused.value.value


def test_a_search_ends_at_its_budget_and_says_so():
    inputs, calls = {"x": Interval(-5, 10), "y": Interval(0, 15)}, []
    result = propagate(
        lambda x, y: calls.append(1) or np.cos(x) + (y - x) ** 2, inputs, budget=60, alpha=[0.0]
    )
    assert result.evaluations == len(calls) <= 60
    assert result.nature is Nature.ATTAINED
    assert "the budget ended the search" in result.notes[-1]
    assert "of at most 60" in str(result)


@pytest.mark.parametrize("method", [General(), Signed()])
def test_a_design_beyond_the_budget_is_refused_before_it_runs(method):
    inputs = {f"x{i}": Triangular(-1.0, 0.0, 2.0) for i in range(8)}
    with refuses("budget") as refused:
        propagate(lambda **x: sum(value**2 for value in x.values()), inputs, method)
    assert refused.value.key == "budget"
    assert "state signs" in refused.value.cure


def test_samples_that_fail_end_the_call():
    def broken(a, b):
        if a > 0.9:
            raise ArithmeticError("no convergence")
        return a + b

    with pytest.raises(FailedError, match=r"2 of \d+ samples failed.*no convergence"):
        propagate(broken, INPUTS, Reduced(), alpha=[0.05, 0.9])


def test_many_outputs_are_bounded_by_corners_or_attained_by_samples_alone():
    result = propagate(lambda a, b: [a * k + b for k in range(30)], INPUTS)
    assert result.nature is Nature.ESTIMATED
    assert result.evaluations < 150
    turning = propagate(lambda a, b: [a * a * k + b for k in range(30)], INPUTS)
    assert turning.natures[1:] == (Nature.ATTAINED,) * 29
    assert turning.evaluations < 500


def test_shares_of_width():
    inputs = {"a": Triangular(-1, 0, 1), "b": Triangular(-2, 0, 2), "c": Triangular(0, 1, 2)}

    def run(fuzzy):
        return propagate(lambda a, b, c: a + b + 0 * c, fuzzy, Reduced())

    shares = width_fractions(run, inputs)
    expected = np.array([[1 / 3] * 4, [2 / 3] * 4, [0] * 4])
    np.testing.assert_allclose(shares.fraction[:, :-1, 0], expected, atol=1e-12)
    assert (shares.fraction[:, -1] == 0).all()
    grouped = width_fractions(run, inputs, groups={"both": ("a", "b")})
    np.testing.assert_allclose(grouped.fraction[0, :-1], 1)


@pytest.mark.parametrize("method", [Signed(), Reduced(), None])
def test_a_stated_sign_that_fails_between_the_corners_is_refused(method):
    """The corners alone see nothing: the hump lies inside all cuts."""
    knowledge = Knowledge(signs={"x": 1, "y": 1})
    inputs = {"x": Interval(0.0, 1.0), "y": Triangular(0, 1, 2)}
    with refuses("knowledge of y"):
        propagate(
            lambda x, y: x * (1 - x) + 1e-3 * x + 1e-3 * y, inputs, method, knowledge=knowledge
        )


def test_what_an_input_fixed_reaches_is_reached_in_the_whole_box():
    def missing(numbers):  # misses the end that it finds with b fixed
        is_fixed = numbers["b"].support[0] == numbers["b"].support[1]
        return np.array([0.0]), np.array([1.2 if is_fixed else 1.0])

    numbers = {"a": Interval(0, 1), "b": Interval(0, 1)}
    shares = width_fractions(missing, numbers).fraction.ravel()
    assert shares == pytest.approx([1 - 1.0 / 1.2, 0.0])
