"""Responses of single modes to a load: by forty steps or a million, in tables, and off their chords.

They agree with fifty digits or a fine march. What is said of errors of tables and of what they stray
from chords between nodes, over ranges of ω and g/ω, is never too little, and hardly more than needed.
"""

from itertools import pairwise

import mpmath as mp
import numpy as np
import pytest

from alphacut.frame import Accelerogram, History, UnprovedError
from alphacut.frame.response.chord_deviation import Grid, line_deviations, load_deviation
from alphacut.frame.response.duhamel import (
    FROM_RECURRENCE,
    absolute_moments,
    responses_at_nodes,
    step_integrals,
)
from alphacut.frame.response.tables import LoadTable, Oscillators, Source, grid_over
from tests.frame import test_forces
from tests.frame.motions import off_chords

UNIT = 2.0**-53
"""Relative error of one rounding."""
TIGHT = 0.5
"""Share of a bound that something reaches: half the bound would be passed."""
ROUNDING = 1e-10
"""Rounding of a response, as a share of a bound of it: a tenth of the margin of proofs."""


@pytest.fixture(autouse=True)
def fifty_digits():
    with mp.workdps(50):
        yield


def exact_integrals(sigma, h):
    """J_0 … J_3 by 50 digits: by series, or by parts where |σ h| is large."""
    sigma, h = mp.mpc(complex(sigma)), mp.mpf(h)
    z = sigma * h
    if abs(z) < 20:
        powers = [z**k / mp.factorial(k) for k in range(100)]
        phi = [mp.fsum(power / (n + 1 + k) for k, power in enumerate(powers)) for n in range(4)]
    else:
        phi = [(mp.exp(z) - 1) / z]
        for n in range(1, 4):
            phi.append((mp.exp(z) - n * phi[-1]) / z)
    return [value * h ** (n + 1) for n, value in enumerate(phi)]


def error_at(z, h):
    """Errors of the integrals at σ h = z, in units of u hⁿ⁺¹/(n + 1)."""
    sigma, out = complex(z) / h, np.empty(4, complex)
    step_integrals(sigma, h, out)
    off = [
        float(abs(mp.mpc(complex(value)) - true))
        for value, true in zip(out, exact_integrals(sigma, h), strict=True)
    ]
    return [(n + 1) * x / h ** (n + 1) / UNIT for n, x in enumerate(off)]


@pytest.mark.parametrize("low", [-8, -1, 0, 1, 3])
def test_integrals_of_a_step_agree_with_fifty_digits(low):
    """Both sides of the change of rule, and undamped, damped and overdamped exponents."""
    rng, errors = np.random.default_rng(low + 8), []
    for _ in range(15):
        angle = np.pi * rng.choice([0.5, rng.uniform(0.5, 1), 1])
        size = 10 ** rng.uniform(low, low + 1 if low > -8 else -1)
        z = 1j * size if angle == np.pi / 2 else size * np.exp(1j * angle)
        at_change = z / size * (FROM_RECURRENCE + rng.choice([-1e-12, 1e-12]))
        for exponent in (z, at_change):
            errors.append(error_at(exponent, rng.uniform(0.01, 1)))
    assert np.max(errors) <= 12


def exact_response(sigma, ground, time):
    """ρ at one time by 50 digits, interval by interval."""
    sigma, time, h = mp.mpc(complex(sigma)), mp.mpf(float(time)), mp.mpf(ground.step)
    samples, total = [mp.mpf(float(x)) for x in ground.samples], mp.mpc(0)
    for i, (a, b) in enumerate(pairwise(samples)):
        low, high = i * h, min(time, (i + 1) * h)
        if low >= time:
            break
        slope = (b - a) / h
        for sign, end in ((1, high), (-1, low)):
            value = (a + slope * (end - low)) / sigma + slope / sigma**2
            total -= sign * mp.exp(sigma * (time - end)) * value
    return total


