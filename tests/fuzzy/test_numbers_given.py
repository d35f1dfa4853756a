"""Limits, thresholds, levels and settings that are no finite numbers are refused in one line."""

import numpy as np
import pytest

from alphacut.frame import StoreyFrame
from alphacut.frame.decisions.exceeding import exceeding
from alphacut.frame.exceedance import exceedance
from alphacut.fuzzy import (
    Automatic,
    BranchAndBound,
    Chebyshev,
    IntervalQuasiMonteCarlo,
    Linear,
    Metamodel,
    MonteCarlo,
    Optimisation,
    Triangular,
    decide,
    from_data,
    levels,
    propagate,
    safe_scale,
)

X = {"x": Triangular(0, 1, 2)}
FRAME = StoreyFrame([20e3], [3.0], 30e9, 3e-4, q0=[0.01])
E = {"E": Triangular(29e9, 30e9, 31e9)}
NONE = (np.nan, np.inf, -np.inf, "1", None, True, 1j, [1.0])


def safe(**changed):
    given = {"nominal": {"x": 1.0}, "tolerances": {"x": 0.1}, "limits": {"y": 2.0}}
    return safe_scale(lambda x: x, **{**given, **changed})


CALLS = {
    "decide": lambda value: decide(lambda x: x, X, {"y": value}),
    "decide tolerance": lambda value: decide(lambda x: x, X, {"y": 1}, tolerance=value),
    "safe limit": lambda value: safe(limits={"y": value}),
    "safe nominal": lambda value: safe(nominal={"x": value}),
    "safe tolerance": lambda value: safe(tolerances={"x": (0.1, value)}),
    "safe most": lambda value: safe(most=value),
    "frame decides": lambda value: exceeding(FRAME, E, {"q1": value}, duration=0.1, step=0.1),
    "frame probability": lambda value: exceedance(
        FRAME, E, {}, limit=value, duration=0.1, step=0.1, samples=1
    ),
    "level": lambda value: propagate(lambda x: x, X, alpha=[0, value]),
    "input": lambda value: propagate(lambda x, y: x, {**X, "y": value}),
    "triangle": lambda value: Triangular(0, value, 2),
    "interaction": lambda value: Linear({"x": 1}, value),
    "spot check": lambda value: propagate(lambda x: x, X, spot_check=value),
}


@pytest.mark.parametrize("name", CALLS)
def test_what_is_no_finite_number_is_refused(name):
    for value in NONE:
        with pytest.raises(ValueError, match=r"must|needs") as refused:
            CALLS[name](value)
        assert "\n" not in str(refused.value)


@pytest.mark.parametrize("limits", [{}, 3.0, None, [1.0]])
def test_limits_are_named(limits):
    for call in (lambda: decide(lambda x: x, X, limits), lambda: safe(limits=limits)):
        with pytest.raises(ValueError, match=r"they must be numbers by name, as \{'y': 4.5\}"):
            call()


@pytest.mark.parametrize(
    ("plan", "setting"),
    [
        (Automatic, "look"),
        (Automatic, "seed"),
        (Automatic, "tolerance"),
        (Chebyshev, "budget"),
        (Optimisation, "starts"),
        (MonteCarlo, "samples"),
        (Metamodel, "boxes"),
        (IntervalQuasiMonteCarlo, "points"),
        (lambda **given: BranchAndBound(lambda x: x, **given), "tolerance"),
    ],
)
def test_settings_of_plans_are_numbers(plan, setting):
    for value in (*NONE, *(() if setting == "tolerance" else (1.5,))):
        with pytest.raises(ValueError, match=f"{setting} of .* must be a (whole|finite) number"):
            plan(**{setting: value})


@pytest.mark.parametrize("budget", ["9", 1.5, True, float("nan")])
def test_a_budget_that_may_be_left_out_is_a_number_where_it_is_not(budget):
    assert Automatic(budget=None) == Automatic()
    with pytest.raises(ValueError, match=r"budget of Automatic is .*; it must be a whole number"):
        Automatic(budget=budget)


def test_a_seed_is_not_negative():
    with pytest.raises(
        ValueError, match="seed of MonteCarlo is -1; it must be a whole number >= 0"
    ):
        MonteCarlo(seed=-1)


@pytest.mark.parametrize("alpha", ["01", ["0", "1"], [False, True], [], 0.5])
def test_levels_are_numbers(alpha):
    with pytest.raises(ValueError, match="they must be a sequence of numbers that rise"):
        propagate(lambda x: x, X, alpha=alpha)
    with pytest.raises(ValueError, match="whole number from 1"):
        levels(True)


@pytest.mark.parametrize("values", [["1", "2"], [1.0, (2.0, "3")], np.array(["1"])])
def test_text_is_no_measured_value(values):
    with pytest.raises(ValueError, match="they must be numbers, or pairs"):
        from_data(values, "median", bounds=(0, 9))


def test_a_resumed_result_counts_no_more_from_the_store_than_all_samples(tmp_path):
    given = {"store": tmp_path / "s.db", "identity": {"v": 1}}
    first = propagate(lambda x: x**2, X, **given)
    again = propagate(lambda x: x**2, X, **given)
    assert first.reused == 0
    assert again.reused == again.samples == first.samples > again.runs
