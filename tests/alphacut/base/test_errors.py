"""Errors pass between processes, and lists of numbers are told from what is none."""

import pickle

import numpy as np
import pytest

from alphacut.base.errors import require_numbers
from alphacut.fuzzy import FailedError, RefusedError


def test_errors_pass_between_processes():
    for error in (RefusedError("size", lambda: 0, "numbers", "take one"), FailedError("no", "try")):
        copy = pickle.loads(pickle.dumps(error))
        assert type(copy) is type(error)
        assert str(copy) == str(error)


def test_a_long_path_is_cut_at_its_begin_and_hides_nothing_else():
    place = "/tmp" + "/a folder of many words" * 20 + "/case.toml, line 5"
    value, allowed, cure = "soft material - 1 %", "a number and a unit", "write it as 1 GPa"
    text = str(RefusedError("phase.modulus", value, allowed, cure, place))
    wanted = f"case.toml, line 5: phase.modulus is {value}; allowed: {allowed}; {cure}"
    assert text.endswith(wanted)
    assert text.startswith("…")
    assert len(text) <= 300


@pytest.mark.parametrize("values", [{1.0, 2.0}, {1.0: 2.0}, b"ab", "12", [1.0, np.nan], 1.0, None])
def test_what_is_no_list_of_finite_numbers_is_refused(values):
    with pytest.raises(RefusedError):
        require_numbers("alpha", values)


@pytest.mark.parametrize("values", [[], (0, 1.5), np.ones((2, 3)), {"a": 1.0}.values()])
def test_lists_of_finite_numbers_pass(values):
    require_numbers("alpha", values)
