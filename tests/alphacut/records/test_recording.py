"""Correction, trimming and scaling of a recording, against their definitions."""

import numpy as np
import pytest

from alphacut.fuzzy.refused import RefusedError
from alphacut.records.recording import Recording, arias_shares

STEP = 0.01
TIME = STEP * np.arange(1001)


def recording(samples):
    return Recording("CSV", "m/s^2", STEP, np.asarray(samples, float))


def test_a_mean_or_a_straight_line_is_taken_away():
    wave = np.sin(2 * np.pi * TIME / 10)
    mean = recording(wave + 3).accelerogram(baseline="mean").acceleration
    assert mean == pytest.approx(wave, abs=1e-12)
    line = recording(5 - 2 * TIME).accelerogram(baseline="linear").acceleration
    assert line == pytest.approx(np.zeros(1001), abs=1e-12)
    assert recording(wave + 3).offset_share == pytest.approx(0.75)


def test_trimming_keeps_the_times_named():
    kept = recording(TIME).accelerogram(trim=(1.0, 2.0)).acceleration
    assert kept[[0, -1]] == pytest.approx([1.0, 2.0])
    assert len(kept) == 101
    with pytest.raises(RefusedError, match="trim"):
        recording(TIME).accelerogram(trim=(20.0, 30.0))


def test_arias_shares_are_those_of_the_piecewise_linear_record():
    values = np.random.default_rng(3).normal(size=40)
    fine = np.interp(np.linspace(0, 39, 39_001), np.arange(40), values)
    by_simpson = np.append(0, np.cumsum(fine[:-2:2] ** 2 + 4 * fine[1::2] ** 2 + fine[2::2] ** 2))
    shares = arias_shares(values, STEP)
    assert shares == pytest.approx((by_simpson / by_simpson[-1])[::500], abs=1e-12)
    kept = recording(values).accelerogram(trim="arias").acceleration
    first, last = np.flatnonzero(shares >= 0.05)[0], np.flatnonzero(shares >= 0.95)[0]
    assert kept == pytest.approx(values[first : last + 1])


def test_the_order_is_correction_trim_scale():
    values = 3 + TIME
    got = recording(values).accelerogram(baseline="mean", trim=(0.0, 5.0), scale=2.0)
    assert got.acceleration == pytest.approx(2 * (values - values.mean())[:501])
