"""Ingredients of a proof on cases where they nearly are the truth: halved, none would cover it."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

from alphacut.frame import (
    Accelerogram,
    Exact,
    Force,
    History,
    LinearFlow,
    StoreyFrame,
    UnprovedError,
)
from alphacut.frame.bounds.branch_and_bound import (
    Frontier,
    Optima,
    Piece,
    bound_problems,
    examine_items,
)
from alphacut.frame.bounds.kernel import stays_below
from alphacut.frame.bounds.model_error import (
    largest_growth,
    majorant_parts,
    proved_error,
    remainder_bounds,
    response_parts,
)
from alphacut.frame.boxes import UnitFlow, boxes
from alphacut.frame.calculus.taylor_model import TaylorModel
from alphacut.frame.methods.proof import bound_levels
from alphacut.frame.modes.modal_model import ModalModel
from alphacut.frame.response.duhamel import responses_at_nodes
from alphacut.fuzzy import Interval

PULSE = Accelerogram(0.37, np.array([1.0, 1.0, 1.0, 1.0, 1.0, 1.0]))


def spring(omega: float, ground: Accelerogram | None, duration: float, step: float) -> ModalModel:
    """An undamped mass whose frequency is uncertain by 5 %."""
    frame = StoreyFrame((1.0,), (1.0,), omega**2 / 24, 1.0, q0=(1.0,), ground=ground)
    inputs = {"E": Interval(0.9 * omega**2 / 24, 1.1 * omega**2 / 24)}
    flow = LinearFlow(frame, ("E",), duration, step, Exact())
    return ModalModel.of_degree(flow, boxes(inputs, (0,)), 12)


def test_remainder_of_the_quadratic_model_is_that_of_a_late_oscillation(rng) -> None:
    """By all three of two inputs, of which the frequency and the velocity's share are functions."""
    frame = StoreyFrame((1.0,), stiffness=(1.0,), q0=(1.0,), outputs=("v1",))
    flow = LinearFlow(frame, ("k1", "m1"), 400.0, 1.0, Exact())
    cuts = boxes({"k1": Interval(0.9, 1.1), "m1": Interval(0.95, 1.05)}, (0,))
    model, h = ModalModel.of_degree(flow, cuts, 12), 1e-4
    bound = remainder_bounds(model, -np.ones(2), np.ones(2)).third[:, 0]
    unit = rng.uniform(-0.99, 0.99, (4000, 2))
    for node in (100, 200, 400):
        at = np.full(len(unit), node), np.zeros(len(unit), int)
        ends = (model.at(unit + h * e, *at)[2] - model.at(unit - h * e, *at)[2] for e in np.eye(2))
        ratio = bound[node] / np.abs(np.stack([*ends], 1) / (2 * h)).max(0)
        assert (ratio >= 1).all()
        assert (ratio <= 2.5).all()


@pytest.mark.parametrize("reach", [3e-9, 1.0, 2.0])
def test_majorants_are_exact_in_narrow_boxes_and_beyond_the_unit_box(reach) -> None:
    """The derivatives of 2 u³ are 6 u², 12 u and 12; coefficients are these over 1, 2 and 6."""
    cubic = polynomials(np.array([0, 0, 0, -2.0])[:, None])
    found = [float(part.item()) for part in majorant_parts(cubic, np.full(1, reach))]
    exact = [2 * reach**3, 6 * reach**2, 6 * reach, 2.0]
    np.testing.assert_allclose(found, exact, rtol=1e-14)


def test_remainder_at_the_start_is_that_of_a_force_over_an_uncertain_mass() -> None:
    loads = [Force(1, 1.0, History.constant())]
    frame = StoreyFrame((1.0,), stiffness=(1.0,), damping_ratio=0.05, loads=loads, outputs=("a1",))
    cuts = boxes({"m1": Interval(0.9, 1.1)}, (0,))
    model = ModalModel.of_degree(LinearFlow(frame, ("m1",), 1.0, 0.1, Exact()), cuts, 12)
    bound = remainder_bounds(model, -np.ones(1), np.ones(1)).third[0, 0, 0, 0, 0]
    assert bound == pytest.approx(6 * 0.1**3 / 0.9**4, rel=1e-6)  # of F/m at m = 0.9


@pytest.mark.parametrize("order", [0, 1, 2, 3])
def test_bounds_of_waves_are_reached_by_a_pulse_on_a_soft_spring(order: int) -> None:
    """Short of a turn all of the pulse adds up: R and its derivatives by λ are ∫ τ^r a."""
    model = spring(1e-2, PULSE, 4.0, 0.1)
    growth = largest_growth(model.eigenvalue, np.ones(1))
    free, forced = response_parts(model, growth)
    rate = model.eigenvalue.at(np.zeros((1, 1)))
    time = model.flow.time
    if order < 3:
        nodes = np.arange(len(time))
        truth = model.loads[0].response(np.repeat(rate, len(nodes), 0), nodes)[order][:, 0]
        ratio = forced.waves[order][5:, 0] / np.abs(truth)[5:]
        assert (ratio >= 1).all()
        assert (ratio <= 1.8).all()
    assert free.waves[order][:, 0] == pytest.approx(time**order)
    assert forced.impulse[-1] == pytest.approx(1.85)  # ∫ |a| of the pulse, cut at 1.85 s
    (driven,), _ = responses_at_nodes(rate.ravel(), PULSE, time, 0)
    elapsed = cumulative_trapezoid(np.abs(driven[:, 0]), dx=0.1, initial=0)
    assert (forced.elapsed[5:, 0] >= (1 - 1e-4) * elapsed[5:]).all()
    assert (forced.elapsed[5:, 0] <= 1.8 * elapsed[5:]).all()


