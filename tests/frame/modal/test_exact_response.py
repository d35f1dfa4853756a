"""Exact values and gradients at single nodes, and what polishes the bounds of many inputs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from alphacut.frame import Accelerogram, Exact, LinearFlow, MatrixStructure, StoreyFrame, envelope
from alphacut.frame.boxes import UnitFlow, boxes
from alphacut.frame.calculus import box_quadratic
from alphacut.frame.calculus.c_library import c_library
from alphacut.frame.calculus.damped_modes import DampedModes
from alphacut.frame.calculus.jet import Array
from alphacut.frame.methods.auto import Auto, ToleranceError
from alphacut.frame.methods.modal import Modal
from alphacut.frame.methods.plan import candidates
from alphacut.frame.modal import fitting
from alphacut.frame.modal.exact_response import ExactResponse
from alphacut.frame.modal.fitting import fit_modes, fit_points, hopeless
from alphacut.frame.modal.ground_response import LoadTables
from alphacut.frame.modal.levels import ENDS, UNSEEN
from alphacut.frame.modal.proportional_response import ProportionalResponse, exact_response
from alphacut.frame.modal.search import QUIET
from alphacut.frame.structures.linear import LinearSystem
from alphacut.frame.structures.modes import ModalError
from alphacut.fuzzy import Interval
from tests.frame.compiler import compiled

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
ACCELERATED = ("a2", "v3", "drift1")
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
        replace(FRAME, dampers=(), damping_ratio=0.03, ground=RECORD),
        replace(FRAME, dampers=(), damping_ratio=0.02, rayleigh=(0.2, 1e-3), outputs=ACCELERATED),
        replace(FRAME, dampers=(), ground=RECORD, gravity=1.0, rayleigh=(0.2, 0.0)),
    ],
    ids=["free", "record", "ratio", "overdamped", "ratio, record", "Rayleigh", "P-Delta"],
)
def test_values_and_gradients_are_those_of_exact_trajectories(system: StoreyFrame) -> None:
    last = "d1" if any(system.dampers) else "zeta" if system.ratios else "rayleigh_mass"
    names = ("E", "m2", "l1", "q3_0", last)
    flow = unit_flow(system, names, 0.1)
    try:
        model = fit_modes(flow.flow, flow.boxes, tolerance=1e-3, budget=60)  # type: ignore[arg-type]
    except ModalError:
        calm = unit_flow(FRAME, names, 0.1)
        model = fit_modes(calm.flow, calm.boxes, tolerance=1e-3, budget=60)  # type: ignore[arg-type]
        model = replace(model, flow=flow.flow, boxes=flow.boxes)
    exact = exact_response(model, np.array([1.0, 2.0, 3.0]))
    assert isinstance(exact, ProportionalResponse) is not any(system.dampers)
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


COARSE = StoreyFrame(
    (18575.0, 6118.0, 17379.0),
    stiffness=(1.219e8, 2.44e8, 1.319e8),
    dampers=(3010.0, 2444.0, 3028.0),
    damper_placement="storey",
    outputs=("shear1", "q3", "a2"),
    ground=Accelerogram(0.3, np.array([-3.3, 1.9, 4.7, -5.0, -1.1])),
)


@pytest.mark.parametrize("step", [0.05, 0.384, 2.0])
def test_values_under_a_record_are_exact_with_nodes_however_far_apart(step: float) -> None:
    modal, names = COARSE.parameters, ("m1", "m2", "m3", "k1", "k2", "k3", "d1")
    cuts = boxes({n: Interval(0.64 * modal[n], 1.36 * modal[n]) for n in names}, (0,))
    flow = UnitFlow(LinearFlow(COARSE, names, 4 * step, step, Exact()), cuts)
    model = fit_modes(flow.flow, cuts, tolerance=1e-2, budget=60)  # type: ignore[arg-type]
    rng = np.random.default_rng(int(100 * step))
    points, node, output = rng.uniform(-1, 1, (40, 7)), rng.integers(5, size=40), np.arange(40) % 3
    true = flow.values(points)
    for exact in (ExactResponse.of(model, np.ones(3)), exact_response(model, np.ones(3))):
        found = exact.value_at(points, node, output)
        peak = np.abs(true).max((0, 1))[output]
        assert (np.abs(found - true[np.arange(40), node, output]) < 1e-8 * peak).all()
        value, gradient, _ = exact.at(points, node, output)
        assert (np.abs(value - found) < 1e-9 * peak).all()
        ahead = exact.value_at(points + 1e-6 * np.eye(7)[0], node, output)
        behind = exact.value_at(points - 1e-6 * np.eye(7)[0], node, output)
        turned = step * 4 * model.fastest
        assert (np.abs((ahead - behind) / 2e-6 - gradient[:, 0]) < 1e-6 * turned * peak).all()


def test_a_table_of_a_record_of_too_many_steps_is_refused() -> None:
    modal, names = COARSE.parameters, ("k1", "m1")
    cuts = boxes({n: Interval(0.7 * modal[n], 1.3 * modal[n]) for n in names}, (0,))
    flow = LinearFlow(COARSE, names, 1.0, 0.05, Exact())
    model = fit_modes(flow, cuts, tolerance=1e-2, budget=60)
    with pytest.raises(ModalError, match="within a step of 25 s; take a smaller one"):
        LoadTables.build(RECORD, 25.0 * np.arange(2001), model.eigenvalue, model.coefficient)


def test_extremes_at_nodes_that_do_not_guide_each_other_are_only_searched() -> None:
    inputs = {n: Interval(0.64 * x, 1.36 * x) for n, x in COARSE.parameters.items() if n in "k1 m2"}
    told = {}
    for step in (0.01, 0.384):
        found = envelope(
            COARSE, inputs, duration=3 * step, step=step, alpha=(0,), method="modal", tolerance=1
        )
        told[step] = found.nature
    assert told == {0.01: "estimated", 0.384: "searched"}


@compiled
@pytest.mark.parametrize("share", [1e-3, 0.03, 0.5], ids=["light", "usual", "heavy"])
@pytest.mark.parametrize("n", [1, 2, 6, 11])
def test_damped_modes_are_those_of_the_companion_matrix(n: int, share: float) -> None:
    rng = np.random.default_rng(n)
    roots, sets = rng.normal(size=(3, n, n)), 19  # no multiple of the sets taken together
    middle = roots @ roots.swapaxes(1, 2) + 0.2 * np.eye(n)
    slowest = np.sqrt(np.linalg.eigvals(np.linalg.solve(middle[0], middle[2])).real.min())
    middle[1] *= share * slowest / np.linalg.norm(np.linalg.solve(middle[0], middle[1]), 2)
    require_modes(middle * rng.uniform(0.9, 1.1, (sets, 3, 1, 1)))


@compiled
def test_close_frequencies_coupled_by_damping_have_their_own_modes() -> None:
    M, coupled = np.eye(3), np.array([[1.0, 0.9, 0.0], [0.9, 1.0, 0.2], [0.0, 0.2, 1.0]])
    parts = [
        [M, strength * coupled, np.diag([1.0, apart, 9.0])]
        for strength in (1e-3, 0.05, 0.2)  # each beside the others
        for apart in (1.2, 1.5, 2.0, 4.0)
    ]
    require_modes(np.array(parts))


@compiled
@pytest.mark.parametrize("place", [0, 5, 8])
def test_no_damped_modes_where_one_does_not_oscillate_or_two_are_not_told_apart(place: int) -> None:
    parts = np.array([[np.eye(2), 0.01 * np.eye(2), np.diag([1.0, 2.0])]] * 9)
    alone = (np.diag([3.0, 0.1]), np.eye(2)), (np.full((2, 2), 0.1), np.eye(2))
    twice = np.array([[0.596, -0.535], [-0.535, 0.832]]), np.diag([1.0, 1.4])
    indefinite = (0.01 * np.eye(2), np.diag([-1.0, 2.0]))
    for damping, stiffness in (*alone, twice, indefinite):
        parts[place, 1:] = damping, stiffness
        assert DampedModes.of(parts) is None


@compiled
def test_no_damped_modes_where_round_off_alone_makes_one_oscillate() -> None:
    rng = np.random.default_rng(2)
    for n in (2, 3, 8):
        for _ in range(10):
            k, m = rng.uniform(0.5, 2, (2, n))
            k[0] = 0.0  # free to drift
            K = np.diag(k + np.append(k[1:], 0)) - np.diag(k[1:], 1) - np.diag(k[1:], -1)
            assert DampedModes.of(np.array([[np.diag(m), 1e-3 * K, K]])) is None


def require_modes(parts: Array) -> None:
    """Hold compiled modes of M, D and K, shape (S, 3, n, n), to NumPy's."""
    modes, n = DampedModes.of(parts), parts.shape[-1]
    assert modes is not None
    for (M, D, K), rate, x, y in zip(parts, modes.rate, modes.right, modes.left, strict=True):
        A = np.block([[np.zeros((n, n)), np.eye(n)], [-np.linalg.solve(M, np.hstack([K, D]))]])
        true = np.linalg.eigvals(A)
        true = true[true.imag > 0]
        assert np.allclose(rate, true[np.argsort(np.abs(true))], rtol=1e-10)
        state = np.hstack([x, rate[:, None] * x])
        assert np.allclose(y @ state.T, np.eye(n), atol=1e-9)
        assert np.allclose(y @ state.conj().T, 0, atol=1e-9)


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
    point = np.zeros((1, 1))  # k = 9: both 3 rad/s
    for exact in (ExactResponse.of(model, np.ones(1)), exact_response(model, np.ones(1))):
        for t in (7, 40, 80):
            _, gradient, _ = exact.at(point, np.array([t]), np.array([0]))
            time = 0.05 * t
            assert gradient[0, 0] == pytest.approx(
                0.9 * -0.1 * time * np.sin(3 * time) / 6, rel=1e-6, abs=1e-9
            )


