"""Cheapest tolerances, against a linear limit, where they are known, and a product."""

import numpy as np
import pytest

from alphacut.fuzzy.decisions.cheapest import cheapest_tolerances


def test_a_linear_limit_is_shared_as_is_known():
    # Σ a t = s and Σ c / t least: t = s √(c/a) / Σ √(a c), cost (Σ √(a c))² / s
    a, c, s = np.array([2.0, 0.5]), np.array([1.0, 4.0]), 0.6
    found = cheapest_tolerances(
        lambda x, y: 2 * x + 0.5 * y,
        {"x": 1.0, "y": 3.0},
        dict(zip("xy", c, strict=True)),
        {"y": 2 + 1.5 + s},
    )
    exact = s * np.sqrt(c / a) / np.sqrt(a * c).sum()
    assert found.cost == pytest.approx(np.sqrt(a * c).sum() ** 2 / s, rel=1e-6)
    assert list(found.tolerances.values()) == pytest.approx(exact, rel=2e-3)
    assert 1 <= found.unsafe < 1 + 1e-6


@pytest.mark.slow
def test_a_product_is_cheaper_than_equal_shares_and_safe():
    inputs, costs = {"x": 1.0, "y": 2.0}, {"x": 1.0, "y": 9.0}
    found = cheapest_tolerances(lambda x, y: x * y, inputs, costs, {"y": 2.5})
    tx, ty = found.tolerances.values()
    assert (1 + tx) * (2 + ty) <= 2.5
    grid = np.linspace(1e-3, 0.249, 200001)  # of x; y follows from the limit
    least = (1 / grid + 9 / (2.5 / (1 + grid) - 2)).min()
    assert found.cost == pytest.approx(least, rel=1e-6)


@pytest.mark.parametrize(
    ("costs", "limit", "pattern"),
    [
        ({}, 3.0, r"the costs name"),
        ({"z": 1.0}, 3.0, r"the costs name z"),
        ({"x": -1.0}, 3.0, r"must be positive"),
        ({"x": 1.0}, 0.5, r"no tolerance is safe"),
        ({"x": 1.0}, 1e9, r"no limit is ever reached"),
        ({"w": 1.0}, 3.0, r"nominal value of w is 0"),
    ],
)
def test_what_makes_no_sense_is_refused(costs, limit, pattern):
    with pytest.raises(ValueError, match=pattern):
        cheapest_tolerances(lambda x, w: x + w, {"x": 1.0, "w": 0.0}, costs, {"y": limit})