def test_what_outputs_do_between_nodes_is_bounded_where_the_record_jumps() -> None:
    """The velocity's kink at the end of the pulse lies halfway between two nodes."""
    frame = StoreyFrame((1.0,), (1.0,), 1e-6 / 24, 1.0, outputs=("v1",), ground=PULSE)
    flow = LinearFlow(frame, ("E",), 3.7 * 20 / 20, 3.7, Exact())
    model = ModalModel.of_degree(flow, boxes({"E": Interval(0.9e-6 / 24, 1e-6 / 24)}, (0,)), 8)
    values = model.values(np.zeros((1, 1)))[0]
    (proof,) = bound_levels(model, np.zeros(values.shape), np.ones(1), gap=1e-2)
    fine = LinearFlow(frame, ("E",), 3.7, 3.7 / 200, Exact()).values(np.array([[1e-6 / 24]]))[0]
    line = np.linspace(fine[0], fine[-1], len(fine))
    assert 1 <= proof.between_nodes[1, 0] / np.abs(fine - line).max() <= 1.8


def test_what_a_free_wave_does_between_nodes_is_bounded_and_half_would_not_do() -> None:
    """A cosine strays from its chord by h² ω²/8 about its crest, as the bound says."""
    model = spring(1.0, None, 6.0, 0.2)
    (proof,) = bound_levels(model, np.zeros((31, 1)), np.ones(1), gap=1e-2)
    fine = np.cos(np.sqrt(1.1) * np.linspace(0, 6, 6001))  # of the fastest of the box
    line = np.interp(np.linspace(0, 6, 6001), model.flow.time, fine[::200])
    off = np.abs(fine - line).max()
    assert proof.between_nodes[1:, 0].min() / off >= 1
    assert proof.between_nodes.max() / off <= 1.3


def test_the_model_error_counts_on_both_sides_of_the_gap_asked_for() -> None:
    """Bounds are raised and attained values lowered by it; both together stay within the gap."""
    model = spring(1.0, None, 6.0, 0.1)
    error = np.full((61, 1), 0.004)
    (proof,) = bound_levels(model, error, np.ones(1), gap=0.01)
    gap = (proof.upper - proof.attained).max()
    assert 2 * 0.004 < gap <= 0.01
    with pytest.raises(UnprovedError, match="take the method dual"):
        bound_levels(model, error, np.ones(1), gap=0.0079)


def test_an_error_that_rises_and_falls_within_a_step_is_in_what_is_between() -> None:
    """Kicked just after the node before, it has decayed by exp(−h) at the next one."""
    frame = StoreyFrame((1.0,), stiffness=(2.0,), rayleigh=(2.0, 0.0), q0=(1.0,))
    flow = LinearFlow(frame, ("k1",), 3.0, 0.5, Exact())
    model = ModalModel.of_degree(flow, boxes({"k1": Interval(1.999, 2.001)}, (0,)), 3)
    error = np.zeros((7, 1))
    error[3] = 1e-3 * np.exp(-0.5)
    plain, kicked = (
        bound_levels(model, x, np.ones(1), gap=1e-2)[0].between_nodes for x in (0 * error, error)
    )
    assert 1 - 1e-12 <= (kicked - plain)[3, 0] / 1e-3 <= 1.01


def test_what_a_series_of_a_load_leaves_out_is_in_the_errors_of_the_model() -> None:
    """A series is cut short, and said to leave out what it does: half would not cover the error."""
    model, unit = spring(1.0, PULSE, 6.0, 0.1), np.linspace(-1, 1, 21)[:, None]
    (load,), nodes = model.loads, np.arange(61)
    assert proved_error(model)[-1, 0] < 1e-10
    (table,) = load.tables
    table.moment = table.moment[:, :2]
    rate, at = model.eigenvalue.at(unit), (np.repeat(unit, 61, 0), np.tile(nodes, 21))
    series = load.response(np.repeat(rate, 61, 0), at[1])[0].reshape(21, 61)
    missed = load.at_nodes(rate)[..., 0] - series
    largest = response_parts(model, largest_growth(model.eigenvalue, np.ones(1)))[1].waves[0][:, 0]
    table.truncation[0] = (np.abs(missed[:, 1:]) / largest[1:]).max()
    truth = UnitFlow(model.flow, model.boxes).values(unit)[..., 0]
    off = np.abs(model.at(*at, 0 * at[1])[0].reshape(21, 61) - truth).max(0)
    of_values = remainder_bounds(model, np.ones(1), np.ones(1)).rounding[:, 0, 0]
    assert 0.5 < (off / (proved_error(model)[:, 0] + of_values))[1:].max() <= 1


