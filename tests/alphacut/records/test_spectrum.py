"""Response spectra against a dense integration and a closed form."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from alphacut.frame import Accelerogram
from alphacut.fuzzy.refused import RefusedError
from alphacut.records.spectrum import spectral_acceleration


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


def test_a_constant_acceleration_has_twice_the_static_response():
    ground = Accelerogram(0.01, np.full(400, 1.5))
    assert spectral_acceleration(ground, 1.0, 0.0) == pytest.approx(3.0, rel=4e-3)


def test_a_stiff_oscillator_has_the_peak_of_the_ground():
    ground = Accelerogram(0.01, np.sin(3 * 0.01 * np.arange(400)))
    assert spectral_acceleration(ground, 0.005, 0.2) == pytest.approx(1.0, rel=5e-3)


@pytest.mark.parametrize(("period", "ratio"), [(0.0, 0.05), (1.0, 1.0), (1.0, -0.1)])
def test_out_of_range_is_refused(period, ratio):
    with pytest.raises(RefusedError):
        spectral_acceleration(Accelerogram(0.01, np.ones(3)), period, ratio)
