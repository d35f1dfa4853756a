"""Errors of time steps and between nodes are estimated as they are, and declared in every bound."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import eigvalsh

from alphacut.frame import (
    Accelerogram,
    Exact,
    Force,
    History,
    ImprovedFollower,
    LagrangianFlow,
    LagrangianSystem,
    LinearFlow,
    Midpoint,
    Sampled,
    StoreyFrame,
    envelope,
    pendulum,
)
from alphacut.frame.verification.self_test import structures_at
from alphacut.frame.verification.step_error import MARGIN, node_deviation
from alphacut.fuzzy import FailedError, Interval, Triangular
from tests.frame.motions import judged_motions, off_chords
from tests.refused import refuses

DUFFING = LagrangianSystem(
    1,
    {"m": 1.0, "a": 0.5, "c": 0.1},
    lambda q, v, p: p["m"] * v[0] ** 2 / 2 - q[0] ** 2 / 2 - p["a"] * q[0] ** 4 / 4,
    lambda p: ([1.0], [0.0]),
    {"x": lambda q, v, p: q[0]},
    lambda q, v, p: [-p["c"] * v[0]],
)
MOTION = {"duration": 5.0, "step": 0.04, "alpha": (0,), "progress": False}


def truth(a, c, time):
    """Motions of the oscillator at the nodes for parameters (S,), shape (S, T)."""

    def right(_, state):
        x, v = np.split(state, 2)
        return np.append(v, -x - a * x**3 - c * v)

    start = np.append(np.ones(len(a)), np.zeros(len(a)))
    accuracy = {"method": "DOP853", "rtol": 1e-9, "atol": 1e-11}
    return solve_ivp(right, (0, time[-1]), start, t_eval=time, **accuracy).y[: len(a)]


def test_the_declared_error_covers_that_of_time_stepping():
    inputs = {"a": Triangular(0.3, 0.5, 0.8), "c": Triangular(0.05, 0.1, 0.2)}
    a, c = np.meshgrid(np.linspace(0.3, 0.8, 11), [0.05, 0.1, 0.2])
    found = envelope(DUFFING, inputs, method=ImprovedFollower(1e-3), **MOTION)
    values = truth(a.ravel(), c.ravel(), found.time)[..., None]
    missed = np.maximum(values.max(0) - found.upper[0], found.lower[0] - values.min(0))
    assert (missed <= found.error[0] + 1e-9).all()
    assert missed.max() > 3e-4


@pytest.mark.parametrize("step", [0.04, 0.1])
def test_the_estimate_is_the_error_of_the_steps(step):
    """Attained bounds of a single motion are those of its steps, give or take their error."""
    motion = {**MOTION, "step": step, "method": Sampled(4)}
    found = envelope(DUFFING, {"a": Interval(0.5, 0.5)}, **motion)
    values = LagrangianFlow(DUFFING, (), 5.0, step).values(np.zeros((1, 0)))[0]
    off = np.abs(values[:, 0] - truth(np.full(1, 0.5), 0.1, found.time)[0]).max()
    assert found.nature == "attained"
    assert "estimated_error" not in found.facts  # how far other motions go is not known
    assert found.basis == (f"midpoint steps of {step:g} s",)
    assert found.error.max() == pytest.approx(MARGIN * off, rel=0.2)
    assert found.facts["step_error"] == found.error.max()
    assert (np.diff(found.error, axis=1) >= 0).all()  # an error at one node is one at all later


def test_steps_are_judged_where_bounds_are_reached_and_a_resonance_may_be(rng):
    """A storey that resonates with a sine between the corners of its support, at a coarse step."""
    omega, h = rng.uniform(2.9, 3.3), 0.03
    sine = Accelerogram(h, 0.7 * np.sin(omega * h * np.arange(1001)))
    frame = StoreyFrame([1e4], stiffness=[1.5e5], damping_ratio=0.01, ground=sine)
    motion = {**MOTION, "duration": 1000 * h, "step": h, "integrator": "midpoint"}
    found = envelope(frame, {"k1": Interval(0.6e5, 2.4e5)}, method=Sampled(128), **motion)
    flow = LinearFlow(frame, ("k1",), 1000 * h, h, Midpoint())
    exact = LinearFlow(frame, ("k1",), 1000 * h, h, Exact())
    assert (np.diff(found.error, axis=1) >= 0).all()
    at = np.unique(np.concatenate([found.lower_at, found.upper_at]))[:, None]
    assert np.abs(flow.values(at) - exact.values(at)).max() <= found.facts["step_error"]


def test_motions_that_do_not_exist_and_steps_that_fail_are_named():
    frame = StoreyFrame((10.0, 20.0), (3.0, 3.0), 25e9, 1e-6, q0=(0.0, 0.1))
    with refuses("trajectory"):
        LinearFlow(frame, ("m1",), 1, 0.1, Exact()).values(np.array([[1e4], [0.0], [2e4]]))
    with pytest.raises(FailedError, match=r"did not converge.*it failed at a = 1e\+30"):
        LagrangianFlow(DUFFING, ("a",), 4, 1.0).values(np.array([[0.5], [0.4], [1e30], [0.3]]))
    falling = LagrangianSystem(
        coordinates=1,
        parameters={"a": 3.0},
        lagrangian=lambda q, v, p: v[0] ** 2 / 2 + p["a"] ** 2 * q[0] ** 2 / 2,
        initial=lambda p: ([1.0], [0.0]),
        observed={"q1": lambda q, v, p: q[0]},
    )
    with pytest.raises(FailedError, match=r"passes the peak of q1.*take a smaller step"):
        envelope(falling, {"a": Interval(2.9, 3)}, Sampled(4), duration=3, step=0.6)


def angles(parameters, starts, time):
    """Angles of the pendulum let go at some, (S, T), from its equation of motion written here."""
    p = parameters
    damping = p["d"] / (p["m"] * p["l"] ** 2)

    def right(_, state):
        phi, omega = np.split(state, 2)
        return np.append(omega, -p["g"] / p["l"] * np.sin(phi) - damping * omega)

    accuracy = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-12}
    state = np.append(starts, np.full(len(starts), p["omega_0"]))
    return solve_ivp(right, (0, time[-1]), state, t_eval=time, **accuracy).y[: len(starts)]


def test_a_step_too_coarse_near_the_upright_is_refused_and_a_finer_one_taken():
    near_upright, inputs = pendulum(phi0=3.0, damping=0.01), {"omega_0": Interval(0.4435, 0.4445)}
    motion = {"duration": 5.0, "alpha": (0,), "method": Sampled(32), "progress": False}
    with pytest.raises(
        FailedError, match=r"too coarse where a bound is attained, at omega_0 = .*smaller step"
    ):
        envelope(near_upright, inputs, step=0.05, **motion)
    assert envelope(near_upright, inputs, step=0.00625, **motion).error.max() > 0


@pytest.mark.parametrize("low", [2.6, 2.9])
def test_declared_errors_hold_where_bounds_are_attained(low):
    system, inputs = pendulum(phi0=3.0, damping=0.05), {"phi_0": Interval(low, 3.0)}
    motion = {"duration": 5.0, "step": 0.01, "alpha": (0,), "progress": False}
    found = envelope(system, inputs, method=Sampled(16), **motion)
    output = list(found.outputs).index("phi")
    for places, bounds in ((found.lower_at, found.lower), (found.upper_at, found.upper)):
        starts, row = np.unique(places[0, :, output, 0], return_inverse=True)
        exact = angles(system.parameters, starts, found.time)[row, np.arange(len(row))]
        off = np.abs(exact - bounds[0, :, output])
        assert (off <= found.error[0, :, output] + 1e-9).all()
        assert found.error[0, -1, output] < 0.1  # the error is not simply large


def test_modes_that_turn_several_times_within_a_step_are_seen() -> None:
    for seed in range(16):
        random = np.random.default_rng(seed)
        stiffness, start = 10 ** random.uniform(5, 6.5, 3), 0.01 * random.normal(size=3)
        frame = StoreyFrame((1e4,) * 3, stiffness=stiffness, q0=start, damping_ratio=0.01)
        point = np.empty((1, 0))
        (motion,) = structures_at(frame, (), point)
        step = random.uniform(15, 50) / np.sqrt(eigvalsh(motion.stiffness / 1e4)[-1])
        found = node_deviation(LinearFlow(frame, (), 12 * step, step, Exact()), point)
        fine = LinearFlow(frame, (), 12 * step, step / 100, Exact()).values(point)[0]
        assert (off_chords(fine, 100) <= found[1:]).all(), seed
        assert found.max() < 4 * abs(fine).max()


@pytest.mark.parametrize("count", [16, 21], ids=["inner node", "last node"])
def test_a_force_that_ends_at_a_node_widens_no_step_but_its_own(count, rng):
    """An acceleration jumps with the force, by far more than motions stray in any step."""
    stiffness, step, parts, steps = np.array([6e7, 3e7]), 0.02, 20, 100
    samples = rng.uniform(1.0, 1.6, count)
    samples[-1] = 3.0  # the force rises until it ends, so that motions exceed both nodes there
    gust = History(0.1, samples)
    frame = StoreyFrame(
        [6e4, 5e4],
        stiffness=stiffness,
        dampers=[4e5, 2e5],
        damper_placement="storey",
        outputs=("a2",),
        loads=[Force(2, 1.2e4, gust)],
    )
    names, points = ("k1", "k2"), np.linspace(0.95, 1.05, 5)[:, None] * stiffness
    flow = LinearFlow(frame, names, steps * step, step, Exact())
    found = node_deviation(flow, points[[0, 2, -1]])[1:, 0]
    times = np.arange(parts * steps + 1) * (step / parts)
    exact = judged_motions(frame, points, names, times)[..., 0].T
    off_chord = off_chords(exact, parts).max(1)
    nodes, inner = exact[::parts], exact[:-1].reshape(steps, parts, -1)
    above = inner.max(1) - np.maximum(nodes[:-1], nodes[1:])
    below = np.minimum(nodes[:-1], nodes[1:]) - inner.min(1)
    beyond_ends = np.maximum(above, below).max(1)
    end = round(gust.step * (len(samples) - 1) / step)  # node at which the force ends
    has_jump = np.arange(1, steps + 1) == end
    assert has_jump.any()
    assert (off_chord <= found)[~has_jump].all()
    assert (beyond_ends <= found).all()
    assert found[has_jump] < 0.5 * off_chord[has_jump]
    assert found[end - 2] < 0.5 * found[end - 1]
    assert found[~has_jump].max() <= 2 * off_chord[~has_jump].max()


@pytest.mark.parametrize("parts", [1, 4, 12])
def test_a_force_between_the_nodes_of_finer_steps_is_counted(parts):
    """It is zero at all times at which trajectories are looked at; F/m between them."""
    step, steps, mass = 0.05, 8, 2.0
    samples = np.zeros(2 * parts * steps + 1)
    samples[1::2] = 1.0
    force = Force(1, 3.0, History(step / parts / 2, samples))
    frame = StoreyFrame([mass], stiffness=[8.0], outputs=("a1", "q1"), loads=[force])
    flow = LinearFlow(frame, ("m1",), steps * step, step, Exact())
    found = node_deviation(flow, np.array([[mass], [1.1 * mass]]))
    assert (found[1:, 0] >= 3.0 / mass).all()
    assert (found[1:, 0] <= 2 * 3.0 / mass).all()
    assert found[:, 1].max() < 0.2 * 3.0 / mass * step**2
