"""Enclosures: what a function does under enclosure is what it does with numbers, or it proves
nothing, whatever it catches.
"""

import copy
import functools
import math
import pickle
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from alphacut.fuzzy import BranchAndBound, Interval, Known, Signed, propagate
from alphacut.fuzzy.knowledge import interval_arithmetic
from alphacut.fuzzy.knowledge.enclosure import Enclosed, gradient_range

LOW, HIGH = np.array([[-1.0]]), np.array([[1.0]])


def steep_if_positive(x):
    with suppress(Exception):
        if x > 0:
            return 5 * x
    return x


def trying(look):
    """A function that is 5 x where `look` works for its input, and x where it raises."""

    def function(x):
        try:
            look(x)
        except Exception:
            return x
        return 5 * x

    return function


@functools.singledispatch
def dispatched(x):
    return x


@dispatched.register
def _(x: float):
    return 5 * x


def counting():
    calls = []

    def function(x):
        calls.append(0)
        return x if len(calls) < 9 else 5 * x

    return function


def keeping():
    kept = []

    def function(x):
        kept.append(x)
        return kept[0] * x

    return function


def remembering():
    last = [1.0]

    def function(x):
        with suppress(Exception):
            last[0] = float(x)
        return last[0] * 5

    return function


def matched(x):
    match x:
        case float():
            return 5 * x
        case _:
            return x


def scalar_or_array(x):
    try:
        return np.where(x > 0, 5 * x, x)
    except TypeError:
        return x


def typed(x):
    return 5 * x if type(x) is float else x


def typed_by_table(x):
    return {float: 5 * x}.get(type(x), x)


def by_path(x):
    try:
        np.linalg.solve(np.array([[1.0, x], [0.0, 1.0]]), np.ones(2))
    except TypeError:
        return x
    return 5 * x


