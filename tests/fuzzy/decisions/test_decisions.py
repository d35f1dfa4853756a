"""Possibility, necessity, margins and safe tolerances, against cases that are known exactly."""

import numpy as np
import pytest

from alphacut.fuzzy import Triangular, from_data
from alphacut.fuzzy.campaign.campaign import CampaignError
from alphacut.fuzzy.decisions.limits import decide, safe_scale
from alphacut.fuzzy.decisions.nested_boxes import Scaled, Verdict, threshold
from alphacut.fuzzy.sets.stepwise import outer_steps

X = Triangular(0, 1, 2)


def test_a_linear_limit_is_exceeded_as_possibly_as_its_cut_says():
    found = decide(lambda x, y: 2 * x + y, {"x": X, "y": X}, {"y": 4.5})
    assert found.possibility == pytest.approx((0.5, 0.5), abs=1e-6)  # 3 (2 − α) = 4.5
    assert found.possibility[0] <= 0.5 <= found.possibility[1]
    assert found.necessity == (0, 0)
    assert found.margin["y"][0] == pytest.approx([-1.5, -0.75, 0, 0.75, 1.5], abs=1e-3)
    assert found.margin["y"][1] == pytest.approx([4.5, 3.75, 3, 2.25, 1.5], abs=1e-3)
    assert 2 * found.witness["x"] + found.witness["y"] > 4.5
    assert found.verdict == "undecided"


def test_what_must_be_exceeded_is_necessary():
    found = decide(lambda x: 2 * x, {"x": Triangular(2, 3, 4)}, {"y": 5})
    assert found.possibility == (1, 1)
    assert found.necessity == pytest.approx((0.5, 0.5), abs=1e-6)  # 2 (2 + α) = 5
    assert decide(lambda x: 2 * x, {"x": Triangular(2, 3, 4)}, {"y": 3.5}).verdict == "unsafe"
    assert decide(lambda x: 2 * x, {"x": Triangular(2, 3, 4)}, {"y": 8.5}).verdict == "safe"


def test_an_extreme_inside_decides():
    found = decide(lambda x: 1 - (x - 1.5) ** 2, {"x": X}, {"y": 0.91})
    assert found.possibility == pytest.approx((0.8, 0.8), abs=1e-6)  # x = 1.2 is in the cut at 0.8


def test_any_of_several_limits_decides():
    both = decide(lambda x: {"a": x, "b": -x}, {"x": X}, {"a": 1.8, "b": -0.3})
    assert both.possibility == pytest.approx((0.3, 0.3), abs=1e-6)  # b: x < 0.3


def test_a_limit_of_no_output_is_refused_and_not_dropped():
    function = lambda x: {"w": x, "s": -x}  # noqa: E731
    for asked in ({"S": 1.0}, {"w": 1.8, "S": 1.0}):
        with pytest.raises(ValueError, match=r"^limit 'S' names no output; there are w, s$"):
            decide(function, {"x": X}, asked)
        with pytest.raises(ValueError, match=r"^limit 'S' names no output; there are w, s$"):
            safe_scale(function, {"x": 1}, {"x": 0.1}, asked)


def test_outputs_without_a_limit_cost_nothing():
    def both(x, y):
        return {"w": x + y, "s": np.sin(9 * x * y) * np.cos(7 * x - y)}

    at, reach = {"x": 1, "y": 1}, {"x": 0.3, "y": 0.2}
    alone = safe_scale(lambda x, y: x + y, at, reach, {"y": 2.4})
    beside = safe_scale(both, at, reach, {"w": 2.4})
    assert (beside.safe, beside.unsafe, beside.runs) == (alone.safe, alone.unsafe, alone.runs)


def test_a_box_where_the_function_has_no_value_is_not_safe_and_a_smaller_one_is():
    root = safe_scale(lambda x: np.sqrt(x), {"x": 1}, {"x": 0.5}, {"y": 9}, tolerance=1e-6)
    assert root.safe == pytest.approx(2, abs=1e-4)
    assert root.safe <= 2
    assert "the function has no value in the box of size 2" in str(root)
    assert "x = -" in str(root)
    with pytest.raises(CampaignError, match="at x = -1"):
        safe_scale(lambda x: np.sqrt(x), {"x": -1}, {"x": 0.5}, {"y": 9})


def test_claims_make_the_possibility_a_bound_of_the_probability():
    data = from_data(np.arange(1.0, 20.0), "next value", bounds=(0, 100))
    found = decide(lambda x: 2 * x, {"x": data}, {"y": 38.5})
    assert found.possibility == pytest.approx((0.1, 0.1), abs=1e-6)
    assert "lies in its α-cut with P >= 1 - α" in str(found)


@pytest.mark.parametrize(
    ("function", "nominal", "reach", "limit", "exact"),
    [
        (lambda x, y: 2 * x + y, {"x": 1, "y": 1}, {"x": 0.1, "y": 0.2}, 3.5, 1.25),
        (lambda x, y: x * y, {"x": 1, "y": 1}, {"x": 0.1, "y": 0.2}, 1.5, (np.sqrt(13) - 3) * 2.5),
        (lambda x, y: x - y**2, {"x": 0, "y": 0.5}, {"x": 1, "y": 1}, 0.3, 1 - np.sqrt(0.45)),
        (lambda x: 1 - (x - 1) ** 2, {"x": 0}, {"x": (3.0, 0.5)}, 0.75, 1.0),
    ],
)
def test_the_safe_scale_is_exact_and_its_witness_is_unsafe(function, nominal, reach, limit, exact):
    found = safe_scale(function, nominal, reach, {"y": limit}, most=2, tolerance=2e-7)
    assert found.safe <= exact + 1e-12 <= found.unsafe + 2e-12
    assert found.unsafe - found.safe < 1e-6
    assert function(**dict(zip(nominal, found.witness, strict=True))) > limit


