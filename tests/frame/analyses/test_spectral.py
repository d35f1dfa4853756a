"""Spectral acceleration of a record, against a dense integration."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from alphacut.frame import Accelerogram, StoreyFrame, over_records, spectral_acceleration
from alphacut.fuzzy import Interval, RefusedError


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


@pytest.mark.parametrize("period", [0.0, -1.0, np.nan, np.inf])
def test_periods_are_positive_numbers(period):
    with pytest.raises(RefusedError, match="period is"):
        spectral_acceleration(Accelerogram(0.02, np.ones(3)), period, 0.05)


def test_a_period_that_no_structure_has_is_refused_before_it_takes_minutes():
    frame = StoreyFrame((50e3,), stiffness=(0.09,), dampers=(0.0,), damper_placement="storey")
    record = Accelerogram(0.02, np.ones(40))
    with pytest.raises(RefusedError, match=r"first natural period .* as t and MN/m"):
        over_records(frame, {"m1": Interval(49e3, 51e3)}, [record], duration=20.0, step=0.02)
