"""Cuts of learned inputs are a box around the learned set: analyses claim no more than that."""

import numpy as np
import pytest

from alphacut.frame import (
    Limit,
    StoreyFrame,
    decide,
    envelope,
    identify,
    measured_mode,
    peaks,
    tolerances,
)
from alphacut.frame.analyses.fragility import CriticalMeasures
from alphacut.fuzzy import Interval, Knowledge, Signed, from_data, jointly, propagate
from tests.frame.motions import exact_motions

FRAME = StoreyFrame(
    [20e3, 20e3],
    stiffness=[10e6, 10e6],
    damping_ratio=0.05,
    q0=(0.01, 0.02),
    outputs=("drift1", "drift2"),
)
DURATION, STEP = 0.9, 0.03
MOTION = {"duration": DURATION, "step": STEP, "progress": False}
BOX = "of the box around the learned set"


@pytest.fixture(scope="module")
def learned():
    """Two stiffnesses from one frequency, which leaves a thin curved set of them."""
    modes = [measured_mode(1, [2.199], frequency_deviation=0.01)]
    priors = {"k1": Interval(6e6, 14e6), "k2": Interval(6e6, 14e6)}
    return identify(FRAME, priors, modes, alpha=(0.05, 1.0))


@pytest.fixture(scope="module")
def found(learned):
    return envelope(FRAME, learned.inputs, alpha=(0.05, 1.0), **MOTION)


@pytest.fixture(scope="module")
def box(learned):
    """The widest box of the learned inputs as intervals, whose points all count."""
    return {name: Interval(*number.cut(0.05)) for name, number in learned.inputs.items()}


@pytest.fixture(scope="module")
def of_box(box):
    return envelope(FRAME, box, alpha=(0.05,), **MOTION)


def test_bounds_hold_for_the_set_and_nothing_in_the_box_is_said_to_be_reached(
    found, box, of_box, rng
):
    assert f"bounds guaranteed {BOX}" in str(found)
    assert "attained" not in str(found)
    assert found.inner is None
    assert np.isnan([found.lower_at, found.upper_at]).all()
    assert np.isnan(found.attained).all()
    assert found.to_dataset().attrs["encloses"] == "the learned set"
    # the same bounds as over the box itself, which reaches more than structures of the set do
    np.testing.assert_allclose(found.upper[0], of_box.upper[0], atol=1e-3 * found.upper.max())
    points = rng.uniform(*np.transpose([number.support for number in box.values()]), (2000, 2))
    k = points.T / 20e3
    squared = k[0] / 2 + k[1] - np.sqrt(k[0] ** 2 / 4 + k[1] ** 2)  # of mode 1
    fits = np.abs(np.sqrt(squared) / (2 * np.pi) / 2.199 - 1) <= 0.01
    assert 0 < fits.sum() < len(fits) / 2
    motions = exact_motions(FRAME, points[fits], box, DURATION, STEP)
    assert (motions <= found.upper[0] + 1e-12).all()
    assert (motions >= found.lower[0] - 1e-12).all()
    reached = np.abs(motions).max((0, 1))
    assert (reached < [peak.reached[0] for peak in peaks(of_box).values()]).all()


def test_a_limit_that_structures_of_the_box_exceed_is_undecided(learned, found, of_box):
    limits = {name: 0.99 * peak.reached[0] for name, peak in peaks(of_box).items()}
    limits = [Limit(*pair) for pair in limits.items()]
    assert decide(of_box, limits).limits["drift1"].verdict == "can be exceeded"
    for name, answer in decide(found, limits).limits.items():
        assert answer.verdict == "undecided", name
        assert answer.possibility == (0.0, 1.0)
    for peak in peaks(found).values():
        assert peak.reached_at == {}
        assert (peak.reached == -np.inf).all()
        assert peak.encloses == "the learned set"
    never = [Limit(name, 1.01 * peak.upper[0]) for name, peak in peaks(found).items()]
    assert decide(found, never).limits["drift1"].verdict == "not exceeded"
    assert BOX in str(decide(found, never))
    motion = {"duration": DURATION, "step": STEP}
    scale = tolerances(FRAME, learned.inputs, never, most=1.0, precision=0.1, **motion)
    assert 0 < scale.kept < 1  # as the prior's support is wider than the box
    assert scale.clear is None
    assert scale.passed is None


def test_measures_are_critical_where_all_structures_of_the_box_exceed_a_limit(found):
    peak = peaks(found)["drift1"]
    measures = CriticalMeasures.from_peaks([peak], [2.0], 0.01)
    np.testing.assert_allclose(measures.low[:, 0], 0.02 / peak.upper)
    np.testing.assert_array_equal(measures.low_reached, measures.high)
    # Some structure of the set lies in the narrowest box, and keeps the limit up to its `low`.
    np.testing.assert_allclose(measures.high_reached[:, 0], measures.low[-1, 0])


def test_the_box_is_remembered_by_claims_and_by_results(learned):
    inputs = learned.inputs
    sample = from_data([1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0], "median")
    joined = jointly({**inputs, "x": sample}, means="frame")
    assert {name: x.encloses for name, x in joined.items()} == {
        "k1": "the learned set",
        "k2": "the learned set",
        "x": "",
    }
    found = propagate(
        lambda k1, k2: k1 + k2,
        inputs,
        Signed(),
        knowledge=Knowledge(signs={"k1": 1, "k2": 1}),
        alpha=(0, 0.05, 1),
        progress=False,
    )
    assert BOX in str(found)
    assert found.inner is None
    assert np.isnan(found.upper_at).all()
    assert found.number().encloses == "the learned set"
