"""Bounds over parts of a box hold there, and so do those of what is pruned."""

import numpy as np
import pytest

from alphacut.frame import Exact, LinearFlow
from alphacut.frame.bounds.box import Box
from alphacut.frame.bounds.level import OutputBounds
from alphacut.frame.bounds.pruning import prune_ends
from tests.frame.bounds.test_dual_proof import each_storey, near, record, storeys

TIME = np.arange(0, 4.01, 0.05)
MODEL = storeys(3, damping_ratio=0.03, ground=record(), outputs=("drift3", "a3"))
FUZZY = each_storey(3, 0.1, 0.07) | {"zeta": near(0.03, 0.3)}
CUT = np.array([number.support for number in FUZZY.values()])
SIDE = 1


@pytest.fixture
def box():
    return Box(MODEL, tuple(FUZZY), TIME, *CUT.T)


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
        level.models.oscillators, part.models.oscillators, part.grids, strict=True
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
    values, unit = motions(box, -np.ones(7), np.ones(7), np.random.default_rng(1), 4000)
    is_pruned = ~((low <= unit) & (unit <= high)).all(1)
    assert (values[is_pruned][:, above, 0].max(0) <= pruned + 1e-12).all()
