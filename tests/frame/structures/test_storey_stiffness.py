"""Stiffnesses given for each storey, second moments of each storey, and weights (P-Delta)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

from alphacut.frame import Exact, LinearFlow, StoreyFrame, envelope
from alphacut.frame.calculus.jet import Array
from alphacut.frame.reduced.beam import BeamFrame
from alphacut.frame.structures.field_frame import FieldFrame
from alphacut.frame.structures.linear import frequencies
from alphacut.fuzzy import Interval
from alphacut.fuzzy.field import FuzzyField

G = 9.81
MASSES, HEIGHTS, STIFF = (20e3, 15e3, 8e3), (4.0, 3.2, 3.0), (3e6, 2.5e6, 1e6)


def dense(masses: Array, heights: Array, stiff: Array, g: float) -> tuple[Array, Array]:
    """M and the Hessian of strain energy less the weights' work, with drops Δ² / 2 h."""
    n = len(masses)
    K = np.zeros((n, n))
    for z in range(n):
        b = np.eye(n)[z] - (np.eye(n)[z - 1] if z else 0)
        K += stiff[z] * np.outer(b, b)
        for floor in range(z, n):  # every mass above sinks with the storey
            K -= g * masses[floor] / heights[z] * np.outer(b, b)
    return np.diag(masses), K


def motion(M: Array, K: Array, q0: Array, time: Array) -> Array:
    """q(t) of the free motion from rest, shape (T, n)."""
    n = len(M)
    A = np.block([[np.zeros((n, n)), np.eye(n)], [-np.linalg.solve(M, K), np.zeros((n, n))]])
    start = np.concatenate([q0, np.zeros(n)])
    return np.array([(expm(A * t) @ start)[:n] for t in time])


def test_given_stiffnesses_move_as_those_of_columns_do() -> None:
    columns = StoreyFrame(MASSES, HEIGHTS, 25e9, 1e-5, q0=(0.01, 0.02, 0.03))
    k = tuple(24 * 25e9 * 1e-5 / h**3 for h in HEIGHTS)
    given = StoreyFrame(MASSES, stiffness=k, q0=(0.01, 0.02, 0.03))
    np.testing.assert_allclose(frequencies(given), frequencies(columns), rtol=1e-12)
    assert given.group("k") == ("k1", "k2", "k3")
    assert not {"E", "I", "l1", "c1"} & set(given.parameters)


def test_second_moments_of_each_storey_are_inputs_of_their_own() -> None:
    own = StoreyFrame(MASSES, HEIGHTS, 25e9, (2e-5, 1e-5, 1e-5))
    columns = StoreyFrame(MASSES, HEIGHTS, 25e9, 1e-5, columns=(4, 2, 2))
    np.testing.assert_allclose(frequencies(own), frequencies(columns), rtol=1e-12)
    assert own.group("I") == ("I1", "I2", "I3")


def test_one_storey_with_its_weight_swings_as_in_closed_form() -> None:
    k, m, h = 5e4, 2e3, 3.0
    frame = StoreyFrame((m,), (h,), stiffness=(k,), gravity=G, q0=(0.1,), outputs=("q1", "shear1"))
    omega = np.sqrt((k - m * G / h) / m)
    flow = LinearFlow(frame, (), 10.0, 0.05, Exact())
    q, shear = flow.values(np.zeros((1, 0)))[0].T
    np.testing.assert_allclose(q, 0.1 * np.cos(omega * flow.time), atol=1e-12)
    np.testing.assert_allclose(shear, k * q, rtol=1e-12)  # of the columns, which bend by it


def test_proved_bounds_with_weights_hold_every_motion_of_a_dense_reference() -> None:
    rng = np.random.default_rng()
    inputs = {
        "k1": Interval(2.9e6, 3.1e6),
        "k3": Interval(0.95e6, 1.05e6),
        "m3": Interval(7.5e3, 8.5e3),
        "l2": Interval(3.1, 3.3),
    }
    gravity = float(rng.uniform(20, 60))  # strong, so that it matters
    frame = StoreyFrame(MASSES, HEIGHTS, stiffness=STIFF, gravity=gravity, q0=(0.01, 0.02, 0.04))
    found = envelope(frame, inputs, duration=1.5, step=0.05, alpha=(0,), tolerance=1e-4)
    assert found.nature == "guaranteed"
    low, high = np.array([inputs[x].support for x in inputs]).T
    without = dense(np.array(MASSES), np.array(HEIGHTS), np.array(STIFF), 0.0)
    start = np.array(frame.q0)
    plain = motion(*without, start, found.time)
    assert ((plain < found.lower[0]) | (plain > found.upper[0])).any()
    for point in rng.uniform(low, high, (12, 4)):
        k = np.array([point[0], STIFF[1], point[1]])
        parts = dense(np.array([*MASSES[:2], point[2]]), np.array([4.0, point[3], 3.0]), k, gravity)
        q = motion(*parts, start, found.time)
        assert (q >= found.lower[0] - 1e-12).all()
        assert (q <= found.upper[0] + 1e-12).all()


