"""Proofs where frequencies of two modes come near each other within the box, and shapes turn."""

import numpy as np
import pytest

from alphacut.frame import Exact, LinearFlow, MatrixStructure, Proof, envelope
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.structures.modes import ModalError
from alphacut.fuzzy import Interval

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


@pytest.mark.parametrize("coupling", [0.0, 1e-4, 0.01, 0.1])
def test_a_proof_holds_or_is_refused_where_frequencies_cross(coupling: float) -> None:
    system, width = twins(coupling), np.random.default_rng().uniform(0.5, 4.0)
    inputs = {"k": Interval(100 - width, 100 + width)}
    points = np.linspace(100 - width, 100 + width, 801)[:, None]
    values = LinearFlow(system, ("k",), DURATION, STEP, Exact()).values(points)
    motion = {"duration": DURATION, "step": STEP, "alpha": (0,), "relative": True}
    method = Proof(tolerance=1e-2, parts=3)
    try:
        proof = envelope(system, inputs, method=method, progress=False, **motion)
    except (UnprovedError, ModalError):
        assert coupling < 0.1  # modes that stay apart are proved
        return
    assert (values <= proof.upper[0] + 1e-12).all()
    assert (values >= proof.lower[0] - 1e-12).all()
    assert proof.error.max() <= 1.1e-2 * np.abs(values).max()
