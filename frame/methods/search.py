"""Search: estimated bounds of linear structures with any number of fuzzy inputs.

1. The polynomials of the modes' eigenvalues and shares that `Proof` uses; with more inputs than six
   they are quadratics, whose error does not matter: they only lead.
2. Start: a sample of the box starts Newton's method for every bound (node, output, side) on the
   polynomials.
3. Exact motions: Newton's method goes on from there with values and gradients of eigen-analyses at
   the points themselves, so that every bound is attained. The curvature is that of the polynomials,
   corrected by what the gradients show. What is best at one node is tried at the nodes around.
4. Passes: for bounds drawn anew, fresh points start Newton's method. What they find beyond the
   bounds is taken over, and tried at the nodes around.
5. Levels are treated from the narrowest box to the widest; what one attains the next attains too.

Two searches do all of this and share nothing: neither the seed nor the points that they start from
nor the degree of their polynomials. Passes go on until both agree. The better bound is stated, and
its error is the gain that Newton's method still predicts, and `UNSEEN` times the largest difference
of the two searches on its output and level. Where the polynomials miss more than `ROUGH` of a peak
they lead nowhere, and bounds are only called attained.
"""

from __future__ import annotations

import copy
import time
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import ClassVar

import numpy as np

from alphacut.frame.boxes import UnitFlow
from alphacut.frame.dynamics.flow import LinearFlow
from alphacut.frame.envelope import Envelope
from alphacut.frame.modal.exact_response import ExactResponse
from alphacut.frame.modal.fitting import fit_modes
from alphacut.frame.modal.model import ModalModel
from alphacut.frame.modal.newton import SAMPLES, first_optima, refine
from alphacut.frame.modal.optima import Optima, Response, best_of, fresh_points, trajectories
from alphacut.frame.structures.linear import frequencies, round_off
from alphacut.frame.structures.modes import ModalError
from alphacut.fuzzy.arrays import Array, Mask, Rows
from alphacut.fuzzy.progress_bar import Progress, subprogress
from alphacut.fuzzy.refused import checked_number
from alphacut.fuzzy.result import Nature

