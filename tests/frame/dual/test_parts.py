"""Bounds over parts of a box hold there, and what is taken away is not forgotten."""

from functools import partial

import numpy as np
import pytest

from alphacut.frame import envelope
from alphacut.frame.dual import parts
from alphacut.frame.dual.box import Box
from alphacut.frame.dual.level import Problem
from alphacut.frame.dual.parts import Peak
from alphacut.frame.dual.proof import DualProof
from alphacut.frame.dynamics.flow import LinearFlow
from alphacut.frame.dynamics.integrators import Exact
from tests.frame.dual.test_dual_proof import each_storey, near, record, storeys

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


@pytest.mark.parametrize("seed", range(3))
def test_models_over_a_part_bound_motions_there(box, seed):
    rng = np.random.default_rng(seed)
    ends = np.sort(rng.uniform(-1, 1, (2, 7)), axis=0)
    values, unit = motions(box, *ends, rng)
    level = box.level()
    part, own = level.within(*ends), 2 * (unit - ends[0]) / (ends[1] - ends[0]) - 1
    for whole, narrow, grid in zip(level.single, part.single, part.tables.grids, strict=True):
        assert narrow.omega.at(own) == pytest.approx(whole.omega.at(unit), rel=1e-12)
        first, last = narrow.places(grid)[:2]
        inside = (grid.omega[first] <= narrow.omega.at(own)) & (
            narrow.omega.at(own) <= grid.omega[last]
        )
        assert inside.all()
        assert last - first < len(grid.omega) - 1
    for o in range(2):
        problem = Problem.of(part, o, SIDE, 1e-9)
        problem.run(np.arange(len(TIME)), 4, 20, 0.0, 0.0)
        assert (values[:, :, o].max(0) <= problem.out[0] + 1e-12).all()


def peak_of(box, enough):
    """The nodes near the peak of the first output, and the largest motion known."""
    values, _ = motions(box, -np.ones(7), np.ones(7), np.random.default_rng(0))
    most, top = values[:, :, 0].max(0), values[:, :, 0].max()
    nodes = np.flatnonzero(most > 0.8 * top)
    every = np.zeros(len(nodes), int)
    exact = partial(box.attained, node=nodes, output=every)
    outer = np.full(len(nodes), 10 * top)
    peak = Peak(partial(box.part, 0, nodes), exact, 7, SIDE, outer, top, enough * top)
    return peak, nodes


@pytest.mark.parametrize("little", [0.0, 99.0])
def test_what_is_taken_away_is_bounded(box, monkeypatch, little):
    monkeypatch.setattr(parts, "LITTLE", little)
    peak, nodes = peak_of(box, 0.05)
    part = peak._part(-np.ones(7), np.ones(7), peak.outer)
    tried, of_piece = [], peak._of_piece

    def noted(_, whole, piece, slabs):
        tried.append((*piece, of_piece(whole, piece, slabs)))
        return tried[-1][-1]

    monkeypatch.setattr(Peak, "_of_piece", noted)
    ends, lost = peak._shaved(part)
    away = [one for one in tried if one[-1].max() <= peak.top + peak.enough]
    assert len(away) > 2
    assert (lost == np.max([bound for _, _, bound in away], axis=0)).all()
    values, unit = motions(box, -np.ones(7), np.ones(7), np.random.default_rng(1), 4000)
    left = np.any([within(unit, low, high) for low, high, _ in ends], axis=0)
    for low, high, bound in away:
        inside = within(unit, low, high)
        most = values[inside][:, nodes, 0].max(0)
        assert (most <= bound + 1e-12).all()
        left |= inside
    assert left.all()


def test_the_largest_bound_of_what_is_taken_away_is_kept(box, monkeypatch):
    peak, nodes = peak_of(box, 0.05)
    part = peak._part(-np.ones(7), np.ones(7), peak.outer)
    falling = iter(np.linspace(peak.top, 0, 99))
    monkeypatch.setattr(Peak, "_of_piece", lambda *_: np.full(len(nodes), next(falling)))
    assert (peak._shaved(part)[1] >= 0.999 * peak.top).all()


def within(unit, low, high):
    """Which points lie in a part."""
    return ((low <= unit) & (unit <= high)).all(1)


@pytest.mark.parametrize("little", [0.0, 99.0])
def test_bounds_keep_what_is_taken_away_and_what_is_left(box, monkeypatch, little):
    monkeypatch.setattr(parts, "LITTLE", little)  # never halved, or always
    monkeypatch.setattr(parts, "HOPE", -99.0)
    monkeypatch.setattr(parts, "SLABS", 1)
    monkeypatch.setattr(parts, "STEPS", 3)
    peak, nodes = peak_of(box, 0.01)
    losts, shaved = [], peak._shaved
    monkeypatch.setattr(
        Peak, "_shaved", lambda _, part: losts.append((out := shaved(part))[1]) or out
    )
    bounds = peak.bounds(12)
    values, _ = motions(box, -np.ones(7), np.ones(7), np.random.default_rng(2), 2000)
    assert len(losts) > 1
    assert (bounds >= np.max(losts, axis=0)).all()
    assert (values[:, nodes, 0].max(0) <= bounds + 1e-12).all()
    assert (peak.value <= bounds).all()
    assert bounds.max() < peak.outer.max()


def test_parts_close_the_gap_of_a_peak():
    given = {"duration": 4.0, "step": 0.05, "alpha": (0,), "progress": False}
    wide, narrow = (
        envelope(MODEL, FUZZY, method=DualProof(gap=1e-4, peaks=peaks), **given)
        for peaks in (1.0, 3e-3)
    )
    assert narrow.facts["gap_of_peaks"] <= 3e-3 < wide.facts["gap_of_peaks"]
    assert (narrow.upper <= wide.upper + 1e-12).all()
    assert (narrow.upper >= wide.inner.upper).all()
