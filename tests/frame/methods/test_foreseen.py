"""Seconds that are told before anything is computed come near those that it then takes."""

import re
import time

import numpy as np
import pytest

from alphacut.frame import StoreyFrame, envelope, pendulum, plan
from alphacut.frame.methods import modal
from alphacut.frame.methods import plan as planning
from alphacut.fuzzy import Triangular

FRAME = StoreyFrame(
    (20e3, 20e3, 20e3),
    (3.5, 3.5, 3.5),
    30e9,
    1e-3,
    v0=(0.3, 0.3, 0.3),
    damping_ratio=(0.05,),
    outputs=("q3", "drift1"),
)
INPUTS = {"E": Triangular(28e9, 30e9, 32e9), "m1": Triangular(18e3, 20e3, 22e3)}
MORE = {"m2": INPUTS["m1"], "m3": INPUTS["m1"]}


@pytest.mark.slow  # a time
@pytest.mark.parametrize(("inputs", "gap"), [(INPUTS, None), (INPUTS, 2e-3), (INPUTS | MORE, 2e-3)])
def test_what_is_told_is_within_a_factor_of_what_it_takes(inputs, gap):
    asked = {"duration": 10.0, "step": 0.01, "alpha": (0.0, 0.5)}
    if gap is not None:
        asked |= {"method": "modal", "certify": gap}
    told, begun = plan(FRAME, inputs, **asked)[0], time.perf_counter()
    envelope(FRAME, inputs, **asked, progress=False)
    spent = time.perf_counter() - begun
    assert "a proof is expected" in told.words
    assert spent / 8 < told.seconds < 8 * spent + 2  # a busy machine


def test_a_proof_that_its_boxes_do_not_end_is_told_with_the_search_after_it(monkeypatch):
    monkeypatch.setattr(modal, "BOXES", 1.0)
    (told, *_) = plan(FRAME, INPUTS | MORE, duration=4.0, step=0.01, alpha=(0.0,))
    assert "for a proof that is expected to fail and" in told.words
    light = plan(FRAME, INPUTS | MORE, duration=4.0, step=0.01, alpha=(0.0,), method="modal")[0]
    assert "proof" not in light.words
    assert np.isfinite(told.seconds)


@pytest.mark.parametrize("longer", [4, 9])
def test_a_search_takes_a_root_more_for_a_node_where_neighbours_are_few(longer, monkeypatch):
    monkeypatch.setattr(planning, "_step", lambda *_: 1.0)  # beside which fits take no time
    seconds = [
        plan(FRAME, INPUTS, duration=t, step=0.01, alpha=(0.0,), method="modal")[0].seconds
        for t in (1.0, 1.0 * longer)
    ]
    assert seconds[1] / seconds[0] == pytest.approx(np.sqrt(longer), rel=0.01)


def test_more_inputs_take_more_for_a_step(monkeypatch):
    monkeypatch.setattr(planning, "_step", lambda *_: 1.0)
    seconds = [
        plan(FRAME, inputs, duration=1.0, step=0.01, alpha=(0.0,), method="modal")[0].seconds
        for inputs in (INPUTS, INPUTS | MORE)
    ]
    assert seconds[1] / seconds[0] == pytest.approx((3 + 4) / (3 + 2), rel=0.01)


@pytest.mark.parametrize("method", ["graph-follower", "improved-graph-follower"])
def test_the_samples_that_judge_a_graph_follower_are_foretold(method: str) -> None:
    inputs, time = {"phi_0": Triangular(0.5, 0.55, 0.6)}, {"duration": 1.0, "step": 0.05}
    asked = {"alpha": (0.0, 0.5), "method": method, "tolerance": 1e-3, **time}
    (told,) = plan(pendulum(), inputs, **asked)
    each = re.fullmatch(r"(\d+) .*", str(envelope(pendulum(), inputs, **asked).facts["judged_by"]))
    assert each is not None
    judging = 2 * int(each[1])
    assert told.words.endswith(f", and {judging} without that judge them")
