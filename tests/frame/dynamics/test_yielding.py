"""Columns that yield: closed forms, linear limits, balanced energy, steps that do not matter."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from alphacut.frame import (
    Accelerogram,
    Exact,
    Force,
    History,
    LinearFlow,
    StoreyFrame,
    envelope,
    peaks,
)
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.dynamics import yielding
from alphacut.frame.dynamics.nonlinear import make_flow
from alphacut.fuzzy import Interval, Nature, RefusedError, Triangular
from tests.refused import refuses

MASS, STIFFNESS, YIELD_FORCE = 2.0, 50.0, 3.0
OMEGA, YIELD_DRIFT = (STIFFNESS / MASS) ** 0.5, YIELD_FORCE / STIFFNESS
WATCHED = ("q1", "ductility1", "residual1", "dissipated1")


def motion(frame, duration, step):
    """Outputs of a frame at its nodes, shape (T, m)."""
    return make_flow(frame, (), duration, step, "exact").values(np.zeros((1, 0)))[0]


def random_frame(rng, storeys):
    """A frame that yields under a record with a jump, silence and samples beside the nodes."""
    stiffness = rng.uniform(5e7, 1e8, storeys)
    record = 6 * rng.normal(size=300) * np.repeat([1, 0, 1], 100)
    yield_drift = rng.uniform(3e-3, 8e-3, storeys)
    return StoreyFrame(
        masses=rng.uniform(3e4, 6e4, storeys),
        stiffness=stiffness,
        lengths=[3.0] * storeys,
        gravity=9.81,
        damping_ratio=rng.uniform(0.0, 0.05),
        dampers=rng.uniform(0, 2e5, storeys),
        rayleigh=(0.2, rng.uniform(0.0, 2e-3)),
        rayleigh_of="tangent",
        yield_force=stiffness * yield_drift,
        hardening=rng.uniform(0.05, 0.3, storeys),
        ground=Accelerogram(float(rng.choice([0.017, 0.02])), record),
        outputs=(f"q{storeys}", f"a{storeys}", "v1", "drift1", "residual1", "dissipated1"),
    )


@pytest.mark.parametrize("load", ["impulse", "damped impulse", "step", "pulse"])
def test_one_storey_follows_the_closed_forms(load, rng):
    frame = StoreyFrame([MASS], stiffness=[STIFFNESS], yield_force=[YIELD_FORCE], outputs=WATCHED)
    if load == "damped impulse":  # without damping while it yields
        half = float(rng.uniform(0.01, 0.1)) * OMEGA  # decay of the elastic motion
        speed, damped = 2 * OMEGA * YIELD_DRIFT, (OMEGA**2 - half**2) ** 0.5
        frame = replace(frame, v0=[speed], rayleigh=(0, 2 * half / OMEGA**2), rayleigh_of="tangent")

        def drift_above(t):
            return speed / damped * np.exp(-half * t) * np.sin(damped * t) - YIELD_DRIFT

        force = end = 0.0
        first = brentq(drift_above, 0, np.pi / 2 / damped, xtol=1e-16, rtol=1e-15)
        velocity = speed * np.exp(-half * first) * np.cos(damped * first) - half * YIELD_DRIFT
    elif load == "impulse":
        speed = float(rng.uniform(1.2, 3)) * OMEGA * YIELD_DRIFT
        frame, force, end = replace(frame, v0=[speed]), 0.0, 0.0
        first = np.arcsin(OMEGA * YIELD_DRIFT / speed) / OMEGA  # time of yielding
        velocity = speed * np.cos(OMEGA * first)
    else:  # x = F/k (1 − cos ωt) up to yielding
        ratio = float(rng.uniform(0.6, 0.9)) if load == "step" else float(rng.uniform(1.1, 2.0))
        first = np.arccos(1 - 1 / ratio) / OMEGA
        velocity, force = ratio * YIELD_DRIFT * OMEGA * np.sin(OMEGA * first), ratio * YIELD_FORCE
        end = first + (float(rng.uniform(0.1, 0.6)) if load == "pulse" else 1e6)
        frame = replace(frame, loads=[Force(1, force, History(end, [1.0, 1.0]))])
    rise, peak = (force - YIELD_FORCE) / MASS, end
    if load == "pulse":  # yields under the force, and on after its end
        at_end = velocity + rise * (end - first)
        plastic = (velocity + at_end) / 2 * (end - first)
        velocity, rise = at_end, -YIELD_FORCE / MASS
    else:
        plastic, peak = 0.0, first
    peak, plastic = peak - velocity / rise, plastic - velocity**2 / rise / 2
    found = motion(frame, 2 * peak, peak / 7)
    drift = plastic + YIELD_DRIFT
    expected = [drift, drift / YIELD_DRIFT, plastic, plastic * YIELD_FORCE]
    assert found[7] == pytest.approx(expected, rel=1e-10)
    if load in ("impulse", "pulse"):  # oscillates about the residual drift, within the yield drift
        t = found[7:, 0] - plastic
        assert t == pytest.approx(YIELD_DRIFT * np.cos(OMEGA * peak / 7 * np.arange(8)), abs=1e-11)


def test_a_grazed_yield_drift_is_seen_within_a_step(rng):
    excess = 10 ** float(rng.uniform(-10, -8))
    velocity = OMEGA * YIELD_DRIFT * (1 + 2 * excess) ** 0.5  # double roots nearly
    frame = StoreyFrame(
        [MASS], stiffness=[STIFFNESS], v0=[velocity], yield_force=[YIELD_FORCE], outputs=WATCHED
    )
    found = motion(frame, 2.0, 0.5)
    assert found[1:, 2] == pytest.approx(excess * YIELD_DRIFT, rel=1e-2)


def test_without_yielding_or_with_hardening_1_the_motion_is_the_linear_one(rng):
    ground = Accelerogram(0.02, random_frame(rng, 1).ground.samples)
    outputs = ("q3", "v1", "a2", "drift2", "shear2")
    frame = replace(random_frame(rng, 3), outputs=outputs, ground=ground)
    elastic = replace(frame, yield_force=(), hardening=())
    expected = LinearFlow(elastic, (), 5.98, 0.02, Exact()).values(np.zeros((1, 0)))[0]
    for changes in ({"yield_force": [1e15] * 3}, {"hardening": [1.0] * 3}):
        found = motion(replace(frame, **changes), 5.98, 0.02)
        assert (np.abs(found - expected).max(0) <= 1e-11 * np.abs(expected).max(0)).all()
    with refuses("flow"):
        LinearFlow(frame, (), 6.0, 0.02, Exact())


def test_storeys_that_yield_from_the_start_have_tangent_stiffness_and_damping(rng):
    stiffness, hardening = rng.uniform(5e7, 1e8, 3), rng.permutation([1.0, 0.2, 0.1])
    rest = {"masses": [4e4] * 3, "v0": [1.0, 2.0, 3.0], "rayleigh": (0.1, 2e-3)}
    frame = StoreyFrame(
        **rest, stiffness=stiffness, yield_drift=[1e-14] * 3, hardening=hardening,
        rayleigh_of="tangent", outputs=("q1", "q2", "q3", "a1", "a2", "a3"),
    )  # fmt: skip
    soft = StoreyFrame(**rest, stiffness=hardening * stiffness, outputs=frame.outputs)
    expected = LinearFlow(soft, (), 0.02, 0.002, Exact()).values(np.zeros((1, 0)))[0]
    error = np.abs(motion(frame, 0.02, 0.002) - expected)[1:]
    assert (error <= 1e-10 * np.abs(expected).max(0)).all()


def test_events_and_not_steps_decide_and_energy_is_balanced(rng, monkeypatch):
    monkeypatch.setattr(yielding, "MAX_IMBALANCE", 1e-11)  # motions that exceed it are refused
    for storeys in (1, 2, 4):
        frames = (random_frame(rng, storeys) for _ in range(20))
        frame, found = next((x, y) for x in frames if (y := motion(x, 6.0, 0.02))[-1, -1] > 0)
        for parts in (2, 5, 10):
            finer = motion(frame, 6.0, 0.02 / parts)[::parts]
            assert (np.abs(finer - found).max(0) <= 1e-9 * np.abs(found).max(0)).all()


@pytest.mark.parametrize("speed", [1.0, 5.0])
def test_weight_on_a_soft_yielding_storey_turns_it_or_brings_it_down(speed):
    """Phases by an independent integrator; at a residual drift or at collapse, with its time."""
    frame = StoreyFrame(
        [5e4], stiffness=[1e7], lengths=[3.0], gravity=9.81, v0=[speed], yield_drift=[0.01],
        hardening=[0.01], damping_ratio=0.02, outputs=("drift1", "residual1"),
    )  # fmt: skip
    softening = 5e4 * 9.81 / 3
    damping = 2 * 0.02 * np.sqrt((1e7 - softening) * 5e4)
    last = 0.99 * 1e5 / (softening - 1e5)  # where columns and weight are equal

    def phase(state, spring, force, event):
        """A phase with the columns' force, spring · drift + force, until an event of the state."""

        def rates(_, y):
            return [y[1], -((spring - softening) * y[0] + force + damping * y[1]) / 5e4]

        def end(_, y):
            return event(y)

        end.terminal = True
        return solve_ivp(rates, (0, 1), state, "DOP853", events=end, rtol=1e-11, atol=1e-13)

    elastic = phase([0.0, speed], 1e7, 0.0, lambda y: y[0] - 0.01)
    ends = (lambda y: y[1]) if speed == 1 else (lambda y: y[0] - last)
    yields = phase(elastic.y[:, -1], 1e5, 0.99e5, ends)
    time = elastic.t[-1] + yields.t[-1]
    if speed == 5:
        with pytest.raises(RefusedError, match=rf"storey 1 .* t = {time:.6g} s"):
            motion(frame, 1.0, 0.1)
        return
    peak = yields.y[0, -1]
    plastic = peak - 0.01
    flow = make_flow(frame, (), 3.0, 0.05, "exact")
    found, peaks_found = flow.values_and_peaks(np.zeros((1, 0)))
    assert peaks_found[0, 0] == pytest.approx(peak, rel=1e-9)
    assert 0.1 < peak < last
    rest = 0.99 * 1e7 * plastic / (1e7 - softening)  # farther out than the plastic drift
    assert found[0, -1, 1] == pytest.approx(rest, rel=1e-9)
    assert found[0, -1, 0] == pytest.approx(rest, rel=0.02)


