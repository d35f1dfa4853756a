"""Correction of a recording and its Arias intensity, against definitions."""

import numpy as np
import pytest

from alphacut.frame.records.recording import Recording, arias_fractions

TIME = 0.01 * np.arange(1001)


def recording(samples):
    return Recording("CSV", "m/s^2", 0.01, np.asarray(samples, float))


def test_a_mean_or_a_straight_line_is_taken_away():
    wave = np.sin(2 * np.pi * TIME / 10)
    assert recording(wave + 3).accelerogram("mean").samples == pytest.approx(wave, abs=1e-12)
    line = recording(5 - 2 * TIME).accelerogram("linear").samples
    assert line == pytest.approx(np.zeros(1001), abs=1e-12)
    assert recording(wave + 3).mean_to_peak_ratio == pytest.approx(0.75)


def test_arias_fractions_are_those_of_the_piecewise_linear_record(rng):
    values = rng.normal(size=40)
    fine = np.interp(np.linspace(0, 39, 39_001), np.arange(40), values)
    by_simpson = np.append(0, np.cumsum(fine[:-2:2] ** 2 + 4 * fine[1::2] ** 2 + fine[2::2] ** 2))
    shares = arias_fractions(values, 0.01)
    assert shares == pytest.approx((by_simpson / by_simpson[-1])[::500], abs=1e-12)
