"""Bounds of floor accelerations by the integral of that of the ground."""

from dataclasses import replace

import numpy as np
import pytest

from alphacut.frame import Accelerogram, MatrixStructure, StoreyFrame
from alphacut.frame.bounds.acceleration_gain import acceleration_gain
from alphacut.frame.boxes import boxes
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.structures.linear import evaluate
from alphacut.fuzzy import Interval
from tests.frame.motions import exact_motions, random_points

FRAME = {"masses": (3.0, 2.0), "stiffness": (900.0, 400.0), "outputs": ("a1", "a2")}
DURATION = 3.0


def inputs_of(frame, share=0.05):
    return {
        name: Interval((1 - share) * x, (1 + share) * x)
        for name, x in frame.parameters.items()
        if x and not name.startswith(("q", "v"))
    }


def matrices():
    """A beam on springs, with a rotation that has no mass."""
    springs = np.array([[900.0, -300.0, 40.0], [-300.0, 300.0, -60.0], [40.0, -60.0, 90.0]])
    return MatrixStructure(
        {"m": 2.0, "k": 1.0},
        mass=[("m", np.array([[1.5, 0.2, 0], [0.2, 1.0, 0], [0, 0, 0]]))],
        stiffness=[("k", springs)],
        observed={"a1": np.eye(9)[6], "a2": np.eye(9)[7]},
        ratios=[0.05],
        pattern=np.array([1.0, 1.0, 0.0]),
    )


CASES = {
    "ratios": lambda: StoreyFrame(**FRAME, damping_ratio=0.03),
    "rayleigh": lambda: StoreyFrame(**FRAME, rayleigh=(0.6, 0.002)),
    "weights": lambda: StoreyFrame(**FRAME, damping_ratio=0.03, lengths=(3.0, 3.0), gravity=9.81),
    "matrices": matrices,
    "dashpots": lambda: StoreyFrame(**FRAME, dampers=(3.0, 1.0), damper_placement="storey"),
    "both": lambda: StoreyFrame(**FRAME, dampers=(3.0, 0.0), damping_ratio=0.03),
    "critical": lambda: StoreyFrame(**FRAME, damping_ratio=0.95),
    "strong": lambda: StoreyFrame(**FRAME, rayleigh=(0.0, 0.09)),
}


def worst_ground(frame, output, step):
    """The ground whose integral is 1 or −1 and moves the output most at the end: its impulses."""
    impulse = Accelerogram(step, np.append(1 / step, np.zeros(3)))
    point = np.array([list(frame.parameters.values())])
    names = dict.fromkeys(frame.parameters)
    found = exact_motions(frame.moved_by(impulse), point, names, DURATION, step)[0, :, output]
    integral = np.sign(np.diff(found, append=0.0))[::-1]
    return np.diff(integral, prepend=0.0) / step


@pytest.mark.parametrize("kind", CASES)
def test_no_ground_of_a_small_integral_moves_the_floors_more(rng, kind):
    """By a random ground, and by the worst one, of structures in the box."""
    frame, step = CASES[kind](), 0.01
    inputs = inputs_of(frame)
    gain = acceleration_gain(frame, boxes(inputs, [0.0]), DURATION)
    points = random_points(inputs, 30, rng)
    largest = np.zeros(2)
    count = round(DURATION / step) + 1
    grounds = [rng.normal(size=count), *(worst_ground(frame, k, step) for k in range(2))]
    for samples in grounds:
        ground = Accelerogram(step, samples)
        fine = np.arange(count * 20) * step / 20
        polygon = ground.values(fine)
        integral = np.cumsum((polygon[1:] + polygon[:-1]) / 2 * step / 20)
        motions = exact_motions(frame.moved_by(ground), points, inputs, DURATION, step)
        largest = np.maximum(largest, np.abs(motions).max(axis=(0, 1)) / np.abs(integral).max())
    assert (largest <= gain).all()
    assert (largest > 0.005 * gain).all()


@pytest.mark.parametrize("kind", ["dashpots", "both", "critical", "strong"])
def test_bounds_by_energy_hold_those_of_the_damping_matrix(kind):
    """With all damping as one matrix, at crisp inputs."""
    frame = CASES[kind]()
    gain = acceleration_gain(frame, boxes({"m1": 3.0}, [0.0]), DURATION)
    matrices, _ = evaluate(frame, (), np.zeros((1, 0)), derivatives=False)
    M, C, K = (x.value[0] for x in (matrices.mass, matrices.damping, matrices.stiffness))
    one, loads = np.ones(2), np.linalg.inv(M)
    energy = np.sqrt(one @ K @ one) * DURATION + np.sqrt(one @ C @ one * DURATION / 2)
    size = np.sqrt(np.diag(loads @ K @ loads)) + np.sqrt(np.diag(loads @ C @ loads @ C @ loads))
    expected = size * energy + np.abs(loads @ C @ one)
    assert (gain >= expected * (1 - 1e-9)).all()
    assert (gain < 1.2 * expected).all()


def test_what_no_bound_holds_for_is_said():
    coupled = replace(matrices(), damping=[(1.0, np.diag([0.3, 0.1, 0.0]))])
    with pytest.raises(UnprovedError, match="dashpots couple the modes; unknowns without mass"):
        acceleration_gain(coupled, boxes({"m": 2.0}, [0.0]), DURATION)
