"""Fuzzy probability that limits are exceeded, with some inputs random and others fuzzy.

The same independent draws serve every fuzzy point (common random numbers), so that differences
between points are no noise. The points are the corners of each α-cut and a spread inside, so the
bounds of the probability are attained: another point may have a smaller or a greater one.

What the draws may miss is bounded by the interval of Clopper and Pearson (1934) at every fuzzy
point, at the level of Bonferroni: with probability `CONFIDENCE` the intervals of all points hold
their probabilities at once.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from alphacut.frame.boxes import ALPHA, Boxes, boxes
from alphacut.frame.dynamics.nonlinear import make_flow
from alphacut.frame.questions.peaks import ANY, require_limits, within_steps
from alphacut.frame.structures.lagrangian import LagrangianSystem
from alphacut.frame.structures.linear import LinearSystem
from alphacut.frame.verification.step_error import MARGIN, node_deviation
from alphacut.fuzzy import FuzzyNumber
from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.progress_bar import Progress
from alphacut.fuzzy.refused import require
from alphacut.fuzzy.sets.boxes import chebyshev_points, corners

LIMITS = 201
"""Limits for which the probability is computed besides."""
SPREAD = 64
"""Points inside each α-cut."""
LOOKED_AT = 4
"""Fuzzy points, and draws of each, whose motion between nodes is looked at."""
MOST_CORNERS = 8
"""Inputs of which the corners are tried."""

CONFIDENCE = 0.95
"""Probability with which the intervals of all fuzzy points hold at once, for each limit."""

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
        evaluations: Motions computed.
    """

    lower: Array
    upper: Array
    error: Array
    interval: Array
    limits: Array
    curve: Array
    evaluations: int


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
        samples: Random draws.
        rng: Source of the draws.
        progress: Called with the completed fraction.

    Raises:
        RefusedError: A parameter is both fuzzy and random, a limit is not positive or names no
            output, or a random parameter does not give `samples` finite values.
    """
    require_limits(limits, model.outputs)
    shared = sorted(set(fuzzy) & set(random))
    require(
        not shared, "random", value=", ".join(shared), allowed="inputs that are not fuzzy as well"
    )
    drawn = [np.asarray(draw(rng, samples), float) for draw in random.values()]
    for name, values in zip(random, drawn, strict=True):
        finite = values.shape == (samples,) and bool(np.isfinite(values).all())
        require(
            finite, f"values of {name}", value=values.shape, allowed=f"{samples} finite numbers"
        )
    draws = np.column_stack(drawn) if drawn else np.zeros((1, 0))
    cuts = boxes(fuzzy, alpha)
    scheme = "midpoint" if isinstance(model, LagrangianSystem) else "exact"
    flow = make_flow(model, (*cuts.names, *random), duration, step, scheme)
    points_of_levels = [_tried(cuts, level) for level in range(len(cuts.alpha))]
    points = np.concatenate(points_of_levels)
    # errors between nodes and of time steps, from a few of the motions
    looked_at = points_of_levels[0][:: -(-len(points_of_levels[0]) // LOOKED_AT)]
    few = np.array([[*point, *draw] for point in looked_at for draw in draws[:LOOKED_AT]])
    between = node_deviation(flow, few)
    step_error = MARGIN * np.maximum.accumulate(flow.deviations(few)[1].max(0), axis=0)
    columns, sizes = [list(model.outputs).index(x) for x in limits], np.array([*limits.values()])
    ratios = []  # of peaks to limits: lower and upper bound at nodes, upper bound within steps
    for count, point in enumerate(points, start=1):
        values = np.abs(flow.values(np.hstack([np.tile(point, (len(draws), 1)), draws])))
        low, high = np.maximum(values - step_error, 0.0), values + step_error
        bounds = low, high, within_steps(high, between)
        ratios.append([x.max(1)[:, columns] / sizes for x in bounds])
        if progress:
            progress(count / len(points))
    by_point = np.moveaxis(np.array(ratios), 1, 0)  # (bounds, points, draws, limits)
    level = np.repeat(np.arange(len(cuts.alpha)), [len(x) for x in points_of_levels])
    events = [*np.moveaxis(by_point, -1, 0)] + ([by_point.max(-1)] if len(limits) > 1 else [])
    return {
        name: _probability(event, level, scale, has_random=bool(random))
        for name, event, scale in zip((*limits, ANY), events, (*sizes, 1.0), strict=False)
    }


def _tried(cuts: Boxes, level: int) -> Array:
    """Return corners of an α-cut and points inside it, shape (S, d), in SI units."""
    lower, upper = cuts.unit(level)
    if not (upper > lower).any():
        return cuts.modal[None]
    inner = (lower + upper) / 2 + (upper - lower) / 2 * chebyshev_points(len(lower), SPREAD)
    ends = corners(lower, upper) if len(lower) <= MOST_CORNERS else inner[:0]
    return np.asarray(cuts.to_physical(np.vstack([ends, inner])))


def _probability(event: Array, level: Array, scale: float, *, has_random: bool) -> Probability:
    """Return bounds of the probability that a ratio of peak to limit exceeds 1.

    Args:
        event: Ratios, shape (3, points, draws): lower bound and upper bound at the nodes, and upper
            bound within the steps.
        level: Row of the level of each point, shape (points,).
        scale: The limit.
        has_random: Whether there are random inputs.
    """
    low_ratio, ratio, ratio_within_steps = event
    # the last limit is the one in question, a ratio of 1
    limits = np.append(np.linspace(0.95 * low_ratio.min(), 1.05 * ratio.max(), LIMITS), 1.0)
    low, _ = _bounds(low_ratio, level, limits)
    least, high = _bounds(ratio, level, limits)
    larger = [ends[:, 0] for ends in _bounds(ratio_within_steps, level, np.ones(1))]
    interval = np.stack([least[:, -1], high[:, -1]])
    if has_random:
        n_least, n_most = ((x > 1).sum(axis=1) for x in (low_ratio, ratio_within_steps))
        interval = _interval(n_least, n_most, ratio.shape[1], level)
    return Probability(
        lower=low[:, -1],
        upper=high[:, -1],
        error=np.maximum(larger[0] - least[:, -1], larger[1] - high[:, -1]),
        interval=interval,
        limits=limits[:-1] * scale,
        curve=np.stack([low[:, :-1], high[:, :-1]]),
        evaluations=ratio.size,
    )


def _interval(least: Array, most: Array, draws: int, level: Array) -> Array:
    """Return the least lower and largest upper Clopper–Pearson limit over points, (2, A).

    Args:
        least: Number of draws that exceed the limit for sure, by point, shape (points,).
        most: Number of draws that may exceed it, also between nodes, shape (points,).
        draws: Independent draws at each point.
        level: Row of the level of each point, shape (points,).
    """
    from scipy.stats import beta

    miss = (1 - CONFIDENCE) / (2 * len(level))  # of either side at one point (Bonferroni)
    low = np.where(least > 0, beta.ppf(miss, least, draws - least + 1), 0.0)
    high = np.where(most < draws, beta.ppf(1 - miss, most + 1, draws - most), 1.0)
    inside = [level >= k for k in range(level.max() + 1)]
    return np.array([[low[x].min() for x in inside], [high[x].max() for x in inside]])


def _bounds(peak: Array, level: Array, limits: Array) -> tuple[Array, Array]:
    """Return least and greatest fraction of peaks above each limit, over points, (A, L) each.

    Points of higher levels count for the lower ones, so that the bounds are nested.

    Args:
        peak: Peaks, shape (points, draws).
        level: Row of the level of each point, shape (points,).
        limits: Limits, shape (L,).
    """
    rows = np.sort(peak, axis=1)
    share = np.array([1 - np.searchsorted(x, limits, side="right") / len(x) for x in rows])
    parts = [share[level >= k] for k in range(level.max() + 1)]
    return np.array([part.min(0) for part in parts]), np.array([part.max(0) for part in parts])
