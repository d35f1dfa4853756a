"""Exact trajectories take over from polynomials: optima, values and what may be missing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from alphacut.frame.boxes import Kept
from alphacut.frame.calculus.jet import Array
from alphacut.frame.modal.contest import contest
from alphacut.frame.modal.exact_response import ExactResponse
from alphacut.frame.modal.newton import refine
from alphacut.frame.modal.optima import FEW, Optima, best_of_few, best_of_pool, problems
from alphacut.frame.modal.probes import probe
from alphacut.frame.modal.starting_points import fresh_points, trajectories
from alphacut.fuzzy.progress_bar import Progress, share

CALM_PASSES = 2
"""Passes one after the other that must gain too little before the search ends."""
VALUES = 16e6
"""Most numbers of the trajectories of a pass that are kept at a time: 128 MB."""
PORTIONS = (0.0, 0.1, 0.45, 0.99)
"""Shares of the time after which passes usually begin, for the progress alone."""
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
        kept: Keeps what every pass has found, under `name`; None for nothing.
        name: Of this search among those that are kept.
    """

    small: float
    quiet: float
    passes: int = 8
    graphs: int = 2048
    anew: int = 4096
    seed: int = 0
    kept: Kept | None = None
    name: str = ""

    def run(
        self,
        exact: ExactResponse,
        starts: Sequence[Array],
        lower: Array,
        upper: Array,
        progress: Progress | None = None,
    ) -> tuple[Array, Array, Array, Array]:
        """Upper bounds of (−output, output) over a box, as `ModalSearch.run` returns them.

        The gain is the larger one of the last two passes.

        Args:
            exact: The outputs.
            starts: Unit coordinates to start from, each of shape (T, m, 2, d).
            lower: Lower ends of the box, shape (d,).
            upper: Upper ends.
            progress: Called with the fraction done, if two passes end the search, as is usual.
        """
        *shape, d = starts[0].shape
        found = problems(np.arange(shape[0]), shape[1], d)
        gains: list[Array] = [np.zeros(shape[1])]
        if (upper > lower).any():
            moved, gains = self._begun(exact, found, starts, lower, upper, progress)
            while len(gains) <= self.passes and not self._calm(gains):
                before, count = found.value.copy(), len(gains)
                tick = share(
                    progress, *(PORTIONS[min(k, len(PORTIONS) - 1)] for k in (count, count + 1))
                )
                anew = min(self.anew * 4 ** (count - 1), len(before))
                moved = self._pass(exact, found, moved, lower, upper, (count, anew), tick)
                gains.append((found.value - before).reshape(shape).max((0, 2)))
                self._keep(found, moved, gains)
        else:
            self._offered(exact, found, starts, lower, upper)
        value, left = found.value.reshape(shape), found.left.reshape(shape)
        gained = np.max(gains[-CALM_PASSES:], axis=0)  # one calm pass alone may be luck
        return value, found.point.reshape(*shape, d), left, gained

    def _calm(self, gains: Sequence[Array]) -> bool:
        """Whether the last passes gained too little to go on for."""
        last = gains[1:][-CALM_PASSES:]
        return len(last) == CALM_PASSES and max(gain.max() for gain in last) <= self.quiet

    @staticmethod
    def _offered(
        exact: ExactResponse, found: Optima, starts: Sequence[Array], lower: Array, upper: Array
    ) -> None:
        every = np.arange(len(found.value))
        for points in starts:
            found.offer(exact, np.clip(points.reshape(len(every), -1), lower, upper), every)

    def _begun(
        self,
        exact: ExactResponse,
        found: Optima,
        starts: Sequence[Array],
        lower: Array,
        upper: Array,
        progress: Progress | None,
    ) -> tuple[Array, list[Array]]:
        """Problems moved and gains of each pass, as kept, or after a first pass without fresh."""
        old = self.kept.load(self.name) if self.kept is not None else None
        if old is not None:
            for name in ("point", "value", "left"):
                getattr(found, name)[:] = old[name]
            return old["moved"], list(old["gains"])
        self._offered(exact, found, starts, lower, upper)
        every, tick = np.arange(len(found.value)), share(progress, *PORTIONS[:2])
        moved = self._pass(exact, found, every, lower, upper, (0, 0), tick)
        gains: list[Array] = [np.zeros(len(exact.outputs))]
        self._keep(found, moved, gains)
        return moved, gains

    def _keep(self, found: Optima, moved: Array, gains: Sequence[Array]) -> None:
        if self.kept is not None:
            state = {name: getattr(found, name) for name in ("point", "value", "left")}
            self.kept.save(self.name, {**state, "moved": moved, "gains": np.array(gains)})

    def _pass(
        self,
        exact: ExactResponse,
        found: Optima,
        moved: Array,
        lower: Array,
        upper: Array,
        effort: tuple[int, int],
        tick: Progress,
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
        best = best_of_pool(fresh, values, nodes, 1)[0]
        _take(found, best)
        tick(0.1)
        if count:
            some = rng.permutation(len(before))[:anew]
            rivals = [best]
            rivals += [best_of_few(fresh, values, nodes, few, rng) for few in FEW]
            for place, rival in enumerate(rivals):
                refine(exact, rival, some, lower, upper, self.small)
                _take(found, rival)
                tick(0.1 + 0.08 * place)
            for place, rival in enumerate(rivals):
                self._carried(exact, found, rival, lower, upper)
                tick(0.42 + 0.08 * place)
        open_ = np.arange(len(before)) if not count else np.flatnonzero(found.value > before)
        refine(exact, found, open_, lower, upper, self.small)
        tick(0.75)
        contest(exact, found, lower, upper, self.small, ROUNDS)
        tick(0.9)
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
