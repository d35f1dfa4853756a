"""Response spectrum of a record, against a dense integration and closed forms."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from alphacut.frame import (
    Accelerogram,
    StoreyFrame,
    over_records,
    response_spectrum,
    rotated_spectra,
    spectral_acceleration,
)
from alphacut.fuzzy import Interval
from tests.refused import refuses


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


@pytest.mark.parametrize("ratio", [0.0, 0.05, 0.7])
def test_a_sudden_constant_acceleration_overshoots_by_its_damping(ratio):
    """The peak is 1 + exp(-π ζ/√(1 - ζ²)) times the static one, however long the period."""
    periods = np.geomspace(2e-3, 0.8, 30).reshape(5, 6)
    exact = 2.5 * (1 + np.exp(-np.pi * ratio / np.sqrt(1 - ratio**2)))
    found = response_spectrum(Accelerogram(0.05, [2.5] * 40), periods, ratio)
    assert found == pytest.approx(np.full((5, 6), exact), rel=4e-3)


def test_the_spectrum_begins_with_the_largest_ground_acceleration():
    samples = np.random.default_rng(3).normal(size=50)
    samples[0] = 0.0  # a jump would overshoot at any period
    ground, peak = Accelerogram(0.02, samples), np.abs(samples).max()
    assert response_spectrum(ground, [0.3, 0.0])[1] == peak
    assert response_spectrum(ground, 1e-3) == pytest.approx(peak, rel=0.01)


@pytest.mark.parametrize(
    ("wrong", "key"),
    [
        ({"periods": [0.1, -1.0]}, "periods"),
        ({"periods": ["long"]}, "periods"),
        ({"damping": 1.0}, "damping"),
    ],
)
def test_what_has_no_spectrum_is_one_line(wrong, key):
    with refuses(key):
        response_spectrum(Accelerogram(0.02, np.ones(3)), **({"periods": 0.3} | wrong))


@pytest.mark.parametrize("period", [0.0, -1.0, np.nan, np.inf])
def test_periods_are_positive_numbers(period):
    with refuses("period"):
        spectral_acceleration(Accelerogram(0.02, np.ones(3)), period, 0.05)


def test_a_period_that_no_structure_has_is_refused_before_it_takes_minutes():
    frame = StoreyFrame((50e3,), stiffness=(0.09,), dampers=(0.0,), damper_placement="storey")
    record = Accelerogram(0.02, np.ones(40))
    with refuses("structure"):
        over_records(frame, {"m1": Interval(49e3, 51e3)}, [record], duration=20.0, step=0.02)


def test_rotated_spectra_are_those_of_records_turned_by_hand():
    rng = np.random.default_rng(5)
    x, y = (Accelerogram(0.02, rng.normal(size=40)) for _ in range(2))
    periods = np.array([[0.0, 0.02], [0.3, 1.5]])
    found = rotated_spectra(x, y, periods, 0.1)
    turned = [
        response_spectrum(
            Accelerogram(0.02, np.cos(angle) * x.samples + np.sin(angle) * y.samples), periods, 0.1
        )
        for angle in np.radians(np.arange(180))
    ]
    assert found.rotd50 == pytest.approx(np.median(turned, axis=0), rel=1e-12)
    assert found.rotd100 == pytest.approx(np.max(turned, axis=0), rel=1e-12)


@pytest.mark.parametrize(
    ("second", "periods", "key"),
    [
        (Accelerogram(0.02, np.ones(4)), 0.3, "samples of components"),
        (Accelerogram(0.01, np.ones(3)), 0.3, "samples of components"),
        (Accelerogram(0.02, np.ones(3)), -1.0, "periods"),
    ],
)
def test_what_cannot_be_rotated_is_one_line(second, periods, key):
    with refuses(key):
        rotated_spectra(Accelerogram(0.02, np.ones(3)), second, periods)
