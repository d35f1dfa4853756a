"""Searches follow basins whose samples stand behind: what is found on hills that are known."""

from typing import ClassVar, cast

import numpy as np
import pytest

from alphacut.frame.calculus.jet import Array
from alphacut.frame.modal.contest import contest
from alphacut.frame.modal.exact_response import ExactResponse
from alphacut.frame.modal.model import ModalModel
from alphacut.frame.modal.newton import refine
from alphacut.frame.modal.optima import Optima, best_of_few, problems
from alphacut.frame.modal.polish import Polish
from alphacut.frame.modal.probes import probe
from alphacut.frame.modal.search import ModalSearch, second_pass

CENTRES = np.array([[-0.7, -0.7], [0.7, -0.7], [-0.7, 0.7], [0.6, 0.6]])
BROAD, THIN = 0.45, 0.12
HEIGHTS = np.array([1.0, 0.99, 0.98, 1.06])
"""Three broad hills and a thin one, the highest: few samples meet it, and none near its top."""
ENDS = np.ones(2)


class Hills:
    """The same sum of bells of two parameters at every node, or of heights that change."""

    secant: ClassVar[bool] = False
    bent: ClassVar[bool] = False
    fastest = 1.0
    outputs = ("q1",)

    def __init__(self, nodes: int, thin: float = THIN, slopes: Array | None = None) -> None:
        self.time = 0.1 * np.arange(nodes)
        self.width = np.array([BROAD, BROAD, BROAD, thin])
        self.slopes = np.zeros(4) if slopes is None else slopes

    def at(self, unit: Array, node: Array, output: Array) -> tuple[Array, Array, Array]:
        del output
        heights = HEIGHTS + self.slopes * node[:, None]
        away = (unit[:, None] - CENTRES) / self.width[:, None]
        bell = heights * np.exp(-(away**2).sum(-1))
        pull = -2 * away / self.width[:, None]
        g = (bell[..., None] * pull).sum(1)
        bend = pull[..., :, None] * pull[..., None, :]
        bend = bend - (2 / self.width**2)[:, None, None] * np.eye(2)
        return bell.sum(-1), g, (bell[..., None, None] * bend).sum(1)

    def value_at(self, unit: Array, node: Array, output: Array) -> Array:
        return self.at(unit, node, output)[0]

    def values(self, unit: Array) -> Array:
        node = np.arange(len(self.time))
        rows = [self.at(unit, np.full(len(unit), k), node)[0] for k in node]
        return np.stack(rows, 1)[..., None]


def on(hills: Hills) -> ExactResponse:
    return cast(ExactResponse, hills)


def top(nodes: int, point: Array, value: float) -> Optima:
    """All problems at one point so far."""
    found = problems(np.arange(nodes), 1, 2)
    found.point[:], found.value[:] = point, np.where(found.side > 0, value, 1.0)
    return found


def broad_top(hills: Hills) -> Optima:
    node = np.zeros(1, int)
    return top(len(hills.time), CENTRES[0], float(hills.value_at(CENTRES[:1], node, node)[0]))


def test_a_polish_solves_anew_from_basins_that_stand_behind() -> None:
    hills = Hills(3)
    starts = [np.broadcast_to(CENTRES[0], (3, 1, 2, 2))]
    reached = Polish(1e-9, 1e-9, graphs=256, seed=4).run(on(hills), starts, -ENDS, ENDS)
    assert (reached[0][:, 0, 1] > 1.05).all()
    assert np.abs(reached[1][:, 0, 1] - CENTRES[3]).max() < 0.01


def test_a_second_calm_pass_is_asked_for() -> None:
    hills = Hills(3, 0.045)
    starts = [np.broadcast_to(CENTRES[0], (3, 1, 2, 2))]
    once = Polish(1e-9, 1e-9, passes=1, graphs=256, seed=31).run(on(hills), starts, -ENDS, ENDS)
    assert once[3].max() <= 1e-9  # a pass that meets nothing
    found = Polish(1e-9, 1e-9, graphs=256, seed=31).run(on(hills), starts, -ENDS, ENDS)
    assert (found[0][:, 0, 1] > 1.05).all()
    for passes in (2, 3):  # the second gains, the third does not: one calm pass says little
        short = Polish(1e-9, 1e-9, passes=passes, graphs=256, seed=31)
        assert short.run(on(hills), starts, -ENDS, ENDS)[3].max() > 0.04


def test_starts_out_of_few_points_reach_a_hill_that_hides_below_a_corner() -> None:
    hills = Hills(1)
    pool = np.vstack([np.tile(CENTRES[0], (60, 1)), np.tile(CENTRES[3] + 0.05, (40, 1))])
    values, nodes = hills.values(pool), np.zeros(200, int)
    assert values[0] > values[-1]  # the lower hill's top before the higher one's side
    many = np.broadcast_to(values, (100, 200, 1))
    rng = np.random.default_rng(3)
    for few, least, most in ((1, 0.3, 0.5), (4, 0.01, 0.08), (64, 0.0, 0.0)):
        found = best_of_few(pool, many, nodes, few, rng)
        on_top = found.value[found.side > 0] < values[0, 0, 0]
        assert least <= on_top.mean() <= most


