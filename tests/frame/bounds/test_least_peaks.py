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
from tests.frame.bounds.test_dual_proof import each_storey, record, storeys
from tests.frame.motions import exact_motions, random_points

MODEL = storeys(3, damping_ratio=0.03, ground=record(), outputs=("q3", "drift1"))
FUZZY = each_storey(3) | {"zeta": Triangular(0.02, 0.03, 0.04)}


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
    found = envelope(frame, inputs, method, duration=2.0, step=0.02, alpha=(0,), progress=False)
    proved, reached = (float(bound[0, 0]) for bound in found.least_peaks)
    points = random_points(inputs, 500, np.random.default_rng(0))
    lowest = np.abs(exact_motions(frame, points, inputs, 2.0, 0.02)).max(1).min()
    assert 0.95 * lowest <= proved <= lowest <= reached <= 1.08 * lowest


ECCENTRIC = Path(__file__).resolve().parents[3] / "cases" / "eccentric-frame"


@pytest.mark.parametrize(("components", "gap"), [(("y",), 0.003), (("x", "y"), 0.02)])
def test_peaks_and_least_peaks_of_floors_that_turn_are_near(rng, components, gap):
    """Models of the whole box reach more than any motion; parts pruned by them have the gap, too."""
    matrices = {name: read_matrix(ECCENTRIC / f"{name}.mtx") for name in ("mass", "wall", "core")}
    frames = sum(read_matrix(ECCENTRIC / f"frame_{axis}.mtx") for axis in "xy")
    (first, pattern), *others = [
        (read_record(ECCENTRIC / f"1_{axis}.AT2"), np.tile(np.eye(3)["xy".index(axis)], 3))
        for axis in components
    ]
    corner = {"x": np.eye(9)[0] - 6 * np.eye(9)[2], "y": np.eye(9)[1] + 9 * np.eye(9)[2]}
    floors = MatrixStructure(
        {"wall": 1.0, "core": 1.0, "frames": 1.0},
        mass=[(1.0, matrices["mass"])],
        stiffness=[("wall", matrices["wall"]), ("core", matrices["core"]), ("frames", frames)],
        observed={axis: corner[axis] for axis in components},
        ratios=(0.05,),
        ground=first,
        pattern=pattern,
        components=others,
    )
    inputs = {name: Interval(0.9, 1.1) for name in floors.parameters}
    method = DualProof(gap=gap, peaks=gap, below=1.0)
    found = envelope(floors, inputs, method, duration=6.0, step=0.02, alpha=(0,), progress=False)
    assert found.facts["gap_of_peaks"] <= gap
    peaks = np.abs(exact_motions(floors, random_points(inputs, 500, rng), inputs, 6.0, 0.02)).max(1)
    proved, reached = found.least_peaks.lower[0], found.least_peaks.upper[0]
    assert (0.925 * reached <= proved).all()
    assert (proved <= np.minimum(peaks.min(0), reached)).all()
    assert (peaks.max(0) <= np.maximum(found.proved.upper, -found.proved.lower)[0].max(0)).all()
