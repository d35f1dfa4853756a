"""Campaigns: grouping, workers, failures, outputs."""

import warnings
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor

import numpy as np
import pytest

from alphacut.fuzzy import (
    CampaignError,
    Chebyshev,
    Extended,
    General,
    Interval,
    Metamodel,
    Optimisation,
    QuasiMonteCarlo,
    Signed,
    Triangular,
)
from tests.fuzzy.general import propagate

INPUTS = {"a": Triangular(0.0, 0.5, 1.0), "b": Triangular(-1.0, 0.0, 2.0)}


def model(a, b):
    return {"sum": a + b, "curve": [a, a * b, np.sin(b)]}


def shared_model(points):
    assert len({point["a"] for point in points}) == 1
    return [model(**point) for point in points]


def fragile(a, b):
    if a > 0.9:
        raise RuntimeError("no convergence")
    return a + b if b < 1.9 else np.nan


def same(one, other):
    return (
        (one.values.array == other.values.array).all()
        and (one.lower == other.lower).all()
        and (one.upper_at == other.upper_at).all()
    )


def test_result_is_the_same_bits_for_any_workers():
    reference = propagate(model, INPUTS)
    for workers in (2, 3):
        assert same(propagate(model, INPUTS, workers=workers), reference)
    with ThreadPoolExecutor(4) as executor:
        assert same(propagate(model, INPUTS, executor=executor), reference)


def test_three_ways_of_calling_agree():
    reference = propagate(model, INPUTS)
    grouped = propagate(shared_model, INPUTS, shared=("a",))
    arrays = propagate(
        lambda a, b: {"sum": a + b, "curve": np.stack([a, a * b, np.sin(b)], axis=1)},
        INPUTS,
        vectorised=True,
    )
    assert same(grouped, reference)
    assert grouped.calls < grouped.runs
    np.testing.assert_allclose(arrays.values.array, reference.values.array, rtol=1e-15)
    assert arrays.calls == 1


def test_outputs_are_named_and_shaped():
    result = propagate(model, INPUTS)
    assert result.outputs == ("sum", "curve[0]", "curve[1]", "curve[2]")
    assert result.values.output("curve").shape == (result.runs, 3)
    assert propagate(lambda a, b: a, INPUTS).outputs == ("y",)
    with pytest.raises(ValueError, match="no output 'total'; there are sum, curve"):
        result.bounds("total")
    with pytest.raises(ValueError, match="no output 'total'; there are sum, curve"):
        result.values.output("total")


@pytest.mark.parametrize("workers", [1, 2])
def test_failed_samples_are_reported_and_the_others_run(workers):
    with pytest.raises(
        CampaignError,
        match=r"9 of 55 samples failed, the others are done: at a = 0, b = 2: ValueError",
    ) as caught:
        propagate(fragile, INPUTS, workers=workers)
    errors = [error for _, error in caught.value.failures]
    assert sum("must be a finite number" in error for error in errors) == 4
    assert sum("no convergence" in error for error in errors) == 5
    assert caught.value.total == 55


def test_one_bad_point_spoils_no_other_of_its_call():
    def grouped(points):
        return [fragile(**point) for point in points]

    with pytest.raises(CampaignError) as caught:
        propagate(grouped, INPUTS, shared=("b",))
    assert len(caught.value.failures) == 9


@pytest.mark.parametrize(
    "plan",
    [
        General(),
        Extended(),
        Signed(),
        Optimisation(),
        Chebyshev(),
        QuasiMonteCarlo(8),
        Metamodel(20, 5),
    ],
)
def test_progress_rises_to_one(plan):
    shares = []
    propagate(model, INPUTS, plan, progress=shares.append)
    assert shares == sorted(set(shares))
    assert shares[-1] == 1
    assert len(shares) > 3


def test_wrong_calls_are_refused():
    with pytest.raises(ValueError, match="shared inputs name c; there are a, b"):
        propagate(model, INPUTS, shared=("c",))
    with pytest.raises(ValueError, match="shared and vectorised are both given"):
        propagate(model, INPUTS, shared=("a",), vectorised=True)
    with pytest.raises(ValueError, match="number of workers is 0"):
        propagate(model, INPUTS, workers=0)


def test_outputs_must_agree_between_samples():
    with pytest.raises(
        CampaignError,
        match=(
            r"3 of 7 samples failed.*has the outputs z where others have y; all must have the same"
            r" names"
        ),
    ):
        propagate(
            lambda x: {"y": x} if x < 0.6 else {"z": x},
            {"x": Interval(0, 1)},
            alpha=(0.0, 0.25, 0.5, 0.75),
        )


def turning(x):
    return {"y": x, "z": [2 * x, 3 * x]} if x < 0.1 else {"z": [2 * x, 3 * x], "y": x}


@pytest.mark.parametrize("plan", [General(), Optimisation(), Chebyshev(), Signed()])
def test_outputs_are_known_by_name_whatever_their_order(plan):
    result = propagate(turning, {"x": Interval(0, 1)}, plan)
    for name, largest in (("y", 1.0), ("z[0]", 2.0), ("z[1]", 3.0)):
        assert result.bounds(name)[1][0] == pytest.approx(largest)


