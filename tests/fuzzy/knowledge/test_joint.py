"""Claims of several inputs hold together as often as said; the minimum of memberships does not."""

import numpy as np
import pytest

from alphacut.frame import StoreyFrame, envelope
from alphacut.fuzzy import (
    Crisp,
    Ellipsoidal,
    Known,
    Optimisation,
    Reduced,
    Signed,
    Triangular,
    from_data,
    jointly,
    propagate,
)
from alphacut.fuzzy.knowledge.joint import JointClaim
from alphacut.fuzzy.sets.arithmetic import DependencyError
from alphacut.fuzzy.sets.claimed import Claimed
from benchmarks.fuzzy.joint_coverage import rows_of

BOUNDS = (0, 100)
FIRST = from_data(np.arange(1.0, 20.0), "next value", bounds=BOUNDS)
SECOND = from_data(np.arange(2.0, 41.0), "next value", bounds=BOUNDS)
MEAN = from_data(np.arange(1.0, 20.0), "mean", bounds=BOUNDS)


def total(x, y):
    return x + y


def test_one_claim_keeps_its_cuts():
    (joined,) = jointly({"x": FIRST}).values()
    for alpha in (0, 0.1, 0.35, 1):
        assert joined.cut(alpha) == FIRST.cut(alpha)


@pytest.mark.parametrize("alpha", [0.0, 0.1, 0.2, 0.5, 0.97])
def test_joint_cuts_are_those_of_the_lower_levels(alpha):
    unknown, independent = (jointly({"x": FIRST, "y": SECOND}, independent=k) for k in (0, 1))
    assert unknown["y"].cut(alpha) == SECOND.cut(alpha / 2)
    assert independent["y"].cut(alpha) == SECOND.cut(1 - np.sqrt(1 - alpha))


def test_joining_twice_changes_nothing_and_new_claims_are_joined_again():
    once = jointly({"x": FIRST, "y": SECOND}, independent=True)
    result = propagate(total, once, Signed(), known=Known({"x": 1, "y": 1}), alpha=[0.1, 0.5])
    assert result.bounds()[0][1] == once["x"].cut(0.5).lower + once["y"].cut(0.5).lower
    three = propagate(lambda x, y, z: x + y + z, {**once, "z": FIRST}, alpha=[0.5, 1])
    assert "3 sources of unknown dependence" in str(three)


def test_propagation_joins_and_prints_the_claim_with_its_conditions():
    inputs = {"x": FIRST, "y": SECOND, "z": Triangular(1, 2, 3), "one": 1.0}
    result = propagate(lambda x, y, z, one: x * y / z * one, inputs, alpha=[0, 0.1, 1])
    text = str(result)
    assert "result of the next value of x, y lies in its α-cut with P >= 1 - α" in text
    assert "x: 19 values drawn alike and independently, bounds [0, 100]" in text
    assert "2 sources of unknown dependence; z in its cut at α (opinions)" in text
    assert text.endswith("if the true range stays inside the inner bounds, which is not proved")
    unchecked = str(propagate(lambda x: x, {"x": FIRST}, Reduced(), alpha=[0, 1]).claim)
    assert unchecked.endswith("the inner bounds, which this plan has not checked")
    assert result.to_dataset().attrs["claim"] == str(result.claim)
    assert result.claim.opinions == ("z",)


def test_a_proved_result_rests_on_no_bounds_and_interactions_are_a_condition():
    proved = propagate(total, {"x": FIRST, "y": 2}, Signed(), known=Known({"x": 1, "y": 1}))
    assert "if the true range" not in str(proved)
    bound = [Ellipsoidal({("x", "y"): 0.5})]
    inputs = {"x": FIRST, "y": SECOND}
    assert "the interactions hold" in str(
        propagate(total, inputs, Optimisation(), interactions=bound, alpha=[0.5])
    )


def test_opinions_are_said_to_be_opinions():
    found = propagate(total, {"x": Triangular(0, 1, 2), "y": 1})
    assert str(found).endswith("\nopinions: x")
    assert str(found.claim) == "x: opinions, so that no level has a probability"
    assert not JointClaim.of({"x": Crisp(1.0)}).opinions


def test_a_result_hands_its_claim_on_in_steps():
    result = propagate(total, {"x": FIRST, "y": 2}, alpha=[0, 0.25, 0.5, 1])
    number = result.number()
    assert isinstance(number, Claimed)
    assert number.cut(0.4) == number.cut(0.25) == tuple(end[1] for end in result.bounds())
    assert number.claim.about == "next value"
    assert "x: 19 values drawn alike and independently" in number.claim.given[0]
    assert propagate(total, {"x": FIRST, "y": 2}, alpha=[0.25, 1]).number().decided == 0.25


def test_kinds_are_mixed_only_under_a_name():
    with pytest.raises(
        ValueError, match=r"claim different things \(x: next value, y: mean\); say what the joint"
    ):
        propagate(total, {"x": FIRST, "y": MEAN})
    named = jointly({"x": FIRST, "y": MEAN}, means="drift of the next frame")
    text = str(propagate(total, named))
    assert "the drift of the next frame lies in its α-cut with P >= 1 - α" in text


def test_one_sample_is_not_independent_of_itself():
    with pytest.raises(ValueError, match="x and y rest on the same values and are not independent"):
        jointly({"x": FIRST, "y": FIRST}, independent=True)


def test_what_values_do_not_decide_is_refused_at_the_joint_level():
    few = from_data([1.0, 2.0, 3.0, 4.0, 5.0], "next value")
    with pytest.raises(ValueError, match=r"from α = 0.6667 on, not at α = 0.5"):
        propagate(total, {"x": few, "y": few}, alpha=[0.5, 0.75])
    assert propagate(total, {"x": few, "y": few}, alpha=[0.7]).bounds()[1] == 10


def test_arithmetic_of_two_claims_is_refused():
    with pytest.raises(DependencyError, match="joins numbers with claims"):
        FIRST + SECOND
    assert (2 * FIRST + Triangular(0, 1, 2)).cut(0.1) == (2 * 1 + 0.1, 2 * 19 + 1.9)


def test_the_frame_carries_the_claim():
    frame = StoreyFrame([1e3], [3.0], 2.5e10, 1e-6, q0=[0.01])
    modulus = from_data(np.linspace(2.4e10, 2.6e10, 19), "next value", bounds=(2e10, 3e10))
    found = envelope(
        frame, {"E": modulus, "m1": Triangular(900, 1000, 1100)}, duration=1, step=0.01
    )
    assert "result of the next value of E lies" in found.facts["claim"]
    assert "m1 in its cut at α (opinions)" in found.facts["claim"]
    assert found.facts["claim"] in repr(found)


@pytest.mark.parametrize("links", [2, 4, 8])
def test_joint_coverage_holds_where_the_minimum_rule_fails(links):
    rows = rows_of(1000, np.random.default_rng(links), (links,))
    assert all(row.holds for row in rows if row.rule != "minimum")
    assert not any(row.holds for row in rows if row.rule == "minimum")
