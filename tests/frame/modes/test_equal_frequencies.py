"""A building alike in x and y: modes of equal frequencies, and an output that stays at rest."""

import numpy as np
import pytest

from alphacut.frame import (
    Accelerogram,
    DualProof,
    Exact,
    Force,
    History,
    LinearFlow,
    MatrixStructure,
    Proof,
    envelope,
)
from alphacut.fuzzy import Interval
from tests.frame.motions import exact_motions, judged_motions, off_chords

EYE = np.eye(4)
CHAIN = np.array([[2.0, -1], [-1, 1]])
BOTH = np.kron(EYE[:2, :2], CHAIN)
RECORD = Accelerogram(0.02, np.sin(8 * np.arange(0, 2.001, 0.02)))
GIVEN = {"duration": 3.0, "step": 0.01, "alpha": [0], "progress": False}


def building(angle=0.0):
    """Two equal chains of two unit masses with springs k, in axes turned by an angle."""
    turn = np.kron([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]], EYE[:2, :2])
    springs = turn @ BOTH @ turn.T
    return MatrixStructure(
        {"k": 610.0},
        [(1.0, EYE)],
        [("k", (springs + springs.T) / 2)],
        {"qx": EYE[1], "qy": EYE[3]},
        ratios=(0.02,),
        ground=RECORD,
        pattern=np.array([1.0, 1, 0, 0]),
    )


@pytest.mark.parametrize(
    ("angle", "method"), [(0.0, DualProof()), (np.pi / 6, DualProof()), (np.pi / 6, Proof())]
)
def test_double_modes_are_proved_and_the_output_at_rest_has_no_gap(angle, method):
    found = envelope(building(angle), {"k": Interval(600, 620)}, method=method, **GIVEN)
    assert found.nature == "guaranteed"
    # the peak of the same building with y twice as stiff, by an independent calculation
    assert found.upper[0, :, 0].max() == pytest.approx(0.009445, rel=1e-3)
    assert found.inner.upper[0, :, 0].max() == pytest.approx(0.009445, rel=1e-4)
    assert np.abs(found.upper[0, :, 1]).max() < 2e-7
    assert np.abs(found.lower[0, :, 1]).max() < 2e-7
    assert found.facts["gap_of_peaks"] < 2e-3
    points = np.array([[600.0], [610.0], [620.0]])
    fine = exact_motions(building(angle), points, ("k",), 3.0, 0.001)[..., 0]
    deviation = off_chords(fine.T, 10).max()
    assert deviation <= found.between[:, 0].max() <= 3 * deviation


def test_an_oscillator_is_left_where_all_blocks_are_narrower_by_sums():
    """Two floors in x, y and torsion; one of x and torsion coupled, and the force in y."""
    K, masses = CHAIN, [1.1667, 1.0533]

    def block(a, b, c, d=0.0):
        zero = np.zeros((2, 2))
        return np.block([[a * K, zero, d * K], [zero, b * K, zero], [d * K, zero, c * K]])

    stiffness = [
        (lambda p: p["g0"] * p["l"] ** -3, block(1, 0, 0)),
        (1.0, block(0, 1, 0)),
        (1.0, block(0, 0, 1.7)),
        ("g3", block(0, 0, 0, 0.07988)),
    ]
    mass = [
        ("ra", np.diag(masses + masses[:1] + [0] * 3)),
        ("rb", np.diag([0] * 3 + masses[1:] + masses)),
    ]
    rng = np.random.default_rng(5)
    ground = Accelerogram(0.449, rng.normal(size=130))
    history = History(3.86, rng.normal(size=6), start=15.73)
    system = MatrixStructure(
        {"g0": 1.0, "g3": 1.0, "ra": 1.0, "rb": 1.0, "l": 1.0},
        mass,
        stiffness,
        {"y0": np.eye(6)[1], "y1": np.eye(6)[4]},
        ratios=(0.03,),
        ground=ground,
        loads=[Force(np.eye(6)[1], 1.3, history)],
    )
    inputs = dict.fromkeys(("rb", "l", "g3", "g0", "ra"), Interval(0.92, 1.06))
    nodes = {"duration": 20 * 1.533, "step": 1.533, "alpha": [0], "progress": False}
    found = envelope(system, inputs, DualProof(parts=1, slabs=1, steps=2), **nodes)
    assert found.facts["single_modes"] > 0


def test_damping_by_ratios_is_smooth_where_modes_of_one_ratio_meet(rng):
    """Beside dashpots: derivatives at a double mode agree with difference quotients."""
    change = rng.normal(size=(2, 4, 4))
    change = change + change.swapaxes(1, 2)
    middle, h, ratios = np.diag([1.0, 1, 4, 9]), 1e-3, np.array([0.02, 0.02, 0.05, 0.05])
    dashpots = 0.01 * np.ones((4, 4))
    system = MatrixStructure(
        {"x": 0.0, "y": 0.0},
        [(1.0, EYE)],
        [(1.0, middle), ("x", change[0]), ("y", change[1])],
        {"sum": np.ones(4)},
        damping=[(1.0, dashpots)],
        ratios=ratios,
        q0=np.array([1.0, 2.0, -1.0, 0.5]),
    )
    flow = LinearFlow(system, ("x", "y"), 2.0, 0.5, Exact())
    near = h * np.array([(0, 0), (1, 0), (-1, 0), (1, 1), (1, -1), (-1, 1), (-1, -1)])
    at, *other = judged_motions(system, near, "xy", flow.time)[..., 0]
    found = flow.taylor(np.zeros((1, 2)))
    assert found.value[0, :, 0] == pytest.approx(at, abs=1e-12)
    slope = (other[0] - other[1]) / (2 * h)
    assert found.first[0, 0, :, 0] == pytest.approx(slope, abs=1e-4)
    bend = np.tensordot([1, -1, -1, 1], other[2:], 1) / (4 * h * h)
    assert found.second[0, 1, 0, :, 0] == pytest.approx(bend, abs=1e-3)
