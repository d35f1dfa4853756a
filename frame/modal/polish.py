"""Exact trajectories take over from polynomials: optima, values and what may be missing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from alphacut.frame.calculus.jet import Array
from alphacut.frame.modal.contest import contest
from alphacut.frame.modal.exact_response import ExactResponse
from alphacut.frame.modal.newton import refine
from alphacut.frame.modal.optima import FEW, Optima, best_of_few, best_of_pool, problems
from alphacut.frame.modal.probes import probe
from alphacut.frame.modal.starting_points import fresh_points, trajectories

CALM_PASSES = 2
"""Passes one after the other that must gain too little before the search ends."""
VALUES = 16e6
"""Most numbers of the trajectories of a pass that are kept at a time: 128 MB."""
ROUNDS = 3
"""Rounds of a contest of optima on either side of a jump, in a pass."""
BEHIND = 0.1
"""Share of the largest bound by which an optimum carried from the next node may lie behind."""
APART = 0.1
"""Share of the box's width from which on two points may lie in different basins."""


@dataclass(frozen=True)
class Polish:
    """Newton's method by exact gradients from the optima of polynomials, and independent passes.

    Each pass offers whole exact trajectories to all nodes, of points where the last pass moved and
    of fresh ones, and solves some problems anew from the best of the fresh ones alone.

    Args:
        small: Gain that Newton's method leaves, in units of the outputs.
        quiet: Gain of a pass that is too little to go on for, in units of the outputs.
        passes: Most passes.
        graphs: Trajectories of moved points, and as many fresh ones, in a pass.
        anew: Problems solved anew in the first pass; four times as many in each further one.
        seed: Of the fresh points.
    """

    small: float
    quiet: float
    passes: int = 8
    graphs: int = 2048
    anew: int = 4096
    seed: int = 0

    def run(
        self, exact: ExactResponse, starts: Sequence[Array], lower: Array, upper: Array
    ) -> tuple[Array, Array, Array, Array]:
        """Upper bounds of (−output, output) over a box, as `ModalSearch.run` returns them.

        The gain is the larger one of the last two passes.

        Args:
            exact: The outputs.
            starts: Unit coordinates to start from, each of shape (T, m, 2, d).
            lower: Lower ends of the box, shape (d,).
            upper: Upper ends.
        """
        *shape, d = starts[0].shape
        found = problems(np.arange(shape[0]), shape[1], d)
        every, gains = np.arange(len(found.value)), [np.zeros(shape[1])]
        for points in starts:
            found.offer(exact, np.clip(points.reshape(-1, d), lower, upper), every)
        if (upper > lower).any():
            moved = self._pass(exact, found, every, lower, upper, (0, 0))
            anew, calm = self.anew, 0
            for count in range(1, self.passes + 1):
                before = found.value.copy()
                moved = self._pass(exact, found, moved, lower, upper, (count, anew))
                gains.append((found.value - before).reshape(shape).max((0, 2)))
                calm = calm + 1 if gains[-1].max() <= self.quiet else 0
                if calm == CALM_PASSES:
                    break
                anew = min(4 * anew, len(before))
        value, left = found.value.reshape(shape), found.left.reshape(shape)
        gained = np.max(gains[-CALM_PASSES:], axis=0)  # one calm pass alone may be luck
        return value, found.point.reshape(*shape, d), left, gained

    def _pass(
        self,
        exact: ExactResponse,
        found: Optima,
        moved: Array,
        lower: Array,
        upper: Array,
        effort: tuple[int, int],
    ) -> Array:
        """Improve `found`; returns the problems that did. Effort: number of pass, solved anew."""
        count, anew = effort
        rng, before = np.random.default_rng((self.seed, 7, count)), found.value.copy()
        nodes = np.arange(len(exact.time))
        graphs = int(np.clip(VALUES / (len(nodes) * len(exact.outputs)), 256, self.graphs))
        known = np.unique(np.round(found.point[moved], 3), axis=0)
        known = np.clip(rng.permutation(known)[:graphs], lower, upper)
        if len(known):
            _take(found, best_of_pool(known, trajectories(exact, known), nodes, 1)[0])
        fresh = fresh_points(rng, lower, upper, graphs)
        values = trajectories(exact, fresh)
        _take(found, best_of_pool(fresh, values, nodes, 1)[0])
        if count:
            some = rng.permutation(len(before))[:anew]
            rivals = [best_of_pool(fresh, values, nodes, 1)[0]]
            rivals += [best_of_few(fresh, values, nodes, few, rng) for few in FEW]
            for rival in rivals:
                refine(exact, rival, some, lower, upper, self.small)
                _take(found, rival)
            for rival in rivals:
                self._carried(exact, found, rival, lower, upper)
        open_ = np.arange(len(before)) if not count else np.flatnonzero(found.value > before)
        refine(exact, found, open_, lower, upper, self.small)
        contest(exact, found, lower, upper, self.small, ROUNDS)
        if count and exact.bent:
            probe(exact, exact.model, found, lower, upper, self.small, rng)
        return np.flatnonzero(found.value > before)

    def _carried(
        self, exact: ExactResponse, found: Optima, rival: Optima, lower: Array, upper: Array
    ) -> None:
        """Solve problems anew from the optima of other basins at the nodes beside."""
        grid = np.arange(len(found.value)).reshape(len(exact.time), -1)
        least = found.value - BEHIND * np.abs(found.value).max()
        for here, there in ((grid[1:], grid[:-1]), (grid[:-1], grid[1:])):
            onto, from_ = here.ravel(), there.ravel()
            apart = np.abs(rival.point[from_] - found.point[onto]).max(1)
            new = (apart > APART * (upper - lower).max()) & (rival.value[from_] > least[onto])
            carried = found.take(onto[new])
            carried.value[:] = -np.inf
            carried.offer(exact, rival.point[from_[new]], np.arange(len(carried.value)))
            open_ = np.flatnonzero(carried.value > least[onto[new]])
            refine(exact, carried, open_, lower, upper, self.small)
            found.offer(exact, carried.point, onto[new])


def _take(found: Optima, rival: Optima) -> None:
    better = rival.value > found.value + 1e-12
    found.point[better], found.value[better] = rival.point[better], rival.value[better]
