"""No motion of a box peaks lower than its least peak, which is near the lowest one known."""

from pathlib import Path

import numpy as np
import pytest

from alphacut.frame import (
    DualProof,
    MatrixStructure,
    Proof,
    StoreyFrame,
    envelope,
    read_matrix,
    read_record,
)
from alphacut.fuzzy import Crisp, Interval, Triangular
from tests.frame.bounds.test_dual_proof import each_storey, near, record, storeys
from tests.frame.motions import exact_motions, random_points

MODEL = storeys(3, damping_ratio=0.03, ground=record(), outputs=("q3", "drift1"))
FUZZY = each_storey(3) | {"zeta": Triangular(0.02, 0.03, 0.04)}

CLOSE = DualProof(gap=0.003, peaks=0.003, below=1.0)
ONE_CUT = {"step": 0.02, "alpha": (0,), "progress": False}


@pytest.fixture(scope="module")
def found():
    given = {"duration": 2.0, "step": 0.05, "alpha": (0, 0.5), "progress": False}
    return envelope(MODEL, FUZZY, method=DualProof(), **given)


def lowest(rng, alpha, count=1000):
    """Smallest peaks of random motions of a cut, (m,)."""
    points = random_points(FUZZY, count, rng, alpha)
    return np.abs(exact_motions(MODEL, points, FUZZY, 2.0, 0.05)).max(1).min(0)


def test_no_motion_peaks_lower(found, rng):
    proved, reached = found.least_peaks
    for level, alpha in enumerate(found.alpha):
        assert (lowest(rng, alpha) >= proved[level] - 1e-12).all()
    assert (proved <= reached).all()
    assert (np.diff(proved, axis=0) >= 0).all()
    assert (proved[0] >= 0.75 * np.minimum(reached[0], lowest(rng, 0.0))).all()


def test_the_peak_of_a_motion_holds_between_nodes(rng):
    """That of a single structure is its least peak."""
    point = random_points(FUZZY, 2, rng)[1]
    inputs = {name: Crisp(float(x)) for name, x in zip(FUZZY, point, strict=True)}
    given = {"duration": 2.0, "step": 0.05, "alpha": (0,), "progress": False}
    bound = envelope(MODEL, inputs, DualProof(), **given).least_peaks.upper[0]
    peak = np.abs(exact_motions(MODEL, point[None], FUZZY, 2.0, 0.001)[0]).max(0)
    assert (peak <= bound).all()
    np.testing.assert_allclose(bound, peak, rtol=0.05)


@pytest.mark.parametrize("method", [Proof(workers=1), DualProof(workers=1)], ids=["proof", "dual"])
def test_both_proofs_know_a_least_peak_and_a_motion_near_it(method):
    frame = StoreyFrame(
        [2e4] * 3, stiffness=[4e7] * 3, damping_ratio=0.03, v0=(0, 0, 0.5), outputs=("q3",)
    )
    inputs = {"k1": Interval(3.8e7, 4.2e7), "m3": Interval(1.9e4, 2.1e4)}
    found = envelope(frame, inputs, method, duration=2.0, **ONE_CUT)
    proved, reached = (float(bound[0, 0]) for bound in found.least_peaks)
    points = random_points(inputs, 500, np.random.default_rng(0))
    lowest = np.abs(exact_motions(frame, points, inputs, 2.0, 0.02)).max(1).min()
    assert 0.95 * lowest <= proved <= lowest <= reached <= 1.08 * lowest


def test_least_peaks_of_a_wide_box_are_near():
    """With cells halved by what the dual function leaves open it is .87 of the lowest known."""
    frame = storeys(3, damping_ratio=0.03, ground=record(), outputs=("drift1",))
    inputs = {name: near(frame.parameters[name], 0.15) for name in ("k1", "m1", "m2")}
    found = envelope(frame, inputs, CLOSE, duration=4.0, **ONE_CUT)
    assert (found.least_peaks.lower >= 0.89 * found.least_peaks.upper).all()


def test_what_is_pruned_has_the_gap_though_models_reach_more_than_motions():
    """Floors that turn, of which a whole box is modelled badly."""
    folder = Path(__file__).resolve().parents[3] / "cases" / "eccentric-frame"
    names = ("mass", "wall", "core", "frame_x", "frame_y")
    mass, wall, core, along_x, along_y = (read_matrix(folder / f"{name}.mtx") for name in names)
    floors = MatrixStructure(
        {"wall": 1.0, "core": 1.0, "frames": 1.0},
        mass=[(1.0, mass)],
        stiffness=[("wall", wall), ("core", core), ("frames", along_x + along_y)],
        observed={"y": np.array([0, 1, 9] + 6 * [0])},
        ratios=(0.05,),
        ground=read_record(folder / "1_y.AT2"),
        pattern=np.tile([0, 1, 0], 3),
    )
    inputs = {name: Interval(0.9, 1.1) for name in floors.parameters}
    found = envelope(floors, inputs, CLOSE, duration=6.0, **ONE_CUT)
    assert found.facts["gap_of_peaks"] <= 0.003
