"""Scenes without a case: a function of one's own and fuzzy numbers from data."""

import numpy as np
import pytest

from alphacut.fuzzy import Triangular, from_data, propagate


def test_a_function_of_ones_own_has_its_exact_cuts():
    inputs = {"x": Triangular(1, 2, 3), "y": Triangular(-1, 0, 2)}
    result = propagate(lambda x, y: x**2 * np.exp(y), inputs)
    alpha = np.linspace(0, 1, 5)
    lower = (1 + alpha) ** 2 * np.exp(alpha - 1)  # rises with both inputs
    upper = (3 - alpha) ** 2 * np.exp(2 - 2 * alpha)
    assert result.lower[:, 0] == pytest.approx(lower, rel=1e-9)
    assert result.upper[:, 0] == pytest.approx(upper, rel=1e-9)


def test_an_extreme_inside_the_box_is_seen():
    result = propagate(lambda x: (x - 0.3) ** 2, {"x": Triangular(-1, 0, 1)})
    assert result.lower[:3, 0] == pytest.approx([0, 0, 0], abs=1e-4)
    assert result.upper[0, 0] == pytest.approx(1.69, rel=1e-9)


def test_cuts_from_data_hold_the_next_value_as_often_as_they_say(rng):
    inside = []
    for values in rng.lognormal(size=(400, 20)):
        low, high = from_data(values[:-1], "next value").cut(0.25)
        inside.append(low <= values[-1] <= high)
    assert np.mean(inside) > 0.75 - 4 * np.sqrt(0.75 * 0.25 / 400)
    assert np.mean(inside) < 0.75 + 1 / 20 + 4 * np.sqrt(0.75 * 0.25 / 400)
