"""Values that are no real numbers, names that are no text: one clear line, never a guess."""

import datetime

import numpy as np
import pytest

from alphacut.fuzzy import (
    Automatic,
    CampaignError,
    Chebyshev,
    Interval,
    Optimisation,
    Triangular,
    levels,
    propagate,
)

INPUT = {"x": Interval(1, 2)}


@pytest.mark.parametrize(
    "value",
    [
        np.complex128(1 + 2j),
        np.ma.masked,
        np.ma.array([1.0, 2.0], mask=[False, True]),
        np.datetime64("2020-01-01"),
        datetime.datetime(2020, 1, 1),
        np.timedelta64(3, "s"),
        "3.0",
        None,
        object(),
    ],
    ids=lambda value: type(value).__name__,
)
def test_an_output_is_a_real_number(value):
    with pytest.raises(CampaignError, match=r"real number|finite number"):
        propagate(lambda x: value, INPUT)


def test_true_and_whole_numbers_are_numbers():
    found = propagate(lambda x: {"above": x > 0, "two": 2, "free": np.ma.array([1.0])}, INPUT)
    assert found.bounds("above")[0].tolist() == [1.0] * 5
    assert found.bounds("two")[1].tolist() == [2.0] * 5


def test_an_input_has_a_name():
    with pytest.raises(ValueError, match="an input is named 1; a name must be text"):
        propagate(lambda x: x, {1: Interval(1, 2)})


@pytest.mark.parametrize("exponent", [float("inf"), float("nan"), 2.5])
def test_a_fuzzy_number_takes_whole_powers_only(exponent):
    with pytest.raises(ValueError, match="it must be a whole number"):
        Triangular(1, 2, 3) ** exponent


@pytest.mark.parametrize("steps", [0, -1, 2.5, 10**9, "4"])
def test_the_number_of_levels_is_bounded(steps):
    with pytest.raises(ValueError, match="whole number from 1 to 10,000"):
        levels(steps)


@pytest.mark.parametrize("plan", [Automatic(), Optimisation(), Chebyshev()])
def test_no_plan_asks_for_what_is_no_number_where_outputs_are_subnormal(plan):
    """A search that divides by a range of 1e-310 goes to infinity."""
    asked = []

    def tiny(x, y):
        asked.append((x, y))
        return x * 1e-310 + 0 * y

    inputs = {"x": Triangular(1, 2, 3), "y": Interval(0, 1)}
    found = propagate(tiny, inputs, plan, alpha=[0, 1])
    assert np.isfinite(asked).all()
    assert found.bounds("y")[0][0] <= 1.0001e-310
