"""Global optimisation of the modal model over a box, for all nodes, outputs and sides together.

Samples of the whole box start Newton's method on every stride-th node; what is found there is tried
at the nodes around (the idea of the Graph Follower: envelopes consist of segments of graphs) until
nothing improves, and carried to the nodes between.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from alphacut.frame.calculus.jet import Array
from alphacut.frame.calculus.low_discrepancy import chebyshev_points
from alphacut.frame.modal.contest import contest
from alphacut.frame.modal.model import ModalModel
from alphacut.frame.modal.newton import refine
from alphacut.frame.modal.optima import FEW, Optima, Response, best_of_few, best_of_pool, problems
from alphacut.frame.modal.probes import probe
from alphacut.frame.modal.starting_points import fresh_points, tensor_points, trajectories
from alphacut.fuzzy.progress_bar import Progress, share

RIVAL = 0.05
"""Share of the largest bound by which a rival basin may lie behind and still be followed."""
BEHIND = 0.1
"""The same for fresh starts, which begin farther from their optima."""
FRESH = 8
"""Fresh points of an independent pass at every node, over the samples of the search."""
VALUES, MOST = 16e6, 1e8
"""Most numbers of trajectories kept at a time: of fresh points 128 MB, of the first 800 MB."""
CALM = 20.0
"""Change of phase (rad) over the box up to which the least effort finds the basins."""
SMALL = 1e-3
"""Share of the wanted error that Newton's method may leave."""
PASSES = 0.2
"""Share of the time after which independent passes begin, for the progress alone."""
QUIET = 0.05
"""Share of the wanted error that the last independent pass may gain."""


