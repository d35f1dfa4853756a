"""Truncated polynomials: products with what they leave out, reciprocals, and bounds of series."""

import numpy as np
import pytest

from alphacut.frame.calculus.monomials import monomial_values
from alphacut.frame.calculus.truncated_polynomials import (
    multiply,
    product_table,
    reciprocal,
    upper_bound,
)


@pytest.mark.parametrize(("d", "degree"), [(0, 1), (1, 7), (2, 5), (3, 4)])
def test_products_leave_out_what_they_say(d, degree, rng):
    table = product_table(d, degree)
    a, b, out = rng.normal(size=(3, len(table.factors)))
    left_out = multiply(a, b, table, out)
    values = monomial_values(rng.uniform(-1, 1, (50, d)), degree)
    error = (values @ a) * (values @ b) - values @ out
    assert (np.abs(error) <= left_out + 1e-12).all()
    # Where all terms have one sign, the bound is attained at a corner.
    left_out = multiply(abs(a), abs(b), table, out)
    assert abs(a).sum() * abs(b).sum() - out.sum() == pytest.approx(left_out, rel=1e-12)
    assert bool(d) == (left_out > 0)


def test_reciprocal_is_one_over_a_polynomial_that_is_not_near_zero(rng):
    table = product_table(2, 6)
    a, out, product = rng.normal(size=(3, len(table.factors)))
    a *= 0.5 / abs(a[1:]).sum()
    a[0] = 1.0
    assert reciprocal(a, table, out)
    multiply(a, out, table, product)
    assert product == pytest.approx(np.eye(len(a))[0], abs=1e-12)
    a[0] = 0.4
    assert not reciprocal(a, table, out)


def test_bound_of_a_series_is_above_all_values_by_the_gap_at_most(rng):
    for _ in range(20):
        series = rng.normal(size=(8, 6)) * 0.5 ** np.arange(8)[:, np.newaxis]
        begin, end = np.sort(rng.uniform(0, 1, 2))
        tau = np.linspace(begin, end, 2001)
        coefficients = np.vander(tau, 8, increasing=True) @ series
        # The bound over the box at each τ is the constant plus all magnitudes.
        values = coefficients[:, 0] + np.abs(coefficients[:, 1:]).sum(axis=1)
        found = upper_bound(series, 8, begin, end, 1e-4, -np.inf)
        assert values.max() - 1e-9 <= found <= values.max() + 2e-4
