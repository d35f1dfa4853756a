"""Possibility that a frame exceeds limits, of one and several outputs, accelerations among them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from alphacut.frame import Exact, LinearFlow, StoreyFrame, envelope
from alphacut.frame.decisions.exceeding import any_exceeding, exceeding
from alphacut.frame.decisions.safe_scale import limit_search
from alphacut.frame.decisions.sure_exceeding import surely
from alphacut.frame.methods import modal
from alphacut.frame.structures.polynomial_dependence import UnprovedError
from alphacut.fuzzy import FuzzyNumber, Interval, PiecewiseLinear, Triangular
from alphacut.fuzzy.sets.stepwise import outer_steps

# one floor without damping: |q| = v0 / ω, absolute acceleration v0 ω, ω² = 24 E I / (l³ m)
RIGIDITY = 24 * 2.5e10 * 1e-6 / 27
ONE = StoreyFrame([1e3], [3.0], 2.5e10, 1e-6, v0=[0.5])
TIME = {"duration": 5.0, "step": 0.001}


def test_the_acceleration_is_the_motions_second_derivative_and_the_grounds() -> None:
    from alphacut.frame import Accelerogram

    rng = np.random.default_rng(5)
    ground = Accelerogram(0.1, np.append(rng.normal(size=30), 0.0))
    frame = StoreyFrame(
        [2e3, 1e3],
        [3.0, 3.0],
        2.5e10,
        1e-6,
        dampers=(100, 50),
        rayleigh=(0.1, 1e-3),
        ground=ground,
        outputs=("v1", "a1", "a2", "v2"),
    )
    flow = LinearFlow(frame, ("E", "m2"), 4.0, 0.001, Exact())
    v1, a1, a2, v2 = flow.values(np.array([[2.6e10, 1.1e3]]))[0].T
    at = np.interp(flow.time, 0.1 * np.arange(31), ground.acceleration)
    for v, a in ((v1, a1), (v2, a2)):
        relative = np.gradient(v, flow.time)
        smooth = slice(5, -5)
        assert np.abs(relative + at - a)[smooth].max() < 2e-2 * np.abs(a).max()


def test_one_limit_is_exceeded_as_possibly_as_is_known() -> None:
    mass = Triangular(800.0, 1000.0, 1200.0)
    limit = 0.5 * np.sqrt(1.1e3 / RIGIDITY)  # exceeded from m = 1100 on: α = 0.5
    found = exceeding(ONE, {"m1": mass}, {"q1": limit}, **TIME)
    assert found.possibility[0] <= 0.5 + 2e-3
    assert found.possibility == pytest.approx((0.5, 0.5), abs=0.01)
    assert found.necessity == (0, 0)
    assert found.verdict == "undecided"
    assert "possibility of exceeding" in str(found)


@pytest.mark.parametrize("used", [lambda number: number, lambda number: 2.0 * number / 2.0])
def test_between_known_levels_of_an_input_the_possibility_stays_open(used: Any) -> None:
    """Of m the cuts at 0, 0.5 and 1 are known, and the true ones between are rounder or straight."""
    limit = 0.5 * np.sqrt(1.1e3 / RIGIDITY)  # exceeded from m = 1100 on
    rounder = PiecewiseLinear((0, 0.5, 0.7, 1), (800, 850, 900, 1000), (1200, 1150, 1140, 1000))
    straight = PiecewiseLinear((0, 0.5, 1), (800, 850, 1000), (1200, 1150, 1000))
    known = used(outer_steps((0.0, 0.5, 1.0), (800, 850, 1000), (1200, 1150, 1000)))
    open_ = exceeding(ONE, {"m1": known}, {"q1": limit}, **TIME)
    for true in (rounder, straight):
        found = exceeding(ONE, {"m1": true}, {"q1": limit}, **TIME)
        assert found.possibility == pytest.approx((float(true.membership(1.1e3)),) * 2, abs=0.01)
        assert open_.possibility[0] <= found.possibility[0]
        assert found.possibility[1] <= open_.possibility[1]
    assert open_.possibility == pytest.approx((0.5, 1.0), abs=1e-3)
    sure = exceeding(ONE, {"m1": known}, {"q1": 0.5 * np.sqrt(900 / RIGIDITY)}, **TIME)
    assert sure.necessity == pytest.approx((0.0, 0.5), abs=1e-3)  # kept by m = 850 … 900


def test_any_of_several_limits_and_accelerations_count() -> None:
    modulus = Triangular(2e10, 2.5e10, 3e10)
    drift = 0.5 * np.sqrt(1e3 / (RIGIDITY * 0.84))  # exceeded up to E = 21 GPa: α = 0.2
    acceleration = 0.5 * np.sqrt(RIGIDITY * 1.08 / 1e3)  # exceeded from E = 27 GPa on: α = 0.6
    limits = {"drift1": drift, "a1": acceleration}
    both = exceeding(ONE, {"E": modulus}, limits, **TIME)
    assert both.possibility == pytest.approx((0.6, 0.6), abs=0.01)
    assert both.scale.nature == "guaranteed"
    one = exceeding(ONE, {"E": modulus}, {"drift1": drift}, **TIME)
    assert one.possibility == pytest.approx((0.2, 0.2), abs=0.01)


def test_one_proved_excess_proves_that_any_limit_is_passed() -> None:
    modulus = {"E": Triangular(2e10, 2.5e10, 3e10)}
    sure = exceeding(ONE, modulus, {"q1": 1e-3}, **TIME)
    sampled = replace(sure, scale=replace(sure.scale, nature="verified by sampling"))
    open_ = replace(sampled, necessity=(0.0, 0.0))
    for each in ({"a": open_, "b": sure}, {"a": sampled, "b": sure, "c": open_}):
        assert any_exceeding(each).scale.nature == "guaranteed"
    kept = replace(sampled, possibility=(0.0, 0.0), necessity=(0.0, 0.0))
    proved = replace(kept, scale=sure.scale)
    assert any_exceeding({"a": kept, "b": proved}).scale.nature == "verified by sampling"
    half = replace(proved, possibility=(0.5, 0.5))
    below = replace(kept, possibility=(0.2, 0.3))  # sampled: it may be passed more possibly
    assert any_exceeding({"a": half, "b": below}).scale.nature == "verified by sampling"


def test_a_smaller_box_or_a_wider_gap_may_have_a_proof_all_the_same() -> None:
    reach = lambda size: (np.array([1e3 - size]), np.array([1e3 + size]))  # noqa: E731
    failed = [(0.5, 0.1, "too wide")]
    search = limit_search(ONE, {"m1": 1e3}, reach, {"q1": 1.0}, **TIME, failed=failed)
    for size, gap, known in ((0.5, 0.1, True), (0.9, 0.01, True), (0.4, 0.1, False)):
        search.gap = gap
        assert bool(search.hopeless(size)) == known
    search.gap = 0.2
    assert not search.hopeless(0.9)


def test_a_box_without_a_proof_is_not_tried_for_every_limit(monkeypatch) -> None:
    tried, mass = [], {"m1": Triangular(800.0, 1000.0, 1200.0)}

    def refused(model, *, patient):
        tried.append(patient)
        raise UnprovedError("too wide")

    monkeypatch.setattr(modal, "proved_error", refused)
    failed, limit = [], 0.5 * np.sqrt(1.1e3 / RIGIDITY)
    far = exceeding(ONE, mass, {"q1": 2 * limit}, failed=failed, **TIME)
    assert (far.scale.nature, far.scale.reason) == ("verified by sampling", "too wide")
    count = len(tried)
    assert count > 0
    near = exceeding(ONE, mass, {"q1": limit}, failed=failed, **TIME)
    again = len(tried) - count  # on the smaller box up to the limit alone
    assert (near.scale.nature, near.scale.reason) == ("verified by sampling", "too wide")
    alone = exceeding(ONE, mass, {"q1": limit}, **TIME)
    assert again < len(tried) - count - again
    assert near.possibility == pytest.approx(alone.possibility, abs=1e-3)


def test_safe_and_hopeless_limits_are_told() -> None:
    modulus = {"E": Triangular(2e10, 2.5e10, 3e10)}
    assert exceeding(ONE, modulus, {"q1": 10.0}, **TIME).verdict == "safe"
    broken = exceeding(ONE, modulus, {"q1": 1e-3}, **TIME)
    assert broken.possibility == (1, 1)
    assert broken.necessity == (1, 1)
    assert broken.verdict == "unsafe"


def test_exceeding_is_as_necessary_as_keeping_is_impossible() -> None:
    inputs = {"m1": Triangular(800.0, 1000.0, 1200.0), "E": Triangular(2e10, 2.5e10, 3e10)}
    rng = np.random.default_rng()
    alpha = float(rng.uniform(0.1, 0.9))
    mass, modulus = inputs["m1"].cut(alpha).lower, inputs["E"].cut(alpha).upper
    limit = 0.5 * np.sqrt(mass / (RIGIDITY * modulus / 2.5e10))  # the least peak of this cut
    found = exceeding(ONE, inputs, {"q1": float(limit)}, **TIME)
    assert found.possibility == (1, 1)
    low, high = found.necessity
    assert low <= 1 - alpha + 1e-3
    assert high >= 1 - alpha - 1e-3  # nodes miss the peak by less
    assert high - low < 0.01
    assert found.scale.nature == "guaranteed"


def test_one_of_several_limits_may_surely_be_passed_where_none_is_by_itself() -> None:
    modulus = {"E": Triangular(2e10, 2.5e10, 3e10)}
    drift = 0.5 * np.sqrt(1e3 / (RIGIDITY * 1.08))  # passed up to E = 27 GPa: kept to 0.6
    acceleration = 0.5 * np.sqrt(RIGIDITY * 0.92 / 1e3)  # passed from 23 GPa on: kept to 0.6
    limits = {"drift1": float(drift), "a1": float(acceleration)}
    each = {k: exceeding(ONE, modulus, {k: x}, **TIME) for k, x in limits.items()}
    assert all(x.necessity == pytest.approx((0.4, 0.4), abs=0.01) for x in each.values())
    together = any_exceeding(each, exceeding(ONE, modulus, limits, **TIME))
    assert together.possibility == (1, 1)
    assert together.necessity[0] == 1
    assert any_exceeding(each).necessity[0] == pytest.approx(0.4, abs=0.01)


def test_what_the_model_may_be_wrong_by_counts_against_the_proof() -> None:
    number = Triangular(900.0, 1000.0, 1100.0)
    limit = float(0.5 * np.sqrt(900.0 / RIGIDITY) / 1.2)  # all peaks are 1.2 times it at least

    def reach(size: float) -> tuple[np.ndarray, np.ndarray]:
        low, high = number.cut(1 - size)
        return np.array([low]), np.array([high])

    search = limit_search(ONE, {"m1": 1e3}, reach, {"q1": limit}, 5.0, 0.001)
    search.fit(1.0)
    assert surely(search, 1.0) == (True, None)
    search.error = search.error + 0.3
    assert not surely(search, 1.0)[0]


def test_no_point_of_a_box_called_sure_keeps_the_limits() -> None:
    rng = np.random.default_rng()
    for _ in range(2):
        stiffness = 10 ** rng.uniform(-6.2, -5.8)
        frame = StoreyFrame([1e3, 800.0], [3.0, 2.8], 2.5e10, stiffness, v0=[0.3, 0.5])
        inputs: dict[str, FuzzyNumber] = {
            "E": Triangular(2e10, 2.5e10, 3.2e10),
            "m1": Triangular(700, 1000, 1200),
            "l2": Triangular(2.5, 2.8, 3.0),
        }
        flow = LinearFlow(frame, tuple(inputs), 2.0, 0.01, Exact())
        supports = np.array([x.support for x in inputs.values()])
        points = rng.uniform(*supports.T, (2000, 3))
        peaks = np.abs(flow.values(points)).max(1)
        limits = {"q1": float(np.quantile(peaks[:, 0], 0.1)), "q2": float(peaks[:, 1].max() * 1.1)}
        found = exceeding(frame, inputs, limits, duration=2.0, step=0.01)
        kept = (peaks <= [*limits.values()]).all(1)
        columns = zip(inputs.values(), points.T, strict=True)
        degree = np.min([number.membership(x) for number, x in columns], axis=0)
        assert degree[kept].max() <= 1 - found.necessity[0]
        assert degree[~kept].max() <= found.possibility[1]
        assert found.necessity[0] <= found.necessity[1] <= 1
        assert found.necessity[1] - found.necessity[0] < 0.05


def test_accelerations_under_unknown_masses_are_proved_and_attained() -> None:
    inputs = {"m1": Interval(900.0, 1100.0), "E": Interval(2.4e10, 2.6e10)}
    frame = StoreyFrame([1e3], [3.0], 2.5e10, 1e-6, v0=[0.5], outputs=("a1",))
    found = envelope(frame, inputs, duration=1.0, step=0.05, alpha=(0.0,), certify=1e-3)
    assert found.nature == "guaranteed"
    omega = np.sqrt(RIGIDITY * 2.6e10 / 2.5e10 / 900.0)  # of the fastest: |a| = v0 ω
    assert np.abs(found.lower).max() <= 0.5 * omega * (1 + 1e-3)


def six_storeys() -> tuple[StoreyFrame, dict[str, FuzzyNumber]]:
    stiffness = (60e6, 60e6, 50e6, 50e6, 40e6, 40e6)
    frame = StoreyFrame([3e4] * 6, stiffness=stiffness, damping_ratio=0.03, v0=[0.5] * 6)
    return frame, {f"k{n + 1}": Interval(0.98 * k, 1.02 * k) for n, k in enumerate(stiffness)}


def test_six_stiffnesses_under_one_ratio_are_proved_far_from_the_limit() -> None:
    frame, inputs = six_storeys()
    flow = LinearFlow(replace(frame, outputs=("drift1",)), (), 1.0, 0.05, Exact())
    peak = float(np.abs(flow.values(np.zeros((1, 0)))).max())
    for limit, verdict in ((2.0, "safe"), (0.4, "unsafe")):
        found = exceeding(frame, inputs, {"drift1": limit * peak}, duration=1.0, step=0.05)
        assert (found.verdict, found.scale.nature) == (verdict, "guaranteed")


@pytest.mark.parametrize(("limit", "word"), [(2.0, "kept"), (0.4, "exceeded")])
def test_a_verdict_names_the_lowest_level_that_it_is_of(limit: float, word: str) -> None:
    """Of cuts below that level nothing is known, and none is called safe or unsafe."""
    frame, inputs = six_storeys()
    flow = LinearFlow(replace(frame, outputs=("drift1",)), (), 1.0, 0.05, Exact())
    peak = float(np.abs(flow.values(np.zeros((1, 0)))).max())
    limits, time = {"drift1": limit * peak}, {"duration": 1.0, "step": 0.05}
    for lowest in (0.05, 0.9):
        found = exceeding(frame, inputs, limits, lowest=lowest, **time)
        assert found.verdict == f"{word} from α = {lowest:g} up; open below"
        assert str(found).startswith(found.verdict)


@pytest.mark.parametrize(("limit", "passed"), [(0.009, 1), (0.011, 0)])
def test_of_a_mode_that_does_not_oscillate_the_nominal_motion_tells(
    limit: float, passed: int
) -> None:
    slow = replace(ONE, q0=[0.01], v0=[0.0], dampers=[1e6])
    found = exceeding(slow, {"E": Triangular(2.4e10, 2.5e10, 2.6e10)}, {"q1": limit}, **TIME)
    assert (found.possibility, found.necessity) == ((passed, 1), (0, passed))
    assert found.verdict == "undecided"
    assert (found.scale.witness is None) == (not passed)
    assert found.scale.reason.startswith("a mode does not oscillate")
    assert "use graph-follower" not in found.scale.reason


def test_a_release_from_the_limit_is_not_said_to_exceed_it() -> None:
    release = replace(ONE, q0=[0.01], v0=[0.0], dampers=[50.0])
    found = exceeding(release, {"E": Triangular(2.4e10, 2.5e10, 2.6e10)}, {"q1": 0.01}, **TIME)
    assert found.possibility[0] == 0
    assert found.necessity == (0, 0)
