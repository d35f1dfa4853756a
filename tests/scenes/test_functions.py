"""Scenes without a case: a function of one's own, and matrices in Python."""

import numpy as np
import pytest

from alphacut.frame import MatrixStructure, envelope
from alphacut.fuzzy import Triangular, propagate


def test_a_function_of_ones_own_has_its_exact_cuts():
    inputs = {"x": Triangular(1, 2, 3), "y": Triangular(-1, 0, 2)}
    result = propagate(lambda x, y: x**2 * np.exp(y), inputs)
    alpha = np.linspace(0, 1, 5)
    lower = (1 + alpha) ** 2 * np.exp(alpha - 1)  # rises with both inputs
    upper = (3 - alpha) ** 2 * np.exp(2 - 2 * alpha)
    assert result.lower[:, 0] == pytest.approx(lower, rel=1e-9)
    assert result.upper[:, 0] == pytest.approx(upper, rel=1e-9)


def test_matrices_have_the_exact_envelope_of_their_motion():
    """Two masses on like springs that start alike move as one: q = q0 cos(√(k/m) t)."""
    structure = MatrixStructure(
        {"m": 2.0, "k": 50.0, "c": 30.0},
        mass=[("m", np.eye(2))],
        stiffness=[("k", np.eye(2)), ("c", np.array([[1.0, -1], [-1, 1]]))],
        observed={"q1": np.array([1.0, 0])},
        q0=np.array([0.1, 0.1]),
    )
    inputs = {"k": Triangular(45, 50, 55), "m": Triangular(1.9, 2.0, 2.1)}
    bounds = envelope(structure, inputs, duration=3.0, step=0.05, alpha=[0, 0.5, 1])
    time = np.asarray(bounds.time)
    for row, alpha in enumerate((0, 0.5, 1)):
        slow, fast = (
            np.sqrt((50 + s * 5 * (1 - alpha)) / (2 - s * 0.1 * (1 - alpha))) for s in (-1, 1)
        )
        motions = 0.1 * np.cos(np.linspace(slow, fast, 4001)[:, None] * time)
        assert bounds.lower[row, :, 0] == pytest.approx(motions.min(axis=0), abs=1e-4)
        assert bounds.upper[row, :, 0] == pytest.approx(motions.max(axis=0), abs=1e-4)
