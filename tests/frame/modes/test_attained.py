"""Exact motions at single inputs agree with those of the judge of the proofs."""

import numpy as np
import pytest

from alphacut.frame import (
    Accelerogram,
    DualProof,
    Force,
    History,
    StoreyFrame,
    UnprovedError,
    envelope,
)
from alphacut.frame.bounds.box import Box
from alphacut.frame.bounds.box_proof import ROUNDING_MARGIN
from alphacut.frame.modes.structure import PointModes
from alphacut.fuzzy import Crisp, Interval
from tests.frame.modes.test_blocks import masses_on_springs
from tests.frame.motions import judged_motions, off_chords

RECORD = Accelerogram(0.02, np.random.default_rng(2).normal(size=40))


def drawn(rng):
    """A frame of three storeys that starts while the ground moves."""
    return StoreyFrame(
        masses=rng.uniform(1e4, 5e4, 3),
        stiffness=rng.uniform(3e7, 1e8, 3),
        damping_ratio=0.02,
        ground=RECORD,
        outputs=("q3", "drift2", "v1", "a2"),
        q0=(0.01, 0.0, 0.02),
        v0=(0.1, -0.5, 0.2),
    )


@pytest.mark.parametrize("kind", ["dashpots", "one mode without oscillation", "stiff storey"])
def test_motions_are_those_of_the_judge(kind, rng):
    """With forces, a record and a start; at nodes of one motion, and at single nodes of several."""
    n = 4
    masses, springs = rng.uniform(1e4, 5e4, n), rng.uniform(3e7, 1e8, n)
    dampers = rng.uniform(0.01, 0.1, n) * np.sqrt(masses * springs)
    ratio = 0.0
    if kind == "one mode without oscillation":
        dampers[0] = 8 * np.sqrt(masses.sum() * springs[0])
    if kind == "stiff storey":
        springs[0] *= 1e3
        dampers[:] = 0.0
        ratio = 0.02
    frame = StoreyFrame(
        masses,
        stiffness=springs,
        dampers=dampers,
        damper_placement="storey",
        damping_ratio=ratio,
        ground=RECORD,
        loads=[Force(n, 1e5, History(0.05, rng.normal(size=12)))],
        v0=rng.normal(size=n),
        outputs=("q1", "v2", "a4", "drift3"),
    )
    names, time = ("k1", "m2"), np.arange(61) * 0.017
    points = np.array([springs[0], masses[1]]) * rng.uniform(0.9, 1.1, (5, 2))
    judged = judged_motions(frame, points, names, time)
    size = ROUNDING_MARGIN * np.abs(judged).max((0, 1))
    modes = PointModes.of_system(frame, names, points)
    assert (np.abs(modes.response(time) - judged[0]) <= size).all()
    point, node, output = rng.integers(5, size=40), rng.integers(61, size=40), np.arange(40) % 4
    found = modes.values(point, node, output, time)
    assert (np.abs(found - judged[point, node, output]) <= size[output]).all()
    off = off_chords(modes.response(np.linspace(0, time[-1], 8 * 60 + 1)), 8)
    assert (off <= modes.interpolation_error(time)[1:] + size).all()


def test_equal_frequencies_do_not_lift_the_rounding():
    """Two alike masses on two alike springs: the modes of the pair are any two of a plane."""
    centre, time = np.array([3.0, 3.0, 7.0]), np.arange(0, 9.01, 0.5)
    box = Box(masses_on_springs(centre), ("a", "b", "c"), time, 0.9 * centre, 1.1 * centre)
    value = box.midpoint_modes.response(time)
    exact = np.sum(np.sin(np.sqrt(centre) * time[:, None]) / np.sqrt(centre), 1)
    assert np.abs(value[:, 0] - exact).max() <= 1e-13


def test_the_margin_alone_holds_the_judges_motion_at_crisp_inputs(rng):
    """Guaranteed and attained bounds are one motion there, from which the judge's differs."""
    frame = drawn(rng)
    value = frame.parameters["k1"]
    given = {"duration": 1.02, "step": 0.017, "alpha": [0.0], "progress": False}
    found = envelope(frame, {"k1": Crisp(value)}, DualProof(workers=1), **given)
    (values,) = judged_motions(frame, np.array([[value]]), ("k1",), found.time)
    assert (values <= found.upper[0]).all()
    assert (values >= found.lower[0]).all()
    peak = np.abs(values).max(0)
    assert (np.ptp([found.lower[0], found.upper[0]], axis=0).max(0) <= 1e-8 * peak).all()


def test_a_gap_below_what_rounding_may_be_is_refused(rng):
    frame = drawn(rng)
    value = frame.parameters["k1"]
    given = {"duration": 0.34, "step": 0.017, "alpha": [0.0], "progress": False}
    with pytest.raises(UnprovedError, match="rounding of the response may be"):
        envelope(frame, {"k1": Interval(value, 1.01 * value)}, DualProof(peaks=5e-9), **given)
