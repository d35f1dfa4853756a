"""Arguments of the wrong kind are refused in one line, whatever they are."""

import numpy as np
import pytest

from alphacut.frame import StoreyFrame, envelope
from alphacut.fuzzy import Crisp, Interval, Triangular, from_data, propagate

FRAME = StoreyFrame([20e3], [3.0], 30e9, 3e-4, q0=[0.01])
INPUTS = {"E": Triangular(29e9, 30e9, 31e9)}
CALLS = {
    "triangular": (Triangular, {"lower": 1.0, "modal": 2.0, "upper": 3.0}),
    "interval": (Interval, {"lower": 1.0, "upper": 2.0}),
    "crisp": (Crisp, {"value": 1.0}),
    "data": (from_data, {"values": [1.0, 2.0, 3.0], "claim": "median", "bounds": (0, 9)}),
    "propagate": (propagate, {"function": lambda E: E, "inputs": INPUTS}),
    "frame": (
        StoreyFrame,
        {"masses": [2e4], "lengths": [3.0], "modulus": 3e10, "second_moment": 3e-4},
    ),
    "envelope": (envelope, {"model": FRAME, "inputs": INPUTS, "duration": 0.2, "step": 0.1}),
}
WRONG = (
    *("banana", "", np.nan, np.inf, object(), lambda: 1, np.datetime64("2020-01-01")),
    *(
        np.array([1 + 2j]),
        np.array(["a"]),
        [[1], [2, 3, 4]],
        np.ma.masked_array([1.0, 2.0], [0, 1]),
    ),
)


@pytest.mark.parametrize("name", CALLS)
def test_what_no_call_can_take_is_refused_in_one_line(name):
    call, good = CALLS[name]
    call(**good)
    for key in good:
        for value in WRONG:
            if key == "function" and callable(value):
                continue
            with pytest.raises(ValueError, match=r".{8}"):
                call(**{**good, key: value})


def test_long_whole_numbers_are_refused():
    with pytest.raises(ValueError, match="write large whole ones as 1e30"):
        Crisp(10**30)
