"""Jets: elementary functions with the derivatives that difference quotients have, on jets, arrays
and symbols alike.
"""

import numpy as np
import pytest

from alphacut.frame.calculus.jet import Jet, cos, exp, sin, variables

FUNCTIONS = {
    "exp": (lambda x, y: exp(-0.3 * x * y), lambda x, y: np.exp(-0.3 * x * y)),
    "sin": (lambda x, y: sin(x) * y, lambda x, y: np.sin(x) * y),
    "cos": (lambda x, y: cos(x * x + y), lambda x, y: np.cos(x * x + y)),
    "quotient": (lambda x, y: 2.0 / x + y / x, lambda x, y: 2.0 / x + y / x),
    "difference": (lambda x, y: 1.0 - x**3 * y, lambda x, y: 1.0 - x**3 * y),
}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_derivatives_are_those_of_difference_quotients(name):
    ours, plain = FUNCTIONS[name]
    point, h = np.array([0.7, 1.3]), 1e-4
    p = variables(point[None], ["x", "y"], ["x", "y"])
    found = ours(p["x"], p["y"])
    assert found.value[0] == pytest.approx(plain(*point))
    for i, a in enumerate(np.eye(2) * h):
        assert found.first[i, 0] == pytest.approx(
            (plain(*(point + a)) - plain(*(point - a))) / (2 * h), rel=1e-6
        )
        for j, b in enumerate(np.eye(2) * h):
            corners = (plain(*(point + s * a + t * b)) * s * t for s in (1, -1) for t in (1, -1))
            assert found.second[i, j, 0] == pytest.approx(sum(corners) / (4 * h * h), abs=1e-5)


def test_the_same_function_takes_arrays_and_symbols():
    import sympy

    x = sympy.Symbol("x")
    grid = np.linspace(0, 1, 5)
    for of, symbolic, numeric in (
        (exp, sympy.exp, np.exp),
        (sin, sympy.sin, np.sin),
        (cos, sympy.cos, np.cos),
    ):
        assert of(x) == symbolic(x)
        assert np.array_equal(of(grid), numeric(grid))
        assert of(0.5) == numeric(0.5)


def test_a_jet_without_directions_is_a_plain_array():
    jet = exp(Jet.constant(np.array([0.0, 1.0]), 0))
    assert np.array_equal(jet.value, np.exp([0.0, 1.0]))
    assert jet.first.shape == (0, 2)
