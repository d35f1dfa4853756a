"""The examination of boxes keeps every box that holds a higher point, by all it may be wrong by."""

import numpy as np
import pytest

from alphacut.frame.bounds.kernel import examine


def code_of_box(*, slope, bend, third, slope_error, radius, target, is_at_ends):
    """Code of one box |x| ≤ `radius` of one input, of one output at one node, on its upper side.

    About its centre the output is slope · x + bend · x²/2, with a third derivative of at most
    `third` in size, and a slope that is wrong by `slope_error` at most.
    """
    one_mode = [np.zeros(shape) for shape in ((1, 1, 1, 2), (1, 1, 1), (1, 1), (1, 1))]
    derivatives = [np.zeros((1, 2, 1)), np.zeros((1, 4, 1, 1))]
    table = np.array([0.0, slope, bend]).reshape(1, 1, 1, 3)
    margin = np.array([0.0, slope_error]).reshape(1, 1, 2)
    code, _, _ = examine(
        (np.array([0, 1]), np.array([0, 1]), np.array([0]), np.array([1])),
        (np.full((1, 1), radius), np.full((1, 2, 1), is_at_ends), table),
        np.ones((1, 1)),
        np.zeros(1),
        (*one_mode, *derivatives),
        (np.full((1, 1, 1, 1, 1), third), margin),
        np.array([np.inf, target]),
        False,
    )
    return code[0]


@pytest.mark.parametrize("part", ["bend", "third", "slope_error"])
@pytest.mark.parametrize("is_at_ends", [False, True])
def test_a_box_whose_highest_point_lies_inside_is_bisected(part, is_at_ends, rng):
    """It is neither left to its neighbour nor confined to its end, though it rises at its centre.

    The slope falls from the centre to the upper end, by one part of what it may change by, to less
    than zero; half of that part would not suffice. So the output is highest inside, or at the lower
    end where its slope is wrong throughout.
    """
    radius, fall = rng.uniform(0.1, 10, 2)
    slope = fall * rng.uniform(0.55, 0.95)
    x = radius * np.linspace(-1, 1, 20001)
    # by each part the slope at `radius` is smaller than that at the centre by `fall`
    parts = {
        "bend": {"bend": -fall / radius, "third": 0.0, "slope_error": 0.0},
        "third": {"bend": 0.0, "third": 2 * fall / radius**2, "slope_error": 0.0},
        "slope_error": {"bend": 0.0, "third": 0.0, "slope_error": fall},
    }[part]
    output = (slope - parts["slope_error"]) * x
    output += parts["bend"] * x**2 / 2 - parts["third"] * x**3 / 6
    target = (output.max() + max(output[-1], 0.0)) / 2
    code = code_of_box(slope=slope, radius=radius, target=target, is_at_ends=is_at_ends, **parts)
    assert code == 1
