"""Tables of the response to a load miss the exact integrals by no more than they say."""

from itertools import pairwise

import mpmath as mp
import numpy as np
import pytest

from alphacut.frame import Accelerogram, History
from alphacut.frame.calculus.rounding import UNIT_ROUNDOFF
from alphacut.frame.response.duhamel import absolute_moments
from alphacut.frame.response.load_tables import LoadTable

IDLE = 1e-7
"""Share of a bound that the largest of some errors reaches at least; the bounds add up what only
partly comes together, such as the errors of the points of a circle."""


@pytest.fixture(autouse=True)
def fifty_digits():
    with mp.workdps(50):
        yield


def exact_jet(response, rate):
    """R, dR/dλ and d²R/dλ² by fifty digits and differences, which leave some twenty."""
    step = mp.mpf(10) ** -12
    below, at, above = (response(mp.mpc(complex(rate)) + step * k) for k in (-1, 0, 1))
    return at, (above - below) / (2 * step), (above - 2 * at + below) / step**2


def errors_and_bounds(table, history, response, rates, nodes):
    """Errors of R and of its derivatives at some nodes, and their bounds, shape (3, N) each."""
    growth = max(rates.real)
    waves = absolute_moments(-growth, history, table.time)
    bounds = table.errors(waves, growth)[:, nodes]
    errors = np.zeros(bounds.shape)
    for i, node in enumerate(nodes):
        for rate in rates:
            found = table.response(np.array([rate]), np.array([node]))[:, 0]
            exact = exact_jet(lambda x, n=node: response(x, table.time[n]), rate)
            off = [float(abs(mp.mpc(complex(x)) - y)) for x, y in zip(found, exact, strict=True)]
            errors[:, i] = np.maximum(errors[:, i], off)
    return errors, bounds, waves[:3, nodes]


def exact_response(rate, history, time):
    """R at one time by fifty digits, interval by interval of the load."""
    total, h, time = mp.mpc(0), mp.mpf(history.step), mp.mpf(float(time))
    samples = [mp.mpf(float(x)) for x in history.samples]
    at_begin, factor = mp.exp(rate * time), mp.exp(-rate * h)  # exp(λ (t − s)) at its beginning
    for i, (a, b) in enumerate(pairwise(samples)):
        slope, length = (b - a) / h, min(time - i * h, h)
        if length <= 0:
            break
        at_end = at_begin * factor if length == h else mp.mpf(1)
        total += at_begin * (a / rate + slope / rate**2)
        total -= at_end * ((a + slope * length) / rate + slope / rate**2)
        at_begin = at_end
    return total


CASES = {  # midpoint, largest deviation, step of the load, of the nodes, number of nodes
    "one window": (-0.3 + 9j, 1.0, 0.02, 0.05, 41),
    "windows": (-0.3 + 20j, 14.0, 0.02, 0.05, 41),
    "narrow": (-0.3 + 9j, 1e-3, 0.05, 0.05, 41),
    "a thousand samples a step": (-1.0 + 30j, 4.0, 0.0005, 0.5, 2),
    "three steps in a sample": (-0.5 + 6j, 3.0, 0.7, 0.2, 16),
}


@pytest.mark.parametrize("case", list(CASES))
def test_tables_miss_the_integrals_by_their_errors_at_most(case, rng):
    midpoint, deviation, step, node_step, count = CASES[case]
    time = np.arange(count) * node_step
    history = Accelerogram(step, rng.normal(size=int(time[-1] / step) + 2))
    table = LoadTable(history, time, midpoint, deviation)
    rates = midpoint + deviation * np.array([1.0, -1j, 0.3 - 0.5j])
    nodes = np.unique([1, count // 2, count - 1])
    errors, bounds, _ = errors_and_bounds(
        table, history, lambda rate, t: exact_response(rate, history, t), rates, nodes
    )
    assert (errors <= bounds).all()
    assert (errors.max(axis=1) >= IDLE * bounds.max(axis=1)).all()


@pytest.mark.parametrize("hertz", [0.0, 1.3])
def test_a_harmonic_load_is_followed_through_windows(hertz):
    """Of exp(λ t) less exp(± iΩ t); a growing exponent of a circle grows within its window alone."""
    history = History.harmonic(hertz, 0.4) if hertz else History.constant()
    time, midpoint, deviation = np.arange(121) * 0.05, -0.3 + 20j, 14.0
    table = LoadTable(history, time, midpoint, deviation)
    omega, phase = mp.mpf(history.frequency), mp.mpf(history.phase)

    def response(rate, t):
        t = mp.mpf(float(t))
        total = mp.mpc(0)
        if not hertz:
            return (mp.exp(rate * t) - 1) / rate
        for sign in (1, -1):
            turn = mp.mpc(0, sign) * omega
            start = mp.exp(mp.mpc(0, sign) * phase)
            total += sign * start * (mp.exp(turn * t) - mp.exp(rate * t)) / (turn - rate)
        return total / mp.mpc(0, 2)

    rates = midpoint + deviation * np.array([1.0, -1.0, 1j, -1j])
    nodes = np.array([1, 20, 120])
    errors, bounds, waves = errors_and_bounds(table, history, response, rates, nodes)
    assert (errors <= bounds).all()
    assert (bounds <= 1e-8 * waves.max(axis=1, keepdims=True)).all()


def test_rounding_of_a_record_with_a_million_samples_in_a_step_is_in_the_errors():
    """Each sample multiplies R by the same rounded exponential: errors add up with their number.

    What operations for each time node would add is less than the bound, and with the exponential of
    most machines less than the error.
    """
    samples = 1_000_000
    time = np.array([0.0, 1.0])
    history = History(1.0 / samples, np.ones(samples + 1), is_held=True)
    midpoint, deviation = 0.7j, 0.01
    table = LoadTable(history, time, midpoint, deviation)

    def response(rate, t):
        return (mp.exp(rate * mp.mpf(float(t))) - 1) / rate

    rates = midpoint + deviation * np.array([0.0, 1.0, -1.0, 1j, -1j])
    errors, bounds, waves = errors_and_bounds(table, history, response, rates, np.array([1]))
    assert (errors <= bounds).all()
    by_nodes = 2 * UNIT_ROUNDOFF * (8 * len(time) + 100) * np.exp(6.0)
    assert bounds[0, 0] > by_nodes * waves[0, 0]
