"""Floor spectra, against exact integration of structures with an oscillator on a floor."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import eigh, expm

from alphacut.frame import (
    Accelerogram,
    Exact,
    Force,
    History,
    LinearFlow,
    MatrixStructure,
    StoreyFrame,
    floor_spectrum,
    pendulum,
)
from alphacut.frame.analyses.floor_oscillators import STEP_ERROR
from alphacut.fuzzy import Interval, RefusedError, Triangular
from tests.frame.motions import random_points

MASSES = np.array([3.0, 2.0])
MOTION = {"duration": 2.0, "step": 0.02, "progress": False}


# How close bounds are differs from draw to draw: it is asked of one draw alone.
OF_ONE_DRAW = pytest.mark.parametrize("is_fixed", [False, True], ids=["any", "fixed"])


def record(rng, count=60):
    return Accelerogram(0.02, rng.normal(size=count))


def frame_of(ground, **changes):
    springs = {"stiffness": (900.0, 400.0), "damping_ratio": 0.05}
    return StoreyFrame(tuple(MASSES), **springs, outputs=("a1", "a2"), ground=ground, **changes)


def cascade_peak(k, ratio, ground, floor, period, damping):
    """Peak |Ω² w| of the oscillator, as a part of one system of first order, at 10 times a step."""
    M, K = np.diag(MASSES), np.array([[k[0] + k[1], -k[1]], [-k[1], k[1]]])
    squares, shapes = eigh(K, M)
    C = M @ shapes @ np.diag(2 * ratio * np.sqrt(squares)) @ shapes.T @ M
    omega, h = 2 * np.pi / period, ground.step / 10
    A = np.zeros((8, 8))  # of q, q', w, w', the ground's acceleration and its slope
    A[:2, 2:4] = np.eye(2)
    A[2:4, :4] = -np.linalg.solve(M, np.hstack([K, C]))
    A[2:4, 6] = -1.0
    A[4, 5] = A[6, 7] = 1.0
    A[5, 4:6] = -(omega**2), -2 * damping * omega
    A[5, :4] = -A[2 + floor, :4]  # the absolute acceleration of the floor
    advance = expm(A * h)
    time = np.arange(round(MOTION["duration"] / h) + 1) * h
    state, peak = np.zeros(8), 0.0
    for begin, end in zip(ground.values(time), ground.before(time)[1:], strict=False):
        state[6:] = begin, (end - begin) / h
        state = advance @ state
        peak = max(peak, omega**2 * abs(state[4]))
    return peak


def mode_period(frame):
    squares = eigh([[1300.0, -400.0], [-400.0, 400.0]], np.diag(MASSES), eigvals_only=True)
    return 2 * np.pi / np.sqrt(squares[0])


@OF_ONE_DRAW
@pytest.mark.parametrize("which", ["of a mode", "long"])
def test_bounds_hold_also_where_the_oscillator_is_tuned_to_a_mode(rng, which, is_fixed):
    """With the damping of the mode, the two have one frequency and one shape (a Jordan block)."""
    rng = np.random.default_rng(5) if is_fixed else rng
    ground = record(rng)
    frame = frame_of(ground)
    period = {"of a mode": mode_period(frame), "long": 1.3}[which]
    inputs = {"k1": Interval(870.0, 930.0), "zeta": Triangular(0.04, 0.05, 0.06)}
    found = floor_spectrum(frame, inputs, "a2", period, 0.05, alpha=[0, 1], **MOTION)
    assert found.natures == (("guaranteed",),)
    peaks = []
    for k1, ratio in random_points(inputs, 60, rng):
        peaks.append(cascade_peak((k1, 400.0), ratio, ground, 1, period, 0.05))
    nominal = cascade_peak((900.0, 400.0), 0.05, ground, 1, period, 0.05)
    assert max(peaks) <= found.bound[0, 0, 0]
    assert found.nominal[0, 0] == pytest.approx(nominal, rel=1e-2)
    assert nominal <= found.bound[1, 0, 0] <= found.bound[0, 0, 0]
    assert (found.attained <= found.bound).all()
    if is_fixed:
        assert found.bound[0, 0, 0] < 1.1 * max(peaks)
        assert found.attained[0, 0, 0] > 0.95 * max(peaks)


@OF_ONE_DRAW
def test_the_nominal_curve_is_the_spectrum_of_the_floor_s_exact_history(rng, is_fixed):
    """By the exact history of the floor's acceleration, as a record of straight lines."""
    rng = np.random.default_rng(5) if is_fixed else rng
    frame = frame_of(record(rng))
    periods = np.array([0.0, 0.09, 0.3, 1.0])
    found = floor_spectrum(frame, {"m1": 3.0}, ["a1", "a2"], periods, 0.03, alpha=[1], **MOTION)
    step = 5e-4
    history = LinearFlow(frame, (), MOTION["duration"], step, Exact()).values(np.zeros((1, 0)))
    for k in range(2):
        floor = Accelerogram(step, history[0, :, k])
        expected = [np.abs(floor.samples).max()]
        # A response spectrum goes on when the record has ended; here all motions end with it.
        for omega in 2 * np.pi / periods[1:]:
            light = StoreyFrame(
                [1.0], stiffness=[omega**2], damping_ratio=0.03, ground=floor, outputs=("q1",)
            )
            motion = LinearFlow(light, (), MOTION["duration"], step, Exact()).values(
                np.zeros((1, 0))
            )
            expected.append(omega**2 * np.abs(motion).max())
        expected = np.array(expected)
        assert found.nominal[k] == pytest.approx(expected, rel=1e-2)
        assert (found.bound[0, k] >= expected * (1 - 1e-3)).all()
        if is_fixed:
            assert found.bound[0, k] == pytest.approx(expected, rel=0.15)