def test_modes_that_do_not_couple_give_what_all_give_in_many_parameters() -> None:
    stiff = replace(
        FRAME, modulus=None, second_moment=None, stiffness=(3e6, 2e6, 1e6), lengths=(), columns=()
    )
    system = replace(stiff, dampers=(), damping_ratio=0.03, ground=RECORD, outputs=ACCELERATED)
    flow = unit_flow(system, ("k1", "k2", "k3", "m1", "m2", "m3", "q1_0"), 0.05)
    model = fit_modes(flow.flow, flow.boxes, tolerance=1e-2, budget=60)  # type: ignore[arg-type]
    rng = np.random.default_rng(5)
    points, node = rng.uniform(-1, 1, (40, 7)), rng.integers(81, size=40)
    output = rng.integers(3, size=40)
    one, other = (make(model, np.ones(3)) for make in (exact_response, ExactResponse.of))
    assert isinstance(one, ProportionalResponse)
    assert one.law is not None
    assert one.law.affine
    for a, b in zip(one.at(points, node, output), other.at(points, node, output), strict=True):
        assert np.abs(a - b).max() < 1e-2 * np.abs(b).max()  # Hessians are the polynomials'
    value, gradient, _ = one.at(points, node, output)
    assert np.abs(value - other.value_at(points, node, output)).max() < 1e-11
    assert np.abs(gradient - other.at(points, node, output)[1]).max() < 1e-10


