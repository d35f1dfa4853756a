"""Jets: arithmetic with the derivatives that difference quotients have."""

import numpy as np
import pytest

from alphacut.frame.calculus.jet import variables

FUNCTIONS = {
    "quotient": lambda x, y: 2.0 / x + y / x,
    "difference": lambda x, y: 1.0 - x**3 * y,
    "root": lambda x, y: (x * x + y) ** 0.5 - x**-2,
}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_derivatives_are_those_of_difference_quotients(name):
    of, point, h = FUNCTIONS[name], np.array([0.7, 1.3]), 1e-4
    p = variables(point[None], ["x", "y"], ["x", "y"])
    found = of(p["x"], p["y"])
    assert found.value[0] == pytest.approx(of(*point))
    for i, a in enumerate(np.eye(2) * h):
        assert found.first[i, 0] == pytest.approx(
            (of(*(point + a)) - of(*(point - a))) / (2 * h), rel=1e-6
        )
        for j, b in enumerate(np.eye(2) * h):
            corners = (of(*(point + s * a + t * b)) * s * t for s in (1, -1) for t in (1, -1))
            assert found.second[i, j, 0] == pytest.approx(sum(corners) / (4 * h * h), abs=1e-5)