def test_matrices_and_coupled_damping_have_floor_spectra(rng):
    """Dashpots couple the modes, so that the error of the steps is bounded by energy."""
    ground = record(rng)
    matrices = MatrixStructure(
        {"k1": 900.0},
        mass=[(1.0, np.diag(MASSES))],
        stiffness=[("k1", np.diag([1.0, 0])), (400.0, np.array([[1.0, -1], [-1, 1]]))],
        observed={"top": np.eye(6)[5]},
        damping=[(1.0, np.array([[4.0, -1.0], [-1.0, 1.0]]))],
        ground=ground,
    )
    frame = StoreyFrame(
        tuple(MASSES), stiffness=(900.0, 400.0), dampers=(3.0, 1.0), damper_placement="storey",
        outputs=("a2",), ground=ground,
    )  # fmt: skip
    inputs = {"k1": Interval(880.0, 920.0)}
    a = floor_spectrum(matrices, inputs, "top", [0.3], alpha=[0], **MOTION)
    b = floor_spectrum(frame, inputs, "a2", [0.3], alpha=[0], **MOTION)
    both = floor_spectrum(
        replace(frame, damping_ratio=1e-9), inputs, "a2", [0.3], alpha=[0], **MOTION
    )
    assert a.natures == b.natures == both.natures == (("guaranteed",),)
    for x in (a, both):
        assert (x.attained <= b.bound).all()
    for x in (a, both):
        assert (b.attained <= x.bound).all()
    assert a.nominal == pytest.approx(b.nominal, rel=1e-6)


def test_components_of_the_ground_motion_add_up(rng):
    """A component along the same direction is a part of the ground motion."""
    first, second = record(rng), record(rng)
    both = replace(first, samples=first.samples + 0.5 * second.samples)
    plan = MatrixStructure(
        {"k": 900.0},
        mass=[(1.0, np.diag(MASSES))],
        stiffness=[("k", np.array([[1.4, -0.4], [-0.4, 0.4]]))],
        observed={"top": np.eye(6)[5]},
        ratios=[0.05],
        ground=both,
    )
    apart = replace(plan, ground=first, components=[(second, np.full(2, 0.5))])
    inputs = {"k": Interval(880.0, 920.0)}
    a, b = (
        floor_spectrum(x, inputs, "top", [0.0, 0.3], alpha=[0], **MOTION) for x in (plan, apart)
    )
    assert b.natures == (("guaranteed",) * 2,)
    # The responses of the oscillators to the components are computed with steps of their own.
    assert (np.abs(b.nominal - a.nominal) <= STEP_ERROR * (a.nominal + b.nominal)).all()
    # Both bounds hold for the same motions; how far above these they lie differs.
    assert (a.attained <= b.bound).all()
    assert (b.attained <= a.bound).all()


