"""Several components of ground motion, against the structure under each of them alone."""

from dataclasses import replace

import numpy as np
import pytest

from alphacut.frame import Accelerogram, Force, History, MatrixStructure, envelope, over_records
from alphacut.fuzzy import Interval
from tests.frame.motions import exact_motions, random_points, require_inside
from tests.refused import refuses

RNG = np.random.default_rng(61)
X, Y, OTHER = (Accelerogram(0.04, RNG.normal(size=26)) for _ in range(3))
EAST, NORTH = np.eye(3)[:2]
# A floor on columns whose stiffness is not centred: unknowns east, north and rotation.
TORSION = np.array([[1.0, 0, -0.3], [0, 1.6, 0.2], [-0.3, 0.2, 0.9]])
PLAN = MatrixStructure(
    {"m": 2.0, "k": 90.0},
    mass=[("m", np.eye(3)), (0.3, np.diag([1.0, 1.0, 0.0]))],
    stiffness=[("k", TORSION)],
    observed={
        "corner": np.array([1.0, 0, -0.8]),
        "speed": np.array([0.0, 0, 0, 0, 1.0, 0.6]),
        "acceleration": np.array([0.0] * 6 + [0.7, 1.0, 0.6]),
    },
    ratios=[0.04],
    ground=X,
    pattern=EAST,
    components=[(Y, NORTH)],
)
INPUTS = {"m": Interval(1.9, 2.1), "k": Interval(86.0, 94.0)}


def test_components_add_up():
    points = random_points(INPUTS, 6, RNG)
    along_north = replace(PLAN, ground=Y, pattern=NORTH, components=())
    alone = (replace(PLAN, components=()), along_north, replace(PLAN, ground=None))
    together, east, north, as_force = (
        exact_motions(structure, points, INPUTS, 1.5, 0.05) for structure in (PLAN, *alone)
    )
    assert np.abs(together).max() > 0.01
    assert together == pytest.approx(east + north, abs=1e-12)
    assert as_force == pytest.approx(north, abs=1e-12)


def test_bounds_hold_and_are_as_tight_as_those_of_a_single_component():
    motion = {"duration": 1.5, "step": 0.05, "alpha": [0.0], "progress": False}
    found = envelope(PLAN, INPUTS, **motion)
    assert found.nature == "guaranteed"
    require_inside(exact_motions(PLAN, random_points(INPUTS, 200, RNG), INPUTS, 1.5, 0.05), found)
    north = replace(PLAN, ground=Y, pattern=NORTH, components=())
    of_ground, of_forces = (
        envelope(structure, INPUTS, **motion) for structure in (north, replace(PLAN, ground=None))
    )
    size = np.abs(of_ground.upper).max(axis=(0, 1))
    assert (np.abs(of_forces.upper - of_ground.upper).max(axis=(0, 1)) < 1e-3 * size).all()


def test_copies_make_inertia_forces_anew():
    force = Force(np.ones(3), 4.0, History.constant())
    pushed = replace(replace(PLAN, loads=[force]), components=[(OTHER, NORTH)])
    assert pushed.loads[0] is force
    assert [load.history for load in pushed.loads[1:]] == [OTHER] * 2
    assert replace(pushed, components=()).loads == (force,)
    assert len(PLAN.with_outputs(["corner"]).loads) == 2


@pytest.mark.parametrize(
    ("components", "key"),
    [
        ([(Accelerogram(0.04, np.ones(9)), NORTH)], "samples of components"),
        ([(Accelerogram(0.02, Y.samples), NORTH)], "samples of components"),
        ([(Y, NORTH[:2])], "influence vector"),
        ([Y], "components"),
        ([(NORTH, Y)], "components"),
    ],
)
def test_what_is_no_component_is_one_line(components, key):
    with refuses(key):
        replace(PLAN, components=components)


def test_a_suite_of_single_records_lacks_a_component():
    with refuses("ground"):
        over_records(PLAN, INPUTS, [OTHER], duration=1.0, step=0.05)
