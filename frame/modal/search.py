"""Global optimisation of the modal model over a box, for all nodes, outputs and sides together.

Samples of the whole box start Newton's method on every stride-th node; what is found there is tried
at the nodes around (the idea of
the Graph Follower: envelopes consist of segments of graphs) until nothing improves, and carried to
    the nodes between.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from alphacut.frame.calculus.box_quadratic import gain, global_maximum, local_maximum
from alphacut.frame.calculus.jet import Array
from alphacut.frame.calculus.low_discrepancy import chebyshev_points
from alphacut.frame.modal.exact_response import ExactResponse
from alphacut.frame.modal.model import ModalModel

Response = ModalModel | ExactResponse
RIVAL = 0.05
"""Share of the largest bound by which a rival basin may lie behind and still be followed."""
BEHIND = 0.1
"""The same for fresh starts, which begin farther from their optima."""
FRESH = 8
"""Fresh points of an independent pass at every node, over the samples of the search."""
VALUES = 16e6
"""Most numbers of their trajectories that are kept at a time: 128 MB."""
CALM = 20.0
"""Change of phase (rad) over the box up to which the least effort finds the basins."""
PIECE = 2000
"""Problems treated together; more would leave the cache."""
SMALL = 1e-3
"""Share of the wanted error that Newton's method may leave."""
QUIET = 0.05
"""Share of the wanted error that the last independent pass may gain."""
USUAL = 6
"""Newton steps after which quadratic models are maximised over all faces: the rest is on ridges."""
NEAR, DECADES = 8, 8.0
"""One in how many fresh points lies near the faces, and how near: decades of the box's width."""
ITERATIONS = 300
"""Newton steps after which a problem that has not converged is left as it is."""


@dataclass(eq=False)
class Optima:
    """Best points so far of N problems.

    Args:
        node: Time node of each problem, shape (N,).
        output: Its output, shape (N,).
        side: +1 for an upper bound, −1 for a lower, shape (N,).
        point: Unit coordinates, shape (N, d).
        value: side × output there, shape (N,).
        left: What Newton's method last promised beyond it, shape (N,).
    """

    node: Array
    output: Array
    side: Array
    point: Array
    value: Array
    left: Array

    def take(self, which: Array) -> Optima:
        """A copy of the problems `which`."""
        return Optima(*(getattr(self, part.name)[which].copy() for part in fields(self)))

    def offer(self, model: Response, points: Array, which: Array) -> Array:
        """Try `points` (W, d) on problems `which` (W,), keep and return the better ones."""
        if not len(which):
            return which
        value = self.side[which] * model.value_at(points, self.node[which], self.output[which])
        better = value > self.value[which] + 1e-12
        self.point[which[better]], self.value[which[better]] = points[better], value[better]
        improved: Array = which[better]
        return improved


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
        more = int(np.clip(np.log2(max(model.turned, 1.0) / CALM), 0, 2))
        return cls(512 * 2**more, 2 + more, SMALL * wanted, QUIET * wanted, seed=seed)

    def run(self, model: Response, lower: Array, upper: Array) -> tuple[Array, Array, Array, Array]:
        """Upper bounds of (−output, output), their unit coordinates, and what may be missing.

        Args:
            model: The modal model.
            lower: Lower ends of the box, shape (d,).
            upper: Upper ends.

        Returns:
            Bounds, shape (T, m, 2), points, shape (T, m, 2, d), what Newton's method promises
            beyond the bounds, shape (T, m, 2), and what the last independent pass gained, shape
            (m,).
        """
        total, m, d = len(model.time), len(model.outputs), len(lower)
        found = problems(np.arange(total), m, d)
        gained: Array = np.zeros(m)
        if (upper > lower).any():
            pool = self._samples(lower, upper)
            values = trajectories(model, pool)
            coarse, rivals = self._search(model, lower, upper, (pool, values), self.stride(model))
            found = self._spread(model, [coarse, *rivals], lower, upper, (pool, values))
            gained = self._second_passes(model, found, lower, upper)
            refine(model, found, np.arange(len(found.value)), lower, upper, self.small)
        else:
            found.offer(model, np.tile(lower, (2 * m * total, 1)), np.arange(2 * m * total))
        shape = (total, m, 2)
        value, left = found.value.reshape(shape), found.left.reshape(shape)
        return value, found.point.reshape(*shape, d), left, gained

    def stride(self, model: Response) -> int:
        """Nodes from one that is searched anew to the next."""
        return max(1, int(self.resolution / (model.fastest * (model.time[1] - model.time[0]))))

    def _second_passes(self, model: Response, found: Optima, lower: Array, upper: Array) -> Array:
        """Independent passes over `found` until one gains nothing; the last one's gain, (m,)."""
        gained = np.zeros(len(model.outputs))
        for count in range(1, self.passes + 1):
            before = found.value.copy()
            improved = second_pass(model, found, lower, upper, self, count)
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
        self,
        model: Response,
        found: Optima,
        nodes: int,
        lower: Array,
        upper: Array,
        fresh: Array,
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

    def _samples(self, lower: Array, upper: Array) -> Array:
        d = len(lower)
        # narrow boxes hold fewer basins
        count = 2 ** round(np.log2(max(64, self.samples * ((upper - lower) / 2).max())))
        unit = chebyshev_points(d, count, skip=1 + 7919 * self.seed)
        points = np.vstack([unit, tensor_points(d, count)])
        scaled: Array = (lower + upper) / 2 + (upper - lower) / 2 * points
        return scaled


