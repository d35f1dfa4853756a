"""What time stepping adds to envelopes, and what is refused: steps that are unstable, motions that
do not exist.
"""

from __future__ import annotations

import warnings
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from alphacut.frame import (
    Accelerogram,
    Exact,
    LagrangianSystem,
    LinearFlow,
    Midpoint,
    RungeKutta4,
    StoreyFrame,
    envelope,
    guard,
)
from alphacut.frame.boxes import UnitFlow, boxes
from alphacut.frame.checks.step_error import MARGIN, step_error
from alphacut.frame.dynamics.nonlinear import LagrangianFlow, StepError
from alphacut.frame.methods.auto import ToleranceError
from alphacut.fuzzy import Interval, Triangular

FRAME = StoreyFrame((10.0, 20.0), (3.0, 3.0), 25e9, 1e-6, q0=(0.0, 0.1))


def duffing() -> LagrangianSystem:
    def lagrangian(q: Any, v: Any, p: Any) -> Any:
        return p["m"] * v[0] ** 2 / 2 - q[0] ** 2 / 2 - p["a"] * q[0] ** 4 / 4

    observed = {"x": lambda q, v, p: q[0], "v": lambda q, v, p: v[0]}
    force = lambda q, v, p: [-p["c"] * v[0]]  # noqa: E731
    return LagrangianSystem(
        1, {"m": 1.0, "a": 0.5, "c": 0.1}, lagrangian, lambda p: ([1.0], [0.0]), observed, force
    )


DUFFING = duffing()
INPUTS = {"a": Triangular(0.3, 0.5, 0.8), "c": Triangular(0.05, 0.1, 0.2)}
TIME: dict[str, Any] = {"duration": 10.0, "step": 0.02, "alpha": (0,)}


def truth(a: float, c: float) -> np.ndarray:
    nodes = np.linspace(0, 10, 501)
    right = lambda t, y: [y[1], -y[0] - a * y[0] ** 3 - c * y[1]]  # noqa: E731
    return solve_ivp(right, (0, 10), [1, 0], t_eval=nodes, rtol=1e-9, atol=1e-11).y.T


def test_the_stated_error_covers_that_of_time_stepping() -> None:
    values = np.array([truth(a, c) for a in np.linspace(0.3, 0.8, 11) for c in (0.05, 0.1, 0.2)])
    for options in ({}, {"method": "auto", "tolerance": 2e-3}):
        found = envelope(DUFFING, INPUTS, **TIME, **options)
        missed = np.maximum(values.max(0) - found.upper[0], found.lower[0] - values.min(0))
        assert found.error is not None
        assert (missed <= found.error[0] + 1e-9).all()
        assert missed.max() > 3e-4
        assert float(found.facts["step_error"]) == pytest.approx(1.5 * 6.05e-4, rel=0.02)  # of x
    assert float(found.facts["estimated_error"]) > float(found.facts["step_error"])


def test_the_estimate_is_the_error_of_every_scheme() -> None:
    for scheme, step in (("midpoint", 0.02), ("composition4", 0.1), ("rk4", 0.1)):
        found = envelope(
            DUFFING,
            {"a": Interval(0.5, 0.5)},
            duration=10.0,
            step=step,
            alpha=(0,),
            method="vertex",
            integrator=scheme,
        )
        values = LagrangianFlow(DUFFING, (), 10.0, step, scheme).values(np.zeros((1, 0)))[0]
        exact = truth(0.5, 0.1)[:: round(step / 0.02)]
        assert float(found.facts["step_error"]) == pytest.approx(
            MARGIN * np.abs(values - exact).max(), rel=0.2
        )
        assert found.error is None


def test_a_coarse_step_warns_and_one_that_leaves_the_motion_is_refused() -> None:
    with pytest.warns(UserWarning, match="step: 1 s leaves an error of time stepping"):
        envelope(DUFFING, INPUTS, duration=10.0, step=1.0, alpha=(0,), method="vertex")
    with pytest.raises((StepError, ValueError), match="take a smaller step"):
        envelope(
            DUFFING,
            {"a": Interval(0.3, 90.0)},
            duration=10.0,
            step=1.0,
            alpha=(0,),
            method="vertex",
            integrator="rk4",
        )
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        envelope(DUFFING, INPUTS, duration=10.0, step=0.02, alpha=(0,), method="vertex")


