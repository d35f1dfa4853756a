"""Damping ratios of single modes: exact motions, derivatives, proofs, and modes that cross."""

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.signal import lsim

from alphacut.frame import Accelerogram, MatrixStructure, StoreyFrame, envelope
from alphacut.fuzzy import Interval, Triangular
from tests.frame.motions import exact_motions, random_points, require_inside
from tests.refused import refuses

RATIOS = (0.02, 0.05, 0.08)
RECORD = Accelerogram(0.05, 3 * np.random.default_rng(8).standard_normal(60))
FRAME = StoreyFrame(
    (2e4, 2e4, 1.5e4),
    stiffness=(9e6, 8e6, 6e6),
    damping_ratio=RATIOS,
    ground=RECORD,
    outputs=("q3", "drift2", "v1"),
)
FUZZY = {
    "k1": Triangular(8.5e6, 9e6, 9.5e6),
    "m3": Interval(1.4e4, 1.6e4),
    "zeta1": Triangular(0.01, 0.02, 0.03),
    "zeta3": Triangular(0.07, 0.08, 0.09),
}


def exact(k1, m3, zeta1, zeta3):
    """Motion with the damping that modes of SciPy give at the samples up to 1.5 s, (T, 3)."""
    k, m = np.array([k1, 8e6, 6e6]), np.array([2e4, 2e4, m3])
    below = np.eye(3) - np.eye(3, k=-1)
    K, M = below.T @ np.diag(k) @ below, np.diag(m)
    squared, shape = eigh(K, M)
    damping = 2 * np.array([zeta1, RATIOS[1], zeta3]) * np.sqrt(squared)
    D = M @ shape @ np.diag(damping) @ shape.T @ M
    rows = np.zeros((3, 6))
    rows[[0, 1, 1, 2], [2, 1, 0, 3]] = 1, 1, -1, 1
    A = np.block([[np.zeros((3, 3)), np.eye(3)], [-np.linalg.solve(M, np.hstack([K, D]))]])
    B = np.repeat([[0.0], [-1.0]], 3, axis=0)
    samples = RECORD.samples[:31]
    return lsim((A, B, rows, np.zeros((3, 1))), samples, RECORD.step * np.arange(31))[1]


def test_motions_are_those_of_an_independent_calculation(rng):
    points = random_points(FUZZY, 8, rng)
    for point, motion in zip(points, exact_motions(FRAME, points, FUZZY, 1.5, 0.05), strict=True):
        reference = exact(*point)
        assert motion == pytest.approx(reference, abs=1e-9 * np.abs(reference).max())


def test_bounds_hold_motions_and_are_near(rng):
    given = {"duration": 1.5, "step": 0.05, "alpha": (0,), "progress": False}
    found = envelope(FRAME, FUZZY, **given)
    assert found.method == "dual"
    values = np.stack([exact(*point) for point in random_points(FUZZY, 20, rng)])
    require_inside(values, found, slack=1e-9)
    assert found.facts["gap_of_peaks"] <= 2e-3


def test_modes_of_unequal_ratios_must_not_cross():
    system = MatrixStructure(
        {"k": 1.0, "z": 0.02},
        [(1.0, np.eye(2))],
        [("k", np.diag([100.0, 0.0])), (1.0, np.diag([0.0, 110.0])), (1.0, [[1, -1], [-1, 1]])],
        {"q": np.array([1.0, 1.0])},
        q0=np.ones(2),
        ratios=("z", 0.05),
    )
    given = {"duration": 1.0, "step": 0.05, "alpha": (0,), "progress": False}
    with refuses("damping ratios"):
        envelope(system, {"k": Interval(0.8, 1.3)}, **given)
    assert envelope(system, {"k": Interval(0.9, 1.0)}, **given).nature == "guaranteed"
