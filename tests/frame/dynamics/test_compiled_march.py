"""The compiled march of Lagrangian systems against its NumPy twin."""

from __future__ import annotations

import time

import numpy as np
import pytest

from alphacut.frame import LagrangianFlow, LagrangianSystem, pendulum
from alphacut.frame.calculus.c_library import c_library
from alphacut.frame.calculus.jet import Jet, cos
from alphacut.frame.dynamics.flow import StepError
from alphacut.frame.dynamics.nonlinear import SCHEMES
from tests.frame.compiler import compiled

SPRINGS = LagrangianSystem(
    2,
    {"m": 1.0, "k": 4.0, "c": 0.1, "l": 0.7, "g": 9.81},
    lambda q, v, p: (
        p["m"] * (v[0] ** 2 + v[0] * v[1] * cos(q[1]) + v[1] ** 2) / 2
        - p["k"] * q[0] ** 2 / 2
        + p["m"] * p["g"] * p["l"] * cos(q[1])
    ),
    lambda p: ([p["l"] / 2, 0.3 * p["m"]], [0.0, p["k"] / 10]),
    {"pull": lambda q, v, p: p["k"] * q[0] + p["c"] * v[1], "q": lambda q, v, p: q[1]},
    lambda q, v, p: [-p["c"] * v[0], -p["c"] * v[1]],
)
NAMES = ("k", "c", "m")
POINTS = np.array([[4.0, 0.1, 1.0], [3.6, 0.2, 1.1], [4.4, 0.0, 0.9]])


def twins(scheme: str) -> tuple[LagrangianFlow, LagrangianFlow]:
    compiled, plain = (LagrangianFlow(SPRINGS, NAMES, 2.0, 0.02, scheme) for _ in range(2))
    plain.__dict__["_compiled"] = None
    return compiled, plain


@compiled
@pytest.mark.parametrize("scheme", SCHEMES)
def test_compiled_trajectories_and_derivatives_are_those_of_numpy(scheme: str) -> None:
    compiled, plain = twins(scheme)
    if compiled._compiled is None:
        pytest.fail("no compiler in the project's own environment")
    fast, slow = compiled.taylor(POINTS), plain.taylor(POINTS)
    for part in ("value", "first", "second"):
        a, b = getattr(fast, part), getattr(slow, part)
        assert np.abs(a - b).max() < 1e-11 * np.abs(b).max()
    assert np.abs(compiled.values(POINTS) - slow.value).max() < 1e-11


@compiled
@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_compiled_trajectory_does_not_depend_on_those_beside_it(scheme: str) -> None:
    flow = LagrangianFlow(SPRINGS, NAMES, 2.0, 0.02, scheme)
    many = flow.taylor(np.vstack([POINTS, 1.3 * POINTS[0], *[POINTS] * 2, 0.8 * POINTS[1]]))
    alone = [flow.taylor(point[None]) for point in POINTS]
    for k, one in enumerate(alone):
        assert np.array_equal(many.value[k], one.value[0])
        assert np.array_equal(many.second[:, :, k], one.second[:, :, 0])


def test_without_a_compiler_numpy_marches(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ALPHACUT_KERNEL", "numpy")
    c_library.cache_clear()
    flow = LagrangianFlow(SPRINGS, NAMES, 0.2, 0.02)
    assert flow._compiled is None
    assert np.isfinite(flow.taylor(POINTS).second).all()
    c_library.cache_clear()


def test_a_compiled_step_that_fails_names_the_step_and_the_parameters() -> None:
    point = np.array([[1.0, 1.0, 0.1], [1.0, 1.0, 2e9]])
    with pytest.raises(StepError, match=r"a step of 4 s did not converge .* it failed at l = 1"):
        LagrangianFlow(pendulum(phi0=3.0), ("l", "m", "d"), 400.0, 4.0).values(point)


@compiled
def test_many_trajectories_cost_a_fraction_of_numpy() -> None:
    compiled, plain = twins("midpoint")
    many = np.tile(POINTS, (10, 1))
    seconds = []
    for flow in (compiled, plain):
        found: Jet = flow.taylor(many)
        begun = time.process_time()
        found = flow.taylor(many)
        seconds.append(time.process_time() - begun)
        assert np.isfinite(found.value).all()
    assert 5 * seconds[0] < seconds[1]
