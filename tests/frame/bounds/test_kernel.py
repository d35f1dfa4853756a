"""The examination of boxes keeps every box that holds a higher point, by all it may be wrong by."""

import numpy as np
import pytest

from alphacut.frame.bounds.kernel import BoxTables, Items, RemainderBounds, examine


def code_of_box(*, slope, bend, third, slope_error, radius, target, is_at_ends):
    """Code of one box |x| ≤ `radius` of one input, of one output at one node, on its upper side.

    About its centre the output is slope · x + bend · x²/2, with a third derivative of at most
    `third` in size, and a slope that is wrong by `slope_error` at most.
    """
    table = np.array([0.0, slope, bend]).reshape(1, 1, 1, 3)
    found = examine(
        Items(np.array([0, 1]), np.array([0, 1]), node=np.array([0]), column=np.array([1])),
        BoxTables(np.full((1, 1), radius), np.full((1, 2, 1), is_at_ends), table),
        np.ones((1, 1)),
        RemainderBounds(
            third=np.full((1, 1, 1, 1, 1), third),
            rounding=np.array([0.0, slope_error]).reshape(1, 1, 2),
        ),
        np.array([np.inf, target]),
    )
    return found.code[0]


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
