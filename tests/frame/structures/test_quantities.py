"""Outputs keep their unit wherever they go; parameters admit what their range says."""

import pickle
import re
from contextlib import nullcontext
from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest

from alphacut.frame import Output, StoreyFrame
from alphacut.frame.structures.quantities import OF_STOREY_FRAME, of_storey_frame

FRAME = StoreyFrame((1.0, 2.0), (1.0, 1.0), 1.0, 1.0, q0=(1.0, 0.0))


def test_a_given_unit_goes_along_with_the_name():
    tip = Output("q1", "mm")
    for copy in (Output(tip), pickle.loads(pickle.dumps(tip)), deepcopy(tip)):
        assert (copy, copy.unit, type(copy)) == ("q1", "mm", Output)
    assert Output("q1").unit == "m"
    assert Output(tip, "cm").unit == "cm"
    assert Output("q12").words == "displacement of floor 12 (q12)"
    assert Output("base_shear").words == "base shear"
    known = {"v12": "m/s", "max a3": "m/s^2", "drift1": "m", "base_shear": "N", "word": "SI"}
    assert {name: Output(name).unit for name in known} == known


@pytest.mark.parametrize("kind", OF_STOREY_FRAME)
def test_ranges_are_those_that_a_frame_accepts(kind: str):
    one = of_storey_frame(kind)
    assert not one.admits(0.5, np.inf)
    assert not one.admits(np.nan, 0.5)
    assert one.admits(1e-9, 0.999)
    arguments = {"E": "modulus", "I": "second_moment", "rayleigh_mass": "rayleigh"}
    arguments |= {"m": "masses", "l": "lengths", "d": "dampers", "zeta": "damping_ratio"}
    arguments |= {"c": "columns", "q": "q0", "v": "v0"}
    if kind not in arguments:
        return
    for value in (-1.0, 0.0, 0.999, 1.0, 2.0):
        given: object = value if kind in ("E", "I", "zeta") else (value, value)
        refused = pytest.raises(ValueError, match=re.escape(one.range))
        with nullcontext() if one.admits(value, value) else refused:
            replace(FRAME, **{arguments[kind]: given})