def test_optima_of_other_basins_are_carried_to_the_next_node() -> None:
    hills = Hills(3)
    found, rival = broad_top(hills), broad_top(hills)
    upper = 2 * np.arange(3) + 1
    rival.point[upper[1]], rival.value[upper[1]] = CENTRES[3], 1.06
    Polish(1e-9, 1e-9)._carried(on(hills), found, rival, -ENDS, ENDS)
    assert (found.value[upper[[0, 2]]] > 1.05).all()
    assert found.value[upper[1]] < 1.01  # only the nodes beside


def test_lines_through_an_optimum_meet_the_hill_beside_it() -> None:
    hills = Hills(2)
    node = np.zeros(1, int)
    found = top(2, CENTRES[1], float(hills.value_at(CENTRES[1:2], node, node)[0]))
    guide = cast(ModalModel, hills)
    rng = np.random.default_rng(0)
    improved = probe(on(hills), guide, found, -ENDS, ENDS, 1e-9, rng)
    assert set(improved) == set(np.flatnonzero(found.side > 0))
    assert np.abs(found.point[improved] - CENTRES[0]).max() < 0.05


def test_an_independent_pass_follows_basins_that_stand_behind() -> None:
    hills = Hills(3)
    found = broad_top(hills)
    search = ModalSearch(samples=128, starts=1, seed=8)
    improved = second_pass(on(hills), found, -ENDS, ENDS, search, 1)
    assert improved[found.side > 0].all()
    assert (found.value[found.side > 0] > 1.05).all()


def test_either_side_of_a_jump_is_tried_on_the_other() -> None:
    hills = Hills(9, slopes=np.array([0.0, 0.2, 0.0, 0.0]))
    found, upper = top(9, CENTRES[0], 1.0), 2 * np.arange(9) + 1
    found.point[upper[-1]] = CENTRES[1]
    found.value[:] = found.side * hills.value_at(found.point, found.node, found.output)
    contest(on(hills), found, -ENDS, ENDS, 1e-9)
    assert np.abs(found.point[upper[1:]] - CENTRES[1]).max() < 0.05


@pytest.mark.parametrize("passes", [1, 8])
def test_what_the_last_pass_gained_is_told(passes: int) -> None:
    hills = Hills(3)
    starts = [np.broadcast_to(CENTRES[0], (3, 1, 2, 2))]
    polish = Polish(1e-9, 1e-9, passes=passes, graphs=256, seed=4)
    value, _, _, gained = polish.run(on(hills), starts, -ENDS, ENDS)
    before = Polish(1e-9, 1e-9, passes=0, graphs=256, seed=4).run(on(hills), starts, -ENDS, ENDS)
    if passes == 1:
        assert gained[0] == pytest.approx((value - before[0]).max())
        assert gained[0] > 0.04
    else:
        assert gained[0] <= 1e-9


class Plane(Hills):
    """A slope so slight that the first trust region promises less than is asked for."""

    def at(self, unit: Array, node: Array, output: Array) -> tuple[Array, Array, Array]:
        value = 1e-3 * unit.sum(1)
        return value, np.full(unit.shape, 1e-3), np.zeros((*unit.shape, 2))


def test_what_a_trust_region_holds_back_is_judged_by_the_whole_box() -> None:
    found = top(1, -ENDS, -2e-3)
    found.value[:] = found.side * -2e-3
    refine(on(Plane(1)), found, np.flatnonzero(found.side > 0), -ENDS, ENDS, 1e-3)
    assert found.value[found.side > 0] == pytest.approx(2e-3)


class Bowl(Hills):
    """A concave quadratic whose second derivatives only the change of its gradients tells."""

    secant: ClassVar[bool] = True
    bend = np.array([[-2.0, 0.7], [0.7, -1.0]])
    evaluated = 0

    def at(self, unit: Array, node: Array, output: Array) -> tuple[Array, Array, Array]:
        self.evaluated += 1
        away = unit - 0.3
        g = away @ self.bend
        return 1 + (g * away).sum(1) / 2, g, np.zeros((*unit.shape, 2))


def test_second_derivatives_are_learned_from_gradients() -> None:
    bowl, found = Bowl(1), top(1, np.array([-0.5, 0.9]), -np.inf)
    refine(on(bowl), found, np.flatnonzero(found.side > 0), -ENDS, ENDS, 1e-9)
    assert found.value[found.side > 0] == pytest.approx(1.0, abs=1e-8)
    assert bowl.evaluated <= 5  # eight where a correction comes a step late