def test_a_motion_that_does_not_exist_is_named() -> None:
    with pytest.raises(ValueError, match=r"not finite from t = 0.*at m = 0;"):
        envelope(DUFFING, {"m": Interval(0, 1)}, **TIME, method="vertex")
    points = np.array([[1e4], [0.0], [2e4]])
    with pytest.raises(ValueError, match=r"singular at m1 = 0; keep the parameters"):
        LinearFlow(FRAME, ("m1",), 1, 0.1, Exact()).values(points)
    with pytest.raises(StepError, match=r"did not converge.*it failed at a = 1e\+30"):
        LagrangianFlow(DUFFING, ("a",), 4, 1.0).values(np.array([[0.5], [0.4], [1e30], [0.3]]))


def test_an_unstable_step_is_refused_with_one_that_is_stable() -> None:
    inputs = {"E": Triangular(24e9, 25e9, 26e9)}
    for scheme in ("rk4", RungeKutta4()):
        with pytest.raises(
            ValueError,
            match=r"omega_max h = 7.*unstable; take at most some 0\.0.* s, or the integrator"
            r" exact or midpoint$",
        ) as refused:
            envelope(
                FRAME,
                inputs,
                duration=10.0,
                step=0.1,
                alpha=(0,),
                method="vertex",
                integrator=scheme,
            )
        step = float(str(refused.value).split("some ")[1].split(" s")[0])
        envelope(
            FRAME,
            inputs,
            duration=100 * step / 2,
            step=step / 2,
            alpha=(0,),
            method="vertex",
            integrator=scheme,
        )


def test_the_dominant_error_is_of_one_output_in_its_unit() -> None:
    mixed = replace(FRAME, masses=(2e4, 1e4), outputs=("q2", "base_shear"))
    found = envelope(
        mixed,
        {"E": Triangular(24e9, 25e9, 26e9)},
        duration=4.0,
        step=0.04,
        alpha=(0,),
        method="improved-graph-follower",
    )
    assert str(found.facts["dominant_error"]).startswith("time stepping: ")
    assert " m of q2 against " in str(
        found.facts["dominant_error"]
    ) or " N of base_shear against " in str(found.facts["dominant_error"])
    # in metres, though the shear is hundreds of newtons
    assert float(found.facts["step_error"]) < 0.01
    assert found.error is not None
    # judged against the exact motion, the error holds that of time stepping without its margin
    assert found.error[0, :, 0].max() > float(found.facts["step_error"]) / MARGIN


def test_the_guard_says_what_it_found() -> None:
    fine, coarse = (guard(FRAME, step, 10.0) for step in (0.0001, 0.1))
    assert "not above 0.5" in fine.message
    assert "take a step" not in fine.message
    assert "take a step of at most" in coarse.message
    with pytest.raises(ValueError, match="a LagrangianSystem has no fixed frequencies"):
        guard(DUFFING, 0.02, 10.0)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="step: -1 s"):
        guard(FRAME, -1.0, 10.0)


def test_time_stepping_is_judged_where_bounds_are_reached_and_a_resonance_may_be() -> None:
    """A storey that resonates with a sine between the corners of its support, at a coarse step."""
    omega, h = np.random.default_rng().uniform(2.9, 3.3), 0.03
    sine = Accelerogram(h, 0.7 * np.sin(omega * h * np.arange(1001)))
    frame = StoreyFrame([1e4], stiffness=[1.5e5], damping_ratio=0.01, ground=sine, outputs=("q1",))
    inputs = {"k1": Interval(0.6e5, 2.4e5)}
    common: dict[str, Any] = {"duration": 1000 * h, "step": h, "alpha": (0,)}
    common |= {"integrator": "midpoint", "relative": True}
    with pytest.warns(UserWarning, match="error of time stepping"):
        found = envelope(frame, inputs, method="quasi-monte-carlo", samples=128, **common)
    flow = LinearFlow(frame, ("k1",), 1000 * h, h, Midpoint())
    at = np.unique(np.concatenate([found.lower_at, found.upper_at]))[:, None]
    wrong = np.abs(flow.values(at) - replace(flow, integrator=Exact()).values(at)).max()
    peak = np.maximum(np.abs(found.lower), np.abs(found.upper)).max()
    at_corners = step_error(UnitFlow(flow, boxes(inputs, (0,)), relative=True)).max()
    assert at_corners < wrong <= found.facts["step_error"]
    with pytest.raises(ToleranceError, match=r"auto: the error of time stepping, .* of each peak"):
        envelope(frame, inputs, tolerance=wrong / peak, **common)
