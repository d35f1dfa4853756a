"""Records behind an oscillator, against exact motions of it."""

import numpy as np
import pytest

from alphacut.frame import Accelerogram, StoreyFrame, response_spectrum
from alphacut.frame.response.filtered_record import filtered_record
from tests.frame.motions import judged_motions


def exact_response(ground, period, ratio, time):
    """−Ω² w and its integral at times, by the judge of proofs: w'' + 2ζΩ w' + Ω² w = −a."""
    omega = 2 * np.pi / period
    damped = {"rayleigh": (2 * ratio * omega, 0.0), "outputs": ("q1", "v1")}
    frame = StoreyFrame([1.0], stiffness=[omega**2], ground=ground, **damped)
    w, velocity = judged_motions(frame, np.zeros((1, 0)), (), time)[0].T
    area = (ground.values(time)[:-1] + ground.before(time)[1:]) / 2 * np.diff(time)
    return -(omega**2) * w, velocity + 2 * ratio * omega * w + np.append(0.0, np.cumsum(area))


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
