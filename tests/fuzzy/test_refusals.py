"""What is refused of fuzzy numbers, campaigns and data, by key and value."""

import numpy as np
import pytest

from alphacut.fuzzy import (
    Crisp,
    FailedError,
    General,
    Knowledge,
    PiecewiseLinear,
    RefusedError,
    Signed,
    Triangular,
    from_data,
    jointly,
    levels,
    propagate,
    width_fractions,
)

X = {"x": Triangular(0, 1, 2)}
SEVEN = [2.01, 1.96, 2.03, 1.88, 2.10, 1.99, 2.05]


def run(function=lambda x: x, inputs=X, *args, **options):
    return propagate(function, inputs, *args, progress=False, **options)


@pytest.mark.parametrize(
    ("make", "key"),
    [
        (lambda: Triangular(2, 1, 3), "Triangular"),
        (lambda: Triangular(0, 1, np.inf), "Triangular"),
        (lambda: Crisp("1"), "Crisp"),
        (lambda: PiecewiseLinear((0, 1), (0, 1), (1,)), "alpha"),
        (lambda: PiecewiseLinear((0, 0.5), (0, 1), (3, 2)), "alpha"),
        (lambda: PiecewiseLinear((0, 1), (0, 2), (3, 1)), "cuts"),
        (lambda: Triangular(0, 1, 2).cut(1.5), "alpha"),
        (lambda: levels(0), "steps between levels"),
        (lambda: run(inputs={}), "inputs"),
        (lambda: run(inputs={"x": "1 mm"}), "input x"),
        (lambda: run(alpha=[0.5, 0.2]), "alpha"),
        (lambda: run("f"), "function"),
        (lambda: run(lambda x: x, X, General), "method"),
        (lambda: run(workers=0), "workers"),
        (lambda: run(budget=0), "budget"),
        (lambda: run(lambda x: x, X, General(), budget=14), "budget"),
        (lambda: run(executor=object()), "executor"),
        (lambda: run(shared=("y",)), "shared input"),
        (lambda: run(shared=("x",), vectorised=True), "shared"),
        (lambda: run(knowledge=Knowledge({"y": 1})), "input of knowledge"),
        (lambda: run(knowledge=Knowledge({"x": {"z": 1}})), "output of knowledge"),
        (lambda: Knowledge({"x": 2}), "sign of x"),
        (lambda: run(lambda x: x, X, Signed(outputs=("z",))), "output"),
        (lambda: run(store="/proc/none/s.db", identity={"v": 1}), "store"),
        (lambda: run(store="s.db"), "identity"),
        (lambda: run(store="s.db", identity={"f": abs}), "identity"),
        (lambda: run(alpha=[0.5]).number(), "alpha"),
        (
            lambda: width_fractions(lambda x: run(inputs=x), X, groups={"g": ("z",)}),
            "input of a group",
        ),
        (lambda: from_data([], "next value"), "values"),
        (lambda: from_data([1, np.nan], "median"), "value 2"),
        (lambda: from_data(SEVEN, "mode"), "claim"),
        (lambda: from_data(SEVEN, "mean", law="gamma"), "law"),
        (lambda: from_data(SEVEN, "mean"), "bounds"),
        (lambda: from_data(SEVEN, "mean", bounds=(3, 2)), "bounds"),
        (lambda: from_data(SEVEN, "mean", bounds=(2, 3)), "value 2"),
        (lambda: from_data([5, 5, 5], "mean", law="normal"), "values of a normal law"),
        (lambda: from_data(SEVEN, "median", law="normal"), "law"),
        (lambda: from_data(SEVEN, "next value").cut(0.05), "alpha of the next value"),
        (
            lambda: jointly(
                {"x": from_data(SEVEN, "median"), "y": from_data([1, 2], "next value")}
            ),
            "claims of the inputs",
        ),
    ],
)
def test_what_has_no_meaning_is_refused_by_its_key(make, key):
    with pytest.raises(RefusedError) as refused:
        make()
    assert refused.value.key == key
    assert refused.value.allowed
    assert "\n" not in str(refused.value)
    assert len(str(refused.value)) < 400


@pytest.mark.parametrize(
    ("output", "allowed"),
    [
        (None, "finite real numbers"),
        (np.nan, "finite real numbers"),
        (1j, "finite real numbers"),
        ("1", "finite real numbers"),
        (np.ma.masked_equal([1.0, 2.0], 2.0), "finite real numbers"),
        ({}, "one number or more"),
        ({"a": [1.0], "a[0]": 2.0}, "all of different names"),
    ],
)
def test_outputs_that_are_no_numbers_fail_with_the_point_and_the_cause(output, allowed):
    with pytest.raises(FailedError) as failed:
        run(lambda x: output)
    assert allowed in failed.value.what
    assert "at x = 1" in failed.value.what
    assert "mend the function" in failed.value.cure
