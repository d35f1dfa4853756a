"""Possibility that a frame exceeds limits, of one and several outputs, accelerations among them."""

from __future__ import annotations

import numpy as np
import pytest

from alphacut.frame import Exact, LinearFlow, StoreyFrame, envelope
from alphacut.frame.decisions.exceeding import exceeding
from alphacut.fuzzy import Interval, Triangular

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


def test_safe_and_hopeless_limits_are_told() -> None:
    modulus = {"E": Triangular(2e10, 2.5e10, 3e10)}
    assert exceeding(ONE, modulus, {"q1": 10.0}, **TIME).verdict == "safe"
    broken = exceeding(ONE, modulus, {"q1": 1e-3}, **TIME)
    assert broken.possibility == (1, 1)
    assert broken.necessity == (0, 1)


def test_accelerations_under_unknown_masses_are_not_called_proved() -> None:
    inputs = {"m1": Interval(900.0, 1100.0), "E": Interval(2.4e10, 2.6e10)}
    frame = StoreyFrame([1e3], [3.0], 2.5e10, 1e-6, v0=[0.5], outputs=("a1",))
    found = envelope(frame, inputs, duration=1.0, step=0.05, alpha=(0.0,), certify=1e-3)
    assert found.nature != "guaranteed"
