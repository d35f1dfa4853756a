"""A structure given by its matrices, against the storey frame that has the same ones."""

from __future__ import annotations

import numpy as np
import pytest

from alphacut.frame import Exact, LinearFlow, MatrixStructure, StoreyFrame, envelope
from alphacut.fuzzy import Triangular

STOREY = StoreyFrame(
    (3.0, 2.0),
    (1.0, 1.2),
    5.0,
    1.0,
    (0.1, 0.2),
    "storey",
    (0.1, 0.0),
    (0.0, 0.4),
    outputs=("q2", "v1"),
)
TOP = 1.2**-3 * np.array([[1.0, -1.0], [-1.0, 1.0]])
MATRIX = MatrixStructure(
    {"E": 5.0, "m1": 3.0},
    mass=[("m1", np.diag([1.0, 0.0])), (2.0, np.diag([0.0, 1.0]))],
    stiffness=[(lambda p: 24 * p["E"], np.diag([1.0, 0.0]) + TOP)],
    observed={"q2": np.array([0.0, 1.0]), "v1": np.array([0.0, 0.0, 1.0, 0.0])},
    damping=[(1.0, np.array([[0.3, -0.2], [-0.2, 0.2]]))],
    q0=np.array([0.1, 0.0]),
    v0=np.array([0.0, 0.4]),
)


def test_matrices_and_storeys_give_the_same_trajectories_with_derivatives() -> None:
    point = np.array([[5.2, 2.9]])
    a, b = (
        LinearFlow(system, ("E", "m1"), 4, 0.1, Exact()).taylor(point)
        for system in (MATRIX, STOREY)
    )
    for part in ("value", "first", "second"):
        assert (
            np.abs(getattr(a, part) - getattr(b, part)).max()
            < 1e-11 * np.abs(getattr(b, part)).max()
        )


def test_envelope_of_given_matrices() -> None:
    inputs = {"E": Triangular(4.8, 5, 5.2), "m1": Triangular(2.9, 3, 3.1)}
    a, b = (
        envelope(system, inputs, duration=4, step=0.1, alpha=(0,), method="modal")
        for system in (MATRIX, STOREY)
    )
    assert np.abs(a.upper - b.upper).max() < 1e-6


def test_matrices_that_do_not_fit_are_refused() -> None:
    eye, row = np.eye(2), {"q": np.ones(2)}
    with pytest.raises(ValueError, match=r"stiffness: an array has shape \(3, 3\)"):
        MatrixStructure({}, [(1.0, eye)], [(1.0, np.eye(3))], row)
    with pytest.raises(ValueError, match="factor 'E' is no parameter"):
        MatrixStructure({}, [(1.0, eye)], [("E", eye)], row)
    with pytest.raises(ValueError, match="not positive definite"):
        MatrixStructure({}, [(1.0, np.diag([1.0, 0.0]))], [(1.0, eye)], row)
    with pytest.raises(ValueError, match="observed: 'q' has shape"):
        MatrixStructure({}, [(1.0, eye)], [(1.0, eye)], {"q": np.ones(3)})
    with pytest.raises(ValueError, match="q0: shape"):
        MatrixStructure({}, [(1.0, eye)], [(1.0, eye)], row, q0=np.ones(3))
