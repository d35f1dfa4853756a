"""Proved bounds of floor accelerations, which are forces over fuzzy masses."""

import numpy as np
import pytest

from alphacut.frame import (
    Accelerogram,
    DualProof,
    Force,
    History,
    MatrixStructure,
    Proof,
    envelope,
)
from alphacut.fuzzy import Interval
from tests.frame.motions import exact_motions, random_points, require_inside


@pytest.fixture
def plan(rng):
    """A floor on two columns and a roof, under two components of the ground and a force."""
    springs = np.array([[3.0, -1.0, 0.2], [-1.0, 1.0, 0.0], [0.2, 0.0, 0.7]])
    rows = np.eye(9)
    return MatrixStructure(
        {"m": 2.0, "k": 90.0},
        mass=[("m", np.array([[2.0, 0.3, 0], [0.3, 1, 0], [0, 0, 0.4]]))],
        stiffness=[("k", springs), (9.0, np.eye(3))],
        observed={"a": rows[7] + 0.3 * rows[8], "v": rows[4], "drift": rows[1] - rows[0]},
        ratios=[0.05],
        ground=Accelerogram(0.04, rng.normal(size=26)),
        loads=[Force(np.array([0, 1.0, 0]), 0.8, History(0.05, rng.normal(size=20)))],
        pattern=np.array([1.0, 1.0, 0.0]),
        components=[(Accelerogram(0.04, rng.normal(size=26)), np.array([0.3, 0.0, 1.0]))],
    )


INPUTS = {"m": Interval(1.95, 2.05), "k": Interval(87.0, 93.0)}


@pytest.mark.parametrize("method", [Proof(tolerance=0.02), DualProof()])
def test_bounds_of_outputs_on_matrices_hold(plan, rng, method):
    """Accelerations with what a force adds at once, velocities and drifts."""
    motion = {"duration": 1.5, "step": 0.05, "alpha": [0.0], "progress": False}
    found = envelope(plan, INPUTS, method, **motion)
    assert found.nature == "guaranteed"
    motions = exact_motions(plan, random_points(INPUTS, 300, rng), INPUTS, 1.5, 0.05)
    require_inside(motions, found)
    size = np.abs(motions).max(axis=(0, 1))
    slack = np.abs(found.upper[0] - motions.max(axis=0)).max(axis=0)
    assert (slack < 0.25 * size).all()


@pytest.mark.parametrize("method", ["dual", "auto"])
def test_a_mixture_of_displacements_and_accelerations_is_proved(plan, method, rng):
    """By the damped modes, which take all outputs off displacements and velocities."""
    row = np.eye(9)[7] + 20.0 * np.eye(9)[1]
    mixed = MatrixStructure(
        plan.parameters, plan.mass, plan.stiffness, {"sum": row}, ratios=[0.05], ground=plan.ground
    )
    motion = {"duration": 1.5, "step": 0.05, "alpha": [0.0], "progress": False}
    found = envelope(mixed, INPUTS, method, **motion)
    assert found.nature == "guaranteed"
    require_inside(exact_motions(mixed, random_points(INPUTS, 100, rng), INPUTS, 1.5, 0.05), found)
