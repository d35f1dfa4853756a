"""Accelerations under forces that vanish at all nodes, jump at one, or are far slower than a mode."""

import numpy as np
import pytest
from scipy.linalg import eigh

from alphacut.frame import Auto, DualProof, Force, History, Proof, StoreyFrame, envelope
from alphacut.fuzzy import FailedError, Interval
from tests.frame.motions import judged_motions, random_points


def test_a_harmonic_force_and_an_acceleration_are_proved_with_seven_inputs():
    """The default method; both have ended with "the proof is wrong"."""
    omega, step, count, phase = 7.650901231995208, 0.057032196779040006, 8, 1.1385035299674409
    force = History.harmonic(omega / 2 / np.pi, phase)
    frame = StoreyFrame(
        masses=[1.0] * 4,
        stiffness=[(0.02 * omega) ** 2] * 4,
        damping_ratio=0.02,
        outputs=("a4", "q4"),
        loads=[Force(4, 1.0, force)],
    )
    names = ("m1", "m2", "m3", "m4", "k1", "k2", "k3")
    inputs = {x: Interval(0.98 * frame.parameters[x], 1.02 * frame.parameters[x]) for x in names}
    try:
        bounds = envelope(
            frame, inputs, duration=count * step, step=step, alpha=[0.0], progress=False
        )
    except FailedError as error:
        pytest.fail(str(error))
    assert bounds.nature == "guaranteed"
    # the force over the mass bends by (Ω h)²/8 between nodes
    assert bounds.between[:, 0].max() >= (omega * step) ** 2 / 8 * 0.9


@pytest.mark.parametrize("is_small", [True, False], ids=["dual", "auto"])
def test_modes_known_by_sums_feel_a_force_that_vanishes_at_nodes(is_small):
    """A mass of 1 kg on 1e6 kg: within a step its acceleration is the force over the mass."""
    step, steps, amplitude = 0.001, 8, 0.1
    samples = np.zeros(2 * steps + 1)
    samples[1::2] = 1.0
    mass, stiffness = np.diag([1e6, 1.0]), np.array([[1e6 + 9, -9.0], [-9.0, 9.0]])
    _, shapes = eigh(stiffness, mass)  # the start leaves the second mode at rest
    frame = StoreyFrame(
        masses=[1e6, 1.0],
        stiffness=[1e6, 9.0],
        damping_ratio=0.02,
        q0=(shapes[:, 0] / shapes[1, 0]).tolist(),
        v0=[0.0, 0.0] if is_small else [1e-5, 1e-5],
        outputs=("a2",),
        loads=[Force(2, amplitude, History(step / 2, samples))],
    )
    names = ("F2",) if is_small else ("F2", "q1_0", "q2_0", "v1_0", "v2_0", "m1", "k1")
    width = 0.05 if is_small else 1e-4
    inputs = {
        x: Interval((1 - width) * frame.parameters[x], (1 + width) * frame.parameters[x])
        for x in names
    }
    method = DualProof(workers=1) if is_small else Auto(workers=1)
    motion = {"duration": steps * step, "step": step, "alpha": [0.0], "progress": False}
    bounds = envelope(frame, inputs, method, **motion)
    assert bounds.nature == "guaranteed"
    assert amplitude * 0.999 <= bounds.between[:, 0].max() <= 1.2 * amplitude


@pytest.mark.parametrize(("start", "gap"), [(0.0, 0.1), (1.0, 0.1), (1e3, 1e-2)])
def test_what_a_model_errs_of_a_force_that_vanishes_at_nodes_is_counted(start, gap):
    """Soft springs and masses of ± 35 %: the acceleration between nodes is F/m, up to 1/0.65."""
    step, steps = 0.1, 4
    samples = np.zeros(8 * steps + 1)
    samples[1::2] = 1.0
    frame = StoreyFrame(
        masses=[1.0],
        stiffness=[1e-6],
        damping_ratio=0.02,
        q0=[start],
        outputs=("a1",),
        loads=[Force(1, 1.0, History(step / 8, samples))],
    )
    method = Proof(gap=gap, tolerance=gap, workers=1)
    motion = {"duration": steps * step, "step": step, "alpha": [0.0], "progress": False}
    bounds = envelope(frame, {"m1": Interval(0.65, 1.35)}, method, **motion)
    # the springs' part of the acceleration of the lightest mass falls from k q0/m
    spring = 1e-6 * start / 0.65
    reached = 1 / 0.65 - spring
    assert bounds.upper[0, :2, 0].max() + bounds.between[1, 0] >= reached - 1e-7


@pytest.mark.parametrize("count", [5, 7], ids=["inner node", "last node"])
@pytest.mark.parametrize("method", [Proof(workers=1), DualProof(workers=1)], ids=["proof", "dual"])
def test_bounds_before_a_jump_of_a_force_at_a_node_hold_and_count_it_once(method, count, rng):
    """With it the acceleration jumps, by far more than motions lie beyond their nodes."""
    step, steps = 0.02, 30
    samples = rng.uniform(1.0, 1.6, count)
    samples[-1] = 3.0  # the force rises until it ends, so that motions exceed both nodes there
    frame = StoreyFrame(
        [6e4, 5e4],
        stiffness=[6e7, 3e7],
        damping_ratio=0.02,
        outputs=("a1", "a2"),
        loads=[Force(2, 1.2e4, History(0.1, samples))],
    )
    inputs = {"k2": Interval(2.97e7, 3.03e7), "F2": Interval(1.19e4, 1.21e4)}
    given = {"duration": steps * step, "step": step, "alpha": [0.0], "progress": False}
    bounds = envelope(frame, inputs, method, **given)
    end = round(0.1 * (count - 1) / step)
    fractions = np.append(np.arange(20) / 20, 1 - 1e-9)
    times = (end - 1 + fractions) * step
    points = random_points(inputs, 12, rng)
    for values in judged_motions(frame, points, inputs, np.append(times, end * step)):
        for sign, at_nodes in ((1.0, bounds.upper[0]), (-1.0, -bounds.lower[0])):
            bound = np.maximum(at_nodes[end - 1], at_nodes[end]) + bounds.between[end]
            assert (sign * values <= bound + 1e-9).all()
    jump = 1.2e4 * samples[-1] / 5e4
    assert bounds.between[end, 1] <= 1.1 * jump


def test_a_stiff_mode_that_is_lightly_damped_follows_a_slow_force_between_nodes(rng):
    mass, omega, step = 2.0, float(rng.uniform(550, 700)), 0.005
    slow = History(2.0, np.ones(2), frequency=float(rng.uniform(8, 15)))
    frame = StoreyFrame(
        masses=[mass],
        stiffness=[mass * omega**2],
        damping_ratio=0.02,
        outputs=("a1",),
        loads=[Force(1, 1.0, slow)],
    )
    inputs = {"m1": Interval(0.98 * mass, 1.02 * mass), "zeta": Interval(0.018, 0.022)}
    motion = {"duration": 0.9, "step": step, "alpha": [0.0], "progress": False}
    bounds = envelope(frame, inputs, Proof(workers=1), **motion)
    assert bounds.between[-25:].max() <= 0.1 / mass
