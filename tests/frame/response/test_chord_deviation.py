"""Straying from chords is bounded over ranges of ω, g/ω and shares, with what modes cancel."""

import numpy as np
import pytest

from alphacut.frame import History
from alphacut.frame.response.chord_deviation import (
    Response,
    line_deviations,
    narrowed_deviation,
)
from alphacut.frame.response.duhamel import responses_at_nodes
from alphacut.frame.response.oscillators import grid_over

PARTS, TIME = 40, np.linspace(0, 1.2, 25)
LOADS = {
    "free": None,
    "record": History(0.035, np.random.default_rng(3).normal(size=30)),
    "sine": History.harmonic(2.0, 0.3, start=0.13),
    "pulse": History(0.11, np.ones(4), start=0.07),
}
SHARES = np.array([1.0, -2.0, 1.0])


def off_chords(sigma, load, order, kappa):
    """Largest distance of Re κ σ^order ρ from the chord of each step, shape (steps,)."""
    fine = np.linspace(TIME[0], TIME[-1], PARTS * (len(TIME) - 1) + 1)
    rho = np.exp(sigma * fine[:, None])
    if load is not None:
        rho = responses_at_nodes(sigma, load, fine, 0)[0][0]
    y = (kappa * sigma**order * rho).real.sum(1)
    return np.abs(y - np.interp(fine, TIME, y[::PARTS]))[1:].reshape(-1, PARTS).max(1)


def modes_that_cancel(load, width, rng):
    """Three modes of shares 1, −2 and 1; κ = share/(iω), and up to `width` of it besides.

    Returns a function to draw what a motion strays by, the bound, and that by magnitude.
    """
    order, quotient = int(rng.integers(3)), rng.uniform(0, 0.1)
    omega = rng.uniform(5, 30) * np.array([1, 1.15, 1.3])
    ends = omega[:, None] * (1 + width * np.array([-1, 1]))
    quotients, spread = (quotient, quotient * (1 + width)), width / omega / 3
    responses = []
    for k, share in enumerate(SHARES):
        sigma = grid_over(tuple(ends[k]), quotients, (4, 2)).sigma
        kappa = share / (1j * sigma.imag[None])
        responses.append(Response(sigma, LOADS[load], order, kappa, np.full((2, 1), spread[k])))
    by_magnitude = np.sum([x.line_deviation(TIME) for x in responses], axis=0)

    def draw():
        w, q = ends[:, 0] + np.ptp(ends, axis=1) * rng.random(3), rng.uniform(*quotients)
        signs = rng.choice([-1, 1], (2, 3))
        kappa = SHARES / (1j * w) + spread * (signs[0] + 1j * signs[1])
        return off_chords((-q + 1j) * w, LOADS[load], order, kappa)

    return draw, narrowed_deviation(responses, TIME, by_magnitude)[1:, 0], by_magnitude[1:, 0]


@pytest.mark.parametrize("width", [0.0, 0.03, 0.3])
@pytest.mark.parametrize("load", LOADS)
def test_modes_that_cancel_stray_as_far_as_stated(load, width, rng):
    draw, bound, by_magnitude = modes_that_cancel(load, width, rng)
    assert (bound <= by_magnitude).all()
    for _ in range(10):
        assert (draw() <= bound * (1 + 1e-6) + 1e-15).all()


def test_bounds_of_crisp_modes_that_cancel_are_about_what_they_stray(rng):
    ratios = []
    for load in [*LOADS] * 4:
        draw, bound, _ = modes_that_cancel(load, 0.0, rng)
        ratios.append(bound.max() / draw().max())
    # one motion's own is up to 5
    assert np.median(ratios) < 2


