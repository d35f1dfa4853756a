"""Exact values and gradients at single nodes, and what polishes the bounds of many inputs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from alphacut.frame import Accelerogram, Exact, LinearFlow, MatrixStructure, StoreyFrame, envelope
from alphacut.frame.boxes import UnitFlow, boxes
from alphacut.frame.calculus import box_quadratic
from alphacut.frame.methods.auto import Auto, ToleranceError
from alphacut.frame.methods.modal import Modal
from alphacut.frame.methods.plan import candidates
from alphacut.frame.modal import fitting
from alphacut.frame.modal.exact_response import ExactResponse
from alphacut.frame.modal.fitting import fit_modes, fit_points, hopeless
from alphacut.frame.modal.levels import ENDS, UNSEEN
from alphacut.frame.modal.search import QUIET
from alphacut.frame.structures.linear import LinearSystem
from alphacut.frame.structures.modes import ModalError
from alphacut.fuzzy import Interval

RECORD = Accelerogram(0.017, np.random.default_rng(4).normal(size=150))
FRAME = StoreyFrame(
    (2e4, 1.5e4, 1e4),
    (3.0, 2.8, 2.7),
    25e9,
    3e-6,
    (50.0, 80.0, 60.0),
    "storey",
    (0.01, 0.03, 0.05),
    (0.1, -0.2, 0.3),
    outputs=("q3", "v1", "shear2"),
)
MANY = ("E", "m1", "m2", "m3", "l1", "d2", "q1_0", "v3_0")


def unit_flow(
    system: LinearSystem, names: tuple[str, ...], share: float, duration: float = 4.0
) -> UnitFlow:
    modal = system.parameters
    cuts = boxes({n: Interval((1 - share) * modal[n], (1 + share) * modal[n]) for n in names}, (0,))
    return UnitFlow(LinearFlow(system, cuts.names, duration, 0.05, Exact()), cuts)


@pytest.mark.parametrize(
    "system",
    [
        FRAME,
        replace(FRAME, ground=RECORD),
        replace(FRAME, dampers=(), damping_ratio=0.03, outputs=("q1", "drift2", "q3")),
        replace(FRAME, dampers=(3e5, 50.0, 50.0)),  # overdamped
    ],
    ids=["free", "record", "ratio", "overdamped"],
)
def test_values_and_gradients_are_those_of_exact_trajectories(system: StoreyFrame) -> None:
    names = ("E", "m2", "l1", "q3_0") + (("d1",) if any(system.dampers) else ("zeta",))
    flow = unit_flow(system, names, 0.1)
    try:
        model = fit_modes(flow.flow, flow.boxes, tolerance=1e-3, budget=60)  # type: ignore[arg-type]
    except ModalError:
        calm = unit_flow(FRAME, names, 0.1)
        model = fit_modes(calm.flow, calm.boxes, tolerance=1e-3, budget=60)  # type: ignore[arg-type]
        model = replace(model, flow=flow.flow, boxes=flow.boxes)
    exact = ExactResponse.of(model, np.array([1.0, 2.0, 3.0]))
    rng = np.random.default_rng(0)
    points, each = rng.uniform(-1, 1, (12, 5)), np.arange(12)
    points[5:8] = points[4]  # problems that share a point
    node, output = rng.integers(81, size=12), rng.integers(3, size=12)
    jet = flow.taylor(points).map(lambda x: x / exact.scale)
    value, gradient, _ = exact.at(points, node, output)
    true, slope = jet.value[each, node, output], jet.first[:, each, node, output].T
    assert np.abs(value - true).max() < 1e-9 * np.abs(jet.value).max()
    assert np.abs(exact.value_at(points, node, output) - true).max() < 1e-9 * np.abs(true).max()
    assert np.abs(gradient - slope).max() < 1e-8 * np.abs(slope).max()


def test_gradients_of_modes_with_one_frequency() -> None:
    two = MatrixStructure(
        parameters={"k": 9.0},
        mass=[(1.0, np.eye(2))],
        stiffness=[("k", np.diag([1.0, 0.0])), (9.0, np.diag([0.0, 1.0]))],
        observed={"sum": np.array([1.0, 1.0])},
        q0=np.array([0.1, 0.2]),
    )
    flow = unit_flow(two, ("k",), 0.1)
    model = fit_modes(flow.flow, flow.boxes, tolerance=1e-2)  # type: ignore[arg-type]
    exact, point = ExactResponse.of(model, np.ones(1)), np.zeros((1, 1))  # k = 9: both 3 rad/s
    for t in (7, 40, 80):
        _, gradient, _ = exact.at(point, np.array([t]), np.array([0]))
        time = 0.05 * t
        assert gradient[0, 0] == pytest.approx(
            0.9 * -0.1 * time * np.sin(3 * time) / 6, rel=1e-6, abs=1e-9
        )


def test_bounds_of_eight_inputs_hold_all_samples_within_their_error() -> None:
    system = replace(FRAME, outputs=("q1", "q3"))
    inputs = {n: Interval(0.9 * FRAME.parameters[n], 1.1 * FRAME.parameters[n]) for n in MANY[:-1]}
    inputs["v3_0"] = Interval(0.2, 0.4)
    found = envelope(
        system, inputs, duration=3.0, step=0.1, alpha=(0,), relative=True, tolerance=1e-3
    )
    rng = np.random.default_rng(8)
    points = rng.uniform(-1, 1, (4000, 8))
    points = np.where(rng.random(points.shape) < 0.7, np.sign(points), points)
    low, high = np.array([number.cut(0) for number in inputs.values()]).T
    exact = LinearFlow(system, MANY, 3.0, 0.1, Exact())
    values = exact.values((low + high) / 2 + (high - low) / 2 * points)
    assert found.error is not None
    assert "bounds" in found.facts
    assert (values <= found.upper[0] + found.error[0]).all()
    assert (values >= found.lower[0] - found.error[0]).all()
    for side in ("lower", "upper"):  # attained where it says
        at = getattr(found, f"{side}_at")[0, ::7].reshape(-1, 8)
        own = exact.values(at).reshape(-1, 2, 31, 2)
        for k, node in enumerate(range(0, 31, 7)):
            for o in range(2):
                assert own[k, o, node, o] == pytest.approx(
                    getattr(found, side)[0, node, o], abs=1e-9
                )


def test_what_the_last_passes_would_not_follow_is_declared() -> None:
    flow = unit_flow(replace(FRAME, outputs=("q3",)), ("E", "m1"), 0.4, 2.0)
    found = Modal(tolerance=1e-9, budget=40).run(flow)
    assert "bounds" in found.facts
    assert found.error is not None
    assert found.error.min() >= UNSEEN * ENDS * 1e-9 >= 1e-9


def test_what_the_search_of_polynomials_would_not_follow_is_declared() -> None:
    flow = unit_flow(replace(FRAME, outputs=("q3",)), ("E", "m1"), 0.02, 2.0)
    found = Modal(tolerance=1e-4).run(flow)
    assert "bounds" not in found.facts
    assert float(found.facts["search_error"]) >= 0.999 * UNSEEN * QUIET * 1e-4


def test_polynomials_are_judged_where_the_optima_lie(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fitting, "_held_out", lambda d: np.zeros((1, d)))  # says nothing
    flow = unit_flow(replace(FRAME, outputs=("q3",)), ("E", "m3"), 0.2)
    found = Modal(tolerance=1e-3).run(flow)
    corners = np.array([[a, b] for a in np.linspace(-1, 1, 21) for b in np.linspace(-1, 1, 21)])
    values = flow.values(corners)
    assert found.error is not None
    assert (values.max(0) <= found.upper[0] + found.error[0]).all()
    assert float(found.facts.get("model_error", 1.0)) > 1e-8


def test_points_of_analysis_are_nested_and_hopeless_degrees_are_not_begun() -> None:
    for d in (2, 5, 9):
        few, many = fit_points(d, 2), fit_points(d, 3)
        assert np.array_equal(few, many[: len(few)])
    assert hopeless([1e-1, 5e-2, 2.5e-2], 1e-6, 6, 280)
    assert not hopeless([1e-2, 1e-3, 1e-4], 1e-6, 3, 280)
    assert hopeless([1e-2, 1e-2, 2e-2, 3e-2], 1e-6, 3, 280)


@pytest.mark.parametrize("d", [1, 4, 12, 30])
def test_compiled_maxima_of_quadratics_are_those_of_numpy(
    d: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = np.random.default_rng(d)
    g, H = rng.normal(size=(300, d)), rng.normal(size=(300, d, d))
    H = (H + H.swapaxes(1, 2)) / 2
    low, high = -rng.random((300, d)), rng.random((300, d))
    fast = box_quadratic.local_maximum(g, H, low, high)
    assert box_quadratic._compiled_maximum(g, H, low, high, np.zeros((300, d)), 6)
    monkeypatch.setattr(box_quadratic, "_compiled_maximum", lambda *_: False)
    slow = box_quadratic.local_maximum(g, H, low, high)
    assert np.abs(fast - slow).max() < 1e-10
    assert (fast >= low).all()
    assert (fast <= high).all()


def test_auto_starts_nothing_that_is_expected_to_take_too_long() -> None:
    flow = unit_flow(FRAME, ("E", "m1"), 0.05)
    plan = candidates(flow, 20000)
    assert [candidate.name for candidate in plan] == ["modal", "improved-graph-follower"]
    assert all(0 < candidate.seconds < 1000 for candidate in plan)
    with pytest.raises(ToleranceError, match=r"modal not started.*follower not started"):
        Auto(tolerance=1e-3, seconds=1e-5).run(flow)
    assert Auto(tolerance=1e-3, seconds=1e5).run(flow).method == "modal"
