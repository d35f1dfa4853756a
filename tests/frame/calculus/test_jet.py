"""Jets: arithmetic with the derivatives that difference quotients have."""

import numpy as np
import pytest

from alphacut.frame.calculus.polynomials import Jet, inverse, variables
from tests.frame.differences import require_derivatives

FUNCTIONS = {
    "quotient": lambda x, y: 2.0 / x + y / x,
    "difference": lambda x, y: 1.0 - x**3 * y,
    "root": lambda x, y: (x * x + y) ** 0.5 - x**-2,
}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_derivatives_are_those_of_difference_quotients(name):
    of, point = FUNCTIONS[name], np.array([0.7, 1.3])

    def taylor(points):
        return of(*variables(points, ["x", "y"], ["x", "y"]).values())

    assert taylor(point[None]).value[0] == pytest.approx(of(*point))
    require_derivatives(taylor, point, np.full(2, 1e-3), within=(1e-8, 1e-8))


def test_the_inverse_of_a_matrix_has_its_derivatives():
    def taylor(points):
        x, y = variables(points, ["x", "y"], ["x", "y"]).values()
        return inverse(Jet.stack([Jet.stack([x, y * y]), Jet.stack([x * y, 2.0 - x])]))

    require_derivatives(taylor, np.array([0.7, 1.3]), np.full(2, 1e-3), within=(1e-7, 1e-7))