@pytest.mark.parametrize("order", [0, 1, 2])
@pytest.mark.parametrize("load", LOADS)
def test_a_mode_alone_strays_as_far_as_its_magnitude_says(load, order, rng):
    """Also while a load has hardly moved it yet."""
    sigma = grid_over((omega := rng.uniform(5, 30),) * 2, (0.05, 0.05), (4, 2)).sigma
    kappa = 1 / (1j * sigma.imag[None])
    response = Response(sigma, LOADS[load], order, kappa, np.zeros((2, 1)))
    bound = response.line_deviation(TIME)[1:, 0]
    off = off_chords(np.array([-0.05 + 1j]) * omega, LOADS[load], order, 1 / (1j * omega))
    assert (off <= bound * (1 + 1e-9) + 1e-15).all()


@pytest.mark.parametrize(
    ("spread", "fall"), [((0, 0), 0), ((0, 0), 1), ((0.01, 0), 0), ((0, 0.01), 0)]
)
@pytest.mark.parametrize("load", LOADS)
def test_values_off_chords_lie_in_their_ranges(load, spread, fall, rng):
    """Over a coarse grid, near whose end κ may `fall`, or of κ that is off at one point."""
    order, parts, kappa, is_coarse = int(rng.integers(3)), 4, 0.3 + 1j, not any(spread)
    w, q = rng.uniform(9, 15) * np.array([1, 1.2]), rng.uniform(0, 0.05) * np.array([1, 3])
    if not is_coarse:
        w[1], q[1] = w[0], q[0]
    nodes = np.linspace(TIME[0], TIME[-1], parts * (len(TIME) - 1) + 1)
    sigma = grid_over(tuple(w), tuple(q), (2, 2)).sigma
    off = np.array(spread)[:, None]
    corners = np.full((1, 2, 2), kappa) * [1, 1 - fall]
    response = Response(sigma, LOADS[load], order, corners, off)
    low, high = (x.ravel() for x in response.off_chords(nodes, parts))
    shares = np.linspace(0, 1, 9)
    at = ((-(q[0] + np.ptp(q) * shares[:, None]) + 1j) * (w[0] + np.ptp(w) * shares)).ravel()
    kappa = np.tile(kappa * (1 - fall * shares**20), 9)
    rho = np.exp(at * nodes[:, None])
    if LOADS[load] is not None:
        rho = responses_at_nodes(at, LOADS[load], nodes, 0)[0][0]
    G = at**order * rho
    G -= np.array([np.interp(nodes, TIME, x) for x in G[::parts].T]).T
    more = off[0] * np.abs(G.real) + off[1] * np.abs(G.imag)
    assert (low <= ((kappa * G).real - more).min(1) + 1e-15).all()
    assert (high >= ((kappa * G).real + more).max(1) - 1e-15).all()


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
    sigma = grid_over((middle * (1 - width), middle * (1 + width)), (0.0, 0.0), (2, 1)).sigma
    response = Response(sigma, load, order, 1 / (1j * sigma.imag[None]), np.zeros((2, 1)))
    bound = response.line_deviation(TIME)[1:, 0]
    fine = np.linspace(TIME[0], TIME[-1], PARTS * (len(TIME) - 1) + 1)
    for omega in middle * np.linspace(1 - width, 1 + width, 11):
        sigma = np.array([1j * omega])
        rho = responses_at_nodes(sigma, load, fine, 0)[0][0, :, 0]
        y = (sigma**order * rho).imag / omega
        off = np.abs(y - np.interp(fine, TIME, y[::PARTS]))[1:].reshape(-1, PARTS).max(1)
        assert (off <= bound * (1 + 1e-9) + 1e-15).all()


