"""Outputs keep their unit wherever they go; parameters admit what their range says."""

import pickle
import re
from contextlib import nullcontext
from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest

from alphacut.frame import Output, StoreyFrame, envelope, peaks
from alphacut.frame.dynamics.nonlinear import make_flow
from alphacut.frame.structures.quantities import OF_STOREY_FRAME, of_storey_frame
from alphacut.fuzzy import Interval, Nature
from tests.refused import refuses

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


@pytest.mark.parametrize("yields", [False, True])
def test_the_overturning_moment_is_that_of_the_shears_at_the_heights(yields, rng):
    """And is proved where few inputs are fuzzy, though it adds storeys by factors of inputs."""
    inputs, low = ("k2", "l1", "l2"), np.array([4e7, 3.0, 2.5])
    columns = {"yield_force": [3e5, 2e5], "hardening": [0.1, 0.2]} if yields else {}
    columns |= {"stiffness": [5e7, 4e7], "lengths": [3, 2.5], "gravity": 9.81}
    observed = ("shear1", "shear2", "overturning_moment")
    frame = StoreyFrame([4e4, 3e4], v0=[0.2, 0.5], damping_ratio=0.03, outputs=observed, **columns)
    points = low * (1 + 0.1 * rng.random((300, 3)))
    values = make_flow(frame, inputs, 0.3, 0.01, "exact").values(points)
    moment = (values[..., :2] * points[:, None, 1:]).sum(-1)
    assert values[..., 2] == pytest.approx(moment, rel=1e-12, abs=1e-6)
    if not yields:
        fuzzy = dict(zip(inputs, map(Interval, low, 1.1 * low), strict=True))
        peak = peaks(envelope(frame, fuzzy, alpha=[0], duration=0.3, step=0.01))[observed[2]]
        assert peak.nature == Nature.GUARANTEED
        assert np.abs(moment).max() <= peak.upper[0] < 1.1 * np.abs(moment).max()
    with refuses("output"):
        replace(frame, gravity=0.0, lengths=[])


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
