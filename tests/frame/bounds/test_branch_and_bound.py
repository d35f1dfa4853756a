"""Branch and bound over a box, from the examination of its parts to what lies between nodes, on cases
where the bounds nearly are the truth: with half of an error of the model it would be passed."""

from dataclasses import replace

import numpy as np
import pytest

from alphacut.frame import Proof, StoreyFrame, UnprovedError, envelope
from alphacut.frame.bounds.branch_and_bound import (
    Frontier,
    Optima,
    Piece,
    bound_problems,
    examine_items,
)
from alphacut.frame.bounds.kernel import BoxTables, Items, RemainderBounds, examine, stays_below
from alphacut.frame.bounds.model_error import remainder_bounds
from alphacut.frame.methods.proof import bound_levels
from alphacut.fuzzy import Interval
from tests.frame.bounds.test_model_error import PULSE, modal_model, polynomials, spring
from tests.frame.motions import exact_motions


def test_what_outputs_do_between_nodes_is_bounded_where_the_record_jumps() -> None:
    """The velocity's kink at the end of the pulse lies halfway between two nodes."""
    frame = StoreyFrame((1.0,), (1.0,), 1e-6 / 24, 1.0, outputs=("v1",), ground=PULSE)
    inputs, given = {"E": Interval(0.9e-6 / 24, 1e-6 / 24)}, {"duration": 3.7, "alpha": (0,)}
    found = envelope(frame, inputs, Proof(gap=1e-2), step=3.7, **given)
    fine = exact_motions(frame, np.array([[1e-6 / 24]]), inputs, 3.7, 3.7 / 200)[0]
    line = np.linspace(fine[0], fine[-1], len(fine))
    assert 1 <= found.between[1, 0] / np.abs(fine - line).max() <= 1.8


def test_what_a_free_wave_does_between_nodes_is_bounded_and_half_would_not_do() -> None:
    """A cosine strays from its chord by h² ω²/8 about its crest, as the bound says."""
    frame = StoreyFrame((1.0,), stiffness=(1.0,), q0=(1.0,))
    inputs, given = {"k1": Interval(0.9, 1.1)}, {"duration": 6.0, "step": 0.2, "alpha": (0,)}
    found = envelope(frame, inputs, Proof(gap=1e-4), **given)
    fine = np.cos(np.sqrt(1.1) * np.linspace(0, 6, 6001))  # of the fastest of the box
    line = np.interp(np.linspace(0, 6, 6001), found.time, fine[::200])
    off = np.abs(fine - line).max()
    assert found.between[1:, 0].min() / off >= 1
    assert found.between.max() / off <= 1.3


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
    found = modal_model(frame, {"k1": Interval(1.999, 2.001)}, 3, duration=3.0, step=0.5)
    error = np.zeros((7, 1))
    error[3] = 1e-3 * np.exp(-0.5)
    plain, kicked = (
        bound_levels(found, x, np.ones(1), gap=1e-2)[0].between_nodes for x in (0 * error, error)
    )
    assert 1 - 1e-12 <= (kicked - plain)[3, 0] / 1e-3 <= 1.01


def cube():
    """A model of the motion x³ for all times; its third derivative is 6."""
    model = spring(1.0, None, 1.0, 1.0)
    half = polynomials(np.array([0, 0, 0, 0.5])[:, None] + 0j)
    return replace(model, eigenvalue=half * 0.0, coefficient=half[:, None])


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


def least_closed(model):
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


def turning():
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


def test_concave_bound_is_that_of_the_curvature_it_adds() -> None:
    """x²/2 − y² on [−1, 1]² is at most 1/2, and no shift below 1 makes it concave."""
    g, H, r = np.zeros(2), np.diag([1.0, -2.0]), np.ones(2)
    work, L = np.empty((3, 2)), np.empty((2, 2))
    for shown in (stays_below, stays_below.py_func):  # compiled, and as it is read
        assert shown(g, H, r, 8.01, work, L)
        assert not shown(g, H, r, 0.49, work, L)


def code_of_box(*, slope, bend, third, slope_error, radius, target, is_at_ends):
    """Code of one box |x| ≤ `radius` of one input, of one output at one node, on its upper side.

    About its centre the output is slope · x + bend · x²/2, with a third derivative of at most
    `third` in size, and a slope that is wrong by `slope_error` at most.
    """
    table = np.array([0.0, slope, bend]).reshape(1, 1, 1, 3)
    found = examine(
        Items(np.array([0, 1]), np.array([0, 1]), node=np.array([0]), column=np.array([1])),
        BoxTables(np.full((1, 1), radius), np.full((1, 2, 1), is_at_ends), table),
        np.ones((1, 1)),
        RemainderBounds(
            third=np.full((1, 1, 1, 1, 1), third),
            rounding=np.array([0.0, slope_error]).reshape(1, 1, 2),
        ),
        np.array([np.inf, target]),
    )
    return found.code[0]


@pytest.mark.parametrize("part", ["bend", "third", "slope_error"])
@pytest.mark.parametrize("is_at_ends", [False, True])
def test_a_box_whose_highest_point_lies_inside_is_bisected(part, is_at_ends, rng):
    """It is neither left to its neighbour nor confined to its end, though it rises at its centre.

    The slope falls from the centre to the upper end, by one part of what it may change by, to less
    than zero; half of that part would not suffice. So the output is highest inside, or at the lower
    end where its slope is wrong throughout.
    """
    radius, fall = rng.uniform(0.1, 10, 2)
    slope = fall * rng.uniform(0.55, 0.95)
    x = radius * np.linspace(-1, 1, 20001)
    # by each part the slope at `radius` is smaller than that at the centre by `fall`
    parts = {
        "bend": {"bend": -fall / radius, "third": 0.0, "slope_error": 0.0},
        "third": {"bend": 0.0, "third": 2 * fall / radius**2, "slope_error": 0.0},
        "slope_error": {"bend": 0.0, "third": 0.0, "slope_error": fall},
    }[part]
    output = (slope - parts["slope_error"]) * x
    output += parts["bend"] * x**2 / 2 - parts["third"] * x**3 / 6
    target = (output.max() + max(output[-1], 0.0)) / 2
    code = code_of_box(slope=slope, radius=radius, target=target, is_at_ends=is_at_ends, **parts)
    assert code == 1
