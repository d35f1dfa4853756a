"""Suites of records with several components, against exact motions under turned ground motions."""

from dataclasses import replace

import numpy as np
import pytest

from alphacut.frame import (
    Accelerogram,
    MatrixStructure,
    StoreyFrame,
    over_records,
    rotated_spectra,
)
from alphacut.frame.analyses.suites import nominal_mode
from alphacut.fuzzy import Interval
from tests.frame.motions import exact_motions, random_points
from tests.refused import refuses

INPUTS = {"k": Interval(144.0, 156.0)}
EAST, NORTH, UP = np.eye(4)[[0, 1, 3]]
MOTION = {"duration": 1.2, "step": 0.05, "alpha": [0.0]}


def plan(rng, *, vertical=False):
    """A floor on columns that are not centred: unknowns east, north, rotation, and one upwards."""
    root = np.eye(4) + 0.3 * rng.normal(size=(4, 4))
    components = [(None, NORTH)]
    if vertical:
        components.append((None, UP))
    return MatrixStructure(
        {"k": 150.0},
        mass=[(2.0, np.eye(4))],
        stiffness=[("k", root @ root.T + 0.3 * np.eye(4))],
        observed={"corner": rng.normal(size=4)},
        ratios=[0.04],
        pattern=EAST,
        components=components,
    )


def records(rng, count, components):
    def record(name):
        return Accelerogram(0.05, rng.normal(size=15), name=name)

    return [tuple(record(f"r{k}{axis}") for axis in "xyz"[:components]) for k in range(count)]


@pytest.mark.parametrize("components", [2, pytest.param(3, marks=pytest.mark.slow)])
@pytest.mark.parametrize("all_angles", [False, True])
def test_motions_under_records_of_components_stay_within_the_bounds(components, all_angles, rng):
    model = plan(rng, vertical=components == 3)
    suite = records(rng, 2, components)
    found = over_records(model, INPUTS, suite, **MOTION, all_angles=all_angles)
    largest = []
    means = 0.0
    points = random_points(INPUTS, 12, rng)
    angles = np.zeros(1)
    if all_angles:
        angles = np.radians(np.arange(0, 360, 5))
    for east, north, *up in suite:
        peak = found.by_record["+".join(x.name for x in (east, north, *up))].peak["corner"]
        values = []
        for a in angles:
            along_east = np.cos(a) * east.samples - np.sin(a) * north.samples
            along_north = np.sin(a) * east.samples + np.cos(a) * north.samples
            turned = replace(east, samples=along_east), replace(north, samples=along_north)
            moved = model.moved_by(*turned, *up)
            duration = found.by_record["+".join(x.name for x in (east, north, *up))].duration_s
            values.append(np.abs(exact_motions(moved, points, INPUTS, duration, 0.025)).max((1, 2)))
        of_structures = np.max(values, axis=0)
        assert of_structures.max() <= peak.proved[0]
        assert of_structures.max() <= 1.01 * peak.reached[0]
        largest.append(of_structures.max())
        means = means + of_structures / len(suite)
        if all_angles:
            at = round(peak.worst.angle / 5) % 72
            assert np.max(values[at]) == pytest.approx(peak.reached[0], rel=0.01)
    assert found.peak["corner"].proved[0] >= max(largest)
    assert found.peak["mean corner"].proved[0] >= means.max()
    # Means are attained by corners of the box, of one input.
    assert found.peak["mean corner"].reached[0] >= 0.97 * means.max()
    assert ("°" in str(found)) == all_angles
    assert ("angle [deg]" in found.records()[0]) == all_angles


@pytest.mark.parametrize("measure", ["RotD50(T1)", "RotD100(T1)", "PGA"])
def test_both_components_have_one_factor(measure, rng):
    model = plan(rng)
    suite = records(rng, 2, 2)
    found = over_records(model, INPUTS, suite, **MOTION, scale=2.5, measure=measure)
    mode = nominal_mode(model)
    for x, y in suite:
        measures = found.by_record[f"{x.name}+{y.name}"].measures
        assert measures[measure] == pytest.approx(2.5)
        rotated = rotated_spectra(x, y, mode.period, mode.ratio)
        pga = max(x.extremes[0], y.extremes[0])
        assert measures["RotD100(T1)"] / measures["PGA"] == pytest.approx(rotated.rotd100 / pga)
        assert measures["RotD50(T1)"] / measures["PGA"] == pytest.approx(rotated.rotd50 / pga)


def test_what_has_too_few_components_is_one_line():
    rng = np.random.default_rng(1)
    model = plan(rng)
    single = replace(model, components=())
    (pair,) = records(rng, 1, 2)
    for key, structure, suite, options in [
        ("ground", model, pair[:1], {}),
        ("ground", single, [pair], {}),
        ("record r0x", single, pair[:1], {"all_angles": 1}),
        ("record r0x", single, pair[:1], {"measure": "RotD50(T1)"}),
        ("samples of components", model, [(pair[0], Accelerogram(0.05, np.ones(4)))], {}),
    ]:
        with refuses(key):
            over_records(structure, INPUTS, suite, **MOTION, **options)
    frame = StoreyFrame(
        stiffness=[8e6], masses=[2e4], yield_force=[3e4], damping_ratio=0.05, outputs=["drift1"]
    )
    with refuses("ground"):
        over_records(frame, {"k1": Interval(7e6, 9e6)}, [pair], **MOTION, all_angles=True)