def test_peaks_are_searched_and_proofs_are_refused(rng):
    frame = replace(random_frame(rng, 2), outputs=("drift1", "ductility1"))
    nominal = frame.parameters["fy1"]
    inputs = {"fy1": Triangular(0.9 * nominal, nominal, 1.1 * nominal)}
    nodes = {"duration": 1.6, "step": 0.02, "alpha": [0.0, 1.0], "progress": False}
    bounds = envelope(frame, inputs, **nodes)
    low, high = inputs["fy1"].support
    points = np.linspace(low, high, 101)[:, None]
    flow = make_flow(frame, ("fy1",), 1.6, 0.02, "exact")
    finer = make_flow(frame, ("fy1",), 1.6, 0.002, "exact")
    reached = flow.values_and_peaks(points)[1]
    assert np.abs(finer.values(points[::10])).max(1) == pytest.approx(reached[::10], rel=2e-3)
    for peak, values in zip(peaks(bounds).values(), reached.T, strict=True):
        if peak.nature is Nature.ATTAINED:  # one of 100 draws: a flat peak has many optima
            assert "would pass the budget" in " ".join(bounds.notes)
            assert values.min() * 0.98 < peak.lower[0] < peak.upper[0] < values.max() * 1.02
            continue
        assert peak.nature is Nature.ESTIMATED
        assert abs(peak.upper[0] - values.max()) <= peak.error[0] <= 0.02 * peak.upper[0]
        assert abs(peak.lower[0] - values.min()) <= peak.error[0]
        assert peak.error[1] == 0  # of the nominal motion alone
    stiff = replace(frame, yield_force=[nominal, 1e12])  # hardening2 acts on nothing
    flat = peaks(envelope(stiff, {"hardening2": Interval(0.1, 0.2)}, **nodes))["drift1"]
    assert flat.nature is Nature.ESTIMATED
    assert flat.lower == pytest.approx(flat.upper, rel=1e-12)
    for method in ("dual", "improved-graph-follower"):
        with refuses("method"):
            envelope(frame, inputs, method, **nodes)
    with pytest.raises(UnprovedError, match="one storey"):
        envelope(frame, inputs, "proof", **nodes)


def test_a_friction_isolator_slides_and_sticks_in_finitely_many_events():
    """Ductility of some thousands: rounding of a drift exceeds that of the yield drift."""
    rough = {"stiffness": [6e7], "v0": [1.0], "yield_drift": [2e-5], "hardening": [0.05]}
    frame = StoreyFrame([5e4], outputs=("q1", "ductility1"), **rough)
    coarse, fine = motion(frame, 3.0, 0.02), motion(frame, 3.0, 0.005)[::4]
    assert coarse[:, 1].max() > 1000
    assert (np.abs(coarse - fine) / np.abs(fine).max(0)).max() < 1e-9