def contest(
    model: Response, found: Optima, lower: Array, upper: Array, small: float, rounds: int = 20
) -> None:
    """Refine either optimum at both nodes of a jump, until no jump moves or the rounds are over.

    Args:
        model: The modal model.
        found: All problems, node by node, which keep what is better.
        lower: Lower ends of the box, shape (d,).
        upper: Upper ends.
        small: Gain that Newton's method leaves.
        rounds: Most rounds.
    """
    grid = np.arange(len(found.value)).reshape(-1, 2 * len(model.outputs))
    open_ = np.ones(len(found.value), bool)
    for _ in range(rounds):
        moved: list[Array] = []
        for here, there in (
            (grid[1:].ravel(), grid[:-1].ravel()),
            (grid[:-1].ravel(), grid[1:].ravel()),
        ):
            apart = np.abs(found.point[here] - found.point[there]).max(1)
            jump = (apart > 0.05 * (upper - lower).max()) & (open_[here] | open_[there])
            if jump.any():
                moved.append(_contested(model, found, here[jump], there[jump], lower, upper, small))
        open_[:] = False
        if moved:
            open_[np.concatenate(moved)] = True
        if not open_.any():
            return


def _contested(
    model: Response,
    found: Optima,
    here: Array,
    there: Array,
    lower: Array,
    upper: Array,
    small: float,
) -> Array:
    """Refine the optima of `there` as rivals of those of `here`; which of these improved."""
    rival = found.take(here)
    rival.point[:] = found.point[there]
    rival.value[:] = rival.side * model.value_at(rival.point, rival.node, rival.output)
    refine(model, rival, np.arange(len(rival.value)), lower, upper, small)
    return found.offer(model, rival.point, here)