def cube() -> ModalModel:
    """A model of the motion x³ for all times; its third derivative is 6."""
    model = spring(1.0, None, 1.0, 1.0)
    half = polynomials(np.array([0, 0, 0, 0.5])[:, None] + 0j)
    return replace(model, eigenvalue=half * 0.0, coefficient=half[:, None])


def polynomials(coefficients: np.ndarray) -> TaylorModel:
    """Polynomials of one variable, coefficients (terms, n)."""
    parts, degree = tuple(coefficients[:, None]), len(coefficients) - 1
    return TaylorModel(parts, np.zeros(coefficients.shape[1]), 1, degree)


@pytest.mark.parametrize(
    ("start", "gap", "budget"),
    [
        (0.5, 1e-3, 4000),  # about 0 the third derivative alone tells that x³ reaches 1
        (0.0, 1e-3, 1),
        (0.97, 0.1, 4000),  # the first box of x³ holds no more than the gap
    ],
)
def test_branch_and_bound_needs_all_of_the_remainder(start, gap, budget) -> None:
    """From a best point of a cubic, in which half of the remainder would hide the highest value."""
    best = np.full((4, 1), start)  # of two nodes and both sides
    optima = Optima(best, np.array([-1, 1, -1, 1]) * start**3)
    proved, _ = bound_problems(cube(), -np.ones(1), np.ones(1), optima, gap=gap, budget=budget)
    assert 1 <= proved[3] <= 1.02


def least_closed(model: ModalModel) -> np.ndarray:
    """Of each problem the least target below which its whole box [−1, 1] is closed, shape (N,)."""
    ends, count = np.ones(1), 2 * len(model.flow.time)
    frontier = Frontier.whole_box(-ends, ends, count)
    piece = Piece(slice(0, 1), slice(0, count))
    remainder = remainder_bounds(model, -ends, ends)
    low, high = np.full(count, -2.5), np.full(count, 2.5)
    for _ in range(30):
        target = (low + high) / 2
        code = examine_items(model, remainder, target, frontier, piece).code
        low, high = np.where(code, target, low), np.where(code, high, target)
    return high


def turning() -> ModalModel:
    """The motion cos((1 + 0.05 u) t) + u, highest at an end whatever the phase."""
    rate, share = np.array([[1j, 0], [0.05j, 0]]), np.array([[0.5 + 0j, 0], [0, 0.5]])
    plain = spring(1.0, None, 12.0, 0.1)
    return replace(plain, eigenvalue=polynomials(rate), coefficient=polynomials(share)[:, None])


@pytest.mark.parametrize("even", [True, False])
def test_a_box_is_closed_where_its_mode_allows_no_more(even: bool) -> None:
    """At all phases of a mode, of which the bound of the third derivative leaves φ³/6 and a little."""
    model = turning() if even else spring(1.0, None, 12.0, 0.1)
    closed = least_closed(model).reshape(-1, 2)
    values = model.values(np.linspace(-1, 1, 2001)[:, None])[..., 0]
    truth = np.stack([-values.min(0), values.max(0)], 1)
    assert (closed >= truth - 1e-7).all()
    early = model.flow.time <= 6  # up to 0.3 rad from the midpoint, where little is left out
    assert (closed - truth)[early].max() <= 9e-3


def test_rounding_of_late_phases_is_in_the_margin() -> None:
    model, narrow = spring(1.0, None, 1e8, 1e6), np.full(1, 1e-8)
    margin = remainder_bounds(model, -narrow, narrow).rounding[:, 0, 0]
    unit = np.random.default_rng(2).uniform(-narrow, narrow, (200, 1))
    powers = np.longdouble(unit) ** model.eigenvalue.exponents[:, 0]
    phase = powers @ model.eigenvalue.coefficients[:, 0].imag
    growth = powers @ model.eigenvalue.coefficients[:, 0].real
    share = [
        powers @ part[:, 0, 0]
        for part in (model.coefficient.coefficients.real, model.coefficient.coefficients.imag)
    ]
    nodes = np.array([1, 10, 100])
    for node in nodes:
        t = np.longdouble(model.flow.time[node])
        exact = (
            2 * np.exp(growth * t) * (share[0] * np.cos(phase * t) - share[1] * np.sin(phase * t))
        )
        off = np.abs(model.at(unit, np.full(200, node), np.zeros(200, int))[0] - exact)
        assert 0 < off.max() <= margin[node]
        assert off.max() > 1e-3 * margin[node]


def test_concave_bound_is_that_of_the_curvature_it_adds() -> None:
    """x²/2 − y² on [−1, 1]² is at most 1/2, and no shift below 1 makes it concave."""
    g, H, r = np.zeros(2), np.diag([1.0, -2.0]), np.ones(2)
    work, L = np.empty((3, 2)), np.empty((2, 2))
    for shown in (stays_below, stays_below.py_func):  # compiled, and as it is read
        assert shown(g, H, r, 8.01, work, L)
        assert not shown(g, H, r, 0.49, work, L)