def test_all_of_the_safe_box_is_safe():
    found = safe_scale(
        lambda x, y: x * y**2 - x,
        {"x": 1, "y": 1},
        {"x": 0.3, "y": 0.2},
        {"y": 0.5},
        tolerance=1e-4,
    )
    rng = np.random.default_rng()
    points = rng.uniform(-1, 1, (100_000, 2))
    points[::2] = np.sign(points[::2])
    x, y = (1 + found.safe * np.array([0.3, 0.2]) * points).T
    assert (x * y**2 - x).max() <= 0.5


def test_a_family_without_a_decision_stays_open():
    family = Scaled(np.zeros(1), np.ones(1), np.ones(1))
    found = threshold(family, lambda low, high: Verdict(high[0] <= 0.25), tolerance=1e-3)
    assert found.safe == pytest.approx(0.25, abs=1e-3)
    assert found.unsafe == found.gap == np.inf
    unsafe = threshold(family, lambda low, high: Verdict(False, np.zeros(1)))
    assert (unsafe.safe, unsafe.unsafe) == (None, 0)
    assert family.size_of(np.array([-0.5])) == 0.5


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: safe_scale(lambda x: x, {"x": 1}, {"z": 1}, {"y": 2}), "the tolerances name z"),
        (lambda: safe_scale(lambda x: x, {"x": 1}, {"x": -1}, {"y": 2}), "must be 0 or greater"),
        (lambda: safe_scale(lambda x: x, {"x": 1}, {"x": 1}, {"y": 2}, most=0), "must be positive"),
    ],
)
def test_bad_tolerances_are_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_functions_of_plain_numbers_are_decided_on():
    def entry(x, y):
        return (np.linspace(0, 1, 3) * x)[2] * y  # arrays of points do not go through it

    with pytest.raises(ValueError, match="broadcast"):
        entry(np.ones(4), np.ones(4))
    found = decide(entry, {"x": X, "y": X}, {"y": 2.25})
    assert found.possibility == pytest.approx((0.5, 0.5), abs=1e-6)  # (2 − α)² = 2.25
    assert f"; {found.runs:,} runs" in str(found)
    assert found.runs > 100
    scale = safe_scale(entry, {"x": 1, "y": 1}, {"x": 0.1, "y": 0.1}, {"y": 1.21})
    assert scale.safe == pytest.approx(1, abs=1e-6)
    assert f"with {scale.runs} runs" in str(scale)


def test_the_output_that_is_limited_decides_not_the_first_of_a_list():
    found = decide(lambda x: [0 * x, 3 * x], {"x": X}, {"y[1]": 4.5})
    assert found.possibility == pytest.approx((0.5, 0.5), abs=1e-6)
    assert found.runs < 2000  # an output that is nought all over ends at once


def test_a_limit_that_the_middle_reaches_is_exceeded_beyond_it():
    found = decide(lambda x: 2 * x, {"x": X}, {"y": 2})
    assert found.possibility == pytest.approx((1, 1), abs=1e-6)


def test_what_cannot_be_enclosed_is_refused_in_a_line_before_it_runs():
    def black(x):
        calls.append(x)
        return x if x > 1 else 1.0

    calls = []
    with pytest.raises(ValueError, match=r"nothing is proved: .* `propagate` estimates") as told:
        decide(black, {"x": X}, {"y": 2})
    with pytest.raises(ValueError, match="nothing is proved: "):
        safe_scale(black, {"x": 1}, {"x": 0.1}, {"y": 2})
    assert "\n" not in str(told.value)
    assert len(calls) == 2


def test_a_budget_ends_a_proof_that_has_no_end():
    found = decide(lambda x: x - x + x, {"x": X}, {"y": 1.5}, budget=4)
    assert found.possibility[0] <= 0.5 <= found.possibility[1]
    assert found.runs < 3000


def test_a_decision_names_the_limit_that_may_be_passed_and_its_margin():
    found = decide(lambda x: {"a": x, "b": -x}, {"x": X}, {"a": 1.8, "b": 3.0})
    head, a, b, *_ = str(found).splitlines()
    assert head.startswith("possible, not certain: possibility of exceeding 0.2, necessity 0;")
    assert a == "margin of a -0.2 … 1.8 at α = 0, so that its limit may be passed"
    assert b == "margin of b 3 … 5 at α = 0"


@pytest.mark.parametrize("used", [lambda number: number, lambda number: number + 0.0])
def test_a_number_known_at_few_levels_decides_no_more_than_they_do(used):
    """A computed number's cut between two levels may be narrower, and a witness outside it."""
    known = used(outer_steps((0.0, 1.0), (0.0, 2.0), (4.0, 2.0)))
    for limit in (3.0, 1.0):
        true = decide(lambda x: x, {"x": Triangular(0, 2, 4)}, {"y": limit})
        found = decide(lambda x: x, {"x": known}, {"y": limit})
        for each, other in zip(
            (*found.possibility, *found.necessity),
            (*true.possibility, *true.necessity),
            strict=True,
        ):
            assert each == pytest.approx(round(each))
            assert abs(each - other) < 0.5 + 1e-6
        assert found.possibility[0] <= true.possibility[0]
        assert found.necessity[1] >= true.necessity[1]
