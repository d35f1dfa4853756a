"""A structure given by its matrices, against the storey frame that has the same ones."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
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


@pytest.mark.parametrize("kind", ["mass", "damping", "stiffness"])
def test_arrays_that_are_not_symmetric_are_refused(kind: str) -> None:
    lower = np.array([[2.0, 0.0], [-1.0, 2.0]])
    cure = r"\[0, 1\] is 0 and \[1, 0\] is -1; only one triangle is there: take A \+ A.T - np"
    with pytest.raises(ValueError, match=f"{kind}: an array is not symmetric, by 1: entry {cure}"):
        replace(MATRIX, **{kind: [(1.0, lower)]})
    with pytest.raises(ValueError, match=r"by 0.5: .*; mirror the one that is right"):
        replace(MATRIX, **{kind: [(1.0, lower - np.diag([0.5], 1))]})
    even = lower - np.diag([1.0 + 1e-12], 1)
    taken = getattr(replace(MATRIX, **{kind: [(1.0, even)]}), kind)[0][1]
    assert (taken == taken.T).all()


def test_the_odd_one_among_arrays_is_named() -> None:
    with pytest.raises(
        ValueError, match=r"mass: an array has shape \(3, 3\); all must be \(2, 2\)"
    ):
        replace(MATRIX, mass=[(1.0, np.eye(3))])
