"""Fuzzy probability that limits are exceeded, with some inputs random and others fuzzy.

The same independent draws serve every fuzzy point (common random numbers), so that differences
between points are no noise. The points are the corners of each α-cut and a spread inside: another
one may have a smaller or a greater probability. What the draws may miss is bounded by the interval
of Clopper and Pearson (1934) at every fuzzy point, at the level of Bonferroni: with probability
`CONFIDENCE` the intervals of all points hold their probabilities at once.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import require
from alphacut.base.progress_bar import Progress
from alphacut.frame.analyses.peaks import ANY, require_limits
from alphacut.frame.boxes import ALPHA, Boxes, boxes
from alphacut.frame.dynamics.nonlinear import make_flow
from alphacut.frame.envelope import within_steps
from alphacut.frame.structures.lagrangian import LagrangianSystem
from alphacut.frame.structures.linear import LinearSystem
from alphacut.frame.verification.step_error import MARGIN, node_deviation
from alphacut.fuzzy import FuzzyNumber
from alphacut.fuzzy.result import Ends
from alphacut.fuzzy.sets.boxes import chebyshev_points, corners

LIMITS = 201  # limits for which the probability is computed besides
SPREAD = 64  # points inside each α-cut
LOOKED_AT = 4  # fuzzy points, and draws of each, whose motion between nodes is looked at
MAX_CORNER_INPUTS = 8  # most inputs of which all corners are tried
CONFIDENCE = 0.95  # probability with which the intervals of all fuzzy points of a limit hold

Sampler = Callable[[np.random.Generator, int], Array]


@dataclass(frozen=True, eq=False)
class Probability:
    """Bounds of the probability that a magnitude exceeds its limit, by level; always attained.

    Args:
        lower: Least probability over the fuzzy points tried, shape (A,).
        upper: Greatest one, shape (A,).
        error: What peaks between nodes may add to either, estimated, shape (A,).
        interval: Ends of the interval that holds the probabilities of all fuzzy points of a level
            with probability `CONFIDENCE` over the draws, shape (2, A).
        limits: Other limits, shape (L,), in SI units; as fractions of their limits for `ANY`.
        curve: Least and greatest probability of exceeding each of them, shape (2, A, L).
    """

    lower: Array
    upper: Array
    error: Array
    interval: Array
    limits: Array
    curve: Array


def probabilities(
    model: LinearSystem | LagrangianSystem,
    fuzzy: Mapping[str, FuzzyNumber],
    random: Mapping[str, Sampler],
    limits: Mapping[str, float],
    *,
    duration: float,
    step: float,
    alpha: Sequence[float] = ALPHA,
    samples: int = 200,
    rng: np.random.Generator,
    progress: Progress | None = None,
) -> dict[str, Probability]:
    """Return bounds of the probability of exceeding each limit, and `ANY` of several.

    All probabilities come from the same motions: those of all fuzzy points with all random draws.

    Args:
        model: A linear structure, moved by the exact propagator, or a general system, by the
            midpoint rule.
        fuzzy: Fuzzy parameters.
        random: Random parameters, each a function from (generator, count) to values (count,).
        limits: Largest magnitude allowed by output, in SI units.
        duration: Length of the motion, in s.
        step: Distance of nodes, in s.
        alpha: Levels.
        samples: Number of random draws.
        rng: Source of the draws.
        progress: Called with the completed fraction.

    Raises:
        RefusedError: A parameter is both fuzzy and random, a limit is not positive or names no
            output, or a random parameter does not give `samples` finite values.
    """
    require_limits(limits, model.outputs)
    shared, allowed = ", ".join(sorted(set(fuzzy) & set(random))), "inputs that are not fuzzy too"
    require(not shared, "random", value=shared, allowed=allowed)
    drawn = [np.asarray(draw(rng, samples), float) for draw in random.values()]
    for name, values in zip(random, drawn, strict=True):
        is_sample = values.shape == (samples,) and bool(np.isfinite(values).all())
        what, allowed = values.shape, f"{samples} finite numbers"
        require(is_sample, f"values of {name}", value=what, allowed=allowed)
    draws = np.column_stack(drawn) if drawn else np.zeros((1, 0))
    cuts = boxes(fuzzy, alpha)
    scheme = "midpoint" if isinstance(model, LagrangianSystem) else "exact"
    flow = make_flow(model, (*cuts.names, *random), duration, step, scheme)
    points_of_levels = [_points_of_cut(cuts, level) for level in range(len(cuts.alpha))]
    points = np.concatenate(points_of_levels)
    # errors between nodes and of time steps, from a few of the motions
    looked_at = points_of_levels[0][:: -(-len(points_of_levels[0]) // LOOKED_AT)]
    few = np.array([[*point, *draw] for point in looked_at for draw in draws[:LOOKED_AT]])
    between = node_deviation(flow, few)
    step_error = MARGIN * np.maximum.accumulate(flow.deviations(few)[1].max(0), axis=0)
    columns, sizes = [list(model.outputs).index(x) for x in limits], np.array([*limits.values()])
    step_error, between = step_error.T[columns], between.T[columns]  # (limits, T)
    ratios = []  # of peaks to limits: lower and upper bound at nodes, upper bound within steps
    for count, point in enumerate(points, start=1):
        values = flow.values(np.hstack([np.tile(point, (len(draws), 1)), draws]))
        size = np.abs(np.moveaxis(values, 2, 0)[columns]).swapaxes(0, 1)  # (draws, limits, T)
        low, high = np.maximum(size - step_error, 0.0), size + step_error
        ratios.append([x.max(-1) / sizes for x in (low, high, within_steps(high, between))])
        if progress:
            progress(count / len(points))
    by_limit = np.moveaxis(np.array(ratios), (3, 1), (0, 1))  # (limits, bounds, points, draws)
    events = dict(zip(limits, zip(by_limit, sizes, strict=True), strict=True))
    if len(limits) > 1:
        events[ANY] = by_limit.max(0), 1.0
    level = np.repeat(np.arange(len(cuts.alpha)), [len(x) for x in points_of_levels])
    return {
        name: _probability(event, level, limit, has_random=bool(random))
        for name, (event, limit) in events.items()
    }


def _points_of_cut(cuts: Boxes, level: int) -> Array:
    """Return corners of an α-cut and points inside it, shape (S, d), in SI units."""
    lower, upper = cuts.unit_ends(level)
    if not (upper > lower).any():
        return cuts.nominal[None]
    inner = (lower + upper) / 2 + (upper - lower) / 2 * chebyshev_points(len(lower), SPREAD)
    ends = corners(lower, upper) if len(lower) <= MAX_CORNER_INPUTS else inner[:0]
    return np.asarray(cuts.to_physical(np.vstack([ends, inner])))


def _probability(event: Array, level: Array, limit: float, *, has_random: bool) -> Probability:
    """Return bounds of the probability that a ratio of peak to limit exceeds 1."""
    # bounds of the ratios, shape (points, draws): lower and upper ones at nodes, upper within steps
    low_ratio, ratio, ratio_within_steps = event
    # the last limit is the one in question, a ratio of 1
    limits = np.append(np.linspace(0.95 * low_ratio.min(), 1.05 * ratio.max(), LIMITS), 1.0)
    low = _bounds_over_points(_fractions_above(low_ratio, limits), level).lower
    least, high = _bounds_over_points(_fractions_above(ratio, limits), level)
    larger = _bounds_over_points(_fractions_above(ratio_within_steps, np.ones(1)), level)
    interval = Ends(least[:, -1], high[:, -1])
    if has_random:
        tail = (1 - CONFIDENCE) / (2 * len(level))  # of either side at one point (Bonferroni)
        surely, possibly = ((x > 1).sum(axis=1) for x in (low_ratio, ratio_within_steps))
        ends = clopper_pearson(surely, possibly, ratio.shape[1], tail)
        of_level = [_bounds_over_points(end, level) for end in ends]
        interval = Ends(of_level[0].lower, of_level[1].upper)
    error = np.maximum(larger.lower[:, 0] - least[:, -1], larger.upper[:, 0] - high[:, -1])
    return Probability(
        lower=low[:, -1],
        upper=high[:, -1],
        error=error,
        interval=np.stack(interval),
        limits=limits[:-1] * limit,
        curve=np.stack([low[:, :-1], high[:, :-1]]),
    )


def clopper_pearson(least: Array, most: Array, total: int, tail: float) -> Ends:
    """Return exact limits of a probability from counts of events in independent draws.

    Of `total` draws `least` are events for sure and `most` may be, of one shape; each limit may be
    passed with probability `tail` (Clopper, Pearson 1934).
    """
    from scipy.special import betaincinv  # which takes time to import

    lower = betaincinv(np.maximum(least, 1), total - least + 1, tail)
    upper = betaincinv(most + 1, np.maximum(total - most, 1), 1 - tail)
    return Ends(np.where(least > 0, lower, 0.0), np.where(most < total, upper, 1.0))


def _fractions_above(peaks: Array, limits: Array) -> Array:
    """Return the fraction of peaks (points, draws) above each limit (L,), shape (points, L)."""
    rows = np.sort(peaks, axis=1)
    return np.array([1 - np.searchsorted(x, limits, side="right") / len(x) for x in rows])


def _bounds_over_points(values: Array, level: Array) -> Ends:
    """Return least and greatest values (A, …) over the points (points, …) of a level and higher."""
    by_level = [values[level >= k] for k in range(level.max() + 1)]
    return Ends(np.array([x.min(0) for x in by_level]), np.array([x.max(0) for x in by_level]))
