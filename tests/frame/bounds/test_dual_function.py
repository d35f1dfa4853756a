"""The dual function of models over a box: for all multipliers it bounds all motions, in whole boxes,
in parts of them and in what is pruned."""

import numpy as np
import pytest

from alphacut.frame import Exact, LinearFlow, UnprovedError
from alphacut.frame.bounds import dual_function
from alphacut.frame.bounds.box import Box, prune_ends
from alphacut.frame.bounds.level import OutputBounds
from tests.frame.bounds.test_dual_proof import CASES, each_storey, near, record, storeys
from tests.frame.motions import exact_motions, random_points

TIME = np.arange(0, 2.01, 0.05)
MODEL = storeys(3, damping_ratio=0.03, ground=record(), outputs=("drift3", "a3"))
FUZZY = each_storey(3, 0.1, 0.07) | {"zeta": near(0.03, 0.3)}
SIDE = 1


def box_of(model, fuzzy, time):
    """The widest box of fuzzy inputs."""
    return Box(model, tuple(fuzzy), time, *np.array([x.support for x in fuzzy.values()]).T)


def level_of(model, fuzzy, time):
    """Models over the widest box."""
    return box_of(model, fuzzy, time).level()


def test_any_multipliers_bound_any_motion(rng):
    model, fuzzy = CASES["record"]
    time = np.arange(0, 4.01, 0.5)
    level = level_of(model, fuzzy, time)
    values = exact_motions(model, random_points(fuzzy, 200, rng), fuzzy, 4.0, 0.5)
    for o in range(len(level.modes.orders)):
        for s, side in enumerate((-1.0, 1.0)):
            problem = OutputBounds.initial(level, o, s, 1.0)
            columns, rows = problem.data.grid_points.astype(int)
            whole = np.tile([0, columns - 1, 0, rows - 1], (len(level.modes.oscillators), 1))
            for node in range(1, len(time)):
                size = np.abs(values[:, node, o]).max() * 10.0 ** rng.uniform(-2, 1)
                mu = size * rng.normal(size=len(problem.data.linear))
                bound = dual_function.dual_value(
                    mu, whole, node, side, problem.data, np.empty(len(mu)), np.empty(7)
                )
                bound += problem.constant[:, node].sum()
                bound += dual_function.cubic_bound(mu, problem.data)
                assert (side * values[:, node, o] <= bound).all()


def test_the_quadratic_over_a_box_is_bounded(rng):
    for _ in range(100):
        linear, bend = rng.normal(size=5) * rng.choice([0.1, 1, 5]), rng.normal(size=15)
        u = np.empty(5)
        bound = dual_function.box_maximum(linear, bend, u)
        own = np.vstack([rng.uniform(-1, 1, (300, 5)), rng.choice([-1.0, 1.0], (300, 5))])
        both = own[:, np.triu_indices(5)[0]] * own[:, np.triu_indices(5)[1]]
        assert (own @ linear + both @ bend <= bound + 1e-12).all()
        assert (np.abs(u) <= 1).all()
    corner = dual_function.box_maximum(np.full(5, 40.0), bend, u)
    assert corner == pytest.approx(200 + bend.sum())


def test_half_of_the_cubic_part_would_not_do():
    """Where the mass alone varies, by 10 %."""
    model = storeys(1, damping_ratio=0.03, v0=(1.0,))
    level = level_of(model, {"m1": near(6e4, 0.1)}, np.array([0.0, 0.1]))
    data = OutputBounds.initial(level, 0, SIDE, 1.0).data
    whole, mu, u = np.array([[0, 0, 0, 0]]), np.array([1.0, 0, 0]), np.empty(1)
    bound = dual_function.dual_value(mu, whole, 1, 1.0, data, np.empty(3), u) + data.omega[0, 0]
    bound += dual_function.cubic_bound(mu, data)
    e = data.participation[0, 0] * data.table[0, 0, 1, 0] + abs(
        data.participation_radius[0, 0] * data.table[0, 0, 1, 0]
    )
    exact = (0.9**-0.5 - 1) * data.midpoint[0, 0] / data.radius[0, 0]
    assert exact <= bound - e <= exact + np.abs(data.cubic[0]).sum() / 2


@pytest.mark.parametrize("wrong", [np.nan, -np.inf, 1e101])
def test_models_that_are_not_finite_are_refused(wrong):
    with pytest.raises(UnprovedError, match="linear is not finite"):
        dual_function.require_in_range({"table": np.ones(2), "linear": np.array([1.0, wrong])})


@pytest.mark.parametrize("gain", [np.nan, np.inf, 1e300])
def test_a_descent_ends_before_its_multipliers_overflow(gain):
    mu, gradient = np.zeros(2), np.array([1e-6, 0.0])
    assert not dual_function.subgradient_step(mu, gradient, np.zeros(2), gain, 1e-9)


@pytest.fixture
def box():
    return box_of(MODEL, FUZZY, TIME)


def motions(box, low, high, rng, count=400):
    """Exact motions (S, T, m) at corners and points of a part, and their coordinates (S, d)."""
    unit = rng.uniform(0, 1, (count, len(low)))
    unit[::2] = unit[::2].round()
    unit = low + unit * (high - low)
    flow = LinearFlow(MODEL, list(FUZZY), TIME[-1], TIME[1], Exact())
    return flow.values(box.inputs(unit)), unit


def test_models_over_a_part_bound_motions_there(box, rng):
    ends = np.sort(rng.uniform(-1, 1, (2, 7)), axis=0)
    values, unit = motions(box, *ends, rng)
    level = box.level()
    part, own = level.on_subbox(*ends), 2 * (unit - ends[0]) / (ends[1] - ends[0]) - 1
    for whole, narrow, grid in zip(
        level.modes.oscillators, part.modes.oscillators, part.grids, strict=True
    ):
        assert narrow.omega.at(own) == pytest.approx(whole.omega.at(unit), rel=1e-12)
        first, last = narrow.table_cell(grid)[:2]
        inside = (grid.omega[first] <= narrow.omega.at(own)) & (
            narrow.omega.at(own) <= grid.omega[last]
        )
        assert inside.all()
        assert last - first < len(grid.omega) - 1
    for o in range(2):
        problem = OutputBounds.initial(part, o, SIDE, 1e-9)
        problem.improve(np.arange(len(TIME)), problem.effort(4, 20))
        assert (values[:, :, o].max(0) <= problem.upper + 1e-12).all()


def test_what_is_pruned_is_bounded(box):
    values, _ = motions(box, -np.ones(7), np.ones(7), np.random.default_rng(0))
    most, top = values[:, :, 0].max(0), values[:, :, 0].max()
    level, above = box.level(), np.flatnonzero(most > 0.8 * top)
    problem = OutputBounds.initial(level, 0, SIDE, 0.05 * top, top)
    problem.improve(np.arange(len(TIME)), problem.effort(24, 40, 1.0))
    low, high, pruned, fractions = prune_ends(level, problem, above)
    assert fractions.sum() == pytest.approx(1.0)
    assert (np.maximum(low + 1, 1 - high) > 0).sum() > 2
    assert pruned.max() <= 1.05 * top
    values, unit = motions(box, -np.ones(7), np.ones(7), np.random.default_rng(1), 2000)
    is_pruned = ~((low <= unit) & (unit <= high)).all(1)
    assert (values[is_pruned][:, above, 0].max(0) <= pruned + 1e-12).all()