def test_weights_that_buckle_a_storey_are_refused_where_they_first_do() -> None:
    masses, heights, stiff = (np.array(x) for x in (MASSES, HEIGHTS, STIFF))
    above = np.cumsum(masses[::-1])[::-1]
    critical = float((stiff * heights / above).min())  # where the dense stiffness is singular
    _, K = dense(masses, heights, stiff, critical)
    assert abs(np.linalg.eigvalsh(K)[0]) < 1e-9 * stiff.max()
    StoreyFrame(MASSES, HEIGHTS, stiffness=STIFF, gravity=critical * (1 - 1e-9))
    with pytest.raises(ValueError, match=r"P-Delta: storey \d buckles"):
        StoreyFrame(MASSES, HEIGHTS, stiffness=STIFF, gravity=critical * (1 + 1e-9))


def test_a_box_that_reaches_buckling_is_refused() -> None:
    frame = StoreyFrame(
        (2e3,), (1.0,), 1e9, 1e-6, q0=(0.1,), gravity=G
    )  # k l / P = 24 E I / (l² m g)
    inside = np.sqrt(24 * 1e3 / (2.2e3 * G))
    time = {"duration": 0.1, "step": 0.1}
    heavy = {"m1": Interval(1.9e3, 2.2e3)}
    envelope(frame, {**heavy, "l1": Interval(0.9 * inside, inside - 1e-6)}, **time)
    with pytest.raises(ValueError, match="storey 1 buckles"):
        envelope(frame, {**heavy, "l1": Interval(0.9 * inside, inside + 1e-6)}, **time)
    with pytest.raises(ValueError, match="storey 1 buckles"):
        frame.require_standing({"m1": (1.9e3, 2.2e3), "l1": (0.9 * inside, inside + 1e-6)})


def test_a_given_stiffness_buckles_first_where_its_storey_is_low() -> None:
    """k l / P falls with the height there, and rises with it where columns make k."""
    frame = StoreyFrame((2e3,), (2.0,), stiffness=(2e4,), gravity=G)
    least = 2e3 * G / 2e4
    frame.require_standing({"l1": (least + 1e-6, 9.0)})
    with pytest.raises(ValueError, match="storey 1 buckles"):
        frame.require_standing({"l1": (least - 1e-6, 9.0)})


def test_a_field_of_stiffnesses_stays_upright_over_its_whole_box() -> None:
    field = FuzzyField("k", (2.0, 5.2, 8.4), 1e6, 2e5, 8.0)
    rest = {"stiffness": (1e6,) * 3, "lengths": HEIGHTS, "gravity": G}
    frame = FieldFrame(MASSES, **rest, field=field)  # type: ignore[arg-type]
    low = {name: (-1.0, 1.0) for name in field.names}
    ranges = frame.ranges(low)
    assert all(ranges[f"k{z}"] == pytest.approx((8e5, 12e5), rel=1e-9) for z in (1, 2, 3))
    heavy = sum(MASSES) * G / HEIGHTS[0]
    weak = replace(frame, field=replace(field, centre=1.1 * heavy, half_width=0.2 * heavy))
    with pytest.raises(ValueError, match="storey 1 buckles"):
        weak.require_standing(low)


@pytest.mark.parametrize(
    ("values", "pattern"),
    [
        ({"modulus": 25e9}, "stiffness: modulus beside it"),
        ({"columns": (2, 2, 2), "second_moment": 1e-5}, "second_moment, columns beside it"),
        ({"stiffness": (1e6, 1e6)}, "stiffness: 2 values for 3 floors"),
        ({"stiffness": (1e6, -1e6, 1e6)}, "stiffness: -1e.06 is not allowed"),
        ({"stiffness": ()}, "modulus: missing"),
        ({"gravity": G}, "lengths: missing"),
        ({"gravity": -G, "lengths": HEIGHTS}, "gravity: -9.81 is not allowed"),
        ({"gravity": "9.81"}, "gravity: '9.81' is not allowed"),
    ],
)
def test_frames_that_make_no_sense_are_refused(values: dict[str, object], pattern: str) -> None:
    with pytest.raises(ValueError, match=pattern):
        StoreyFrame(MASSES, **{"stiffness": STIFF, **values})  # type: ignore[arg-type]


def test_a_large_structure_is_refused_with_the_way_to_a_small_one() -> None:
    frame = BeamFrame(2, 1)
    for large in (frame, frame.structure()):
        with pytest.raises(ValueError, match=r"reduced\(box\)"):
            envelope(large, {"mass": Interval(1e4, 1.2e4)}, duration=1, step=0.1)  # type: ignore[arg-type]
