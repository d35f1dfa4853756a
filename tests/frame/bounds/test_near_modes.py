"""Proofs where frequencies of two modes come near each other within the box, and shapes turn."""

import numpy as np
import pytest

from alphacut.frame import Accelerogram, Envelope, MatrixStructure, Proof, UnprovedError, envelope
from alphacut.fuzzy import Interval
from tests.frame.motions import exact_motions, require_inside

STEP, DURATION = 0.05, 3.0


def twins(coupling: float) -> MatrixStructure:
    """Two oscillators of 10 rad/s, the first one's stiffness k, with a weak spring between."""
    first, second = np.diag([1.0, 0.0]), np.diag([0.0, 1.0])
    spring = np.array([[1.0, -1.0], [-1.0, 1.0]])
    return MatrixStructure(
        {"k": 100.0},
        [(1.0, np.eye(2))],
        [("k", first), (100.0, second), (100 * coupling, spring)],
        {"q1": np.array([1.0, 0.0]), "q2": np.array([0.0, 1.0])},
        q0=np.array([0.1, 0.0]),
    )


def proof_of(coupling: float, width: float) -> Envelope:
    """Proof for a first stiffness within a width of 100 N/m."""
    inputs = {"k": Interval(100 - width, 100 + width)}
    motion = {"duration": DURATION, "step": STEP, "alpha": (0,)}
    return envelope(twins(coupling), inputs, Proof(tolerance=1e-2, parts=3), **motion)


@pytest.mark.parametrize(("coupling", "widest"), [(0.01, 2.0), (0.1, 4.0)])
def test_a_proof_holds_where_frequencies_come_near(coupling, widest, rng):
    width = rng.uniform(0.25, 1.0) * widest
    points = np.linspace(100 - width, 100 + width, 801)[:, None]
    values = exact_motions(twins(coupling), points, ("k",), DURATION, STEP)
    proof = proof_of(coupling, width)
    require_inside(values, proof, slack=1e-12)
    assert proof.error.max() <= 1.1e-2 * np.abs(values).max()


@pytest.mark.parametrize(("coupling", "width"), [(1e-4, 0.5), (0.01, 4.0)])
def test_a_proof_is_refused_where_frequencies_cross(coupling: float, width: float) -> None:
    with pytest.raises(UnprovedError):
        proof_of(coupling, width)


@pytest.mark.parametrize("fuzzy", ["k", "d", "m"])
def test_equal_modes_with_dashpots_are_proved_where_one_input_moves_both(fuzzy, rng):
    """Two equal chains in axes turned by any angle, each with a dashpot that couples its modes."""
    turn = np.kron(np.linalg.qr(rng.normal(size=(2, 2)))[0], np.eye(2))
    chains, dashpots, mass = (
        turn @ np.kron(np.eye(2), part) @ turn.T
        for part in ([[2, -1], [-1, 1]], np.diag([1, 0]), np.eye(2))
    )
    system = MatrixStructure(
        {"m": 1.0, "k": 610.0, "d": 0.5},
        [("m", mass)],
        [("k", chains)],
        {"x": np.eye(4)[1], "y": np.eye(4)[3]},
        damping=[("d", dashpots)],
        q0=rng.normal(size=4),
        ground=Accelerogram(0.05, rng.normal(size=40)),
        pattern=rng.normal(size=4),
    )
    value = system.parameters[fuzzy]
    inputs = {fuzzy: Interval(0.98 * value, 1.02 * value)}
    found = envelope(system, inputs, Proof(), duration=2.0, step=0.05, alpha=(0,), progress=False)
    points = np.linspace(0.98 * value, 1.02 * value, 81)[:, None]
    require_inside(exact_motions(system, points, inputs, 2.0, 0.05), found, slack=1e-11)
    assert found.facts["gap_of_peaks"] < 1e-3
