"""What is known of modes by sums alone: forms of inverse matrices over the whole box."""

import numpy as np
import pytest

from alphacut.frame.calculus.taylor_model import TaylorModel
from alphacut.frame.modes.rest import inverse_form


@pytest.mark.parametrize("order", [1, 2, 3])
def test_remainder_of_an_inverse_form_is_that_of_a_geometric_series(order, rng):
    """Of a (1 + ρ u) the inverse is a geometric series, whose remainder all bounds attain.

    At u = −1 the terms beyond the order N add ρ^(N + 1) / (1 − ρ) of the value in the middle.
    """
    variation, value = rng.uniform(0.2, 0.6), rng.uniform(0.5, 5)
    parts = np.full((1, 1, 1), value), np.full((1, 1, 1), value * variation)
    matrix = TaylorModel(parts, np.zeros((1, 1)), inputs=1, order=order)
    left, right = (matrix.like(rng.uniform(-3, 3, (count, 1))) for count in (2, 3))
    found = inverse_form(matrix, left, right, least=1 - variation)
    middle = left.value @ right.value.T / value
    for u in (-1.0, 1.0):
        exact = middle / (1 + variation * u)
        off = np.abs(found.at(np.array([[u]]))[0] - exact)
        assert (off <= found.remainder + 1e-12 * np.abs(middle)).all()
    of_series = np.abs(middle) * variation ** (order + 1) / (1 - variation)
    np.testing.assert_allclose(found.remainder, of_series, rtol=1e-9)
