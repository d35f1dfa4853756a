"""Claims of several inputs hold together as often as said; the minimum of memberships does not."""

import numpy as np
import pytest

from alphacut.fuzzy import (
    Automatic,
    Knowledge,
    Signed,
    Triangular,
    from_data,
    jointly,
    propagate,
)
from benchmarks.fuzzy.coverage import jointly_held
from tests.refused import refuses

BOUNDS = (0, 100)
FIRST = from_data(np.arange(1.0, 20.0), "next value", bounds=BOUNDS)
SECOND = from_data(np.arange(2.0, 41.0), "next value", bounds=BOUNDS)
MEAN = from_data(np.arange(1.0, 20.0), "mean", bounds=BOUNDS)
RISING = Knowledge({"x": 1, "y": 1})


def total(x, y):
    return x + y


@pytest.mark.parametrize("alpha", [0.0, 0.1, 0.2, 0.5, 0.97])
def test_joint_cuts_are_those_of_the_lower_levels(alpha):
    unknown, independent = (jointly({"x": FIRST, "y": SECOND}, independent=k) for k in (0, 1))
    assert unknown["y"].cut(alpha) == SECOND.cut(alpha / 2)
    assert independent["y"].cut(alpha) == SECOND.cut(1 - np.sqrt(1 - alpha))
    assert jointly({"x": FIRST})["x"].cut(alpha) == FIRST.cut(alpha)
    both = propagate(total, independent, Signed(), knowledge=RISING, alpha=[0.5])
    ends = np.add(*(number.cut(0.5) for number in independent.values()))
    assert both.bounds() == pytest.approx(ends[:, None])  # which are not joined again
    three = propagate(lambda x, y, z: x + y + z, {**independent, "z": FIRST}, alpha=[1])
    assert "3 sources of unknown dependence" in str(three)


def test_propagation_joins_and_prints_the_claim_with_its_conditions():
    inputs = {"x": FIRST, "y": SECOND, "z": Triangular(1, 2, 3), "one": 1.0}
    method = Automatic()
    result = propagate(lambda x, y, z, one: x * y / z * one, inputs, method, alpha=[0, 0.1, 1])
    text = str(result)
    assert "result of the next value of x, y lies in its α-cut with P >= 1 - α" in text
    assert "x: 19 values drawn alike and independently, bounds [0, 100]" in text
    assert "2 sources of unknown dependence; z in its cut at α (opinions)" in text
    assert text.endswith(f"inside the {result.nature} bounds, which is not proved")
    assert result.claim.opinions == ("z",)
    proved = propagate(total, {"x": FIRST, "y": 2}, Signed(), knowledge=RISING)
    assert "if the true range" not in str(proved)


def test_opinions_are_said_to_be_opinions():
    claim = propagate(total, {"x": Triangular(0, 1, 2), "y": 1}, Signed()).claim
    assert str(claim) == "x: opinions, so that no level has a probability"
    assert not propagate(total, {"x": 2, "y": 1}, Signed()).claim.opinions


def test_a_result_hands_its_claim_on_in_steps():
    result = propagate(total, {"x": FIRST, "y": 2}, Signed(), alpha=[0, 0.25, 0.5, 1])
    number = result.number()
    assert number.cut(0.4) == number.cut(0.25) == tuple(end[1] for end in result.bounds())
    assert number.claim.about == "next value"
    assert "x: 19 values drawn alike and independently" in number.claim.conditions[0]
    assert (
        propagate(total, {"x": FIRST, "y": 2}, Signed(), alpha=[0.25, 1]).number().decided == 0.25
    )


def test_kinds_are_mixed_only_under_a_name():
    with refuses("claims of the inputs") as refused:
        propagate(total, {"x": FIRST, "y": MEAN})
    assert refused.value.value == ["mean", "next value"]
    named = jointly({"x": FIRST, "y": MEAN}, means="drift of the next frame")
    text = str(propagate(total, named, Signed()))
    assert "the drift of the next frame lies in its α-cut with P >= 1 - α" in text


def test_one_sample_is_not_independent_of_itself():
    with refuses("independent") as refused:
        jointly({"x": FIRST, "y": FIRST}, independent=True)
    assert refused.value.cure == "x and y rest on the same values"


def test_what_values_do_not_decide_is_refused_at_the_joint_level():
    few = from_data([1.0, 2.0, 3.0, 4.0, 5.0], "next value")
    with refuses("alpha of the next value"):
        propagate(total, {"x": few, "y": few}, alpha=[0.5, 0.75])
    result = propagate(total, {"x": few, "y": few}, Signed(), alpha=[0.7])
    assert result.upper[0, 0] == 10


@pytest.mark.parametrize(
    ("links", "samples"),
    [(4, 120), *(pytest.param(links, 600, marks=pytest.mark.slow) for links in (2, 5))],
)
def test_joint_coverage_holds_where_the_minimum_rule_fails(links, samples, rng):
    scores = jointly_held(links, samples, rng)
    assert scores["minimum"] < -4.5
    assert min(scores["unknown"], scores["independent"]) > -4.5
