"""Search: estimated bounds of linear structures with any number of fuzzy inputs.

1. The polynomials of the modes' eigenvalues and shares that `Proof` uses; with more inputs than six
   they are quadratics, whose error does not matter: they only lead.
2. First pass: a sample of the box starts Newton's method for every bound (node, output, side) on
   the polynomials.
3. Exact motions: Newton's method goes on from there with values and gradients of eigen-analyses at
   the points themselves, so that every bound is attained. The curvature is that of the polynomials,
   corrected by what the gradients show. What is best at one node is tried at the nodes around.
4. Independent passes: for bounds drawn anew, fresh points, none of them from a pass before, start
   Newton's method on exact motions. What they find beyond the bounds is taken over, and tried at
   the nodes around. Passes go on until two after each other gain too little.
5. Levels are treated from the narrowest box to the widest; what one attains the next attains too.

The error of a bound is what Newton's method still promises, and `UNSEEN` times the gain of the last
two passes: of its output as a whole, and of the bounds near by where those gained more. Where the
polynomials miss more than `ROUGH` of a peak they lead nowhere, and bounds are only called attained.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from alphacut.frame.boxes import UnitFlow
from alphacut.frame.dynamics.flow import LinearFlow
from alphacut.frame.envelope import Envelope
from alphacut.frame.modal.exact_response import ExactResponse
from alphacut.frame.modal.fitting import fit_modes
from alphacut.frame.modal.model import ModalModel
from alphacut.frame.modal.newton import first_optima, refine
from alphacut.frame.modal.optima import Optima, Response, best_of, fresh_points, trajectories
from alphacut.frame.structures.linear import frequencies, round_off
from alphacut.frame.structures.modes import ModalError
from alphacut.fuzzy.arrays import Array, Mask, Rows
from alphacut.fuzzy.progress_bar import Progress, share
from alphacut.fuzzy.refused import real
from alphacut.fuzzy.result import Nature

SMALL = 0.05
"""Share of the error allowed that Newton's method may leave, and that the polynomials may have."""
QUIET = 0.2
"""Share of the error allowed that the last two passes may gain."""
UNSEEN = 4.0
"""Factor on what they gained: 0.8 of the error allowed; `SMALL` adds 0.15 at most."""
FRESH = 1024
"""Fresh points of a pass."""
VALUES = 16e6
"""Most numbers of their trajectories: 128 MB."""
DRAWN = 1024
"""Bounds that the first pass draws; each further one draws twice as many."""
FEW = (1, 8)
"""Fresh points out of which the best starts, beside the best of all: the best of many lies too
often at a corner."""
SHIFTS = (1, 2, 4, 8, 16)
"""Distances of the nodes that try each other's points."""
ROUNDS = 6
"""Rounds in which neighbours are tried, at most."""
MANY = 12
"""Inputs above which a pass takes so long that fewer are made; the error says what that costs."""
ROUGH = 0.3
"""Error of the polynomials, as a share of an output's peak, above which they do not lead."""


