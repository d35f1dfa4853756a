"""Records behind an oscillator, against exact integration of its state."""

import numpy as np
import pytest
from scipy.linalg import expm

from alphacut.frame import Accelerogram, response_spectrum
from alphacut.frame.response.filtered_record import filtered_record


def exact_response(ground, period, ratio, time):
    """−Ω² w and its integral at times with equal distances, by exponentials of matrices."""
    omega, h = 2 * np.pi / period, time[1]
    # The state is w, w', the integral of −Ω² w, the ground's acceleration and its slope.
    A = np.zeros((5, 5))
    A[0, 1] = A[3, 4] = 1.0
    A[1] = -(omega**2), -2 * ratio * omega, 0.0, -1.0, 0.0
    A[2, 0] = -(omega**2)
    advance = expm(A * h)
    state = np.zeros(5)
    found = np.zeros((len(time), 2))
    for k, (begin, end) in enumerate(
        zip(ground.values(time), ground.before(time)[1:], strict=False)
    ):
        found[k] = -(omega**2) * state[0], state[2]
        state[3:] = begin, (end - begin) / h
        state = advance @ state
    found[-1] = -(omega**2) * state[0], state[2]
    return found.T


@pytest.mark.parametrize(
    ("period", "ratio", "substeps"), [(0.05, 0.05, 5), (0.3, 0.0, 2), (0.3, 0.4, 1), (2.0, 0.02, 1)]
)
def test_the_integral_lies_within_its_bound(rng, period, ratio, substeps):
    """The record jumps at both ends, and the response goes on after it."""
    ground = Accelerogram(0.02, rng.normal(size=50))
    found = filtered_record(ground, period, ratio, substeps=substeps, duration=1.5)
    step = found.record.step
    fine = 40
    time = np.arange(round(1.5 / step) * fine + 1) * (step / fine)
    response, integral = exact_response(ground, period, ratio, time)
    polygon = found.record.values(time)
    areas = np.append(0.0, np.cumsum((polygon[1:] + polygon[:-1]) / 2 * step / fine))
    # a sum of trapezes misses nothing of a polygon whose corners are nodes
    missed = np.abs(integral - areas).max()
    assert missed <= found.integral_error * (1 + 1e-9) + 1e-13
    assert found.integral_error < 20 * missed
    assert np.abs(response - polygon).max() < (2 * np.pi / period * step) ** 2 * 10.0


def test_the_peak_is_that_of_the_response_spectrum(rng):
    ground = Accelerogram(0.02, np.append(rng.normal(size=50), 0.0))
    for period in (0.1, 0.5):
        found = filtered_record(ground, period, 0.05, substeps=20, duration=2.0)
        peak = np.abs(found.record.samples).max()
        expected = response_spectrum(ground, period, readings=2000)  # 40 miss up to a percent
        assert peak == pytest.approx(expected, rel=2e-3)


def test_the_error_falls_with_the_cube_of_the_step(rng):
    ground = Accelerogram(0.02, rng.normal(size=50))
    coarse, fine = (
        filtered_record(ground, 0.2, 0.05, substeps=n, duration=2.0).integral_error for n in (4, 8)
    )
    assert 6.0 < coarse / fine < 16.0
