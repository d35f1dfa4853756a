"""What a measurement teaches, in words."""

import pytest

from alphacut.stages.vibration.update import sentences

FOUND = {
    "alpha": [0.05],
    "inputs": {"k1": {"lower": [1.0], "upper": [2.0]}},
    "narrowed": {"k1": 0.5},
    "held_out": [],
    "not_learned": [],
    "claim": "",
}


@pytest.mark.parametrize("nothing", [None, float("nan")])
def test_an_envelope_without_width_has_no_share_of_it(nothing):
    told = sentences({**FOUND, "envelope_width": {"q1": 0.25, "q3": nothing}})
    assert "envelope of q1: 25 % of its width before" in told
    assert "envelope of q3: no width, as before" in told