def test_a_model_that_ends_its_program_ends_its_sample_only():
    def ends(x):
        if x > 0.9:
            raise SystemExit(3)
        return x

    with pytest.raises(
        CampaignError,
        match=r"2 of 11 samples failed, the others are done: .*; at x = 1: SystemExit: 3",
    ):
        propagate(ends, {"x": Interval(0, 1)}, alpha=(0.0, 0.1, 0.2, 0.3, 0.4))


def test_a_function_that_an_executor_cannot_send_is_reported():
    with (
        ProcessPoolExecutor(1) as executor,
        pytest.raises(CampaignError, match="cannot be sent between processes"),
    ):
        propagate(lambda x: x, {"x": Interval(0, 1)}, executor=executor, alpha=(0.0,))


@pytest.mark.parametrize("nothing", [{}, []])
def test_a_function_without_outputs_is_refused(nothing):
    with pytest.raises(CampaignError, match="the function returned no number"):
        propagate(lambda x: nothing, {"x": Interval(0, 1)})


def test_response_surface_reproduces_a_quadratic_and_states_its_error():
    result = propagate(lambda a, b: 1 + a * b - b**2, INPUTS)
    surface = result.surface()
    assert surface.degree == 2
    assert surface.error[0] < 1e-12
    np.testing.assert_allclose(surface([[0.3, 0.7]]), 1 + 0.21 - 0.49)
    wavy = propagate(lambda a, b: np.sin(4 * a + b), INPUTS).surface()
    points = np.random.default_rng(1).uniform([0, -1], [1, 2], (500, 2))
    true = np.sin(4 * points[:, 0] + points[:, 1])
    seen = np.sqrt(np.mean((wavy(points)[:, 0] - true) ** 2))
    assert seen < 3 * wavy.error[0] < 0.3


def test_dataset_carries_bounds_and_places():
    data = propagate(model, INPUTS).to_dataset()
    assert data["lower"].dims == ("alpha", "output")
    assert data["upper_at"].dims == ("alpha", "output", "parameter")
    assert float(data["upper"].sel(alpha=0, output="sum")) == 3


@pytest.mark.parametrize(
    "function",
    [
        lambda x: x.sum(),
        lambda x: {"y": x, "z": x.mean()},
        lambda x: x[:2],
        lambda x: {"y": np.r_[x, 1]},
    ],
)
def test_a_vectorised_function_returns_one_output_for_each_point(function):
    with pytest.raises(
        CampaignError,
        match=(
            r"of the vectorised function|vectorised function returned.*first axis must be the"
            r" points"
        ),
    ):
        propagate(function, {"x": Triangular(0, 1, 3)}, vectorised=True)


def test_a_constant_output_of_a_vectorised_function_is_spread():
    result = propagate(lambda x: {"y": x, "z": 3.0}, {"x": Interval(0, 1)}, vectorised=True)
    assert (result.bounds("z")[0] == 3).all()


def test_two_outputs_of_one_name_are_refused():
    with pytest.raises(
        CampaignError, match=r"two outputs are named 'a\[0\]'; each needs a name of its own"
    ):
        propagate(lambda x: {"a[0]": x, "a": [x]}, {"x": Interval(0, 1)})
    with pytest.raises(
        CampaignError, match="two outputs are named '1'; each needs a name of its own"
    ):
        propagate(lambda x: {"1": x, 1: x}, {"x": Interval(0, 1)})


def test_a_cause_of_many_failures_is_told_once():
    with pytest.raises(CampaignError) as caught:
        propagate(fragile, INPUTS)
    text = str(caught.value)
    assert text.count("no convergence") == text.count("must be a finite number") == 1
    assert "at a = 1, b = -1: RuntimeError: no convergence (the same at 4 more)" in text


def test_a_result_is_printed_in_few_lines_and_without_subnormal_numbers():
    result = propagate(lambda a, b: np.zeros(20_000) - 5e-324, INPUTS, alpha=[0.0, 1.0])
    lines = str(result).splitlines()
    assert len(lines) == 27
    assert lines[1] == "y[0], α = 0: 0 … 0"
    assert lines[-2] == "… and 19,988 outputs more: bounds(NAME) has them"
    assert "-0" not in str(propagate(lambda a, b: -0.0 * a, INPUTS))


def test_a_number_that_stands_for_two_inputs_is_noted():
    one = Triangular(0, 1, 2)
    result = propagate(lambda u, v, w: u - v + w, {"u": one, "v": one, "w": Triangular(0, 1, 2)})
    assert result.notes == (
        (
            "inputs u, v share one fuzzy number and vary independently; where they are one"
            " quantity, make it one input"
        ),
    )
    assert result.bounds()[0][0] == -2


def test_notes_tell_outputs_from_inputs_of_the_same_name():
    result = propagate(lambda y: (y - 1) ** 2, {"y": Interval(0, 3)}, Signed())
    assert result.notes[0].startswith("output y is not monotone in input y")


def test_a_random_function_is_warned_of():
    draw = np.random.default_rng(1).normal
    inputs = {"a": Triangular(1, 2, 3), "b": Triangular(1, 2, 3)}
    told = r"one call gave y = .* at a = .* where the function gives .*; a random function has no"
    with pytest.warns(UserWarning, match=told):
        found = propagate(lambda a, b: {"y": a + b + draw()}, inputs, General())
    assert "a fixed seed" in str(found.notes[-1])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        propagate(lambda a, b: a + b, inputs, General())
        propagate(lambda a, b: a + b + draw(), inputs, General(), spot_check=0)
