"""Possibility and necessity of passing a limit, read off α-cuts."""

from dataclasses import replace

import numpy as np
import pytest

from alphacut.fuzzy import Interval, Known, Signed, Triangular, decide, from_data, levels, propagate
from alphacut.fuzzy.result import Bounds, Ends, Nature

RISING = Known({"x": 1})
X = {"x": Triangular(0.0, 1.0, 2.0)}


ALPHA = levels(4)


def bounds(inputs=X, alpha=ALPHA, function=lambda x: x):
    return propagate(function, inputs, Signed(), known=RISING, alpha=alpha)


@pytest.mark.parametrize(
    ("limit", "possibility", "necessity", "verdict"),
    [
        (2.5, (0, 0), (0, 0), "safe"),
        (2.0, (0, 0), (0, 0), "safe"),
        (1.6, (0.25, 0.5), (0, 0), "undecided"),
        (0.9, (1, 1), (0, 0.25), "undecided"),
        (0.4, (1, 1), (0.5, 0.75), "undecided"),
        (-0.5, (1, 1), (1, 1), "unsafe"),
    ],
)
def test_degrees_of_a_triangle_hold_those_of_its_membership(limit, possibility, necessity, verdict):
    decision = decide(bounds(), {"y": limit})
    assert decision.possibility == possibility
    assert decision.necessity == pytest.approx(necessity)
    assert decision.verdict == verdict
    # the degrees themselves: μ of the limit on either side
    exact = 1.0 if limit < 1 else max(2 - limit, 0.0)
    assert possibility[0] <= exact <= possibility[1]
    sure = 0.0 if limit >= 1 else min(1 - limit, 1.0)
    assert necessity[0] <= sure <= necessity[1]


def test_an_error_that_reaches_the_limit_leaves_it_open():
    proved = bounds()
    loose = replace(
        proved, nature=Nature.ESTIMATED, natures=(), inner=None, error=np.full((5, 1), 0.3)
    )
    assert decide(loose, {"y": 2.2}).possibility == (0, 0.25)
    assert decide(loose, {"y": 1.9}).possibility == (0, 0.5)
    assert decide(replace(proved, inner=None), {"y": 1.6}).possibility == (
        0,
        0.5,
    )  # nothing attained
    assert decide(replace(proved, inner=None), {"y": 1.6}).nature is Nature.GUARANTEED


def test_attained_bounds_exclude_nothing():
    attained = replace(bounds(), nature=Nature.ATTAINED, natures=(), inner=None)
    decision = decide(attained, {"y": 2.5})
    assert decision.possibility == (0, 1)
    assert decision.verdict == "undecided"
    assert decide(attained, {"y": 1.6}).possibility == (0.25, 1)


def test_any_of_several_limits_counts_and_margins_are_in_their_units():
    inputs = {"x": Triangular(0.0, 1.0, 2.0)}
    both = bounds(inputs, function=lambda x: {"u": x, "v": 10 * x})
    decision = decide(both, {"u": 1.6, "v": 30})
    assert decision.possibility == (0.25, 0.5)
    assert decision.margin["v"][0][0] == 10
    assert "margin of v 10 … 30 at α = 0" in str(decision)
    assert "<td>v</td>" in decision._repr_html_()


def test_over_time_the_greatest_value_counts_and_no_motion_attains_the_least():
    time = np.array([0.0, 1.0, 2.0])
    lower = np.array([[[0.0], [0.5], [-1.0]], [[0.5], [1.0], [0.0]]])
    upper = np.array([[[1.0], [3.0], [2.0]], [[0.5], [2.0], [1.0]]])
    blank = np.full((2, 3, 1, 1), np.nan)
    motion = Bounds(
        alpha=np.array([0.0, 1.0]),
        lower=lower,
        upper=upper,
        lower_at=blank,
        upper_at=blank,
        error=0 * lower,
        nature=Nature.GUARANTEED,
        outputs=("q",),
        inputs=X,
        method="modal",
        time=time,
        inner=Ends(lower, upper),
    )
    assert decide(motion, {"q": 2.5}).possibility == (0, 1)
    assert decide(motion, {"q": 0.9}).necessity == (0.0, 1.0)
    assert decide(motion, {"q": 0.4}).necessity[0] == 1.0


def test_a_claim_of_the_inputs_bounds_the_probability():
    number = from_data(np.arange(1.0, 20.0), "next value", bounds=(0, 100))
    decision = decide(bounds({"x": number}, alpha=[0, 0.1, 0.5, 1]), {"y": 15.1})
    assert decision.possibility[0] <= number.membership(15.1) <= decision.possibility[1]
    assert "lies in its α-cut with P >= 1 - α" in str(decision)


def test_a_crisp_interval_is_possible_or_not():
    decision = decide(bounds({"x": Interval(0, 1)}, alpha=[0.0, 1.0]), {"y": 0.5})
    assert decision.possibility == (1, 1)
    assert decision.necessity == (0, 0)
