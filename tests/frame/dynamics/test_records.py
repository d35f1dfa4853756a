"""Motions under records of every kind against the exact motion, which shares no code with them."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from alphacut.frame import Accelerogram, Exact, Force, History, LinearFlow, StoreyFrame
from alphacut.frame.boxes import boxes
from alphacut.frame.dynamics.flow import trajectory
from alphacut.frame.modes.modal_model import ModalModel
from alphacut.frame.structures.linear import evaluate
from alphacut.frame.verification.self_test import structures_at
from alphacut.fuzzy import Interval

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
    (exact,) = structures_at(frame, SimpleNamespace(inputs={}), np.zeros((1, 0)))
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


def test_tables_of_the_modes_are_exact_under_any_record() -> None:
    rng = np.random.default_rng(2)
    for _ in range(10):
        frame = replace(random_structure(rng), dampers=())
        step = float(rng.choice(NODES))
        cuts = boxes({"E": Interval(frame.modulus, 1.0001 * frame.modulus)}, (0,))
        flow = LinearFlow(frame, ("E",), round(4 / step) * step, step, Exact())
        model = ModalModel.of_degree(flow, cuts, 4)
        truth = motion(replace(frame, modulus=1.0001 * frame.modulus), flow.time)
        everywhere = (np.ones((truth.size, 1)), *map(np.ravel, np.indices(truth.shape)))
        for values in (model.values(np.ones((1, 1)))[0], model.at(*everywhere)[0]):
            wrong = np.abs(values.reshape(truth.shape) - truth).max(0)
            assert (wrong < 1e-10 * np.abs(truth).max(0)).all()


@pytest.mark.parametrize("turn", [1.99, 7.9, 31.0])
def test_fast_motions_turn_as_far_in_a_step_as_its_rule_allows(turn: float) -> None:
    noise = Accelerogram(0.013, np.random.default_rng(4).standard_normal(250))
    frame = StoreyFrame((1.0,), (1.0,), (turn / 0.1) ** 2 / 24, 1.0, outputs=("q1", "v1"))
    assert deviation(replace(frame, ground=noise), 0.1) < 1e-10