@OF_ONE_DRAW
def test_means_over_records_are_those_of_each_structure(rng, is_fixed):
    """The mean of the bounds holds, and some structure has the attained mean."""
    rng = np.random.default_rng(5) if is_fixed else rng
    records = [replace(record(rng), name=name) for name in "ab"]
    inputs = {"k1": Interval(850.0, 950.0)}
    found = floor_spectrum(
        frame_of(None), inputs, "a2", [0.35], alpha=[0], records=records, **MOTION
    )
    assert found.suite == ("a", "b")
    assert found.natures == (("guaranteed",),)
    assert found.words().startswith("Mean over 2 records of the largest")
    means = [
        np.mean([cascade_peak((k, 400.0), 0.05, x, 1, 0.35, 0.05) for x in records])
        for k in np.linspace(850.0, 950.0, 41)
    ]
    assert max(means) <= found.bound[0, 0, 0]
    assert found.attained[0, 0, 0] <= found.bound[0, 0, 0]
    if is_fixed:
        assert 0.9 * max(means) < found.attained[0, 0, 0] <= max(means) * (1 + 1e-3)
    alone = [
        floor_spectrum(frame_of(x), inputs, "a2", [0.35], alpha=[0], **MOTION) for x in records
    ]
    for name in ("bound", "nominal"):
        mean = np.mean([getattr(x, name) for x in alone], axis=0)
        assert getattr(found, name) == pytest.approx(mean, rel=1e-9)


def test_without_a_bound_of_the_steps_nothing_is_guaranteed(rng):
    springs = np.array([[900.0, -300.0, 40.0], [-300.0, 300.0, -60.0], [40.0, -60.0, 90.0]])
    coupled = MatrixStructure(
        {"k": 1.0},
        mass=[(1.0, np.diag([3.0, 2.0, 0.0]))],
        stiffness=[("k", springs)],
        damping=[(1.0, np.diag([0.3, 0.1, 0.0]))],
        observed={"top": np.eye(9)[7]},
        ratios=[0.05],
        ground=record(rng),
        pattern=np.array([1.0, 1.0, 0.0]),
    )
    found = floor_spectrum(coupled, {"k": Interval(0.98, 1.02)}, "top", [0.3], alpha=[0], **MOTION)
    assert found.natures == (("estimated",),)
    assert "Not all bounds are guaranteed: dashpots couple" in found.words()


def test_a_table_and_rows_tell_all(rng):
    inputs = {"k1": Interval(880.0, 920.0)}
    found = floor_spectrum(frame_of(record(rng)), inputs, "a2", [0.0, 0.3], alpha=[0, 1], **MOTION)
    assert found.table().head[:3] == ("spectrum of", "Sa at α = 0", "nature")
    assert found.table().rows[found.largest_rows[0]][0] == "a2, T = 0.3 s"
    rows = found.records()
    assert [row["period [s]"] for row in rows] == [0.0, 0.3] * 2
    assert rows[1]["bound [m/s^2]"] == found.bound[0, 0, 1]
    assert "≤" in str(found)


def test_what_has_no_floor_spectrum_is_one_line(rng):
    ground = record(rng)
    frame = frame_of(ground)
    force = Force(1, 2.0, History.constant())

    def refuses(structure, message, outputs="a2", periods=(0.3,), **changes):
        with pytest.raises(RefusedError, match=message):
            floor_spectrum(
                structure,
                changes.pop("inputs", {"k1": 900.0}),
                outputs,
                periods,
                **MOTION | changes,
            )

    refuses(pendulum(), "structure is LagrangianSystem; allowed: a linear structure")
    refuses(frame_of(None), "ground is missing; allowed: an accelerogram")
    refuses(frame_of(replace(ground, start=0.5)), "ground is a record that starts late")
    refuses(frame_of(ground, loads=(force,)), "loads is 1 forces; allowed: accelerograms")
    refuses(frame_of(ground, q0=(0.1, 0.0)), "structure is displaced or in motion at the start")
    refuses(frame, "displaced or in motion", inputs={"q1_0": Interval(-0.1, 0.1)})
    refuses(frame, "output is q2; allowed: absolute accelerations, as a3", outputs="q2")
    refuses(frame, "outputs is missing", outputs=())
    refuses(frame, "periods is missing", periods=())
    refuses(frame, "periods is 0.0001 s", periods=[1e-4])
    refuses(frame, "damping is 1.5", damping=1.5)
    refuses(frame, "duration is 0.5 s; allowed: .* whole steps of 0.3 s", duration=0.5, step=0.3)