def test_values_off_chords_between_two_points_of_a_grid_are_in_their_range(rng):
    """Of free oscillation, exp(i ω t) off its chord is a phase at late times, a cosine with κ.

    With κ turned so that the cosine is highest between the two frequencies of the grid, where each
    value of the grid is smaller by (h t)²/8 of it; h is the distance of the frequencies.
    """
    omega, parts = rng.uniform(8, 12), 4
    nodes = rng.uniform(60, 100) + np.linspace(0.0, 0.4, parts + 1)
    late = nodes[parts // 2]
    h = rng.uniform(0.1, 0.3) / late
    chord = np.interp(np.arange(parts + 1), [0, parts], [0.0, 1.0])

    def off_the_chord(omega):
        motion = np.exp(1j * omega * nodes)
        return motion - (1 - chord) * motion[0] - chord * motion[-1]

    kappa = np.exp(-1j * np.angle(off_the_chord(omega)[parts // 2]))
    sigma = grid_over((omega - h / 2, omega + h / 2), (0.0, 0.0), (2, 1)).sigma
    response = Response(sigma, None, 0, np.full((1, *sigma.shape), kappa), np.zeros((2, 1)))
    low, high = response.off_chords(nodes, parts)
    for at in omega + h * np.linspace(-0.5, 0.5, 21):
        off = (kappa * off_the_chord(at)).real
        assert (low[:, 0] <= off + 1e-12).all()
        assert (off - 1e-12 <= high[:, 0]).all()


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
    omega, width, parts, step = rng.uniform(15, 25), rng.uniform(0.05, 0.15), 4, TIME[1] - TIME[0]
    ends = omega * np.array([1 - width, 1 + width])
    sigma = grid_over(tuple(ends), (0.0, 0.0), (2, 1)).sigma
    points = 1j * np.array([*sigma[0].imag, omega])
    nodes = np.linspace(TIME[0], TIME[-1], parts * (len(TIME) - 1) + 1)
    kinds = {"off the chord": [], "free in the step": []}
    for sample in np.eye(len(TIME)):
        load = History(step, sample)
        rho, _ = responses_at_nodes(points, load, nodes, 2)  # with two derivatives, (3, T, 3)
        middle = rho[:, -3] - (rho[:, -5] + rho[:, -1]) / 2
        kinds["off the chord"].append(middle)
        # A = ρ + a/σ + b/σ² at the beginning of the last step, with its second derivative
        a, b = sample[-2], (sample[-1] - sample[-2]) / step
        value = rho[0, -5] + a / points + b / points**2
        second = rho[2, -5] + 2 * a / points**3 + 6 * b / points**4
        kinds["free in the step"].append(np.stack([value, value, second]))
    for kind, columns in kinds.items():
        values = np.stack(columns, -1)  # (value, slope, curvature; points; samples)
        on_grid = np.concatenate([values[0, :2], values[2, :2]])
        load = History(step, samples_that_vanish_on_a_grid(on_grid, values[0, 2]))
        kappa = np.full((1, *sigma.shape), np.exp(-1j * np.angle(values[0, 2] @ load.samples)))
        response = Response(sigma, load, 0, kappa, np.zeros((2, 1)))
        fine = np.linspace(TIME[-2], TIME[-1], 41)
        rho = responses_at_nodes(points[2:], load, np.append(TIME[:-2], fine), 0)[0][0, -41:, 0]
        off = (kappa[0, 0, 0] * (rho - np.linspace(rho[0], rho[-1], 41))).real
        assert np.abs(off).max() > 1e-6 * np.abs(rho).max()
        if kind == "off the chord":
            low, high = response.off_chords(nodes, parts)
            assert low[-3, 0] <= off[20] <= high[-3, 0]
        else:
            assert np.abs(off).max() <= response.line_deviation(TIME)[-1, 0]


def test_the_bend_of_a_harmonic_force_counts_where_its_pieces_end_on_the_line(rng):
    for _ in range(40):
        omega = 10 ** rng.uniform(-1, 2)
        step, count = rng.uniform(0.01, 0.45) / omega, int(rng.integers(1, 60))
        force = History.harmonic(omega / 2 / np.pi, rng.uniform(0, 6))
        time = np.arange(count + 1) * step
        row = (-0.01 + 1j) * np.array([[0.01 * omega, 0.0101 * omega]])
        sigma = np.vstack([row, row * 1.0001])
        bound = line_deviations(sigma, force, time, (2,), is_force=True)[2][1].max()
        fine = np.linspace(0, time[-1], 40 * count + 1)
        chord = np.interp(fine, time, force.values(time))
        assert bound >= np.abs(force.values(fine) - chord).max()
