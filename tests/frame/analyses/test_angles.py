"""Peaks over all angles of incidence, against sampled angles and inputs."""

from dataclasses import replace

import numpy as np
import pytest

from alphacut.frame import Accelerogram, Force, History, MatrixStructure, over_angles
from alphacut.frame.analyses.angles import turned
from alphacut.frame.analyses.peaks import Peak, close_peaks, largest_peaks
from alphacut.fuzzy import Interval, Nature
from tests.frame.motions import exact_motions, random_points
from tests.refused import refuses

DURATION, STEP = 0.8, 0.05
MOTION = {"duration": DURATION, "step": STEP, "alpha": [0.0]}


def random_plan(rng, **changes):
    """A floor on columns that are not centred: unknowns east, north and rotation."""
    root = np.eye(3) + 0.3 * rng.normal(size=(3, 3))
    ground, second = (Accelerogram(0.05, rng.normal(size=13)) for _ in range(2))
    return MatrixStructure(
        {"m": 2.0, "k": 150.0},
        mass=[("m", np.eye(3))],
        stiffness=[("k", root @ root.T + 0.3 * np.eye(3))],
        observed={"corner": rng.normal(size=3)},
        ratios=[0.04],
        ground=ground,
        pattern=np.eye(3)[0],
        components=[(second, np.eye(3)[1])],
        **changes,
    )


INPUTS = {"k": Interval(144.0, 156.0)}


def sampled_peaks(structure, inputs, angles, points):
    """Peaks at the nodes of each angle and point, from motions under both components apart.

    They are computed without `turned`, from ground motions along the axes.
    """
    (second, north), *others = structure.components
    still = replace(structure, ground=None, components=others)
    axes = [
        replace(still, ground=ground, pattern=pattern)
        for ground in (structure.ground, second)
        for pattern in (structure.pattern, north)
    ]
    fixed, *along = (
        exact_motions(x, points, inputs, DURATION, STEP)[..., 0] for x in (still, *axes)
    )
    first_east, first_north, second_east, second_north = (motion - fixed for motion in along)
    cosine, sine = np.cos(angles)[:, None], np.sin(angles)[:, None]
    motions = fixed + cosine * (first_east + second_north) + sine * (first_north - second_east)
    return np.abs(motions).max(axis=1)


@pytest.mark.parametrize("is_loaded", [False, True])
def test_no_sampled_angle_exceeds_the_bound_of_random_plans(is_loaded, rng):
    exceeds_no_sampled_angle(is_loaded, rng)


@pytest.mark.parametrize("is_loaded", [False, True])
def test_peaks_of_fixed_plans_are_close_to_those_of_samples(is_loaded):
    """How close the search comes is nothing that holds of every plan."""
    reached, sampled = exceeds_no_sampled_angle(is_loaded, np.random.default_rng(int(is_loaded)))
    assert reached > 0.99 * sampled


def exceeds_no_sampled_angle(is_loaded, rng):
    """The largest peaks that are reached and sampled, after all checks of a random plan."""
    changes = {}
    if is_loaded:
        history = History(0.1, rng.normal(size=6))
        changes = {"q0": 0.01 * rng.normal(size=3), "loads": [Force(np.ones(3), 0.7, history)]}
    plan = random_plan(rng, **changes)
    directions = 3
    found = over_angles(plan, INPUTS, **MOTION, directions=directions)
    peak = found.peak["corner"]
    assert peak.nature is Nature.GUARANTEED
    n_first = directions * (1 + is_loaded)
    assert len(found.by_angle) >= n_first
    angles = rng.uniform(0, 2 * np.pi, 2000)
    sampled = sampled_peaks(plan, INPUTS, angles, random_points(INPUTS, 2000, rng))
    assert sampled.max() <= peak.proved[0]
    assert peak.reached[0] <= peak.proved[0]
    # What is attained is attained at the named inputs, angle and time.
    point = np.array([[peak.reached_at["k"]]])
    worst = peak.worst
    there = exact_motions(turned(plan, np.radians(worst.angle)), point, INPUTS, DURATION, STEP)
    assert np.abs(there[0, round(worst.time / STEP), 0]) == pytest.approx(peak.reached[0])
    assert sampled_peaks(plan, INPUTS, np.radians([worst.angle]), point) == pytest.approx(
        peak.reached[0]
    )
    return peak.reached[0], sampled.max()


def test_every_angle_of_a_symmetric_plan_is_alike():
    """An output along any direction has its peak where the ground moves along it."""
    record = Accelerogram(0.05, np.random.default_rng(4).normal(size=13))
    still = Accelerogram(0.05, np.zeros(13))
    east, north = np.eye(2)
    plan = MatrixStructure(
        {"k": 150.0},
        [(2.0, np.eye(2))],
        [("k", np.eye(2))],
        {"east": east, "oblique": 0.5 * east + 0.75**0.5 * north},
        ratios=[0.04],
        ground=record,
        pattern=east,
        components=[(still, north)],
    )
    found = over_angles(plan, INPUTS, **MOTION)
    alone = close_peaks(replace(plan, components=()), INPUTS, ["east"], **MOTION)["east"]
    for name, angle in (("east", 0), ("oblique", 60)):
        assert found.peak[name].reached[0] == pytest.approx(alone.reached[0], rel=1e-3)
        assert alone.reached[0] <= found.peak[name].proved[0] <= 1.02 * alone.proved[0]
        assert found.peak[name].worst.angle % 180 == pytest.approx(angle, abs=1e-6)
    table = str(found)
    assert "guaranteed" in table
    assert "°, " in table
    assert [row["peak reached"] for row in found.records()] == [
        peak.reached[0] for peak in found.peak.values()
    ]


def test_what_has_no_angles_is_one_line():
    plan = random_plan(np.random.default_rng(1))
    with refuses("ground"):
        over_angles(replace(plan, components=()), INPUTS, **MOTION)
    with refuses("output"):
        over_angles(plan, INPUTS, **MOTION, names=["max corner"])
    with refuses("directions"):
        over_angles(plan, INPUTS, **MOTION, directions=1)


def test_structures_with_small_peaks_under_each_record_have_none_under_both():
    """Of two structures one has the peaks 1 and 3 under two records, and the other 3 and 1."""
    ones = np.ones(1)
    peak = Peak(
        alpha=0 * ones, lower=ones, upper=3 * ones, error=0 * ones, reached=3 * ones,
        least_lower=ones, least_upper=ones, nature=Nature.GUARANTEED,
    )  # fmt: skip
    alone = largest_peaks({"first": {"q": peak}})["q"]
    both = largest_peaks({"first": {"q": peak}, "second": {"q": peak}})["q"]
    assert alone.min_peak_bounds.upper == 1
    assert both.min_peak_bounds.upper >= 3
    wider = replace(peak, upper=4 * ones, reached=2 * ones, cause="open")
    both = largest_peaks({"first": {"q": peak}, "second": {"q": wider}})["q"]
    assert (both.reached, both.cause) == (3, "open")  # of the largest bound