CASES = {
    "nodes at samples": (20.0, 0.03, 0.02, 0.02),
    "nodes between samples": (9.0, 0.02, 0.02, 0.0071),
    "undamped, five samples a node": (14.0, 0.0, 0.02, 0.1),
    "product above 15": (103.0, 0.03, 0.25, 0.025),
    "product 340": (1700.0, 0.05, 0.2, 0.013),
    "a third of a step": (5.0, 0.3, 0.3, 0.1),
}


@pytest.mark.parametrize("case", list(CASES))
def test_responses_agree_with_fifty_digits(case):
    omega, quotient, step, node_step = CASES[case]
    rng = np.random.default_rng(len(case))
    ground = Accelerogram(step, rng.normal(size=40))
    time = np.arange(61) * node_step
    sigma = omega * np.array([0.3, 1.0, 1.01]) * (-quotient + 1j)
    value = responses_at_nodes(sigma, ground, time, 2)
    nodes = rng.choice(np.arange(1, 61), 8, replace=False)
    for s in range(3):
        size = np.abs(value[0, :, s]).max()
        for node in nodes:
            exact = complex(exact_response(sigma[s], ground, time[node]))
            assert abs(value[0, node, s] - exact) <= 1e-11 * size
    named = responses_at_nodes(np.tile(sigma, (8, 1)), ground, time, 2, node=nodes)
    assert np.allclose(named, value[:, nodes], rtol=1e-13, atol=0)


RECORD = Accelerogram(0.05, np.random.default_rng(1).normal(size=30))
LATE = History.constant(start=0.3)  # 1 s between its samples, in which the fastest decay underflows


