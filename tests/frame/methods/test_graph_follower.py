"""The Graph Follower on the paper's frame: its numbers, its switches, and bounds that are attained."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from alphacut import frame
from alphacut.frame import Envelope, GraphFollower, envelope
from alphacut.frame.boxes import UnitFlow, boxes
from alphacut.frame.calculus import box_quadratic
from alphacut.frame.calculus.box_quadratic import gain, global_maximum, local_maximum
from alphacut.fuzzy import Triangular
from benchmarks.frame.envelopes import FRAME
from benchmarks.frame.references.alpha_cut_optimisation import CutOptimisation
from tests.frame.nesting import nesting_violation

E = {"E": Triangular(22.7626e9, 24.7561e9, 25.8312e9)}
MASSES = {f"m{i + 1}": Triangular(0.95 * m, m, 1.05 * m) for i, m in enumerate(FRAME.masses)}


@pytest.fixture(scope="module")
def short() -> Envelope:
    return envelope(FRAME, {**E, **MASSES}, duration=5, step=0.02, method="graph-follower")


def followed_plainly(flow: UnitFlow, tolerance: float) -> tuple[np.ndarray, np.ndarray]:
    """Bounds of the widest box and points of all graphs, by section 5.3 word for word."""
    points = [flow.boxes.to_unit(flow.boxes.modal)]
    jets = [flow.taylor(points[0][None])]
    for level, node in product(reversed(range(len(flow.boxes.alpha))), range(len(flow.time))):
        low, high = flow.boxes.unit(level)
        new = []
        for output, sign in product(range(len(flow.outputs)), (-1, 1)):
            best = int(np.argmax([sign * jet.value[0, node, output] for jet in jets]))
            g = sign * jets[best].first[:, 0, node, output]
            H = sign * jets[best].second[:, :, 0, node, output]
            at = points[best]
            x = local_maximum(g[None], H[None], (low - at)[None], (high - at)[None])
            if gain(g[None], H[None], x)[0] > tolerance:
                point = np.clip(at + x[0], low, high)
                if all(np.abs(point - other).max() > 1e-9 for other in [*points, *new]):
                    new.append(point)
        points += new
        jets += [flow.taylor(point[None]) for point in new]
    values = np.array([jet.value[0] for jet in jets])
    return np.stack([values.min(0), values.max(0)]), np.array(points)


@pytest.mark.parametrize("seed", range(3))
def test_the_same_graphs_as_when_every_node_asks_every_graph(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n = seed + 1
    masses, heights = rng.uniform(5e3, 1e4, n), rng.uniform(2.3, 3.2, n)
    start = {"q0": rng.uniform(-0.03, 0.03, n), "v0": rng.uniform(-0.2, 0.2, n)}
    system = frame.StoreyFrame(masses, heights, 25e9, 1e-5, (2e3,) * n, **start)
    inputs = {"E": Triangular(23e9, 25e9, 28e9), "d1": Triangular(1e3, 2e3, 4e3)}
    inputs["m1"] = Triangular(0.9 * masses[0], masses[0], 1.1 * masses[0])
    cuts = boxes(inputs, (0.0, 0.5, 1.0))
    flow = UnitFlow(frame.LinearFlow(system, cuts.names, 2, 0.02), cuts)
    found = GraphFollower(tolerance=2e-4).follow(flow)
    bounds, points = followed_plainly(flow, 2e-4)
    assert len(points) > 10
    assert found.storage.points == pytest.approx(points, abs=1e-9)
    assert np.abs(found.bounds[0] * [-1, 1] - np.moveaxis(bounds, 0, -1)).max() < 1e-12
    assert (found.best[-1] == 0).all()
    assert (found.best[:, 0] == 0).all()  # of equal graphs the first


def test_minima_quoted_in_the_paper() -> None:
    found = envelope(FRAME, E, duration=5, step=0.01, method="graph-follower").minimum[0]
    assert found[0] == pytest.approx(-0.293, abs=1e-3)
    assert found[1] == pytest.approx(-0.383, abs=1e-3)


def test_bounds_are_attained_by_the_parameters_given(short: Envelope) -> None:
    flow = frame.LinearFlow(FRAME, short.parameters, 5, 0.02)
    for node, output in ((40, 0), (173, 2), (250, 1)):
        for bound, at in ((short.lower, short.lower_at), (short.upper, short.upper_at)):
            assert flow.values(at[1, node, output][None])[0, node, output] == pytest.approx(
                bound[1, node, output], abs=1e-12
            )


def test_cuts_are_nested_and_the_modal_cut_has_no_width(short: Envelope) -> None:
    assert nesting_violation(short) == 0
    assert np.abs(short.upper[-1] - short.lower[-1]).max() == 0
    assert (short.upper[0] - short.lower[0]).max() > 0.05


def test_random_trajectories_stay_within_the_tolerance(short: Envelope) -> None:
    sampled = envelope(
        FRAME,
        {**E, **MASSES},
        duration=5,
        step=0.02,
        alpha=short.alpha,
        method="quasi-monte-carlo",
        samples=1024,
    )
    assert max((sampled.upper - short.upper).max(), (short.lower - sampled.lower).max()) < 2e-4


def test_direct_optimisation_agrees_node_by_node(short: Envelope) -> None:
    cuts = boxes({**E, **MASSES}, short.alpha)
    flow = UnitFlow(frame.LinearFlow(FRAME, cuts.names, 5, 0.02), cuts)
    for node, output, side in ((100, 0, 1), (240, 2, -1)):
        found, at, calls = CutOptimisation().bound(flow, 0, node=node, output=output, side=side)
        reached = (short.upper if side > 0 else short.lower)[0, node, output]
        assert found == pytest.approx(reached, abs=2e-4)
        assert calls > 10
        assert (np.abs(at) <= 1).all()


def test_first_order_is_a_vertex_method_and_second_order_better() -> None:
    first = envelope(
        FRAME, {**E, **MASSES}, duration=10, step=0.05, alpha=(0,), method="graph-follower", order=1
    )
    second = envelope(
        FRAME, {**E, **MASSES}, duration=10, step=0.05, alpha=(0,), method="graph-follower", order=2
    )
    assert (second.upper - first.upper).max() > 0.005
    cuts = boxes({**E, **MASSES}, (0,))
    at_corner = np.isclose(np.abs(cuts.to_unit(first.upper_at)), 1)
    assert at_corner[0, 20:].mean() > 0.9


def test_budget_ends_the_search_and_says_so() -> None:
    stopped = envelope(
        FRAME,
        {**E, **MASSES},
        duration=10,
        step=0.05,
        alpha=(0,),
        method="graph-follower",
        budget=7,
    )
    assert stopped.trajectories <= 12
    assert "budget of 7" in str(stopped.facts["reason"])


def test_record_tells_how_every_bound_came_about() -> None:
    told = frame.record(FRAME, {**E, **MASSES}, duration=5, step=0.05, output=2)
    assert (told.local_upper <= told.upper).all()
    assert (
        told.local_upper < told.upper - 1e-6
    ).any()  # post-processing improves what the sweep left
    assert {step.found for step in told.steps} >= {-1, 1}
    for step in told.steps:
        if step.found >= 0:
            assert step.side * (step.predicted - told.graphs[step.guess, step.node]) > 1e-4


@pytest.mark.parametrize("kernel", ["c", "numpy"])
def test_quadratics_over_boxes(kernel: str, monkeypatch: pytest.MonkeyPatch) -> None:
    if kernel == "numpy":
        monkeypatch.setattr(box_quadratic, "_compiled_maximum", lambda *_: False)
    rng = np.random.default_rng(5)
    g, A = rng.standard_normal((300, 3)), rng.standard_normal((300, 3, 3))
    H, low, high = A + A.swapaxes(1, 2), -rng.uniform(0, 2, (300, 3)), rng.uniform(0, 2, (300, 3))
    best = gain(g, H, global_maximum(g, H, low, high))
    grid = np.stack(np.meshgrid(*[np.linspace(0, 1, 21)] * 3), -1).reshape(-1, 3)
    dense = gain(g, H, low[:, None] + (high - low)[:, None] * grid).max(1)
    assert (best >= dense - 1e-9).all()
    assert (best <= dense + 0.2).all()
    near = gain(g, H, local_maximum(g, H, low, high))
    assert (near <= best + 1e-9).all()
    assert (np.abs(near - best) < 1e-9).mean() > 0.6


@pytest.mark.parametrize("d", [1, 2, 5, 12, 30])
def test_both_kernels_go_uphill_to_the_same_points(d: int, monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(d)
    g, A = rng.standard_normal((200, d)), rng.standard_normal((200, d, d))
    H, ends = A + A.swapaxes(1, 2) - 2 * np.sqrt(d) * np.eye(d), rng.uniform(0, 1, (2, 200, d))
    compiled = local_maximum(g, H, -ends[0], ends[1], rounds=2)
    monkeypatch.setattr(box_quadratic, "_compiled_maximum", lambda *_: False)
    plain = local_maximum(g, H, -ends[0], ends[1], rounds=2)
    apart = np.abs(gain(g, H, compiled) - gain(g, H, plain))
    assert (apart < 1e-9).mean() > 0.98  # a tie of two corners may go either way


@pytest.mark.parametrize(
    ("option", "message"),
    [
        ({"order": 3}, "order: 3"),
        ({"tolerance": -1.0}, "tolerance: -1"),
        ({"budget": 0}, "budget: 0"),
    ],
)
def test_wrong_switches_are_refused(option: dict[str, float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        GraphFollower(**option)


def test_wrong_inputs_are_refused() -> None:
    for change, message in (
        ({"method": "magic"}, "'magic' is unknown"),
        ({"integrator": "euler"}, "'euler' is unknown"),
        ({"alpha": (0, 0)}, "must rise"),
    ):
        with pytest.raises(ValueError, match=message):
            envelope(FRAME, E, duration=1, step=0.1, **change)
    with pytest.raises(ValueError, match="no uncertain parameter"):
        envelope(FRAME, {}, duration=1, step=0.1)


def test_dataset_keeps_names_and_units(short: Envelope) -> None:
    dataset = short.to_dataset()
    assert dataset["lower"].dims == ("alpha", "time", "output")
    assert dataset["upper_at"].sizes["parameter"] == 4
    assert dataset["lower"].attrs["units"] == "m"
    assert float(dataset["lower"].sel(alpha=0, output="q1").min()) == short.minimum[0, 0]


def test_rounds_need_fewer_graphs_for_a_smaller_error() -> None:
    inputs = {**E, **MASSES}
    common = {"duration": 10, "step": 0.02, "alpha": (0,)}
    truth = envelope(FRAME, inputs, **common)
    plain = envelope(FRAME, inputs, method="graph-follower", integrator="exact", **common)
    rounds = envelope(FRAME, inputs, method="improved-graph-follower", integrator="exact", **common)
    error = [
        max(np.abs(truth.upper - x.upper).max(), np.abs(truth.lower - x.lower).max())
        for x in (plain, rounds)
    ]
    assert error[1] < 6e-5
    assert error[1] < error[0]
    assert rounds.trajectories < 1.3 * plain.trajectories + 64
    assert rounds.nature == "estimated"


def test_pendulum_goes_through_the_same_door() -> None:
    inputs = {
        "m": Triangular(0.95, 1, 1.05),
        "l": Triangular(0.95, 1, 1.05),
        "phi_0": Triangular(1.4, 1.5, 1.6),
    }
    found = envelope(
        frame.pendulum(), inputs, duration=3, step=0.02, alpha=(0, 1), tolerance=0.01, batch=16
    )
    sampled = envelope(
        frame.pendulum(),
        inputs,
        duration=3,
        step=0.02,
        alpha=(0, 1),
        method="quasi-monte-carlo",
        samples=512,
    )
    assert found.outputs == ("force", "phi")
    assert max((sampled.upper - found.upper).max(), (found.lower - sampled.lower).max()) < 0.02
    assert (found.upper - sampled.upper).max() < 0.3
    assert nesting_violation(found) < 0.01


def test_outputs_of_different_units_get_their_own_tolerance() -> None:
    from dataclasses import replace

    mixed = envelope(
        replace(FRAME, outputs=("q3", "base_shear")),
        E,
        duration=4,
        step=0.05,
        alpha=(0,),
        method="graph-follower",
    )
    alone = envelope(
        replace(FRAME, outputs=("q3",)),
        E,
        duration=4,
        step=0.05,
        alpha=(0,),
        method="graph-follower",
    )
    assert mixed.trajectories < 6 * alone.trajectories
    assert mixed.to_dataset()["lower"].attrs["units"] == "SI, by output"


@pytest.mark.slow
def test_a_contest_between_neighbouring_nodes_finds_a_basin_that_every_model_missed() -> None:
    from benchmarks.frame.random_frames import TIME, random_frame

    frame, inputs = random_frame(12)
    short = {**TIME, "duration": 9.6}  # the node that was missed is at 9.5 s
    truth = envelope(frame, inputs, method="modal", tolerance=1e-5, **short)
    common = {
        "method": "improved-graph-follower",
        "integrator": "exact",
        "tolerance": 2.5e-5,
        "spread": 256,
        **short,
    }
    plain, contested = (envelope(frame, inputs, contests=n, **common) for n in (0, 3))
    errors = [
        max(np.abs(e.upper - truth.upper).max(), np.abs(e.lower - truth.lower).max())
        for e in (plain, contested)
    ]
    assert errors[0] > 2e-4
    assert errors[1] < 5e-5
