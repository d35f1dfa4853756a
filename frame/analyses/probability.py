"""Fuzzy probability that limits are exceeded, with some inputs random and others fuzzy.

The same independent draws of the random inputs serve all fuzzy points (common random numbers), so
that differences between the points are not noise. The fuzzy points are the corners of each α-cut
and points spread inside; other points may have a smaller or a larger probability. What the draws
may miss is bounded at every fuzzy point by the interval of Clopper and Pearson (Biometrika 26, 404,
1934) at the level of Bonferroni: with the probability `CONFIDENCE` the intervals of all points
contain their probabilities at once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import Annotated, NamedTuple

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.base.errors import checked_number, require, require_choice
from alphacut.base.number_text import MINUS, ShownUnit, range_text
from alphacut.base.progress_bar import Progress
from alphacut.base.quantity import Quantity
from alphacut.frame.analyses.answer import Answer, Row
from alphacut.frame.analyses.limits import (
    ANY,
    Limit,
    LimitResult,
    about_limit,
    limits_by_name,
    stated_units,
)
from alphacut.frame.analyses.question import Asked, Question
from alphacut.frame.boxes import ALPHA, Boxes, boxes
from alphacut.frame.dynamics.flow import Flow
from alphacut.frame.dynamics.nonlinear import make_flow
from alphacut.frame.result import within_steps
from alphacut.frame.structures.model import StructureModel
from alphacut.frame.verification.step_error import MARGIN, node_deviation
from alphacut.fuzzy import Crisp, FuzzyNumber
from alphacut.fuzzy.result import Ends, Nature
from alphacut.fuzzy.sets.boxes import chebyshev_points, corners
from alphacut.fuzzy.sets.numbers import enclosed_set

CONFIDENCE = 0.95
"""Probability with which the intervals of all fuzzy points of a limit contain their probabilities;
conventional."""

Sampler = Callable[["np.random.Generator", int], Array]
"""Function that returns a number of values of a random parameter, in SI units, by a generator."""


class Curve(NamedTuple):
    """Probability of exceeding a limit as a function of the limit.

    Args:
        limit: Limits, shape (limits,); for an event of several limits, fractions of the limits.
        lower: Lower bounds of the probability, shape (levels, limits).
        upper: Upper bounds of the probability, shape (levels, limits).
    """

    limit: Array
    lower: Array
    upper: Array


@dataclass(frozen=True, eq=False, kw_only=True)
class LimitProbability(LimitResult):
    """Bounds of the probability that a limit is exceeded, on each level.

    Args:
        lower: Smallest probability of the fuzzy points that were tried, shape (levels,).
        upper: Largest probability of these points, shape (levels,).
        error: Estimated change of either bound by peaks between the time nodes, shape (levels,).
        interval: Lower and upper end of the interval that contains the probabilities of all fuzzy
            points of a level with the probability `CONFIDENCE`, shape (levels,) each.
        curve: The same bounds for other limits.
        nature: Guarantee, which is attained: other points may have other probabilities.
    """

    lower: Array
    upper: Array
    error: Array
    interval: Ends
    curve: Curve
    nature: Nature = Nature.ATTAINED

    def bounds_text(self, level: int) -> str:
        """Return the bounds on the level with an index as text."""
        return range_text(float(self.lower[level]), float(self.upper[level]), self.nature, 3)


@dataclass(frozen=True)
class ProbabilityQuestion(Question):
    """Fuzzy probability that limits are exceeded; inputs that are not random stay fuzzy.

    Args:
        limits: Limits of magnitudes, one for each output, in SI units.
        random: inputs that are random, with the shape of their membership
        samples: random draws at each fuzzy point
    """

    needs_magnitudes = True
    limits: tuple[Limit, ...]
    random: tuple[str, ...] = ()
    # The error of a probability p falls as √(p (1 − p)/samples): 200 give 0.035 at p = 1/2. Each
    # sample is a response at each fuzzy point, so that more take long.
    samples: Annotated[int, Quantity(minimum=1, maximum=10_000, is_integer=True)] = 200

    def answer(self, asked: Asked, progress: Progress) -> Probability:
        """Return bounds of the probabilities, from samples that are computed anew."""
        members = [member for name in self.random for member in asked.model.group(name)]
        random = {x: asked.numbers[x] for x in members if asked.numbers[x].support.width > 0}
        return probability(
            asked.model,
            # An input is random or fuzzy, not both.
            {name: number for name, number in asked.inputs.items() if name not in random},
            self.limits,
            random,
            duration=asked.duration,
            step=asked.step,
            alpha=asked.alpha,
            samples=self.samples,
            progress=progress,
        )


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Probability(Answer):
    """Fuzzy probability that limits are exceeded.

    Args:
        alpha: Levels, shape (levels,).
        events: Probability of exceeding each limit by its name. If there are several limits, the
            last one, with the name `ANY`, is the probability that any of them is exceeded.
        fuzzy: Names of the fuzzy inputs.
        random: Names of the random inputs.
        samples: Number of draws at each fuzzy point.
        step: Distance of the time nodes, in s.
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
    def stated_units(self) -> dict[str, ShownUnit]:
        """Units in which the limits are stated, by output."""
        return stated_units(self.events.values())

    def text_rows(self) -> Iterator[Row]:
        """Yield a row for each limit, and last for any of them.

        The columns are the event that the limit is exceeded; bounds of its probability at the
        lowest level; the guarantee; the bounds at the highest level; the confidence interval at
        the lowest level; and what peaks between the time nodes may add, the largest over levels.
        """
        for part in self.events.values():
            low = float(part.interval.lower[0])
            high = float(part.interval.upper[0])
            # The interval is rounded outwards.
            interval = range_text(low, high, Nature.GUARANTEED, 3)
            yield {
                "limit": part.event,
                "at the lowest α": part.bounds_text(0),
                "nature": part.nature,
                "at the highest α": part.bounds_text(-1),
                f"{CONFIDENCE:.0%} interval at the lowest α": interval,
                "between nodes": f"{part.error.max():.2g}".replace("-", MINUS),
            }

    def number_rows(self) -> Iterator[Row]:
        """Yield a row of numbers for each limit and level, and last for the event of any limit.

        The columns are name, unit and value of the limit, α, the smallest and the largest
        probability of the points tried, the guarantee, both ends of the confidence interval, and
        what peaks between the time nodes may add to a probability.
        """
        for name, part in self.events.items():
            for level, alpha in enumerate(self.alpha):
                yield {
                    **part.columns(name),
                    "α": alpha,
                    "at least": part.lower[level],
                    "at most": part.upper[level],
                    "nature": part.nature,
                    f"{CONFIDENCE:.0%} interval from": part.interval.lower[level],
                    f"{CONFIDENCE:.0%} interval to": part.interval.upper[level],
                    "between nodes": part.error[level],
                }

    def words(self) -> str:
        """Return sentences on how the probability was computed, and on its interval."""
        random = ", ".join(self.random) or "no input"
        return (
            f"Random: {random}, with {self.samples} independent draws at each fuzzy point. The"
            " bounds are those of the fuzzy points that were tried; other points may have larger or"
            f" smaller probabilities. With a probability of {CONFIDENCE:.0%} the interval contains"
            " the probabilities of all these points at once (Clopper and Pearson, Bonferroni over"
            f" the points). Peaks are read every {self.step:g} s; the last column says what may be"
            " added between the nodes."
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
    """Return bounds of the probability that each limit, and any of several limits, is exceeded.

    All probabilities are computed from the same responses: those at all fuzzy points with all
    random draws.

    Args:
        model: A linear structure, whose response is exact at the time nodes, or a general system,
            which is integrated by the midpoint rule.
        inputs: Fuzzy parameters by name, in SI units.
        limits: Limits of magnitudes, one for each output, in SI units.
        random: Random parameters by name. A fuzzy number is drawn with a probability density of the
            shape of its membership function; a function is called with a generator and a count and
            returns values of shape (count,). Names without values are those of `inputs` that are
            random.
        duration: Length of the response, in s.
        step: Distance of the time nodes, in s.
        alpha: Levels.
        samples: Number of random draws.
        seed: Seed of the draws.
        progress: Called with the completed fraction.

    Raises:
        RefusedError: A parameter is both fuzzy and random, a random name is none of `inputs`, a
            limit is not positive or names no output, `samples` is below 1 or `seed` below 0, or a
            random parameter does not give `samples` finite values.
    """
    checked_number("samples", samples, whole=True, least=1)
    checked_number("seed", seed, whole=True, least=0)
    if not isinstance(random, Mapping):
        for name in random:
            require_choice("random", name, inputs)
        random = {name: inputs[name] for name in random}
        # What is random is not fuzzy.
        inputs = {name: number for name, number in inputs.items() if name not in random}
    named = limits_by_name(limits, (), magnitudes=True)
    model = model.with_outputs(tuple(named))
    # A parameter that is drawn at random cannot be a coordinate of a fuzzy point as well.
    shared = ", ".join(sorted(set(inputs) & set(random)))
    require(not shared, "random", value=shared, allowed="inputs that are not fuzzy too")
    draws = _random_draws(random, samples, seed)

    # Without fuzzy inputs, one parameter with its own value gives a box of one point.
    crisp = {name: Crisp(x) for name, x in model.parameters.items() if name not in random}
    first = dict(islice(crisp.items(), 1))
    cuts = boxes(inputs or first, alpha)
    flow = make_flow(model, (*cuts.names, *random), duration, step)
    points_of_levels = [_points_of_cut(cuts, level) for level in range(len(cuts.alpha))]
    level_of_points = np.repeat(np.arange(len(cuts.alpha)), [len(x) for x in points_of_levels])
    points = np.concatenate(points_of_levels)

    # 4 points of the lowest level with 4 draws each show the errors of the time steps (tuned).
    some_points = points_of_levels[0][:: -(-len(points_of_levels[0]) // 4)]
    some_inputs = np.concatenate([_joined(point, draws[:4]) for point in some_points])
    columns = [flow.outputs.index(name) for name in named]
    ratios = _peak_ratios(
        flow,
        points,
        draws,
        between=node_deviation(flow, some_inputs).T[columns],
        step_error=_step_error(flow, some_inputs).T[columns],
        columns=columns,
        limits=np.array([limit.number for limit in named.values()]),
        progress=progress,
    )

    events = {}
    for k, (name, limit) in enumerate(named.items()):
        about = about_limit(limit, model.unit_of(limit.output))
        events[name] = _limit_probability(
            about, ratios.of_limit(k), level_of_points, is_random=bool(random)
        )
    if len(named) > 1:
        about = LimitResult(output=ANY, is_event=True)
        events[ANY] = _limit_probability(
            about, ratios.of_any(), level_of_points, is_random=bool(random)
        )
    return Probability(
        encloses=enclosed_set(inputs.values()),
        alpha=np.asarray(cuts.alpha),
        events=events,
        fuzzy=tuple(inputs),
        random=tuple(random),
        samples=samples,
        step=step,
    )


def _random_draws(random: Mapping[str, FuzzyNumber | Sampler], samples: int, seed: int) -> Array:
    """Return independent draws of all random parameters, shape (samples, parameters).

    Without random parameters there is one draw of no parameters, shape (1, 0).

    Args:
        random: Distribution of each parameter by its name: a function that is called with a
            generator and a number and returns so many values in SI units, or a fuzzy number, whose
            membership function is taken as the shape of the probability density.
        samples: Number of draws.
        seed: Seed of the generator; equal seeds give equal draws.

    Raises:
        RefusedError: A function does not return `samples` finite values.
    """
    # One generator for all parameters: their draws are independent.
    rng = np.random.default_rng(seed)
    columns = []
    for name, number in random.items():
        if isinstance(number, FuzzyNumber):
            number = shaped_like(number)
        values = np.asarray(number(rng, samples), float)
        is_sample = values.shape == (samples,) and bool(np.isfinite(values).all())
        allowed = f"{samples} finite numbers"
        require(is_sample, f"values of {name}", value=values.shape, allowed=allowed)
        columns.append(values)
    return np.column_stack(columns) if columns else np.zeros((1, 0))


def shaped_like(number: FuzzyNumber) -> Sampler:
    """Return a sampler whose probability density is proportional to a membership function.

    The cumulative integral of the membership function is inverted by linear interpolation on a fine
    grid. A crisp number gives its only value.

    Args:
        number: The fuzzy number.

    Returns:
        Function of a random generator and a count n that returns n independent values, shape (n,).
    """
    support = number.support
    uniform = np.linspace(support.lower, support.upper, 4001)
    # The corners of the membership function belong to the grid, so that it is integrated exactly
    # where it is linear between them.
    cuts = number.cuts
    grid = np.unique(np.append(uniform, cuts.lower + cuts.upper))
    membership = number.membership(grid)
    # Trapezoidal rule.
    areas = np.diff(grid) * (membership[1:] + membership[:-1]) / 2
    integral = np.concatenate([[0.0], np.cumsum(areas)])

    def draw(rng: np.random.Generator, count: int) -> Array:
        return np.asarray(np.interp(rng.random(count) * integral[-1], integral, grid))

    return draw


def _points_of_cut(cuts: Boxes, level: int) -> Array:
    """Return points of an α-cut, in SI units, shape (points, inputs).

    They are 64 quasi-random points, denser towards the faces of the cut, and, for up to 8 inputs,
    first all corners. If no input has a width on the level, it is the nominal point alone.

    Args:
        cuts: The α-cuts as boxes.
        level: Index of the level.
    """
    lower, upper = cuts.unit_ends(level)
    if not (upper > lower).any():
        return cuts.nominal[np.newaxis]
    # 64 points inside, and all corners of up to 8 inputs (tuned: the time is in proportion).
    inner = (lower + upper) / 2 + (upper - lower) / 2 * chebyshev_points(len(lower), 64)
    if len(lower) <= 8:
        inner = np.vstack([corners(lower, upper), inner])
    return np.asarray(cuts.to_physical(inner))


def _joined(point: Array, draws: Array) -> Array:
    """Return the fuzzy inputs of a point followed by the random inputs of each draw.

    The shape is (draws, fuzzy and random inputs).
    """
    return np.hstack([np.tile(point, (len(draws), 1)), draws])


def _step_error(flow: Flow, points: Array) -> Array:
    """Return the estimated error that time stepping has caused by each time node.

    It is 1.5 times the largest error, up to the node, of some responses; 0 for exact responses. The
    shape is (times, outputs), in the units of the outputs.

    Args:
        flow: Response as a function of all inputs.
        points: Inputs whose responses are compared with more accurate ones, shape (points, inputs).
    """
    # Errors of time stepping accumulate, so that an estimate holds for all later nodes.
    _, errors = flow.deviations(points)  # (points, times, outputs)
    return np.asarray(MARGIN * np.maximum.accumulate(errors.max(axis=0), axis=0))


class PeakRatios(NamedTuple):
    """Bounds of the ratios of peaks to limits.

    Args:
        lower: Lower bounds of the peaks at the time nodes, shape (points, draws), or (points,
            draws, limits) for several limits.
        upper: Upper bounds of the peaks at the time nodes, same shape.
        within_steps: Upper bounds of the peaks at all times, same shape.
    """

    lower: Array
    upper: Array
    within_steps: Array

    def of_limit(self, number: int) -> PeakRatios:
        """Return the ratios to the limit with a number, shape (points, draws)."""
        return PeakRatios(
            self.lower[:, :, number], self.upper[:, :, number], self.within_steps[:, :, number]
        )

    def of_any(self) -> PeakRatios:
        """Return the largest ratio over all limits; it exceeds 1 if any limit is exceeded."""
        return PeakRatios(
            self.lower.max(axis=2), self.upper.max(axis=2), self.within_steps.max(axis=2)
        )


def _peak_ratios(
    flow: Flow,
    points: Array,
    draws: Array,
    *,
    between: Array,
    step_error: Array,
    columns: Sequence[int],
    limits: Array,
    progress: Progress | None,
) -> PeakRatios:
    """Return the ratios of peaks to limits at all fuzzy points with all draws.

    Args:
        flow: Response as a function of the fuzzy and then the random inputs, in SI units.
        points: Values of the fuzzy inputs, shape (points, fuzzy inputs).
        draws: Values of the random inputs, shape (draws, random inputs).
        between: By how much the magnitude of the limited outputs may exceed, within the step before
            each node, the larger of its values at both ends of the step, shape (limits, times).
        step_error: Error of the limited outputs at the nodes, shape (limits, times).
        columns: Index of the output that each limit belongs to.
        limits: Limits of magnitudes, positive, shape (limits,).
        progress: Called with the completed fraction.

    Returns:
        Lower and upper bounds of peak over limit at the time nodes, and upper bounds at all times,
        shape (points, draws, limits) each.

    Raises:
        RefusedError: A response does not exist or is not finite.
        StepError: A time step of a response did not converge.
    """
    of_points = []
    for k in range(len(points)):
        magnitudes = np.abs(flow.values(_joined(points[k], draws))[:, :, columns]).swapaxes(1, 2)
        # A magnitude is not negative, whatever the error. `within_steps` gives upper bounds over
        # the whole step before each node.
        low = np.maximum(magnitudes - step_error, 0.0)  # (draws, limits, times)
        high = magnitudes + step_error
        bounds = (low, high, within_steps(high, between))
        of_points.append([bound.max(axis=-1) / limits for bound in bounds])
        if progress:
            progress((k + 1) / len(points))
    lower, upper, at_all_times = np.moveaxis(np.array(of_points), 1, 0)
    return PeakRatios(lower, upper, at_all_times)


def _limit_probability(
    about: LimitResult, ratios: PeakRatios, level: Ints, *, is_random: bool
) -> LimitProbability:
    """Return bounds, over fuzzy points, of the probability that peak over limit exceeds 1.

    The probability at a point is the fraction of the draws that exceed the limit. On each level
    its smallest and its largest value over the points of the cut are given, with lower and upper
    bounds of the peaks at the time nodes; how far peaks between the nodes would change either; and
    the interval that contains the probabilities of all points at once with the probability 0.95.

    Args:
        about: Side, output, unit and value of the limit, or the name of the event.
        ratios: Bounds of peak over limit at the nodes and at all times, shape (points, draws) each.
        level: Index of the level to which each fuzzy point belongs, shape (points,).
        is_random: Whether there are random inputs. If not, there is one draw, and the interval is
            the range of the points, with what peaks between the nodes may add.

    Returns:
        Bounds, interval and error, shape (levels,) each, and the bounds as functions of 201 limits
        around the peaks: in SI units, and as multiples of the limits for an event of several.
    """
    # The bounds are computed for 201 further limits, and for the limit itself, a ratio of 1.
    # Beyond these limits the probability is 0 or 1.
    smallest = ratios.lower.min()
    largest = ratios.upper.max()
    limits = np.append(np.linspace(0.95 * smallest, 1.05 * largest, 201), 1.0)
    # Lower bounds of peaks give lower bounds of probabilities, and upper ones upper bounds. All
    # have the shape (levels, limits); the last limit is the one that is asked for.
    low = _bounds_over_points(_fractions_above(ratios.lower, limits), level).lower
    at_nodes = _bounds_over_points(_fractions_above(ratios.upper, limits), level)
    lower_at_nodes = at_nodes.lower[:, -1]
    high = at_nodes.upper
    # The same with what outputs may add within the time steps; it is declared as an error.
    fractions = _fractions_above(ratios.within_steps, np.ones(1))
    within_steps = _bounds_over_points(fractions, level)
    added_to_lower = within_steps.lower[:, 0] - lower_at_nodes
    added_to_upper = within_steps.upper[:, 0] - high[:, -1]
    # Without random inputs nothing is left to chance, and the interval is the range of the points.
    interval = Ends(low[:, -1], within_steps.upper[:, 0])
    if is_random:
        # Either limit at each point is missed with this probability; by the inequality of
        # Bonferroni all of them hold with the probability `CONFIDENCE`.
        tail = (1 - CONFIDENCE) / (2 * len(level))
        surely = (ratios.lower > 1).sum(axis=1)
        possibly = (ratios.within_steps > 1).sum(axis=1)
        of_points = clopper_pearson(surely, possibly, ratios.upper.shape[1], tail)
        interval = Ends(
            _bounds_over_points(of_points.lower, level).lower,
            _bounds_over_points(of_points.upper, level).upper,
        )
    return LimitProbability(
        **vars(about),
        lower=low[:, -1],
        upper=high[:, -1],
        error=np.maximum(added_to_lower, added_to_upper),
        interval=interval,
        curve=Curve(limits[:-1] * about.limit, low[:, :-1], high[:, :-1]),
    )


def clopper_pearson(least: Array, most: Array, total: int, tail: float) -> Ends:
    """Return exact confidence limits of a probability from counts in independent draws.

    If the probability of the event is the lower limit, the chance that `least` or more draws have
    it is `tail`. If it is the upper limit, the chance that `most` or fewer draws have it is `tail`
    (Clopper and Pearson, Biometrika 26, 404, 1934).

    Args:
        least: Number of draws in which the event occurs for sure, of any shape.
        most: Number of draws in which it may occur, `least` or more, same shape.
        total: Number of draws, 1 or more.
        tail: Probability with which either limit may be missed, between 0 and 1.

    Returns:
        Lower limits, 0 where `least` is 0, and upper limits, 1 where `most` is `total`, in the
        shape of the counts.
    """
    from scipy.special import betaincinv  # takes time to import

    # The limits are quantiles of beta distributions. They are 0 if no draw counts and 1 if all do,
    # where a parameter of the distributions would be zero.
    lower = betaincinv(np.maximum(least, 1), total - least + 1, tail)
    upper = betaincinv(most + 1, np.maximum(total - most, 1), 1 - tail)
    return Ends(np.where(least > 0, lower, 0.0), np.where(most < total, upper, 1.0))


def _fractions_above(peaks: Array, limits: Array) -> Array:
    """Return the fraction of peaks above each limit at each point, shape (points, limits).

    Args:
        peaks: Peaks, shape (points, draws).
        limits: Limits, shape (limits,).
    """
    # In a sorted row, the fraction at most a limit is the rank of the limit.
    rows = np.sort(peaks, axis=1)
    return np.array([1 - np.searchsorted(x, limits, side="right") / len(x) for x in rows])


def _bounds_over_points(values: Array, level: Ints) -> Ends:
    """Return the smallest and largest value over the points of each level and all higher ones.

    Args:
        values: Values, shape (points, …).
        level: Index of the level of each point, shape (points,).

    Returns:
        Both bounds, shape (levels, …), with as many levels as the largest index says.
    """
    # The cut of a level contains those of all higher levels and their points.
    by_level = [values[level >= k] for k in range(level.max() + 1)]
    return Ends(
        np.array([x.min(axis=0) for x in by_level]), np.array([x.max(axis=0) for x in by_level])
    )
