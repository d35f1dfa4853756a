"""Limits under several records: what exact trajectories answer before proofs, and what is left."""

import numpy as np
import pytest

from alphacut.frame import Accelerogram, Limit, StoreyFrame, decide
from alphacut.frame.analyses.suites import (
    record_peaks,
    scaled_records,
    summarised,
    thresholds_under,
)
from alphacut.frame.dynamics.yielding import YieldingFlow
from alphacut.fuzzy import Triangular

INPUTS = {"k1": Triangular(37.0, 39.0, 43.0)}
MOTION = {"step": 0.05, "alpha": [0.0, 0.5]}
SAMPLES = 6.0 * np.sin(6.0 * 0.05 * np.arange(25) + 0.3)
FRAME = StoreyFrame(
    masses=[1.0], stiffness=[39.0], yield_force=[2.0], hardening=[0.1], damping_ratio=0.05,
    outputs=("q1",), ground=Accelerogram(0.05, SAMPLES),
)  # fmt: skip


@pytest.fixture(scope="module")
def records():
    """Return records of one shape and three sizes."""
    grounds = [Accelerogram(0.05, x * SAMPLES, name=f"{x:g}") for x in (0.5, 1.0, 2.0)]
    return scaled_records(FRAME, grounds, duration=1.5, step=0.05)


@pytest.fixture(scope="module")
def largest(records):
    """Return the peaks of 41 structures under each record, rising from one record to the next."""
    k = np.linspace(37.0, 43.0, 41)[:, np.newaxis]
    found = []
    for record in records:
        flow = YieldingFlow(FRAME.moved_by(*record.components), ("k1",), record.duration, 0.025)
        found.append(flow.values_and_peaks(k)[1][:, 0])
    return np.array(found)


def answer(records, limit):
    """Return the verdict on a limit, what was asked about it, and the peaks under each record."""
    asked = thresholds_under(FRAME, INPUTS, records, [limit], **MOTION)
    names = {"names": ["q1"], "progress": False}
    peaks = {
        x.name: record_peaks(FRAME, INPUTS, x, thresholds=asked[x.name], **names, **MOTION)
        for x in records
    }
    found = summarised(FRAME, INPUTS, records, peaks, **MOTION)
    verdict = decide(found, limit).limits[limit.peak].verdict
    return verdict, [asked[record.name][0] for record in records], peaks


def test_a_limit_that_one_record_exceeds_is_not_asked_of_those_that_keep_it(records, largest):
    # near the largest peak under the second record, where its proof would bisect long
    limit = Limit("q1", float(largest[1].max() * (1 - 1e-6)))
    assert largest[0].max() < limit.number < largest[2].min()
    verdict, asked, peaks = answer(records, limit)
    assert verdict == "exceeded"  # under the third record
    assert [x.answered for x in asked] == [0.5, 0.5, -1.0]
    verdict, asked, _ = answer(records[:2], limit)
    assert verdict == "can be exceeded"
    assert [x.answered for x in asked] == [0.0, 0.0]
    for found, values in zip(peaks.values(), largest, strict=True):
        assert found["q1"].nature == "guaranteed"
        assert found["q1"].proved[0] >= values.max()


def test_a_mean_is_asked_as_limits_of_the_records_whose_mean_it_is(records, largest):
    means = largest.mean(axis=0)
    for value, expected in (
        (1.3 * largest.max(axis=1).mean(), "not exceeded"),
        (0.7 * largest.min(axis=1).mean(), "exceeded"),
    ):
        verdict, asked, peaks = answer(records, Limit("q1", float(value), mean=True))
        assert verdict == expected
        assert np.mean([x.value for x in asked]) == pytest.approx(value)
        assert all(x["q1"].is_to_limits for x in peaks.values())
    limit = Limit("q1", float(means.min() + means.max()) / 2, mean=True)
    verdict, asked, _ = answer(records, limit)
    assert verdict == "can be exceeded"
    assert [x.answered for x in asked] == [0.5, 0.5, 0.5]
