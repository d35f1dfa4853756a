"""Interactions cut the box where they say, and nowhere else."""

import numpy as np
import pytest

from alphacut.fuzzy import (
    Automatic,
    Ellipsoidal,
    General,
    Interval,
    Linear,
    Optimisation,
    Reduced,
    RefusedError,
    Triangular,
    levels,
    propagate,
)

SQUARE = {"a": Interval(0.0, 1.0), "b": Interval(0.0, 1.0)}
SEARCHES = [Automatic(), Optimisation()]


@pytest.mark.parametrize("method", SEARCHES)
def test_linear_interaction_cuts_the_box(method):
    half = [Linear({"a": 1, "b": 1}, 1.2)]
    result = propagate(lambda a, b: a * b, SQUARE, method, alpha=[0.0], interactions=half)
    assert result.upper[0, 0] == pytest.approx(0.36, abs=1e-3)
    assert result.upper_at[0, 0].sum() <= 1.2 + 1e-9


@pytest.mark.parametrize("scale", [1e-13, 1e13])
def test_the_units_of_inputs_under_an_interaction_do_not_matter(scale):
    inputs = {"a": Interval(0.0, scale), "b": Interval(0.0, scale)}
    half = [Linear({"a": 1, "b": 1}, 1.2 * scale)]
    result = propagate(lambda a, b: a + 2 * b, inputs, alpha=[0.0], interactions=half)
    assert result.upper[0, 0] == pytest.approx(2.2 * scale, rel=1e-6)


@pytest.mark.parametrize("correlation", [0.0, 0.6, -0.6])
def test_ellipsoidal_interaction_of_a_sum(correlation):
    inputs = {"a": Triangular(-1.0, 0.0, 1.0), "b": Triangular(-1.0, 0.0, 1.0)}
    ellipse = Ellipsoidal({("a", "b"): correlation})
    result = propagate(lambda a, b: a + b, inputs, Optimisation(), interactions=[ellipse])
    # support function of the ellipse
    expected = (1 - np.array(levels(4))) * np.sqrt(2 + 2 * correlation)
    np.testing.assert_allclose(result.upper[:, 0], expected, atol=2e-5)
    np.testing.assert_allclose(result.lower[:, 0], -expected, atol=2e-5)


def test_an_ellipsoid_leaves_inputs_that_it_does_not_name_their_whole_cuts():
    inputs = {name: Triangular(-1.0, 0.0, 1.0) for name in "abcd"}
    pair = [Ellipsoidal({("a", "d"): 0.8})]

    def outputs(a, b, c, d):
        return {"all": a + b + c + d, "free": b + c, "named": a + d}

    result = propagate(outputs, inputs, Optimisation(), interactions=pair, alpha=[0.0, 0.5])
    for name, widest in (("all", 2 + np.sqrt(3.6)), ("free", 2.0), ("named", np.sqrt(3.6))):
        np.testing.assert_allclose(result.bounds(name).upper, [widest, widest / 2], rtol=1e-5)


@pytest.mark.parametrize("method", [General(), Reduced()])
def test_methods_that_cannot_respect_interactions_refuse(method):
    with pytest.raises(RefusedError) as refused:
        propagate(lambda a, b: a, SQUARE, method, interactions=[Linear({"a": 1}, 0.5)])
    assert (refused.value.key, refused.value.value) == ("interactions", "Linear")