SMALL = 0.05
"""Share of the error allowed that Newton's method may leave, and that the polynomials may have."""
AGREEMENT = 0.2
"""Share of the error allowed by which the two searches may differ."""
UNSEEN = 4.0
"""Factor on their difference: 0.8 of the error allowed; `SMALL` adds 0.15 at most."""
FRESH = 1024
"""Fresh points of a pass."""
VALUES = 16e6
"""Most numbers of their trajectories: 128 MB."""
DRAWN = 1024
"""Bounds that the first pass draws; each further one draws twice as many."""
CANDIDATES = (1, 8)
"""Numbers of fresh points out of which the best starts, beside the best of all: the best of many
lies too often at a corner."""
SHIFTS = (1, 2, 4, 8, 16)
"""Distances of the nodes that try each other's points."""
ROUNDS = 6
"""Rounds in which neighbours are tried, at most."""
MANY_INPUTS = 12
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
        passes: Most passes of either search; 8 unless given, 5 of more than `MANY_INPUTS` inputs.
        seed: Of all that is drawn.

    Raises:
        RefusedError: A value is not positive.

    Example:
        >>> from alphacut.frame import StoreyFrame, envelope
        >>> from alphacut.fuzzy import Triangular
        >>> frame = StoreyFrame(masses=[1e3], stiffness=[4e4], q0=[0.1])
        >>> inputs = {"m1": Triangular(900, 1000, 1100)}
        >>> str(envelope(frame, inputs, Search(), duration=0.5, step=0.1).nature)
        'estimated'
    """

    name: ClassVar[str] = "search"
    tolerance: float | None = None
    passes: int | None = None
    seed: int = 0

    def __post_init__(self) -> None:
        for key in ("tolerance", "passes"):
            if getattr(self, key) is not None:
                checked_number(key, getattr(self, key), positive=True)

    def run(self, flow: UnitFlow, progress: Progress | None = None) -> Envelope:
        """Return the envelope on all levels by two searches, with an error from their differences.

        It is estimated or, where the polynomials of the modes are too rough, only attained.

        Raises:
            ModalError: The structure has no oscillating modes over the box, or is not linear.
        """
        start_time, tolerance = time.perf_counter(), flow.tolerance(self.tolerance)
        if not isinstance(flow.flow, LinearFlow):
            raise ModalError("search: the system is not linear; take the Graph Follower")
        model = fit_modes(flow.flow, flow.boxes, tolerance=SMALL * tolerance, scale=flow.scale)
        fitting, searching = subprogress(progress, 0.0, 0.1), subprogress(progress, 0.1, 1.0)
        fitting(0.5)
        is_rough = _rough(model, flow)
        exact = ExactResponse.from_model(model, flow.scale, has_hessian=not is_rough)
        # each search works on polynomials where they are accurate enough, else on exact motions
        is_accurate = bool((model.error / flow.scale).max() <= SMALL * tolerance)
        second = fit_modes(
            flow.flow,
            flow.boxes,
            tolerance=SMALL * tolerance,
            scale=flow.scale,
            degree=model.degree - 1,
        )
        fitting(1.0)
        searches = (
            _IndependentSearch(exact.model if is_accurate else exact, self.seed, 0),
            _IndependentSearch(
                _second_response(second, flow, is_accurate=is_accurate), self.seed, 1
            ),
        )
        # optima and errors of each level, from the narrowest box
        levels, solved = len(flow.boxes.alpha), list[tuple[Optima, Array]]()
        for done, level in enumerate(reversed(range(levels))):
            tick = subprogress(searching, done / levels, (done + 1) / levels)
            narrower = solved[-1][0] if solved else None
            ends = flow.boxes.unit(level)
            solved.append(self._level(searches, *ends, tolerance, narrower, tick))
        shape, scale = (levels, len(flow.time), len(flow.outputs), 2), flow.scale[:, None]
        values = [x.side * exact.value_at(x.point, x.node, x.output) for x, _ in solved[::-1]]
        # wider boxes attain what narrower ones do
        bounds = np.maximum.accumulate(np.stack(values)[::-1])[::-1].reshape(shape) * scale
        at = np.stack([optima.point for optima, _ in solved[::-1]]).reshape(*shape, -1)
        missed = np.stack([error for _, error in solved[::-1]]).reshape(shape) * scale
        if is_accurate:  # the values of the polynomials were compared
            missed += 2 * model.error.max(0)[:, None]
        error = np.maximum(missed.max(-1), _rounding(model, np.abs(bounds).max((0, 1, 3))))
        facts = {
            "degree": model.degree,
            "model_error": float((model.error / flow.scale).max()),
            "search_error": float((missed / scale).max()),
        }
        return flow.envelope(
            bounds,
            at,
            None if is_rough else error,
            method=self.name,
            nature=Nature.ATTAINED if is_rough else Nature.ESTIMATED,
            evaluations=model.analyses,
            seconds=time.perf_counter() - start_time,
            facts=facts,
        )

    def attained(
        self, flow: UnitFlow, nodes: Rows, progress: Progress | None = None
    ) -> tuple[Array, Array]:
        """Return large values of (−output, output) that exact motions attain at some nodes.

        One search from a sample of each box, whose optima are tried on neighbouring nodes and in
        the next wider box.

        Args:
            flow: The motion and its boxes.
            nodes: Indices of the nodes, shape (J,).
            progress: Called with the completed fraction.

        Returns:
            The values, shape (A, J, m, 2), and unit coordinates that attain them, (…, d).

        Raises:
            ModalError: As `run`.
        """
        if not isinstance(flow.flow, LinearFlow):
            raise ModalError("search: the system is not linear; take the Graph Follower")
        least_gain = SMALL * flow.tolerance(self.tolerance)
        model = fit_modes(flow.flow, flow.boxes, tolerance=least_gain, scale=flow.scale)
        exact = ExactResponse.from_model(model, flow.scale, has_hessian=not _rough(model, flow))
        levels, solved = len(flow.boxes.alpha), list[Optima]()
        for done, level in enumerate(reversed(range(levels))):
            box = (*flow.boxes.unit(level), least_gain)
            tick = subprogress(progress, done / levels, (done + 1) / levels)
            optima = first_optima(exact.model, *box, nodes=nodes)
            _evaluate_and_refine(exact, optima, box, tick)
            rows = np.arange(len(optima.value))
            if solved:
                optima.offer(exact, solved[-1].point, rows)
            grid, fresh = rows.reshape(len(nodes), -1), np.ones(len(rows), bool)
            refine(exact, optima, _exchanged(exact, optima, grid, fresh, tick), *box)
            solved.append(optima)
        shape = len(nodes), len(flow.outputs), 2
        values = np.stack([optima.value.reshape(shape) for optima in solved[::-1]])
        points = np.stack([optima.point.reshape(*shape, -1) for optima in solved[::-1]])
        return values * flow.scale[:, None], points

    def _level(
        self,
        searches: tuple[_IndependentSearch, _IndependentSearch],
        lower: Array,
        upper: Array,
        tolerance: float,
        narrower: Optima | None,
        tick: Progress,
    ) -> tuple[Optima, Array]:
        """Return optima of all N bounds in a box, improved by two searches until they agree.

        Args:
            searches: The two independent searches.
            lower: Lower ends of the box in unit coordinates, shape (d,).
            upper: Upper ends.
            tolerance: Wanted error, in units of `scale`.
            narrower: Optima of the next narrower level; None on the narrowest.
            tick: Called with the completed fraction.

        Returns:
            The better optima of both, and their estimated errors, shape (N,).
        """
        box = lower, upper, SMALL * tolerance
        for number, search in enumerate(searches):
            search.start(*box, subprogress(tick, 0.2 * number, 0.2 * (number + 1)))
        first, second = searches
        if not (upper > lower).any():
            return first.optima, np.zeros(len(first.optima.value))
        max_passes = self.passes or (8 if len(lower) <= MANY_INPUTS else 5)
        for count in range(max_passes):
            # progress by halves of the remainder, since the number of passes is not known
            done = [1 - 0.6 * 0.5 ** (count + number / 3) for number in range(4)]
            ticks = [subprogress(tick, *ends) for ends in pairwise(done)]
            first.improve(count, ticks[0])
            second.improve(count, ticks[1])
            best, difference = _compared(first.response, first.optima, second.optima, box, ticks[2])
            if narrower is not None:
                best.offer(first.response, narrower.point, np.arange(len(best.value)))
            if difference.max() <= AGREEMENT * tolerance:
                break
        outputs = len(first.response.outputs)
        return best, best.predicted_gain + _search_errors(
            difference, outputs, AGREEMENT * tolerance
        )


class _IndependentSearch:
    """One of the two searches, with its optima on the level that is searched.

    Args:
        response: What Newton's method works on.
        seed: Seed of the method.
        number: 0 or 1, which of the searches it is.
    """

    optima: Optima

    def __init__(self, response: Response, seed: int, number: int) -> None:
        self.response, self.seed, self.number = response, seed, number
        self.narrower: Optima | None = None

    def start(self, lower: Array, upper: Array, least_gain: float, tick: Progress) -> None:
        """Set `optima` to those of all bounds in a box, by a sample and the narrower box's optima.

        The box is in unit coordinates; Newton's method stops below `least_gain`.
        """
        self.box = lower, upper, least_gain
        unit = None
        if self.number:
            rng = np.random.default_rng((self.seed, self.number))
            ends = np.ones(len(lower))
            unit = fresh_points(rng, -ends, ends, SAMPLES)  # others than those of the first search
        first_tick = subprogress(tick, 0.0, 0.3)
        self.optima = first_optima(_polynomials(self.response), *self.box, unit, first_tick)
        rows = np.arange(len(self.optima.value))
        self.grid = rows.reshape(len(self.response.time), -1)  # node by node
        if isinstance(self.response, ExactResponse):
            self.optima.value[:] = -np.inf
            self.optima.offer(self.response, self.optima.point.copy(), rows)
            refine(self.response, self.optima, rows, *self.box, subprogress(tick, 0.3, 0.5))
        if self.narrower is not None:
            self.optima.offer(self.response, self.narrower.point, rows)
        self.narrower = self.optima
        if (upper > lower).any():
            self._follow(np.ones(len(rows), bool), subprogress(tick, 0.5, 1.0))

    def improve(self, count: int, tick: Progress) -> None:
        """Maximise bounds at random nodes from fresh points; try better points at nodes nearby.

        Args:
            count: Number of passes before this one; each draws twice as many bounds.
            tick: Called with the completed fraction of the pass.
        """
        optima, outputs = self.optima, len(self.response.outputs)
        rng = np.random.default_rng((self.seed, self.number, count, len(optima.value)))
        size = int(np.clip(VALUES / (len(self.grid) * outputs), 64, FRESH))
        pool = fresh_points(rng, *self.box[:2], size)
        n_nodes = max(1, DRAWN * 2**count // (2 * outputs))
        nodes = np.sort(rng.permutation(len(self.grid))[:n_nodes])
        values = trajectories(_polynomials(self.response), pool, nodes)
        rivals = [best_of(pool, values, nodes)]
        rivals += [best_of(pool, values, nodes, number, rng) for number in CANDIDATES]
        improved = np.zeros(len(optima.value), bool)
        for number, rival in enumerate(rivals):
            _evaluate_and_refine(
                self.response, rival, self.box, subprogress(tick, number / 6, (number + 1) / 6)
            )
            better = optima.offer(self.response, rival.point, self.grid[nodes].ravel())
            improved[better] = True
        self._follow(improved, subprogress(tick, 0.5, 1.0))

    def _follow(self, fresh: Mask, tick: Progress) -> None:
        """Try the points of bounds under the mask at nodes nearby, and refine what they improve.

        Improved bounds are tried in the next round, until nothing improves or after `ROUNDS`.
        """
        for done in range(ROUNDS):
            ends = [(done + half) / ROUNDS for half in (0.0, 0.5, 1.0)]
            ticks = [subprogress(tick, *pair) for pair in pairwise(ends)]
            better = _exchanged(self.response, self.optima, self.grid, fresh, ticks[0])
            if not len(better):
                return
            refine(self.response, self.optima, better, *self.box, ticks[1])
            fresh = np.zeros(len(self.optima.value), bool)
            fresh[better] = True


def _evaluate_and_refine(
    response: Response, optima: Optima, box: tuple[Array, Array, float], tick: Progress
) -> None:
    """Set optima to values of a response at their points, and refine them by Newton's method.

    `box` is its lower and upper ends, and the gain below which Newton's method stops.
    """
    rows = np.arange(len(optima.value))
    optima.value[:] = -np.inf
    optima.offer(response, optima.point.copy(), rows)
    refine(response, optima, rows, *box, tick)


def _compared(
    response: Response,
    first: Optima,
    second: Optima,
    box: tuple[Array, Array, float],
    tick: Progress,
) -> tuple[Optima, Array]:
    """Return the better optimum of each of N pairs, and the distance of their values (N,).

    The first ones are of the response; the second, of another, are evaluated and refined on it in a
    box of lower and upper ends, and the gain below which Newton's method stops.
    """
    improved = copy.deepcopy(second)
    _evaluate_and_refine(response, improved, box, tick)
    better = improved.value > first.value
    best = replace(
        first,
        point=np.where(better[:, None], improved.point, first.point),
        value=np.maximum(first.value, improved.value),
        predicted_gain=np.where(better, improved.predicted_gain, first.predicted_gain),
    )
    return best, np.abs(improved.value - first.value)


def _second_response(model: ModalModel, flow: UnitFlow, *, is_accurate: bool) -> Response:
    """Return what the second search maximises: polynomials if accurate, else exact motions."""
    if is_accurate:
        return model.in_units(flow.scale)
    return ExactResponse.from_model(
        model, flow.scale, has_hessian=model.degree > 1 and not _rough(model, flow)
    )


def _rough(model: ModalModel, flow: UnitFlow) -> bool:
    """Return whether the polynomials miss more than `ROUGH` of an output's peak."""
    peak = np.abs(flow.flow.values(flow.boxes.modal[None])[0]).max(0)
    return bool((model.error.max(0) > ROUGH * peak).any())


