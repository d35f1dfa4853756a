"""Correction of a recording and its response spectrum, against definitions and integration."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from alphacut.frame import Accelerogram
from alphacut.records.recording import Recording, arias_fractions, spectral_acceleration

TIME = 0.01 * np.arange(1001)


def recording(samples):
    return Recording("CSV", "m/s^2", 0.01, np.asarray(samples, float))


def test_a_mean_or_a_straight_line_is_taken_away():
    wave = np.sin(2 * np.pi * TIME / 10)
    assert recording(wave + 3).accelerogram("mean").samples == pytest.approx(wave, abs=1e-12)
    line = recording(5 - 2 * TIME).accelerogram("linear").samples
    assert line == pytest.approx(np.zeros(1001), abs=1e-12)
    assert recording(wave + 3).offset_share == pytest.approx(0.75)


def test_arias_fractions_are_those_of_the_piecewise_linear_record(rng):
    values = rng.normal(size=40)
    fine = np.interp(np.linspace(0, 39, 39_001), np.arange(40), values)
    by_simpson = np.append(0, np.cumsum(fine[:-2:2] ** 2 + 4 * fine[1::2] ** 2 + fine[2::2] ** 2))
    shares = arias_fractions(values, 0.01)
    assert shares == pytest.approx((by_simpson / by_simpson[-1])[::500], abs=1e-12)


@pytest.mark.parametrize("period", [0.05, 0.3, 2.0])
def test_peaks_are_those_of_a_dense_integration(period):
    samples = np.random.default_rng(8).normal(size=61)
    ground, omega, ratio = Accelerogram(0.02, samples), 2 * np.pi / period, 0.05

    def rate(t, y):
        load = np.interp(t, 0.02 * np.arange(61), samples, right=0.0)
        return [y[1], -load - 2 * ratio * omega * y[1] - omega**2 * y[0]]

    times = np.linspace(0, 1.2 + period, 4001)
    step = min(0.002, period / 50)
    motion = solve_ivp(rate, (0, times[-1]), [0, 0], t_eval=times, rtol=1e-9, max_step=step)
    exact = omega**2 * abs(motion.y[0]).max()
    assert spectral_acceleration(ground, period, ratio) == pytest.approx(exact, rel=4e-3)