def second_pass(
    model: Response,
    found: Optima,
    lower: Array,
    upper: Array,
    search: ModalSearch,
    count: int,
) -> Array:
    """Offer what fresh samples and fresh starts reach, without the optima found so far.

    Args:
        model: The modal model.
        found: All problems, node by node, which keep what is better.
        lower: Lower ends of the box, shape (d,).
        upper: Upper ends.
        search: Whose effort is repeated.
        count: Which pass this is, from 1 on; each has samples and nodes of its own.

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
    for rival in best_of_pool(pool, trajectories(model, pool), every_node, search.basins):
        open_ = np.flatnonzero(rival.value > found.value - behind)
        refine(model, rival, open_, lower, upper, search.quiet / 4)
        improved[found.offer(model, rival.point, every.ravel())] = True
    for k in range(search.starts):
        pool = fresh_points(rng, lower, upper, search.samples // 4**k)
        rival = best_of_pool(pool, trajectories(model, pool, nodes), nodes, 1)[0]
        refine(model, rival, np.arange(len(rival.value)), lower, upper, search.quiet / 4)
        improved[found.offer(model, rival.point, every[nodes].ravel())] = True
    return improved


def fresh_points(rng: np.random.Generator, lower: Array, upper: Array, size: int) -> Array:
    """Random points of a box, many with coordinates on or near faces, shape (size, d)."""
    pool = rng.uniform(lower, upper, (size, len(lower)))
    faces = rng.random(pool.shape) < rng.choice([0.0, 0.3, 0.6], (size, 1))
    nearest = np.where(rng.random(pool.shape) < 0.5, lower, upper)
    near = np.arange(size) % NEAR == 0  # where an extreme beside a face would be too thin to meet
    away = 10.0 ** rng.uniform(-DECADES, 0, (int(near.sum()), 1))
    pool[near] = nearest[near] + away * (pool[near] - nearest[near])
    pool[faces] = nearest[faces]
    return pool


def trajectories(model: Response, points: Array, nodes: Array | None = None) -> Array:
    """Values of the model at points (P, d) and the nodes, all unless given, shape (P, T, m)."""
    pieces = [model.values(chunk) for chunk in np.array_split(points, -(-len(points) // 256))]
    return np.concatenate([x if nodes is None else x[:, nodes] for x in pieces])


def tensor_points(d: int, most: int) -> Array:
    """Finest grid of extreme Chebyshev points with at most `most`, shape (k^d, d)."""
    k = int(most ** (1 / d) + 1e-9)
    if k < 2:
        return np.zeros((0, d))
    axis = -np.cos(np.pi * np.arange(k) / (k - 1))
    return np.array(np.meshgrid(*[axis] * d, indexing="ij")).reshape(d, -1).T


def problems(nodes: Array, outputs: int, d: int) -> Optima:
    """All outputs and sides at `nodes`, node by node; the sides of an output are (−1, +1)."""
    count = 2 * outputs
    node = np.repeat(nodes, count)
    output, side = (
        np.tile(np.repeat(np.arange(outputs), 2), len(nodes)),
        np.tile([-1.0, 1.0], len(nodes) * outputs),
    )
    return Optima(
        node,
        output,
        side,
        np.zeros((len(node), d)),
        np.full(len(node), -np.inf),
        np.zeros(len(node)),
    )


def best_of_pool(pool: Array, values: Array, nodes: Array, starts: int) -> list[Optima]:
    """Best points of the pool (P, d) for every problem, and rivals elsewhere."""
    m = values.shape[-1]
    chosen = (values if len(nodes) == values.shape[1] else values[:, nodes]).reshape(len(pool), -1)
    # points this near the best are taken out together with it
    reach = 0.25 * np.ptp(pool, axis=0).max()
    out = [problems(nodes, m, pool.shape[1]) for _ in range(starts)]
    for column, sign in enumerate((-1.0, 1.0)):
        left: Array = chosen
        for optima in out:
            best = left.argmin(0) if sign < 0 else left.argmax(0)
            optima.point[column::2], optima.value[column::2] = (
                pool[best],
                sign * chosen[best, np.arange(len(best))],
            )
            if optima is not out[-1]:
                unique, index = np.unique(best, return_inverse=True)
                near = np.stack([np.abs(pool - pool[k]).max(1) < reach for k in unique], 1)
                left = np.where(near[:, index], -sign * np.inf, left)
    return out


def refine(
    model: Response, optima: Optima, which: Array, lower: Array, upper: Array, small: float
) -> None:
    """Newton's method in the box on `which`, until none promises more than `small`."""
    size = int(np.clip(PIECE * 36 / lower.size**2, PIECE // 8, PIECE))
    for piece in np.array_split(which, -(-len(which) // size) or 1):
        _newton(model, optima, piece, lower, upper, small)


def _newton(
    model: Response, optima: Optima, which: Array, lower: Array, upper: Array, small: float
) -> None:
    """End a problem when its model, not held back by the trust region, promises at most `small`.

    What the models last promised is kept in `optima.left`.
    """
    radius: Array = np.full(len(which), 0.5)
    f, g, H = _signed(model, optima, optima.point[which], which)
    bend = np.zeros_like(H)  # what gradients have shown H to lack
    for count in range(ITERATIONS):
        low = np.maximum(lower - optima.point[which], -radius[:, None])
        high = np.minimum(upper - optima.point[which], radius[:, None])
        step = (
            local_maximum(g, H, low, high, rounds=2)
            if count < USUAL
            else global_maximum(g, H, low, high)
        )
        promised = gain(g, H, step)
        optima.left[which] = promised
        held = np.abs(step).max(1, initial=0.0) >= 0.999 * radius
        open_ = (promised > small) | (held & (promised > 1e-3 * small))
        which, radius, step, promised, g, H, bend = (
            x[open_] for x in (which, radius, step, promised, g, H, bend)
        )
        if not len(which):
            return
        trial = np.clip(optima.point[which] + step, lower, upper)
        step = trial - optima.point[which]
        f, g2, H2 = _signed(model, optima, trial, which)
        if model.secant:
            lack = _symmetric_rank_one(H2 + bend, step, g2 - g)
            bend += lack
            H, H2 = H + lack, H2 + bend
        got = f - optima.value[which]
        better = got > 0
        optima.point[which[better]], optima.value[which[better]] = trial[better], f[better]
        g[better], H[better] = g2[better], H2[better]
        ratio = got / promised
        radius = np.where(
            ratio > 0.75,
            np.minimum(2 * radius, 2.0),
            np.where(ratio < 0.25, 0.3 * np.abs(step).max(1), radius),
        )


def _symmetric_rank_one(H: Array, step: Array, change: Array) -> Array:
    """Least correction of Hessians (N, d, d) that explains a change of gradients over a step."""
    lack = change - (H @ step[..., None])[..., 0]
    weight = (lack * step).sum(1)
    size = np.sqrt((lack**2).sum(1) * (step**2).sum(1))
    sound = np.abs(weight) > 1e-6 * size
    scaled = lack / np.where(sound, weight, 1.0)[:, None] * sound[:, None]
    correction: Array = lack[:, :, None] * scaled[:, None, :]
    return correction


def _signed(
    model: Response, optima: Optima, points: Array, which: Array
) -> tuple[Array, Array, Array]:
    """Side × output with gradient and Hessian, of problems `which` at points (W, d)."""
    side = optima.side[which]
    f, g, H = model.at(points, optima.node[which], optima.output[which])
    return side * f, side[:, None] * g, side[:, None, None] * H
