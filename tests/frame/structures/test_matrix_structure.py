"""A structure given by its matrices, against the storey frame that has the same ones."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from scipy.sparse import coo_array

from alphacut.frame import Exact, LinearFlow, MatrixStructure, StoreyFrame

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


def test_sparse_arrays_are_those_that_they_stand_for() -> None:
    def sparse(terms: Any) -> Any:
        return [(factor, coo_array(array)) for factor, array in terms]

    kinds = {kind: sparse(getattr(MATRIX, kind)) for kind in ("mass", "damping", "stiffness")}
    whole = replace(MATRIX, **kinds)
    a, b = (
        LinearFlow(system, ("E", "m1"), 1, 0.1, Exact()).values(np.array([[5.2, 2.9]]))
        for system in (MATRIX, whole)
    )
    assert (a == b).all()
