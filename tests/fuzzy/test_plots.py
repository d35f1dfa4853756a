"""What is drawn between the levels that were computed holds what the model does there."""

import matplotlib
import numpy as np
import pytest

from alphacut.fuzzy import Interval, PiecewiseLinear, Reduced, Triangular, from_data, propagate

matplotlib.use("Agg")
LEVELS = (0.0, 0.25, 0.5, 0.75, 1.0)
BENT = PiecewiseLinear((0.0, 0.2, 1.0), (0.0, 0.1, 2.0), (5.0, 2.3, 2.0))


def drawn(found, level):
    """Ends of the outline that a picture shows at a level, the widest."""
    x, y = found.plot().lines[0].get_xydata().T
    half = len(x) // 2
    lows = [np.interp(level, y[:half], x[:half])]
    highs = [np.interp(level, y[half:][::-1], x[half:][::-1])]
    matplotlib.pyplot.close("all")
    return min(lows), max(highs)


def data(seed):
    values = np.random.default_rng(seed).normal(11, 0.7, 7)
    return from_data(values, "next value", bounds=(8, 15))


@pytest.mark.parametrize("seed", [0, 1, 2])
@pytest.mark.parametrize("between", [0.1, 0.3, 0.6])
def test_the_picture_holds_the_cuts_between_the_levels_of_measured_values(seed, between):
    def model(x, y):
        return y / x

    inputs = {"x": data(seed), "y": Triangular(1, 2, 3)}
    low, high = drawn(propagate(model, inputs, Reduced(), alpha=LEVELS), between)
    true = propagate(model, inputs, Reduced(), alpha=(0.0, between, 1.0))
    assert low <= true.lower[1, 0]
    assert high >= true.upper[1, 0]


def test_an_input_that_bends_between_levels_is_drawn_and_handed_on_in_steps():
    found = propagate(lambda x: x, {"x": BENT}, Reduced(), alpha=(0, 0.5, 1))
    assert drawn(found, 0.2) == pytest.approx(BENT.cut(0))
    assert tuple(found.number().cut(0.2)) == BENT.cut(0)
    assert "at most the steps between levels" in found.plot().get_title()
    fine = propagate(lambda x: x, {"x": BENT}, Reduced(), alpha=(0, 0.2, 0.5, 1))
    assert drawn(fine, 0.1) == pytest.approx(BENT.cut(0.1))
    assert "straight between levels" in fine.plot().get_title()
    assert tuple(fine.number().cut(0.1)) == BENT.cut(0)  # its ends may bend where no level is


def test_nothing_is_drawn_below_the_lowest_level():
    found = propagate(lambda x: x, {"x": Triangular(0, 1, 2)}, Reduced(), alpha=(0.5, 1))
    assert found.plot().lines[0].get_ydata().min() == 0.5
    whole = propagate(lambda x: x, {"x": Interval(0, 1)}, Reduced(), alpha=(0, 1))
    assert drawn(whole, 0.5) == (0, 1)