@dataclass(frozen=True)
class Search:
    """The method and its options.

    Args:
        tolerance: Error wanted, as a share of each output's peak, or in the unit of the first
            displacement (the first output without one) where the envelope is not relative; 1e-3
            unless given.
        passes: Most independent passes; 8 unless given, 5 of more than `MANY` inputs.
        seed: Of all that is drawn.

    Raises:
        RefusedError: A value is not positive.
    """

    name: ClassVar[str] = "search"
    tolerance: float | None = None
    passes: int | None = None
    seed: int = 0

    def __post_init__(self) -> None:
        for key in ("tolerance", "passes"):
            if getattr(self, key) is not None:
                real(key, getattr(self, key), positive=True)

    def run(self, flow: UnitFlow, progress: Progress | None = None) -> Envelope:
        """Envelope of all outputs on all levels, estimated or, of rough polynomials, attained.

        Raises:
            ModalError: The structure has no oscillating modes over the box, or is not linear.
        """
        begun, tolerance = time.perf_counter(), flow.tolerance(self.tolerance)
        if not isinstance(flow.flow, LinearFlow):
            raise ModalError("search: the system is not linear; take the Graph Follower")
        model = fit_modes(flow.flow, flow.boxes, tolerance=SMALL * tolerance, scale=flow.scale)
        rough = _rough(model, flow)
        exact = ExactResponse.of(model, flow.scale, bent=not rough)
        # what leads: polynomials where they are as good as is asked for, or the exact motions
        enough = bool((model.error / flow.scale).max() <= SMALL * tolerance)
        way = exact.model if enough else exact
        levels, solved = len(flow.boxes.alpha), list[tuple[Optima, Array]]()
        for done, level in enumerate(reversed(range(levels))):
            tick = share(progress, done / levels, (done + 1) / levels)
            within = solved[-1][0] if solved else None
            solved.append(self._level(way, *flow.boxes.unit(level), tolerance, within, tick))
        shape, scale = (levels, len(flow.time), len(flow.outputs), 2), flow.scale[:, None]
        values = [x.side * exact.value_at(x.point, x.node, x.output) for x, _ in solved[::-1]]
        bounds = np.maximum.accumulate(np.stack(values)[::-1])[::-1].reshape(shape) * scale
        at = np.stack([optima.point for optima, _ in solved[::-1]]).reshape(*shape, -1)
        missed = np.stack([error for _, error in solved[::-1]]).reshape(shape) * scale
        missed += 2 * enough * model.error.max(0)[:, None]
        error = np.maximum(missed.max(-1), _rounding(model, np.abs(bounds).max((0, 1, 3))))
        facts = {
            "degree": model.degree,
            "model_error": float((model.error / flow.scale).max()),
            "search_error": float((missed / scale).max()),
        }
        return flow.envelope(
            bounds,
            at,
            None if rough else error,
            method=self.name,
            nature=Nature.ATTAINED if rough else Nature.ESTIMATED,
            evaluations=model.analyses,
            seconds=time.perf_counter() - begun,
            facts=facts,
        )

    def _level(
        self,
        way: Response,
        lower: Array,
        upper: Array,
        tolerance: float,
        within: Optima | None,
        tick: Progress,
    ) -> tuple[Optima, Array]:
        """Optima in a box, and what they may miss, shape (N,)."""
        optima = first_optima(_polynomials(way), lower, upper, SMALL * tolerance)
        every = np.arange(len(optima.value))
        grid = every.reshape(len(way.time), -1)  # node by node
        box = lower, upper, SMALL * tolerance
        if isinstance(way, ExactResponse):
            optima.value[:] = -np.inf
            optima.offer(way, optima.point.copy(), every)
            refine(way, optima, every, *box)
        if within is not None:
            optima.offer(way, within.point, every)
        tick(0.2)
        if not (upper > lower).any():
            return optima, np.zeros(len(every))
        _follow(way, optima, grid, box, np.ones(len(every), bool))
        tick(0.5)
        gains = list[Array]()
        most = self.passes or (8 if len(lower) <= MANY else 5)
        for count in range(most):
            before = optima.value.copy()
            rng = np.random.default_rng((self.seed, count, len(every)))
            self._pass(way, optima, grid, box, DRAWN * 2**count, rng)
            gains.append((optima.value - before).reshape(len(grid), -1))
            tick(0.5 + 0.5 * (1 - 0.6 ** (count + 1)))
            if count and max(gain.max() for gain in gains[-2:]) <= QUIET * tolerance:
                break
        return optima, optima.left + _missed(gains, len(way.outputs), QUIET * tolerance).ravel()

    def _pass(
        self,
        way: Response,
        optima: Optima,
        grid: Rows,
        box: tuple[Array, Array, float],
        count: int,
        rng: np.random.Generator,
    ) -> None:
        """Solve `count` bounds anew from fresh points, and follow what is better."""
        m = len(way.outputs)
        size = int(np.clip(VALUES / (len(grid) * m), 64, FRESH))
        pool = fresh_points(rng, *box[:2], size)
        nodes = np.sort(rng.permutation(len(grid))[: max(1, count // (2 * m))])
        values = trajectories(_polynomials(way), pool, nodes)
        rivals = [best_of(pool, values, nodes)]
        rivals += [best_of(pool, values, nodes, few, rng) for few in FEW]
        improved = np.zeros(len(optima.value), bool)
        for rival in rivals:
            own = np.arange(len(rival.value))
            rival.value[:] = -np.inf
            rival.offer(way, rival.point.copy(), own)
            refine(way, rival, own, *box)
            improved[optima.offer(way, rival.point, grid[nodes].ravel())] = True
        _follow(way, optima, grid, box, improved)


def _rough(model: ModalModel, flow: UnitFlow) -> bool:
    peak = np.abs(flow.flow.values(flow.boxes.modal[None])[0]).max(0)
    return bool((model.error.max(0) > ROUGH * peak).any())


def _polynomials(way: Response) -> ModalModel:
    return way.model if isinstance(way, ExactResponse) else way


def _follow(
    way: Response, optima: Optima, grid: Rows, box: tuple[Array, Array, float], fresh: Mask
) -> None:
    """Try at every node what is fresh near by, and refine it, until nothing improves."""
    for _ in range(ROUNDS):
        better = _exchanged(way, optima, grid, fresh)
        if not len(better):
            return
        refine(way, optima, better, *box)
        fresh = np.zeros(len(optima.value), bool)
        fresh[better] = True


def _exchanged(way: Response, optima: Optima, grid: Rows, fresh: Mask) -> Rows:
    """Try at each node the fresh points of nodes near by; problems that improved.

    Envelopes consist of segments of graphs (the idea of the Graph Follower).
    """
    better = []
    for shift in SHIFTS:
        count = max(len(grid) - shift, 0)
        for here, there in ((shift, 0), (0, shift)):
            of = grid[there : there + count].ravel()
            to = grid[here : here + count].ravel()[fresh[of]]
            better.append(optima.offer(way, optima.point[of[fresh[of]]], to))
    return np.asarray(np.unique(np.concatenate(better)))


def _missed(gains: list[Array], outputs: int, quiet: float) -> Array:
    """Bounds of what may be missed, from the gains (T, 2 m) of the last passes."""
    last = np.max(gains[-2:], axis=0)
    by_output = last.reshape(len(last), outputs, 2).max((0, 2))
    return np.asarray(UNSEEN * np.maximum(quiet, np.repeat(by_output, 2)) + 0 * last)


def _rounding(model: ModalModel, peak: Array) -> Array:
    """Least error of trajectories in doubles, given their peaks (m,), shape (T, m)."""
    rates = np.abs(model.eigenvalue.coefficients[0])
    largest = max(rates.max(), frequencies(model.flow.system).max())
    late: Array = 64 * np.finfo(float).eps + round_off(largest**2, rates.min(), model.time)
    return late[:, None] * peak