@compiled
def test_the_answer_to_the_ground_is_the_same_compiled_and_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    long = replace(FRAME, ground=Accelerogram(0.01, np.random.default_rng(1).normal(size=900)))
    flow = unit_flow(long, ("E", "m1"), 0.4, 12.0)
    model = fit_modes(flow.flow, flow.boxes, tolerance=1e-2)  # type: ignore[arg-type]
    assert model.load is not None
    assert len(model.load.starts) > 2
    rng = np.random.default_rng(6)
    rate, node = model.eigenvalue(rng.uniform(-1, 1, (50, 2))), rng.integers(240, size=50)
    fast = *model.load.response(rate, node), model.load.response_alone(rate, node)
    monkeypatch.setenv("ALPHACUT_KERNEL", "numpy")
    c_library.cache_clear()
    slow = *model.load.response(rate, node), model.load.response_alone(rate, node)
    c_library.cache_clear()
    for a, b in zip(fast, slow, strict=True):
        assert np.abs(a - b).max() < 1e-12 * np.abs(b).max()
        assert not np.array_equal(a, b)


@compiled
@pytest.mark.parametrize("seed", range(6))
def test_compiled_modes_give_what_eigenvectors_give(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng, n = np.random.default_rng((seed, 31)), 1 + seed
    kinds = [f"{kind}{z + 1}" for z in range(n) for kind in ("q", "v", "a", "drift", "shear")]
    damped = (tuple(10 ** rng.uniform(1, 4, n)), ("storey", "ground")[seed % 2])
    system = StoreyFrame(
        tuple(rng.uniform(1e4, 3e4, n)),
        tuple(rng.uniform(2.5, 3.5, n)),
        25e9,
        2e-5,
        *damped,  # type: ignore[arg-type]
        tuple(rng.uniform(0.01, 0.1, n)),
        tuple(rng.uniform(0.01, 0.1, n)),
        tuple(rng.choice(kinds, 4, replace=False)),
        (0.1, 1e-3) if seed % 3 else (0.0, 0.0),
        RECORD if seed % 2 else None,
        gravity=9.81 if seed > 3 else 0.0,
    )
    names = ("E", "m1", "d1", f"l{n}", f"q{n}_0", "rayleigh_mass")[: 6 if seed % 3 else 5]
    flow = unit_flow(system, names, 0.1)
    model = fit_modes(flow.flow, flow.boxes, tolerance=1e-1, budget=60)  # type: ignore[arg-type]
    points, node = rng.uniform(-1, 1, (200, len(names))), rng.integers(81, size=200)
    points[20:40], output = points[20], rng.integers(4, size=200)
    own, every = flow.boxes.to_physical(points), np.arange(200)
    fast = ExactResponse.of(model, np.ones(4))
    assert fast._compiled(own, every, node, output, deep=True) is not None
    found = (*fast.at(points, node, output), fast.value_at(points, node, output))
    monkeypatch.setenv("ALPHACUT_KERNEL", "numpy")
    c_library.cache_clear()
    slow = ExactResponse.of(model, np.ones(4))
    assert slow._compiled(own, every, node, output, deep=True) is None
    twin = (*slow.at(points, node, output), slow.value_at(points, node, output))
    c_library.cache_clear()
    for a, b in zip(found, twin, strict=True):
        for o in range(4):
            mine = output == o
            assert np.abs(a[mine] - b[mine]).max() < 1e-11 * np.abs(b[mine]).max()


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


@compiled
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


@pytest.mark.parametrize("d", [1, 2, 4, 6])
def test_compiled_global_maxima_are_those_of_numpy(d: int, monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(d + 40)
    g, H = rng.normal(size=(300, d)), rng.normal(size=(300, d, d))
    H = (H + H.swapaxes(1, 2)) / 2 - rng.choice([0.0, 2.0], (300, 1, 1)) * np.eye(d)
    low, high = -rng.random((300, d)), rng.random((300, d))
    fast = box_quadratic.global_maximum(g, H, low, high)
    monkeypatch.setattr(box_quadratic, "_compiled_maximum", lambda *_: False)
    slow = box_quadratic.global_maximum(g, H, low, high)
    assert np.abs(fast - slow).max() < 1e-10
    assert ((fast > low) & (fast < high)).any()


def test_auto_starts_nothing_that_is_expected_to_take_too_long() -> None:
    flow = unit_flow(FRAME, ("E", "m1"), 0.05)
    plan = candidates(flow, 20000)
    assert [candidate.name for candidate in plan] == ["modal", "improved-graph-follower"]
    assert all(0 < candidate.seconds < 1000 for candidate in plan)
    with pytest.raises(ToleranceError, match=r"modal not started.*follower not started"):
        Auto(tolerance=1e-3, seconds=1e-5).run(flow)
    assert Auto(tolerance=1e-3, seconds=1e5).run(flow).method == "modal"