@pytest.mark.parametrize(("ground", "node_step"), [(RECORD, 0.0371), (RECORD, 0.05), (LATE, 0.02)])
def test_windows_begin_at_rest(ground, node_step):
    """What arose before a window goes on freely; the rest is the window's own."""
    time, sigma = np.arange(41) * node_step, np.array([-0.3 + 9j, 0.4 - 20j, -30 + 2j, -2e3 + 9j])
    length = 7
    whole = responses_at_nodes(sigma, ground, time, 0)
    (found,) = responses_at_nodes(sigma, ground, time, window=length)
    before = (np.maximum(np.arange(41) - 1, 0) // length) * length
    free = np.exp(sigma * (time - time[before])[:, None]) * whole[0, before]
    assert np.allclose(found + free, whole[0], atol=1e-13 * np.abs(whole).max(), rtol=1e-11)
    assert (found[0] == 0).all()


def test_windows_late_in_a_long_interval_of_the_load_are_exact():
    """Up to there a growing exponent of a window's series would have grown by e⁴⁵."""
    time, sigma = np.arange(81) * 0.02, np.array([60 + 9j])
    (found,) = responses_at_nodes(sigma, LATE, time, window=4)
    elapsed = time[1:] - time[(np.arange(80) // 4) * 4]
    exact = np.expm1(sigma[0] * elapsed) / sigma[0]
    late = time[1:] > 0.5
    assert np.allclose(found[1:, 0][late], exact[late], rtol=1e-12)


@pytest.mark.parametrize("decay", [-0.4, 0.0, 3.0])
def test_absolute_moments_are_bounds_and_sharp(decay):
    """Against sums over 200 parts of a sample's interval; the integral of |f| itself is exact."""
    time, part = np.array([0.0, 0.03, 0.4, 1.0, 1.37, 1.6]), RECORD.step / 200
    bounds = absolute_moments(decay, RECORD, time)
    for t, found in zip(time[1:], bounds.T[1:], strict=True):
        tau = (np.arange(round(t / part)) + 0.5) * part
        force = np.abs(RECORD.values(t - tau))
        true = (tau ** np.arange(5)[:, None] * np.exp(-decay * tau) * force).sum(-1) * part
        assert (found >= true * (1 - 1e-4)).all()
        assert found[0] <= (1.001 if decay == 0 else 1.2) * true[0]


@pytest.mark.parametrize("sigma", [np.nan, 2e3 + 3j, -1e12 + 1j, -1 + 1e10j])
def test_exponents_out_of_range_are_refused(sigma):
    ground, time = Accelerogram(0.1, np.ones(20)), np.arange(5) * 0.1
    with pytest.raises(UnprovedError, match="take a shorter step of the record"):
        responses_at_nodes(np.array([-1 + 2j, sigma]), ground, time, 0)
    with pytest.raises(UnprovedError, match="allowed: 1e"):
        responses_at_nodes(np.array([[sigma]]), ground, time, 1, node=np.array([2]))


TABLES = {  # midpoint, largest deviation, step of the load, of the nodes, number of nodes
    "one window": (-0.3 + 9j, 1.0, 0.02, 0.05, 41),
    "windows": (-0.3 + 20j, 14.0, 0.02, 0.05, 41),
    "narrow": (-0.3 + 9j, 1e-3, 0.05, 0.05, 41),
    "a thousand samples a step": (-1.0 + 30j, 4.0, 0.0005, 0.5, 2),
    "three steps in a sample": (-0.5 + 6j, 3.0, 0.7, 0.2, 16),
}


@pytest.mark.parametrize("hertz", [0.0, 1.3])
@pytest.mark.parametrize("case", list(TABLES))
def test_tables_miss_the_integrals_by_their_errors_at_most(case, hertz, rng):
    """Also of a load times a sine; a growing exponent of a circle grows within its window alone."""
    midpoint, deviation, step, node_step, count = TABLES[case]
    time = np.arange(count) * node_step
    samples = rng.normal(size=int(time[-1] / step) + 2)
    history = History(step, samples, frequency=2 * np.pi * hertz, phase=0.4)
    table = LoadTable(history, time, midpoint, deviation)
    rates = midpoint + deviation * np.array([1.0, -1.0, -1j, 0.3 - 0.5j])
    waves = absolute_moments(-max(rates.real), history, time)
    largest = waves[:3].max(axis=1, keepdims=True)
    bounds = table.errors(waves)[:3] + ROUNDING * largest
    exact = responses_at_nodes(rates, history, time, 2)
    for k, rate in enumerate(rates):
        found = table.response(np.full(count, rate), np.arange(count))
        assert (np.abs(found - exact[..., k]) <= bounds).all()
    assert (bounds <= 1e-8 * largest).all()


# tables over grids of ω and g/ω

TWO_TONES = Accelerogram(0.02, np.sin(np.arange(200) * 0.11) * np.sin(np.arange(200) * 0.47))


@pytest.mark.parametrize("source", ["load", "velocity", "start"])
@pytest.mark.parametrize("order", [0, 1, 2])
def test_tables_miss_what_they_state_and_no_less_than_half(source, order):
    time = np.arange(0, 3, 0.05)
    moved = Source.named(source, TWO_TONES if source == "load" else None)
    fine = Grid(np.linspace(9.5, 10.5, 41), np.linspace(0.02, 0.035, 41))
    for omega, quotient in ((5, 1), (1, 10), (5, 10)):  # points of the fine grid in a cell
        coarse = Grid(fine.omega[::omega], fine.quotient[::quotient])
        table = Oscillators(coarse, time, {order}).responses(moved, order)
        exact = Oscillators(fine, time, {order}).responses(moved, order).value
        at = table.value
        for axis, (own, grid) in enumerate(
            ((fine.quotient, coarse.quotient), (fine.omega, coarse.omega)), 1
        ):
            weights = np.array([np.interp(own, grid, row) for row in np.eye(len(grid))])
            at = np.moveaxis(np.tensordot(at, weights, (axis, 0)), -1, axis)
        off = np.abs(at - exact).max((1, 2))
        assert (off <= table.error + 1e-14).all()
        if (omega, quotient) != (5, 10):
            assert (off[1:] / table.error[1:]).max() > TIGHT


def test_what_second_derivatives_do_within_a_cell_is_in_the_error():
    """G″ = (σ − σ₁)(σ − σ₂) is zero at both ends of a cell, and G strays by 5 h⁴/384 within."""
    grid, h = Grid(np.array([10.0, 11.0]), np.zeros(1)), 1.0
    oscillators = Oscillators(grid, np.zeros(1), range(3))
    zero, fourth = np.zeros((3, 1)), np.array([[0.0], [0.0], [0.0], [0.0], [2.0]])
    error, _ = oscillators._error(zero, fourth, 0, start=True)
    exact = 5 * h**4 / 384
    assert exact <= error[0] <= 3 * exact


def test_responses_are_those_of_a_fine_march_and_stray_as_stated():
    grid, parts = Grid(np.linspace(9.99, 10.01, 3), np.array([0, 1e-3])), 8
    resonant = Accelerogram(0.02, np.sin(0.2 * np.arange(400)))
    ended = Accelerogram(0.02, np.ones(51))  # between two nodes
    cases = [(source, resonant, 0.05) for source in ("load", "velocity", "start")]
    for source, ground, step in (*cases, ("load", ended, 0.01)):
        coarse = step * (np.arange(120) + 0.5)
        time = coarse[0] + step / parts * np.arange(119 * parts + 1)
        moved = Source.named(source, ground if source == "load" else None)
        for order in (0, 1, 2):
            at_nodes = Oscillators(grid, coarse, {order})
            wide = at_nodes.responses(moved, order)
            fine = Oscillators(grid, time, {order}).responses(moved, order).value
            assert np.allclose(fine[::parts], wide.value, atol=1e-12 * np.abs(fine).max())
            off = off_chords(fine.reshape(len(time), -1), parts).max(1)
            bound = at_nodes.line_deviation(moved, order)[1:]
            assert (off <= bound + 1e-13).all()
            assert (off > TIGHT * bound).any()


# chords between nodes


@pytest.mark.parametrize("kind", ["any", "a sine that reaches its chord within steps"])
def test_no_history_strays_farther_from_its_chords_than_is_said(kind, rng):
    for _ in range(60):
        history, step = test_forces.random_history(rng), rng.uniform(0.01, 0.2)
        if kind != "any":
            omega = 10 ** rng.uniform(-1, 2)
            step = rng.uniform(0.01, 0.45) / omega
            history = History.harmonic(omega / 2 / np.pi, rng.uniform(0, 6))
        fine = np.arange(64 * 30 + 1) * step / 64
        off = off_chords(history.values(fine), 64)
        bound = load_deviation(history, fine[::64])[1:]
        assert (off <= bound + 1e-9 * history.extremes[0]).all()


PARTS, TIME = 40, np.linspace(0, 1.2, 25)
LOADS = {
    "free": None,
    "record": History(0.035, np.random.default_rng(3).normal(size=30)),
    "sine": History.harmonic(2.0, 0.3, start=0.13),
    "pulse": History(0.11, np.ones(4), start=0.07),
}


FINE = np.linspace(TIME[0], TIME[-1], PARTS * (len(TIME) - 1) + 1)


@pytest.mark.parametrize("order", [0, 1, 2])
@pytest.mark.parametrize("load", LOADS)
def test_a_mode_alone_strays_as_far_as_its_magnitude_says(load, order, rng):
    """Also while a load has hardly moved it yet."""
    grid = grid_over((omega := rng.uniform(5, 30),) * 2, (0.05, 0.05), (4, 2))
    bound = line_deviations(grid, LOADS[load], TIME, (order,))[order][1, 1:]
    sigma = (-0.05 + 1j) * omega
    rho = np.exp(sigma * FINE)
    if LOADS[load]:
        rho = responses_at_nodes(np.array([sigma]), LOADS[load], FINE, 0)[0, :, 0]
    off = off_chords((sigma**order * rho).imag / omega, PARTS)
    assert (off <= bound * (1 + 1e-9) + 1e-15).all()


def test_bounds_over_a_coarse_grid_fall_with_the_step_where_samples_lie_within(rng):
    load = History(0.001, rng.normal(size=3000).cumsum())
    omega, quotient = (100.0, 140.0), (0.05, 0.15)
    grid = grid_over(omega, quotient, (24, 3))
    bounds = []
    for step in (0.016, 0.004):
        time = step * np.arange(round(3 / step) + 1)
        bounds.append(line_deviations(grid, load, time, (0,))[0][1].max())
        fine = np.linspace(0, time[-1], 8 * len(time) - 7)
        w, q = rng.uniform(*omega, 5), rng.uniform(*quotient, 5)
        rho = responses_at_nodes((-q + 1j) * w, load, fine, 0)[0]
        assert off_chords((rho / (1j * w)).real, 8).max() <= bounds[-1]
    assert bounds[1] < bounds[0] / 8


@pytest.mark.parametrize("samples_in_step", [1, PARTS])
@pytest.mark.parametrize("order", [0, 1, 2])
def test_resonance_between_two_points_of_a_grid_is_in_the_bound(order, samples_in_step, rng):
    """A mode strays most at a frequency between the grid's two, in which it hardly resonates.

    Where the load has many samples within a step, the bound consists of what the response is off
    the chord of the step there, and of what that may be between the frequencies. Where it has none,
    it is made of the size of the response at the beginning of the step.
    """
    middle = rng.uniform(28, 32)
    step = (TIME[1] - TIME[0]) / samples_in_step
    samples = np.sin(middle * np.arange(0.0, TIME[-1] + step, step))
    load = History(step, samples)
    # at the end the response at the grid's frequencies has beaten down to almost nothing
    width = rng.uniform(0.9, 1.05) * 2 * np.pi / (TIME[-1] * middle)
    grid = grid_over((middle * (1 - width), middle * (1 + width)), (0.0, 0.0), (2, 1))
    bound = line_deviations(grid, load, TIME, (order,))[order][1, 1:]
    omega = middle * np.linspace(1 - width, 1 + width, 11)
    (rho,) = responses_at_nodes(1j * omega, load, FINE, 0)
    off = off_chords(((1j * omega) ** order * rho).imag / omega, PARTS).max(1)
    assert (off <= bound * (1 + 1e-9) + 1e-15).all()


def samples_that_vanish_on_a_grid(functionals, at_middle):
    """Samples of a load for which complex numbers linear in them vanish, (count, N), and one not.

    Of all such samples those for which the number `at_middle` (N,) is largest.
    """
    rows = np.concatenate([functionals.real, functionals.imag])
    null_space = np.linalg.svd(rows)[2][len(rows) :]
    found = null_space.T @ (null_space @ at_middle.real)
    return found / np.abs(found).max()


def test_what_a_response_is_between_points_at_which_it_and_its_curvature_vanish(rng):
    """Nothing is read at the two frequencies of the grid: its fourth derivative alone bounds it."""
    omega, width, step = rng.uniform(15, 25), rng.uniform(0.05, 0.15), TIME[1] - TIME[0]
    ends = omega * np.array([1 - width, 1 + width])
    grid = grid_over(tuple(ends), (0.0, 0.0), (2, 1))
    points = 1j * np.array([*grid.omega, omega])
    columns = []
    for sample in np.eye(len(TIME)):
        load = History(step, sample)
        rho = responses_at_nodes(points, load, TIME, 2)  # with two derivatives, (3, T, 3)
        # A = ρ + a/σ + b/σ² at the beginning of the last step, with its second derivative
        a, b = sample[-2], (sample[-1] - sample[-2]) / step
        value = rho[0, -2] + a / points + b / points**2
        second = rho[2, -2] + 2 * a / points**3 + 6 * b / points**4
        columns.append(np.stack([value, second]))
    values = np.stack(columns, -1)  # (value, curvature; points; samples)
    on_grid = np.concatenate([values[0, :2], values[1, :2]])
    load = History(step, samples_that_vanish_on_a_grid(on_grid, values[0, 2]))
    rho = responses_at_nodes(points[2:], load, FINE, 0)[0, :, 0]
    off = off_chords(rho, PARTS)[-1]
    assert off > 1e-6 * np.abs(rho[-PARTS:]).max()
    assert off <= line_deviations(grid, load, TIME, (0,))[0][0, -1]