EVADING = {
    "suppressed comparison": steep_if_positive,
    "equality": trying(lambda x: x == 0.3),
    "inequality": trying(lambda x: x != 0.3),
    "less": trying(lambda x: x > 0.3),
    "branch": trying(lambda x: not x),
    "float": trying(float),
    "int": trying(int),
    "complex": trying(complex),
    "index": trying(lambda x: range(9)[x]),
    "floor": trying(math.floor),
    "ceil": trying(math.ceil),
    "trunc": trying(math.trunc),
    "round": trying(round),
    "math": trying(math.sin),
    "finite": trying(math.isfinite),
    "remainder": trying(lambda x: x % 0.5),
    "quotient": trying(lambda x: x // 0.5),
    "remainder of a number": trying(lambda x: 2.0 % (x + 7)),
    "divmod": trying(lambda x: divmod(x, 2)),
    "key": trying(lambda x: {x: 1}),
    "lookup": trying(lambda x: {0.3: 1}.get(x)),
    "cached": trying(functools.cache(lambda x: x)),
    "max": trying(lambda x: max(x, 0.0)),
    "sorted": trying(lambda x: sorted([x, 0.0])),
    "text": trying(str),
    "format": trying(lambda x: f"{x:g}"),
    "repr": trying(repr),
    "copy": trying(copy.copy),
    "deepcopy": trying(copy.deepcopy),
    "pickle": trying(pickle.dumps),
    "where": trying(lambda x: np.where(x > 0, 1, 2)),
    "numpy.where": trying(lambda x: np.where(x, 1, 2)),
    "numpy.floor": trying(np.floor),
    "numpy.mod": trying(lambda x: np.mod(x, 1)),
    "numpy.sign": trying(np.sign),
    "numpy.heaviside": trying(lambda x: np.heaviside(x, 1)),
    "numpy.isfinite": trying(np.isfinite),
    "numpy.isfinite in an array": trying(lambda x: np.isfinite(np.array([x]))),
    "numpy.asarray": trying(lambda x: np.asarray(x, float)),
    "numpy.interp": trying(lambda x: np.interp(x, [0, 1], [0, 1])),
    "numpy.linalg": by_path,
    "attribute": trying(lambda x: x.real),
    "hasattr": lambda x: 5 * x if hasattr(x, "is_integer") else x,
    "getattr": lambda x: 5 * x if getattr(x, "value", None) is None else x,
    "isinstance": lambda x: 5 * x if isinstance(x, float) else x,
    "suppressed isinstance": trying(lambda x: isinstance(x, float)),
    "type": typed,
    "type in a table": typed_by_table,
    "class": lambda x: 5 * x if x.__class__ is float else x,
    "match": matched,
    "singledispatch": lambda x: dispatched(x),
    "scalar or array": scalar_or_array,
    "keeps numbers": remembering(),
    "infinite exponent": trying(lambda x: x**math.inf),
    "text beside": trying(lambda x: x + "1"),
    "matrix": trying(lambda x: x @ np.eye(1)),
    "bits": trying(lambda x: x & 1),
}


@pytest.mark.parametrize("name", EVADING)
def test_what_has_no_enclosure_proves_nothing_whatever_is_caught(name):
    function = EVADING[name]
    inputs = {"x": Interval(-1, 1)}
    with pytest.raises(ValueError, match=r"cannot be enclosed \(.+\); write it in arithmetic"):
        propagate(function, inputs, BranchAndBound(function), alpha=(0.0,))
    ranges = gradient_range(function, ("x",))
    with pytest.raises(ValueError, match="cannot be enclosed"):
        propagate(function, inputs, Signed(), known=Known(gradient_range=ranges), alpha=(0.0,))


def noisy():
    return lambda x: x * np.random.default_rng().random()


@pytest.mark.parametrize("made", [counting, noisy])
def test_functions_that_are_another_at_every_call_prove_nothing(made):
    inputs, function, enclosed = {"x": Interval(-1, 1)}, made(), Enclosed(made(), ("x",))
    with pytest.raises(ValueError, match=r"cannot be enclosed|must be the model itself"):
        propagate(function, inputs, BranchAndBound(function), alpha=(0.0,))
    with pytest.raises(ValueError, match="it does other arithmetic than in its first call"):
        [enclosed(LOW, HIGH) for _ in range(9)]


def test_inputs_that_are_kept_for_another_call_prove_nothing():
    with pytest.raises(ValueError, match="keeps inputs of one call for another"):
        Enclosed(keeping(), ("x",))(LOW, HIGH)


def test_a_constant_is_enclosed():
    found = Enclosed(lambda x: {"y": 2.0, "z": x}, ("x",))(LOW, HIGH)
    assert found["y"].value == (2.0, 2.0)


TABLE = functools.cache(lambda: np.linspace(0, 1, 3))
ADDED = {
    "abs": lambda x, y: abs(x - y) + np.fabs(x * y),
    "hypot": lambda x, y: np.hypot(x, y - 0.3) + np.hypot(x, 2.0),
    "greatest": lambda x, y: np.maximum(x, y**2) + np.minimum(x, 0.3) * np.maximum(0.2, y),
    "clip": lambda x, y: np.clip(x * y, -0.5, 0.7) + y,
    "exponentials": lambda x, y: 2**x + 0.5 ** (x * y) + np.exp2(y) + (4 + y) ** (x / 2),
    "logarithms": lambda x, y: np.log10(x + 4) + np.log2(5 + y) + np.arctan(3 * x - y),
    "arrays": lambda x, y: np.sum(x * TABLE() + np.array([1.0, 2.0, y]) / (y + 5)),
    "reciprocal": lambda x, y: np.reciprocal(x + 4) + np.float_power(y + 4, 1.5) + np.positive(x),
}
ends = st.floats(-3, 3)


@pytest.mark.parametrize("name", ADDED)
@settings(deadline=None)
@given(a=ends, b=ends, c=ends, d=ends)
def test_enclosures_hold_values_and_slopes(name, a, b, c, d):
    function = ADDED[name]
    lower, upper = np.array([min(a, b), min(c, d)]), np.array([max(a, b), max(c, d)])
    found = Enclosed(function, ("x", "y"))(lower[None], upper[None])["y"]
    unit = np.array([[0, 0], [1, 1], [0, 1], [1, 0], [0.5, 0.5], [0.3, 0.9], [0.71, 0.13]])
    points = lower + unit * (upper - lower)
    values = np.array([function(*point) for point in points.tolist()])
    assert (values >= found.value[0] - 1e-12).all()
    assert (values <= found.value[1] + 1e-12).all()
    if min(upper - lower) > 1e-3:  # secants lie among the slopes too
        middle = (lower + upper) / 2
        for i in range(2):
            step = 0.4 * (upper - lower) * np.eye(2)[i]
            rise = function(*(middle + step).tolist()) - function(*(middle - step).tolist())
            slope = rise / (0.8 * (upper - lower)[i])
            assert found.slope[0][i][0] - 1e-9 <= slope <= found.slope[1][i][0] + 1e-9


def test_a_power_of_what_may_be_negative_has_no_bounds():
    found = Enclosed(lambda x: (x - 3) ** (2 + 0 * x), ("x",))(LOW, HIGH)["y"]
    assert found.value == (-np.inf, np.inf)


def test_branch_and_bound_proves_kinks():
    def function(x, y):
        return np.maximum(abs(x), 2**y) - np.minimum(x, y)

    inputs = {"x": Interval(-1, 2), "y": Interval(-2, 1)}
    result = propagate(function, inputs, BranchAndBound(function), alpha=(0.0,))
    x, y = np.meshgrid(np.linspace(-1, 2, 301), np.linspace(-2, 1, 301))
    values = function(x, y)
    assert result.lower[0, 0] <= values.min() <= result.lower[0, 0] + 2e-3
    assert result.upper[0, 0] - 2e-3 <= values.max() <= result.upper[0, 0]


def test_a_length_through_zero_is_bounded():
    def function(x, y):
        return np.hypot(x, y)

    inputs = {"x": Interval(-3, 2), "y": Interval(-4, 1)}
    result = propagate(function, inputs, BranchAndBound(function), alpha=(0.0,))
    assert result.lower[0, 0] == pytest.approx(0, abs=1e-2)
    assert result.upper[0, 0] == pytest.approx(5)


@pytest.mark.parametrize("function", [lambda x: np.where(x > 0, x, 1), lambda x: np.floor(x)])
def test_a_refusal_names_the_functions_that_are_enclosed(function):
    with pytest.raises(
        ValueError, match=r"has no enclosure\); .* numpy's absolute, .*, hypot, .* and"
    ):
        Enclosed(function, ("x",))(LOW, HIGH)


def test_a_reciprocal_across_zero_has_no_bounds():
    ends = np.array([-1.0, 1.0, -2.0, 0.0]), np.array([2.0, 2.0, -1.0, 1.0])
    lower, upper = interval_arithmetic.reciprocal(ends)
    assert (lower[[0, 3]] == -np.inf).all()
    assert (upper[[0, 3]] == np.inf).all()
    np.testing.assert_allclose([lower[1:3], upper[1:3]], [[0.5, -1.0], [1.0, -0.5]])


def test_a_power_has_no_bounds_where_its_base_may_be_negative():
    """Where a part of the box has no value, the rest of it bounds nothing."""
    found = Enclosed(lambda x: x**0.5, ("x",))(LOW, HIGH)["y"]
    assert found.value == (-np.inf, np.inf)


@pytest.mark.parametrize("options", [{"dtype": np.float32}, {"where": True}])
def test_options_of_numpys_functions_have_no_enclosure(options):
    with pytest.raises(ValueError, match=r"numpy\.add has no enclosure"):
        Enclosed(lambda x: np.add(x, 1.5, **options), ("x",))(LOW, HIGH)
