"""Fuzzy probability that limits are exceeded, with some inputs random and others fuzzy.

The same independent draws serve every fuzzy point (common random numbers), so that differences
between points are no noise. The points are the corners of each α-cut and a spread inside: another
one may have a smaller or a greater probability. What the draws may miss is bounded by the interval
of Clopper and Pearson (1934) at every fuzzy point, at the level of Bonferroni: with probability
`CONFIDENCE` the intervals of all points hold their probabilities at once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import require
from alphacut.base.number_text import MINUS, range_text
from alphacut.base.progress_bar import Progress
from alphacut.frame.analyses.answer import Record
from alphacut.frame.analyses.limits import (
    ANY,
    About,
    Limit,
    LimitsAnswer,
    facts_of,
    limits_by_name,
)
from alphacut.frame.boxes import ALPHA, Boxes, boxes
from alphacut.frame.dynamics.nonlinear import make_flow
from alphacut.frame.envelope import within_steps
from alphacut.frame.structures.model import StructureModel
from alphacut.frame.verification.step_error import MARGIN, node_deviation
from alphacut.fuzzy import Crisp, FuzzyNumber
from alphacut.fuzzy.result import Ends, Nature
from alphacut.fuzzy.sets.boxes import chebyshev_points, corners
from alphacut.fuzzy.sets.numbers import enclosed_set

LIMITS = 201  # limits for which the probability is computed besides
SPREAD = 64  # points inside each α-cut
LOOKED_AT = 4  # fuzzy points, and draws of each, whose motion between nodes is looked at
MAX_CORNER_INPUTS = 8  # most inputs of which all corners are tried
CONFIDENCE = 0.95  # probability with which the intervals of all fuzzy points of a limit hold

Sampler = Callable[[np.random.Generator, int], Array]
"""A function from a generator and a count to as many values of a random parameter, in SI."""


class Curve(NamedTuple):
    """Other limits, shape (L,), and bounds of the probability of exceeding each, shape (A, L)."""

    limit: Array
    lower: Array
    upper: Array


@dataclass(frozen=True, eq=False, kw_only=True)
class LimitProbability(About):
    """Bounds of the probability that a limit is exceeded, by level.

    Args:
        lower: Least probability over the fuzzy points tried, shape (A,).
        upper: Greatest one, shape (A,).
        error: What peaks between nodes may add to either, estimated, shape (A,).
        interval: Ends of the interval that holds the probabilities of all fuzzy points of a level
            with probability `CONFIDENCE` over the draws, shape (A,) each.
        curve: The same bounds for other limits; of several limits as fractions of theirs.
        nature: Attained: other points may have a smaller or a greater probability.
    """

    lower: Array
    upper: Array
    error: Array
    interval: Ends
    curve: Curve
    nature: Nature = Nature.ATTAINED

    def bounds_text(self, level: int) -> str:
        """Return the bounds on a level as a text."""
        return range_text(float(self.lower[level]), float(self.upper[level]), self.nature, 3)


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Probability(LimitsAnswer[LimitProbability]):
    """Fuzzy probability that limits are exceeded, on levels `alpha` (A,), by their names.

    `fuzzy` and `random` are the inputs by their kind, `samples` the draws at each fuzzy point and
    `step` the distance of the nodes, in s.
    """

    key = "probability"
    title = "How probable is it that limits are exceeded?"
    alpha: Array
    events: dict[str, LimitProbability]
    fuzzy: tuple[str, ...]
    random: tuple[str, ...]
    samples: int
    step: float

    @property
    def parts(self) -> dict[str, LimitProbability]:
        """The probabilities by the names of their limits."""
        return self.events

    def texts_of(self, part: LimitProbability) -> dict[str, str]:
        """Return bounds on the lowest and the highest level, and what they may miss."""
        low, high = (float(end[0]) for end in part.interval)
        return {
            "limit": part.event,
            "at the lowest α": part.bounds_text(0),
            "nature": self.nature_text(part.nature),
            "at the highest α": part.bounds_text(-1),
            f"{CONFIDENCE:.0%} interval at the lowest α": range_text(
                low,
                high,
                Nature.GUARANTEED,
                3,  # rounded outwards
            ),
            "between nodes": f"{part.error.max():.2g}".replace("-", MINUS),
        }

    def numbers_of(self, part: LimitProbability) -> Iterator[Record]:
        """Yield a record for each level."""
        for k, alpha in enumerate(self.alpha):
            yield {
                "α": float(alpha),
                "at least": float(part.lower[k]),
                "at most": float(part.upper[k]),
                "nature": self.nature_text(part.nature),
                f"{CONFIDENCE:.0%} interval from": float(part.interval.lower[k]),
                f"{CONFIDENCE:.0%} interval to": float(part.interval.upper[k]),
                "between nodes": float(part.error[k]),
            }

    def words(self) -> str:
        """Return sentences on how the probability was computed, and what its interval holds."""
        random = ", ".join(self.random) or "no input"
        return (
            f"Random: {random}, with {self.samples} independent draws at each fuzzy point."
            " The bounds are those of the fuzzy points tried; other points may have more or less."
            f" With a probability of {CONFIDENCE:.0%} the interval holds the probabilities of all"
            " fuzzy points at once (Clopper and Pearson, Bonferroni over the points). Peaks are"
            f" those at nodes every {self.step:g} s; the last column says what lies between them."
        )


def probability(
    model: StructureModel,
    inputs: Mapping[str, FuzzyNumber],
    limits: Limit | Sequence[Limit],
    random: Mapping[str, FuzzyNumber | Sampler] | Sequence[str] = (),
    *,
    duration: float,
    step: float,
    alpha: Sequence[float] = ALPHA,
    samples: int = 200,
    seed: int = 0,
    progress: Progress | None = None,
) -> Probability:
    """Return bounds of the probability of exceeding each limit, and `ANY` of several.

    All probabilities come from the same motions: those of all fuzzy points with all random draws.

    Args:
        model: A linear structure, moved by the exact propagator, or a general system, by the
            midpoint rule.
        inputs: Fuzzy parameters by name, in SI units.
        limits: Limits of magnitudes, one for each output, in SI units.
        random: Random parameters by name: a fuzzy number is drawn with a density of the shape of
            its membership, a function takes (generator, count) and returns values (count,). Names
            alone are those of `inputs` that are random.
        duration: Length of the motion, in s.
        step: Distance of nodes, in s.
        alpha: Levels.
        samples: Number of random draws.
        seed: Seed of the draws.
        progress: Called with the completed fraction.

    Raises:
        RefusedError: A parameter is both fuzzy and random, a limit is not positive or names no
            output, or a random parameter does not give `samples` finite values.
    """
    if not isinstance(random, Mapping):
        random = {name: inputs[name] for name in random}
        inputs = {name: number for name, number in inputs.items() if name not in random}
    named = limits_by_name(limits, (), magnitudes=True)
    model = model.with_outputs(tuple(named))
    sizes = np.array([x.number for x in named.values()])
    shared, allowed = ", ".join(sorted(set(inputs) & set(random))), "inputs that are not fuzzy too"
    require(not shared, "random", value=shared, allowed=allowed)
    rng, drawn = np.random.default_rng(seed), list[Array]()
    for name, number in random.items():
        draw = shaped_like(number) if isinstance(number, FuzzyNumber) else number
        values = np.asarray(draw(rng, samples), float)
        is_sample = values.shape == (samples,) and bool(np.isfinite(values).all())
        what, allowed = values.shape, f"{samples} finite numbers"
        require(is_sample, f"values of {name}", value=what, allowed=allowed)
        drawn.append(values)
    draws = np.column_stack(drawn) if drawn else np.zeros((1, 0))
    crisp = {name: Crisp(x) for name, x in model.parameters.items() if name not in random}
    cuts = boxes(inputs or dict([*crisp.items()][:1]), alpha)  # which has one point
    flow = make_flow(model, (*cuts.names, *random), duration, step)
    points_of_levels = [_points_of_cut(cuts, level) for level in range(len(cuts.alpha))]
    points = np.concatenate(points_of_levels)
    # errors between nodes and of time steps, from a few of the motions
    looked_at = points_of_levels[0][:: -(-len(points_of_levels[0]) // LOOKED_AT)]
    few = np.array([[*point, *draw] for point in looked_at for draw in draws[:LOOKED_AT]])
    between = node_deviation(flow, few)
    step_error = MARGIN * np.maximum.accumulate(flow.deviations(few)[1].max(0), axis=0)
    columns = [[*map(str, model.outputs)].index(x) for x in named]
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
    level = np.repeat(np.arange(len(cuts.alpha)), [len(x) for x in points_of_levels])
    has_random, events = bool(random), dict[str, LimitProbability]()
    for (name, limit), ratio in zip(named.items(), by_limit, strict=True):
        bounds = _bounds_of_event(ratio, level, limit.number, has_random=has_random)
        unit = model.unit_of(limit.output)
        events[name] = LimitProbability(**facts_of(limit, unit), **bounds)
    if len(named) > 1:
        bounds = _bounds_of_event(by_limit.max(0), level, 1.0, has_random=has_random)
        events[ANY] = LimitProbability(output=ANY, is_event=True, **bounds)
    return Probability(
        encloses=enclosed_set(inputs.values()),
        alpha=np.asarray(cuts.alpha),
        events=events,
        fuzzy=tuple(inputs),
        random=tuple(random),
        samples=samples,
        step=step,
    )


def shaped_like(number: FuzzyNumber) -> Sampler:
    """Return a function (generator, count) that draws values with a density like the membership."""
    grid = np.unique(np.concatenate([np.linspace(*number.support, 4001), *number.cuts[1:]]))
    membership = number.membership(grid)
    areas = np.diff(grid) * (membership[1:] + membership[:-1]) / 2
    integral = np.concatenate([[0.0], np.cumsum(areas)])

    def draw(rng: np.random.Generator, count: int) -> Array:
        return np.asarray(np.interp(rng.random(count) * integral[-1], integral, grid))

    return draw


def _points_of_cut(cuts: Boxes, level: int) -> Array:
    """Return corners of an α-cut and points inside it, shape (S, d), in SI units."""
    lower, upper = cuts.unit_ends(level)
    if not (upper > lower).any():
        return cuts.nominal[None]
    inner = (lower + upper) / 2 + (upper - lower) / 2 * chebyshev_points(len(lower), SPREAD)
    ends = corners(lower, upper) if len(lower) <= MAX_CORNER_INPUTS else inner[:0]
    return np.asarray(cuts.to_physical(np.vstack([ends, inner])))


def _bounds_of_event(
    event: Array, level: Array, limit: float, *, has_random: bool
) -> dict[str, Any]:
    """Return the bounds of `LimitProbability` that a ratio of peak to limit exceeds 1, by name."""
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
    return {
        "lower": low[:, -1],
        "upper": high[:, -1],
        "error": error,
        "interval": interval,
        "curve": Curve(limits[:-1] * limit, low[:, :-1], high[:, :-1]),
    }


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
