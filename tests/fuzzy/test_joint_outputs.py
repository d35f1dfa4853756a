"""Hulls of two outputs: exact polygons, enclosures, and a frame's displacements together."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from alphacut.frame import Exact, LinearFlow, StoreyFrame
from alphacut.fuzzy import Automatic, BranchAndBound, Interval, QuasiMonteCarlo, Reduced, Triangular
from alphacut.fuzzy.joint_outputs import Turned, joint_outputs
from alphacut.fuzzy.sets.stepwise import outer_steps

BOX = {"x": Interval(0.0, 2.0), "y": Interval(-1.0, 1.0)}


def test_a_parallelogram_is_found_exactly() -> None:
    found = joint_outputs(lambda x, y: (x + y, x - y), BOX, Reduced(), directions=8)
    inner, outer = found.area()
    assert inner == pytest.approx(8.0)  # 4 · |det|
    assert outer == pytest.approx(8.0)  # its sides lie along four of the directions
    assert found.holds(np.array([[1.0, 1.0], [3.0, 3.0]])).tolist() == [True, False]


def test_the_outer_polygon_is_proved_and_holds_all_pairs() -> None:
    def pair(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return x * y, x - y**2

    found = joint_outputs(
        pair, BOX, BranchAndBound(Turned(pair, 12)), directions=12, alpha=[1.0], vectorised=True
    )
    assert found.nature == "guaranteed"
    rng = np.random.default_rng()
    x, y = rng.uniform(0, 2, 20000), rng.uniform(-1, 1, 20000)
    pairs = np.column_stack(pair(x, y))
    assert found.holds(pairs, slack=1e-12).all()
    inner, outer = found.area()
    assert inner < outer < 1.1 * inner


def test_levels_are_nested_and_a_disc_is_met_by_many_directions() -> None:
    def pair(r: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return r * np.cos(t), r * np.sin(t)

    inputs = {"r": Triangular(0, 0, 1), "t": Interval(0, 2 * np.pi)}
    found = joint_outputs(
        pair, inputs, QuasiMonteCarlo(20000), directions=32, alpha=[0.0, 0.5], vectorised=True
    )
    inner, outer = found.area(0)
    assert inner <= np.pi * (1 + 1e-9)
    assert outer == pytest.approx(np.pi, rel=0.01)
    assert found.area(1)[1] == pytest.approx(np.pi / 4, rel=0.01)


def test_two_floors_at_a_node_and_one_floor_at_two_times() -> None:
    frame = StoreyFrame(
        [2e3, 1e3, 1e3], [3.0] * 3, 2.5e10, 1e-6, q0=(0.01, 0.02, 0.03), outputs=("q1", "q3")
    )
    flow = LinearFlow(frame, ("E", "m2"), 2.0, 0.5, Exact())
    inputs = {"E": Interval(2.3e10, 2.7e10), "m2": Interval(900.0, 1100.0)}

    def floors(E: np.ndarray, m2: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        motion = flow.values(np.column_stack([np.atleast_1d(E), np.atleast_1d(m2)]))
        return motion[:, -1, 0], motion[:, -1, 1]

    def times(E: np.ndarray, m2: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        motion = flow.values(np.column_stack([np.atleast_1d(E), np.atleast_1d(m2)]))
        return motion[:, 2, 1], motion[:, -1, 1]

    rng = np.random.default_rng()
    E, m2 = rng.uniform(2.3e10, 2.7e10, 300), rng.uniform(900, 1100, 300)
    for pair in (floors, times):
        found = joint_outputs(pair, inputs, Automatic(), directions=8, alpha=[0.0], vectorised=True)
        pairs = np.column_stack(pair(E, m2))
        size = float(np.ptp(pairs, axis=0).max())
        assert found.holds(pairs, slack=0.01 * size).all()
        ranges = np.prod(np.ptp(found.outer[0], axis=0))
        assert found.area()[1] < 0.75 * ranges  # the outputs hang together


def test_one_direction_is_refused() -> None:
    with pytest.raises(ValueError, match=r"a hull needs two or more"):
        joint_outputs(lambda x, y: (x, y), BOX, directions=1)


def test_errors_of_the_outputs_grow_the_outer_polygon_and_shrink_the_inner_one() -> None:
    def pair(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return x + 0.3 * y, x * y - y

    error = np.array([0.05, 0.02])
    exact, found = (
        joint_outputs(pair, BOX, Reduced(), alpha=[1.0], vectorised=True, error=wrong)
        for wrong in ((0.0, 0.0), (0.05, 0.02))
    )
    rng = np.random.default_rng()
    pairs = np.column_stack(pair(rng.uniform(0, 2, 2000), rng.uniform(-1, 1, 2000)))
    assert found.holds(pairs + error * rng.uniform(-1, 1, pairs.shape)).all()
    assert not exact.holds(np.concatenate([exact.inner[0] + error, exact.inner[0] - error])).all()
    assert 0 < found.area()[0] < exact.area()[0] < exact.area()[1] < found.area()[1]
    for signs in itertools.product((-1, 1), repeat=2):  # the truth may be the hull, moved
        moved = found.inner[0] + error * signs
        hull = exact.inner[0]
        sides = np.roll(hull, -1, axis=0) - hull
        x, y = np.moveaxis(moved[:, None] - hull, -1, 0)
        assert (sides[:, 0] * y - sides[:, 1] * x >= -1e-12).all()
    (lost,) = joint_outputs(pair, BOX, Reduced(), alpha=[1.0], vectorised=True, error=(9, 9)).inner
    assert lost.shape == (1, 2)


def test_the_plans_own_error_is_in_the_outer_polygon() -> None:
    def pair(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return np.sin(9 * x) * y, np.cos(9 * x) + y

    plan = Automatic(tolerance=0.2)
    found = joint_outputs(pair, BOX, plan, directions=8, alpha=[1.0], vectorised=True)
    error = np.nan_to_num(found.result.error[0])
    assert error.max() > 0
    assert found.margin[0] == pytest.approx(error)


def test_pairs_reached_in_a_wider_cut_than_the_levels_own_are_not_inner() -> None:
    """At 0.5 only the cut at 0 is known, around the true one, and at 0.75 none above."""
    number = outer_steps((0.0, 0.6, 1.0), (0.0, 1.0, 2.0), (4.0, 3.0, 2.0))
    found = joint_outputs(lambda x: (x, -x), {"x": number}, alpha=(0.0, 0.5, 0.6, 0.75))
    reached = [float(np.ptp(corners[:, 0])) for corners in found.inner]
    assert reached == pytest.approx([4.0, 2.0, 2.0, 0.0])
    assert any("at α = 0.5, 0.75 an input's cut is that" in note for note in found.result.notes)