def _polynomials(response: Response) -> ModalModel:
    """Return the polynomials of a response."""
    return response.model if isinstance(response, ExactResponse) else response


def _exchanged(response: Response, optima: Optima, grid: Rows, fresh: Mask, tick: Progress) -> Rows:
    """Try the optimal points of some bounds for the same bounds at nodes up to 16 steps away.

    An envelope consists of pieces of single motions, so that points are optimal at several nodes.

    Returns:
        Rising indices of the bounds that improved.

    Args:
        response: Exact motions or polynomials.
        optima: Optima of all N bounds, improved in place.
        grid: Indices of each node's bounds among the N, shape (T, 2 m).
        fresh: Mask of the bounds whose points are tried elsewhere, shape (N,).
        tick: Called with the completed fraction.
    """
    better = []
    for done, shift in enumerate(SHIFTS):
        tick(done / len(SHIFTS))
        count = max(len(grid) - shift, 0)
        for target_first, source_first in ((shift, 0), (0, shift)):
            source = grid[source_first : source_first + count].ravel()
            target = grid[target_first : target_first + count].ravel()[fresh[source]]
            better.append(optima.offer(response, optima.point[source[fresh[source]]], target))
    return np.asarray(np.unique(np.concatenate(better)))


def _search_errors(difference: Array, outputs: int, agreement: float) -> Array:
    """Return the estimated error of each bound, shape (N,), from the searches' differences.

    It is `UNSEEN` times the largest difference on the same output, at least the agreement.

    Args:
        difference: Differences of the two searches, shape (N,).
        outputs: Number of outputs m; N = T m 2.
        agreement: Largest difference at which searches agree.
    """
    by_output = difference.reshape(-1, outputs, 2).max((0, 2))
    largest = np.broadcast_to(
        np.repeat(by_output, 2), (difference.size // (2 * outputs), 2 * outputs)
    )
    return np.asarray(UNSEEN * np.maximum(agreement, largest)).ravel()


def _rounding(model: ModalModel, peak: Array) -> Array:
    """Return the error of trajectories in double precision, shape (T, m), for peaks (m,)."""
    rates = np.abs(model.eigenvalue.coefficients[0])  # |λ| at the middle of the box
    largest = max(rates.max(), frequencies(model.flow.system).max())
    relative: Array = 64 * np.finfo(float).eps + round_off(largest**2, rates.min(), model.time)
    return relative[:, None] * peak
