"""Forces on floors and records of the ground: exact motions against SciPy's solver and against those
that judge proofs, which share no code with them; and bounds that no motion leaves."""

import itertools
import warnings
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from alphacut.frame import (
    Accelerogram,
    DualProof,
    Exact,
    Force,
    History,
    LinearFlow,
    Midpoint,
    Proof,
    StoreyFrame,
    UnprovedError,
    envelope,
)
from alphacut.frame.dynamics.flow import trajectory
from alphacut.frame.structures.linear import evaluate
from alphacut.frame.verification.self_test import (
    ContradictionError,
    structures_at,
    with_motions_tested,
)
from alphacut.fuzzy import Interval, Triangular

GUST = History(0.3, np.array([1.0, 1.6, 0.4, 1.1, 0.9, 1.5, 0.7]), is_static=True)
ALL = (
    Force(3, 5e3, GUST),
    Force(2, 3e3, GUST),
    Force(1, 2e3, History.harmonic(1.3, 0.4, start=0.35)),
    Force(2, 3e2, None),
    Force(3, 1e3, History.constant(1.07)),
    Force(
        1, 2e3, History(0.37, np.array([0.5, -1.0, 2.0, 1.0]), start=0.21, frequency=7, phase=-1)
    ),
    Force(3, 1e3, replace(History.harmonic(3.2, 0.4, start=0.3), is_held=False)),
)
OUTPUTS = ("q3", "drift2", "v1", "a3", "a1", "shear1")
RECORD = Accelerogram(0.13, np.array([0.5, -1.0, 0.7, 0.2, -0.4]))
FRAME = StoreyFrame(
    [2e3, 1.5e3, 1e3],
    [3, 3, 3],
    30e9,
    2e-6,
    damping_ratio=0.03,
    outputs=OUTPUTS,
    ground=RECORD,
    loads=ALL,
)


def course(force, t):
    """f(t) at the nominal amplitude, written from the definition."""
    h = force.history
    if h is None or t < h.start:
        return 0.0
    sine = np.sin(h.frequency * (t - h.start) + h.phase) if h.frequency else 1.0
    place, last = (t - h.start) / h.step, len(h.samples) - 1
    envelope = (
        np.interp(place, np.arange(last + 1), h.samples) if place < last or h.is_held else 0.0
    )
    return force.amplitude * envelope * sine


def by_solver(frame, times):
    """Outputs of a frame by an adaptive Runge–Kutta method, piece by piece between jumps."""
    m, rows = evaluate(frame, (), np.zeros((1, 0)), derivatives=False)
    M, D, K, C, n = *(x.value[0] for x in (m.mass, m.damping, m.stiffness)), rows.value[0], 3
    q0, v0 = m.q0.value[0, :, 0], m.v0.value[0, :, 0]
    for force in frame.loads:
        unit = np.eye(n)[force.at - 1]
        if force.history is None:
            v0 = v0 + np.linalg.solve(M, force.amplitude * unit)
        elif force.history.is_static:
            q0 = q0 + np.linalg.solve(K, course(force, 0.0) * unit)

    def push(t):
        total = np.zeros(n)
        for force in frame.loads:
            total[force.at - 1] += course(force, t)
        return total

    def rate(t, state, before):
        t = min(t, before)
        ground = np.interp(t, np.arange(5) * 0.13, frame.ground.samples, right=0.0)
        force = push(t) - K @ state[:n] - D @ state[n:]
        return np.append(state[n:], np.linalg.solve(M, force) - ground)

    histories = [force.history for force in frame.loads if force.history]
    ends = {x for h in histories for x in h.start + h.step * np.arange(len(h.samples))} | {0.13 * 4}
    cuts = sorted({0.0, float(times[-1]), *(float(x) for x in ends if 0 < x < times[-1] - 1e-9)})
    out, state = np.zeros((len(times), len(C))), np.append(q0, v0)
    for low, high in itertools.pairwise(cuts):
        inside = (times >= low - 1e-12) & (times < high - 1e-12) | (times == high) * (
            high == cuts[-1]
        )
        seen = np.clip(times[inside], low, high)
        found = solve_ivp(
            *(rate, (low, high), state, "DOP853"),
            args=(high - 1e-13,),
            dense_output=True,
            rtol=1e-12,
            atol=1e-13,
            max_step=0.01,
        )
        out[inside] = found.sol(seen).T @ C.T
        for o, name in enumerate(frame.outputs):
            if name[0] == "a":
                z = int(name[1:]) - 1
                out[inside, o] += [push(t)[z] / M[z, z] for t in times[inside]]
        state = found.y[:, -1]
    return out


