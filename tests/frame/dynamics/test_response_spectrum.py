"""Response spectra against closed forms and a dense integration that knows nothing of them."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from alphacut.frame import Accelerogram
from alphacut.frame.dynamics.response_spectrum import response_spectrum


def test_a_ramp_that_stays_gives_the_closed_form() -> None:
    # a(t) rises to A within t1 and ends at 2 t1: three phases of sines and lines
    A, t1, omega = 2.0, 0.4, 7.0
    t = np.linspace(0, 0.8 + 2 * np.pi / omega, 60_001)

    def ramp(s: np.ndarray) -> np.ndarray:  # of unit slope from 0 on
        return np.where(s > 0, s - np.sin(omega * s) / omega, 0.0) / omega**2

    def step(s: np.ndarray) -> np.ndarray:
        return np.where(s > 0, 1 - np.cos(omega * s), 0.0) / omega**2

    q = -A / t1 * (ramp(t) - ramp(t - t1)) + A * step(t - 2 * t1)
    found = response_spectrum(Accelerogram(t1, np.array([0, A, A])), [2 * np.pi / omega], 0.0)
    assert abs(found.displacement[0] - np.abs(q).max()) <= found.error[0] + 1e-9 * np.abs(q).max()
    assert found.error[0] < 1e-6 * found.displacement[0]


def test_a_constant_push_doubles_the_static_displacement_and_damping_takes_its_share() -> None:
    A = 3.0
    ground = Accelerogram(1.0, np.full(60, A))
    for zeta in (0.0, 0.02, 0.3):
        found = response_spectrum(ground, [0.5, 2.0], zeta)
        over = 1 + np.exp(-zeta * np.pi / np.sqrt(1 - zeta**2))
        np.testing.assert_allclose(found.pseudo_acceleration, A * over, rtol=1e-6)
        np.testing.assert_allclose(
            found.pseudo_velocity, found.pseudo_acceleration / found.omega, rtol=1e-14
        )


def test_a_short_pulse_moves_a_soft_oscillator_after_the_record() -> None:
    pulse = Accelerogram(0.01, np.array([0.0, 100.0, 0.0]))  # 1 m/s
    found = response_spectrum(pulse, [np.pi], 0.0)
    np.testing.assert_allclose(found.displacement, 0.5, rtol=1e-4)


def test_records_of_any_kind_agree_with_dense_integration_within_the_error() -> None:
    rng = np.random.default_rng()
    step = float(rng.uniform(0.01, 0.05))
    a = rng.normal(size=40)  # jumps to zero where it ends
    period, zeta = float(rng.uniform(0.05, 3.0)), float(rng.uniform(0, 0.4))
    omega, times = 2 * np.pi / period, step * np.arange(40)
    state, peak = np.zeros(2), 0.0
    knots = [*times, times[-1] + 1.2 * period / np.sqrt(1 - zeta**2)]
    for left, right in pairwise(knots):
        inside = right <= times[-1] + 1e-12

        def rate(t: float, y: np.ndarray, inside: bool = inside) -> list[float]:
            push = float(np.interp(t, times, a)) if inside else 0.0
            return [y[1], -push - 2 * zeta * omega * y[1] - omega**2 * y[0]]

        run = solve_ivp(rate, (left, right), state, "DOP853", rtol=1e-11, atol=1e-14)
        fine = solve_ivp(
            rate, (left, right), state, "DOP853", rtol=1e-11, atol=1e-14,
            t_eval=np.linspace(left, right, 400), max_step=(right - left) / 2,
        )  # fmt: skip
        peak, state = max(peak, float(np.abs(fine.y[0]).max())), run.y[:, -1]
    found = response_spectrum(Accelerogram(step, a), [period], zeta)
    assert found.error[0] < 1e-5 * np.abs(a).max() / omega**2  # of what it would hold at rest
    missed = 0.5 * (0.0031 * 2 * np.pi) ** 2  # of a peak between two of the reference's points
    assert abs(found.displacement[0] - peak) <= found.error[0] + (1e-9 + missed) * peak


def test_a_peak_between_nodes_whose_velocities_have_one_sign_is_found() -> None:
    step, zeta, omega = 0.013, 0.05, 2 * np.pi / 1.063659179388998
    a = np.random.default_rng(1).normal(0, 0.2, 77) * 9.80665
    rates = np.zeros((4, 4))  # of q, its velocity, the ground's acceleration and its slope
    rates[0, 1], rates[1, :3], rates[2, 3] = 1, (-(omega**2), -2 * zeta * omega, -1), 1
    few, state, q = expm(rates * step / 64), np.zeros(2), []
    for first, last in pairwise(a):
        moved = np.array([*state, first, (last - first) / step])
        for _ in range(64):
            moved = few @ moved
            q.append(moved[0])
        state = moved[:2]
    found = response_spectrum(Accelerogram(step, a), [2 * np.pi / omega], zeta)
    most = np.abs(q).max()
    assert most > 1.0008 * np.abs(q[63::64]).max()
    assert most - 1e-9 <= found.displacement[0] + found.error[0]
    assert found.displacement[0] - found.error[0] <= most * (1 + (0.1 / 64) ** 2)


def test_stiff_oscillators_follow_the_ground_and_soft_ones_stay_behind() -> None:
    rng = np.random.default_rng(4)
    a = np.cumsum(rng.normal(size=200)) * np.hanning(200)
    ground = Accelerogram(0.02, a)
    found = response_spectrum(ground, [2e-4, 400.0], 0.05)
    assert found.pseudo_acceleration[0] == pytest.approx(np.abs(a).max(), rel=2e-3)
    velocity = np.concatenate([[0.0], np.cumsum((a[1:] + a[:-1]) / 2 * 0.02)])
    # the ground's own displacement, piecewise cubic, and its drift after the end
    place = np.cumsum(velocity[:-1] * 0.02 + (2 * a[:-1] + a[1:]) * 0.02**2 / 6)
    assert found.displacement[1] > 0.8 * np.abs(place).max()


@pytest.mark.parametrize(
    ("periods", "damping", "pattern"),
    [
        ([], 0.05, "there must be one at least"),
        ([0.0], 0.05, "each must be greater than 0 s"),
        ([np.nan], 0.05, "finite"),
        ("1", 0.05, "list of numbers"),
        ([1.0], 1.0, "below 1"),
        ([1.0], -0.1, "below 1"),
        ([1.0], "5 %", "must be a number"),
        ([1e-9], 0.05, "steps, above"),
        ([1e9], 0.05, "steps, above"),
    ],
)
def test_what_makes_no_oscillator_is_refused(
    periods: object, damping: object, pattern: str
) -> None:
    with pytest.raises(ValueError, match=pattern):
        response_spectrum(Accelerogram(0.1, np.array([0, 1.0])), periods, damping)  # type: ignore[arg-type]