@dataclass(frozen=True)
class ModalSearch:
    """The search and its effort.

    Args:
        samples: Trajectories of the modal model that find the basins.
        starts: Basins refined per problem.
        small: Gain that Newton's method leaves, in units of the outputs.
        quiet: Gain of an independent pass that ends the search, in units of the outputs.
        passes: Most independent passes.
        basins: Those of fresh points that a pass follows at every node.
        resolution: Phase of the fastest mode (rad) between nodes that are searched anew.
        seed: Of the samples.
    """

    samples: int = 512
    starts: int = 2
    small: float = 1e-9
    quiet: float = 1e-7
    passes: int = 8
    basins: int = 4
    resolution: float = 0.25
    seed: int = 0

    @classmethod
    def suited(cls, model: ModalModel, seed: int = 0, wanted: float = 1e-6) -> ModalSearch:
        """More samples and starts where phases vary much over the box."""
        more = int(np.clip(np.log2(max(model.turned(model.time[-1]), 1.0) / CALM), 0, 2))
        return cls(512 * 2**more, 2 + more, SMALL * wanted, QUIET * wanted, seed=seed)

    def run(
        self, model: ModalModel, lower: Array, upper: Array, progress: Progress | None = None
    ) -> tuple[Array, Array, Array, Array]:
        """Upper bounds of (−output, output), their unit coordinates, and what may be missing.

        Args:
            model: The modal model.
            lower: Lower ends of the box, shape (d,).
            upper: Upper ends.
            progress: Called with the fraction done.

        Returns:
            Bounds, shape (T, m, 2), points, shape (T, m, 2, d), what Newton's method promises
            beyond the bounds, shape (T, m, 2), and what the last independent pass gained, shape
            (m,).
        """
        total, m, d = len(model.time), len(model.outputs), len(lower)
        found = problems(np.arange(total), m, d)
        gained: Array = np.zeros(m)
        tick = share(progress, 0.0, 1.0)
        if (upper > lower).any():
            pool = self._samples(lower, upper, int(MOST / (total * m)))
            values = trajectories(model, pool)
            tick(0.02)
            coarse, rivals = self._search(model, lower, upper, (pool, values), self.stride(model))
            tick(0.1)
            found = self._spread(model, [coarse, *rivals], lower, upper, (pool, values))
            tick(PASSES)
            passes = share(tick, PASSES, 0.97)
            gained = self._second_passes(model, found, lower, upper, passes)
            tick(0.97)
            refine(model, found, np.arange(len(found.value)), lower, upper, self.small)
        else:
            found.offer(model, np.tile(lower, (2 * m * total, 1)), np.arange(2 * m * total))
        shape = (total, m, 2)
        value, left = found.value.reshape(shape), found.left.reshape(shape)
        return value, found.point.reshape(*shape, d), left, gained

    def stride(self, model: Response) -> int:
        """Nodes from one that is searched anew to the next."""
        return max(1, int(self.resolution / (model.fastest * (model.time[1] - model.time[0]))))

    def _second_passes(
        self, model: ModalModel, found: Optima, lower: Array, upper: Array, tick: Progress
    ) -> Array:
        """Independent passes over `found` until one gains nothing; the last one's gain, (m,)."""
        gained = np.zeros(len(model.outputs))
        for count in range(1, self.passes + 1):
            before, halved = found.value.copy(), 0.5**count  # each pass may be the last
            own = share(tick, 1 - 2 * halved, 1 - halved)
            improved = second_pass(model, found, lower, upper, self, count, own)
            rng = np.random.default_rng((self.seed, 13, count))
            improved[probe(model, model, found, lower, upper, self.quiet / 4, rng)] = True
            if improved.any():
                self._follow(model, found, len(model.time), lower, upper, improved)
                contest(model, found, lower, upper, self.small)
            gained = (found.value - before).reshape(len(model.time), -1, 2).max((0, 2))
            if gained.max() <= self.quiet:
                break
        return gained

    def _search(
        self, model: Response, lower: Array, upper: Array, pool: tuple[Array, Array], stride: int
    ) -> tuple[Optima, list[Optima]]:
        """Optima on every stride-th node, and the local optima of other basins."""
        nodes = np.unique(np.append(np.arange(0, len(model.time), stride), len(model.time) - 1))
        best = best_of_pool(*pool, nodes, self.starts)
        for optima in best:
            refine(model, optima, np.arange(len(optima.value)), lower, upper, self.small)
        found = replace(best[0], point=best[0].point.copy(), value=best[0].value.copy())
        for other in best[1:]:
            better = other.value > found.value
            found.point[better], found.value[better] = other.point[better], other.value[better]
        self._follow(model, found, len(nodes), lower, upper, np.ones(len(found.value), bool))
        return found, best

    def _follow(
        self, model: Response, found: Optima, nodes: int, lower: Array, upper: Array, fresh: Array
    ) -> None:
        """Tries at every node what its neighbours found, near and far, until nothing improves."""
        grid = np.arange(len(found.value)).reshape(nodes, -1)
        for _ in range(8):
            changed = np.zeros(len(found.value), bool)
            for shift in (1, 2, 4, 8, 16, 32):
                for here, there in ((grid[shift:], grid[:-shift]), (grid[:-shift], grid[shift:])):
                    new = (fresh | changed)[there.ravel()]
                    changed[
                        found.offer(model, found.point[there.ravel()[new]], here.ravel()[new])
                    ] = True
            again = np.flatnonzero(changed)
            if not len(again):
                return
            refine(model, found, again, lower, upper, self.small)
            fresh = changed

    def _spread(
        self,
        model: Response,
        coarse: list[Optima],
        lower: Array,
        upper: Array,
        pool: tuple[Array, Array],
    ) -> Optima:
        """Carry optima to all nodes, from either neighbour, then Newton; rivals likewise."""
        m, d, total = len(model.outputs), coarse[0].point.shape[1], len(model.time)
        nodes = coarse[0].node.reshape(-1, 2 * m)[:, 0]
        right = np.minimum(np.searchsorted(nodes, np.arange(total)), len(nodes) - 1)
        neighbours = (right, np.maximum(right - 1, 0))
        every = np.arange(2 * m * total)

        def carried(optima: Optima) -> Optima:
            out, points = (
                problems(np.arange(total), m, d),
                optima.point.reshape(len(nodes), 2 * m, d),
            )
            for near in neighbours:
                out.offer(model, points[near].reshape(-1, d), every)
            return out

        found = carried(coarse[0])
        refine(model, found, every, lower, upper, self.small)
        margin = RIVAL * np.abs(found.value).max()
        for rival in [
            *(carried(other) for other in coarse[1:]),
            best_of_pool(*pool, np.arange(total), 1)[0],
        ]:
            apart = np.abs(rival.point - found.point).max(1) > 0.1 * (upper - lower).max()
            which = np.flatnonzero(apart & (rival.value > found.value - margin))
            refine(model, rival, which, lower, upper, self.small)
            found.offer(model, rival.point[which], which)
        contest(model, found, lower, upper, self.small)
        return found

    def _samples(self, lower: Array, upper: Array, most: int) -> Array:
        """Points of the box; more than `most`, of as many nodes and outputs, fill the memory."""
        d = len(lower)
        # narrow boxes hold fewer basins
        count = 2 ** round(np.log2(max(64, self.samples * ((upper - lower) / 2).max())))
        count = max(64, min(count, most // 2))
        unit = chebyshev_points(d, count, skip=1 + 7919 * self.seed)
        points = np.vstack([unit, tensor_points(d, count)])
        scaled: Array = (lower + upper) / 2 + (upper - lower) / 2 * points
        return scaled


def second_pass(
    model: Response,
    found: Optima,
    lower: Array,
    upper: Array,
    search: ModalSearch,
    count: int,
    tick: Progress = lambda done: None,
) -> Array:
    """Offer what fresh samples and fresh starts reach, without the optima found so far.

    Args:
        model: The modal model.
        found: All problems, node by node, which keep what is better.
        lower: Lower ends of the box, shape (d,).
        upper: Upper ends.
        search: Whose effort is repeated.
        count: Which pass this is, from 1 on; each has samples and nodes of its own.
        tick: Told the share done.

    Returns:
        Which problems improved, shape (N,).
    """
    rng = np.random.default_rng((search.seed, count))
    stride, improved = search.stride(model), np.zeros(len(found.value), bool)
    nodes = np.arange(rng.integers(stride), len(model.time), stride)
    every_node = np.arange(len(model.time))
    every = np.arange(len(found.value)).reshape(len(model.time), -1)
    wide = FRESH * search.samples * float((upper - lower).max()) / 2
    pool = fresh_points(rng, lower, upper, int(np.clip(wide, 64, VALUES / len(found.value))))
    behind = BEHIND * np.abs(found.value).max()
    rivals = best_of_pool(pool, trajectories(model, pool), every_node, search.basins)
    for done, rival in enumerate(rivals):
        tick(done / (len(rivals) + 1))
        open_ = np.flatnonzero(rival.value > found.value - behind)
        refine(model, rival, open_, lower, upper, search.quiet / 4)
        improved[found.offer(model, rival.point, every.ravel())] = True
    pool = fresh_points(rng, lower, upper, search.samples)
    values = trajectories(model, pool, nodes)
    for few in FEW:
        rival = best_of_few(pool, values, nodes, few, rng)
        refine(model, rival, np.arange(len(rival.value)), lower, upper, search.quiet / 4)
        improved[found.offer(model, rival.point, every[nodes].ravel())] = True
    return improved
