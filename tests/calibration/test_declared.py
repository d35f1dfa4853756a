"""The judge itself: it passes what is right and sees bounds that say nothing or too much."""

import numpy as np
import pytest

from tests.calibration.declared import Calibration

TRUTH = np.linspace(-0.04, 0.05, 400)


def judged(width, error):
    """A table of values that are off by up to 1e-3, with such bounds and errors."""
    rng, table = np.random.default_rng(1), Calibration("test", 1)
    table.guaranteed("bounds", (TRUTH - width, TRUTH + width), (TRUTH - 0.01, TRUTH + 0.01))
    table.estimated("errors", error, rng.uniform(5e-4, 1e-3, 400))
    return table


def test_bounds_that_hold_and_are_near_pass():
    judged(0.011, 1e-3).judge()


@pytest.mark.parametrize(
    ("width", "error", "row"),
    [
        (1.0, 1e-3, "bounds"),
        (0.0099, 1e-3, "bounds"),
        (0.011, 1.0, "median of the errors"),
        (0.011, 9e-4, "errors"),
    ],
)
def test_bounds_that_say_nothing_or_too_much_fail(width, error, row):
    """An envelope of [−1, 1], and one that a single motion leaves."""
    with pytest.raises(AssertionError, match=rf"^{row} "):
        judged(width, error).judge()


def test_one_value_outside_proved_bounds_fails_and_one_of_many_estimates_does_not():
    table = Calibration("test", 1)
    table.estimated("errors", np.ones(1000), np.append(2.0, np.full(999, 0.5)))
    table.judge()
    table.guaranteed("bounds", (0.0, 1.0), (0.0, 1 + 1e-8))
    with pytest.raises(AssertionError, match=r"^bounds "):
        table.judge()


def test_a_table_of_nothing_fails():
    with pytest.raises(AssertionError, match="nothing was judged"):
        Calibration("test", 1).judge()