TIMES = np.arange(151) * 0.02
NAMED = ("m1",)
"""What of an envelope is read for the structures at points: the names of its inputs."""


@pytest.fixture(scope="module")
def reference():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return by_solver(FRAME, TIMES)


def test_exact_steps_and_exact_motions_equal_a_solver(reference):
    flow = LinearFlow(FRAME, ("m1",), 3.0, 0.02, Exact())
    values = flow.values(np.array([[2e3]]))[0]
    size = np.abs(reference).max(0)
    assert (np.abs(values - reference) <= 1e-8 * size).all()
    (motion,) = structures_at(FRAME, NAMED, np.array([[2e3]]))
    judged, rounding = motion.outputs(TIMES)
    assert (np.abs(judged - reference) <= 1e-8 * size).all()
    assert (rounding <= 1e-9 * size).all()


def test_a_force_that_begins_after_the_end_does_nothing():
    late = replace(FRAME, loads=(*ALL, Force(1, 9e3, History.constant(7.0))))
    point = np.array([[2e3]])
    motions = [structures_at(x, NAMED, point)[0].outputs(TIMES)[0] for x in (FRAME, late)]
    np.testing.assert_array_equal(*motions)
    values = [LinearFlow(x, ("m1",), 3.0, 0.02, Exact()).values(point) for x in (FRAME, late)]
    np.testing.assert_allclose(*values, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("method", [Proof(), DualProof()], ids=lambda x: x.name)
@pytest.mark.parametrize("ratio", [0.5, 0.01])
def test_a_stiff_structure_under_a_constant_force_is_bounded_by_its_overshoot(method, ratio):
    """It turns by 1,500 rad in the one straight piece of the force: at most twice the static."""
    force = Force(1, 5.0, History.constant(0.05))
    frame = StoreyFrame([1.0], stiffness=[2.5e6], damping_ratio=ratio, loads=(force,))
    given = {"duration": 1.0, "step": 0.002, "alpha": (0,), "progress": False}
    found = envelope(frame, {"k1": Interval(0.95 * 2.5e6, 1.05 * 2.5e6)}, method=method, **given)
    overshoot = 1 + np.exp(-np.pi * ratio / np.sqrt(1 - ratio**2))
    assert found.upper.max() / (5 / (0.95 * 2.5e6)) == pytest.approx(overshoot, rel=0.03)
    assert found.lower.min() > -0.01 * 5 / 2.5e6


def test_midpoint_converges_with_order_two(reference):
    errors = []
    for parts in (4, 8):
        flow = LinearFlow(FRAME, ("m1",), 3.0, 0.02 / parts, Midpoint())
        errors.append(np.abs(flow.values(np.array([[2e3]]))[0, ::parts] - reference).max(0))
    assert (errors[1][:4] < 0.3 * errors[0][:4]).all()


def random_history(rng):
    """A course of any kind: gusts or a ramp, times a sine or not, late or at once, held or not."""
    is_late, is_sine = rng.random(2) < 0.5
    return History(
        rng.uniform(0.05, 0.5),
        rng.normal(1, 0.5, rng.integers(2, 9)),
        start=rng.uniform(0, 0.6) if is_late else 0.0,
        is_held=bool(rng.integers(2)),
        is_static=not is_late and bool(rng.integers(2)),
        frequency=rng.uniform(2, 25) if is_sine else 0.0,
        phase=rng.uniform(0, 6) if is_sine else 0.0,
    )


def random_frame(rng):
    """A frame of up to four floors, the lowest with fuzzy masses, forces of all kinds, some with a record."""
    n = int(rng.integers(1, 5))
    histories = [random_history(rng) for _ in range(rng.integers(1, 4))]
    loads = [Force(int(rng.integers(1, n + 1)), rng.uniform(1e3, 5e3), x) for x in histories]
    loads += [Force(n, 300.0, None)] * bool(rng.integers(2))
    frame = StoreyFrame(
        rng.uniform(1e3, 4e3, n),
        np.full(n, 3.0),
        30e9,
        10 ** rng.uniform(-6, -4.5),
        damping_ratio=rng.uniform(0.01, 0.08),
        outputs=(f"q{n}", "drift1", f"a{n}"),
        ground=Accelerogram(0.05, rng.normal(size=30)) if rng.random() < 0.4 else None,
        loads=loads,
    )
    masses = enumerate(frame.masses[:2], 1)
    inputs = {f"m{z}": Triangular(0.95 * m, m, 1.05 * m) for z, m in masses}
    name = frame.force_names[0]
    amplitude = frame.parameters[name]
    return frame, inputs | {name: Triangular(0.9 * amplitude, amplitude, 1.1 * amplitude)}


CHANGES = {"start": 0.05, "phase": 0.3, "frequency": 0.5, "samples": 0.01}
ALWAYS = 2
"""Random frames that are tested always; thirty in all are with `-m slow`."""


@pytest.mark.parametrize(
    "number", [pytest.param(k, marks=() if k < ALWAYS else pytest.mark.slow) for k in range(30)]
)
def test_a_right_proof_of_a_random_frame_agrees_with_its_judge_and_no_other_does(number, rng):
    """The envelope judges itself by exact motions; those of a force that differs contradict it."""
    frame, inputs = random_frame(rng)
    method = (DualProof(slabs=4, peaks=0.05), Proof(tolerance=2e-2))[number % 2]
    try:
        found = envelope(frame, inputs, method=method, duration=1.2, step=0.02, alpha=[0, 1])
    except UnprovedError as refusal:
        pytest.skip(str(refusal))
    assert found.facts["motions_tested"] > 0
    force = frame.loads[0]
    names = CHANGES if force.history.frequency else ("start", "samples")
    for name in names:
        changed = replace(force.history, **{name: getattr(force.history, name) + CHANGES[name]})
        other = replace(frame, loads=[replace(force, history=changed), *frame.loads[1:]])
        with pytest.raises(ContradictionError):
            with_motions_tested(found, other)


STEPS = [0.01, 0.017, 1 / 128, 1 / 256, 0.05, 0.3, np.pi / 50, 0.1 / 3]
NODES = [0.1, 0.05, 0.02, 0.013]


def random_record(rng: np.random.Generator) -> Accelerogram:
    """Noise, a pulse or a sine, mostly cut where it is not zero, of an odd step and any length."""
    step = float(rng.choice([*STEPS, rng.uniform(0.004, 0.4)]))
    count = max(2, int(rng.uniform(0.3, 6) / step))
    time = np.arange(count) * step
    kind = rng.integers(4)
    if kind == 0:
        samples = rng.standard_normal(count)
    elif kind == 1:
        samples = np.full(count, rng.uniform(-3, 3))
    elif kind == 2:
        samples = np.sin(rng.uniform(1, 20) * time + rng.uniform(0, 6))
    else:
        samples = np.where(rng.random(count) < 0.1, rng.uniform(-5, 5, count), 0.0)
        samples[0] = 2.0
    return Accelerogram(step, samples)


def random_structure(rng: np.random.Generator) -> StoreyFrame:
    n = int(rng.integers(1, 5))
    return StoreyFrame(
        rng.uniform(1e3, 1e4, n),
        rng.uniform(2.3, 3.2, n),
        rng.uniform(20e9, 30e9),
        10 ** rng.uniform(-6, -3.5),
        rng.uniform(20, 3e4, n),
        str(rng.choice(["ground", "storey"])),
        rng.uniform(-0.01, 0.01, n),
        rng.uniform(-0.1, 0.1, n),
        outputs=tuple(dict.fromkeys(("q1", f"q{n}", "v1", "shear1"))),
        ground=random_record(rng),
    )


def motion(frame: StoreyFrame, time: np.ndarray) -> np.ndarray:
    """Outputs at times by the exact motion that judges proofs."""
    (exact,) = structures_at(frame, (), np.zeros((1, 0)))
    return exact.outputs(time)[0]


def deviation(frame: StoreyFrame, step: float) -> float:
    """Largest error of exact values, by outputs and by values or derivatives, over the peak."""
    duration = round(4 / step) * step
    flow, point = LinearFlow(frame, ("E",), duration, step, Exact()), np.array([[frame.modulus]])
    truth = motion(frame, flow.time)
    ways = [flow.values(point)[0], flow.taylor(point).value[0]]
    return max(float((np.abs(v - truth).max(0) / np.abs(truth).max(0)).max()) for v in ways)


@pytest.mark.parametrize("count", [12, pytest.param(1000, marks=pytest.mark.slow)])
def test_motions_under_any_record_are_exact(count: int) -> None:
    rng = np.random.default_rng(count)
    for number in range(count):
        structure = random_structure(rng)
        if number % 2:  # most of these have classical modes
            structure = replace(structure, dampers=())
        assert deviation(structure, float(rng.choice(NODES))) < 1e-10


@pytest.mark.parametrize(
    "dampers", [(3e3, 0.0, 8e2), (0.0, 6e5, 0.0)], ids=["swinging", "creeping"]
)
def test_derivatives_by_modes_are_those_of_the_steps(dampers: tuple[float, ...]) -> None:
    """Of the ground, a sine, a start and accelerations; one mode creeps where a damper is strong."""
    sine = Force(2, 4e3, History.harmonic(2.2, 0.3, start=0.4))
    frame = StoreyFrame(
        (2e3, 1.5e3, 1e3),
        stiffness=(3e5, 2e5, 2e5),
        dampers=dampers,
        damper_placement="storey",
        q0=(0.01, 0.0, 0.02),
        outputs=("q3", "drift1", "v2", "a2"),
        ground=random_record(np.random.default_rng(3)),
        loads=(sine,),
    )
    flow = LinearFlow(frame, ("m2", "k1", "d2", "F2"), 3.0, 0.03, Exact())
    points = np.array([[1.5e3, 3e5, dampers[1], 4e3], [1.6e3, 2.9e5, dampers[1] + 50, 3e3]])
    matrices, rows = evaluate(frame, flow.names, points, derivatives=True)
    found, by_steps = (
        flow._by_superposition(matrices, rows),
        trajectory(flow._step_map(matrices), matrices.start, rows),
    )
    assert found is not None
    for name in ("value", "first", "second"):
        a, b = getattr(found, name), getattr(by_steps, name)
        size = np.abs(b).max((-3, -2), keepdims=True)
        assert (np.abs(a - b) <= 1e-9 * size).all()


@pytest.mark.parametrize("turn", [1.99, 7.9, 31.0])
def test_fast_motions_turn_as_far_in_a_step_as_its_rule_allows(turn: float) -> None:
    noise = Accelerogram(0.013, np.random.default_rng(4).standard_normal(250))
    frame = StoreyFrame((1.0,), (1.0,), (turn / 0.1) ** 2 / 24, 1.0, outputs=("q1", "v1"))
    assert deviation(replace(frame, ground=noise), 0.1) < 1e-10
