"""What an engineer reads off an envelope: fuzzy peaks, and fuzzy probabilities of exceeding a limit."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from frame.box import ALPHA, Boxes, boxes
from frame.envelope import Envelope
from frame.flow import Flow, LinearFlow
from frame.halton import chebyshev_points
from frame.integrators import Exact
from frame.jet import Array
from frame.lagrangian import LagrangianSystem
from frame.linear import LinearSystem
from frame.nonlinear_flow import LagrangianFlow
from fuzzy import FuzzyNumber


@dataclass(frozen=True, eq=False)
class FuzzyPeaks:
    """Largest magnitude of each output over time, as intervals by level.

    Args:
        alpha: Levels, shape (A,).
        lower: What the peak is at least, shape (A, m).
        upper: What it is at most, shape (A, m).
    """

    alpha: Array
    lower: Array
    upper: Array


def peaks(envelope: Envelope) -> FuzzyPeaks:
    """Fuzzy peaks of |output| from the envelope: the upper ends are exact, the lower ends a bound from below.

    No trajectory peaks higher than the envelope; and each has, at every node, at least the magnitude that its band is away from zero.
    """
    upper = np.maximum(envelope.upper, -envelope.lower).max(1)
    lower = np.maximum(np.maximum(envelope.lower, -envelope.upper), 0.0).max(1)
    return FuzzyPeaks(envelope.alpha, lower, upper)


@dataclass(frozen=True, eq=False)
class FuzzyProbability:
    """Probability that |output| exceeds a limit within the duration, as intervals by level.

    Args:
        alpha: Levels, shape (A,).
        lower: Least probability over the fuzzy inputs, shape (A,).
        upper: Greatest probability, shape (A,).
        deviation: Largest standard deviation of the estimates.
        trajectories: Trajectories computed.
    """

    alpha: Array
    lower: Array
    upper: Array
    deviation: float
    trajectories: int


def exceedance(
    system: LinearSystem | LagrangianSystem,
    inputs: Mapping[str, FuzzyNumber],
    random: Mapping[str, Callable[[np.random.Generator, int], Array]],
    *,
    limit: float,
    duration: float,
    step: float,
    output: int = 0,
    alpha: Sequence[float] = ALPHA,
    samples: int = 200,
    spread: int = 64,
    rng: np.random.Generator | None = None,
    progress: Callable[[float], None] | None = None,
) -> FuzzyProbability:
    """Fuzzy probability of exceeding a limit when some inputs are random and others fuzzy.

    The same random draws serve every fuzzy point (common random numbers), so differences between points are not noise. The bounds
    are attained at the points tried: corners and a spread of points of each box, from the narrowest to the widest.

    Args:
        system: A linear structure, by the exact propagator, or a general system, by the midpoint rule.
        inputs: Fuzzy parameters.
        random: Random parameters by name, each a sampler (generator, count) to values of shape (count,).
        limit: Magnitude of the output that must not be exceeded, in its unit.
        duration: Length of the simulation, in s.
        step: Distance of nodes, in s.
        output: Index of the output.
        alpha: Levels.
        samples: Random draws.
        spread: Points of the box besides its corners, per level.
        rng: Source of the draws; seeded with 0 unless given.
        progress: Called with the fraction done.

    Raises:
        ValueError: A parameter is both fuzzy and random, or the limit is not positive.
    """
    both = set(inputs) & set(random)
    if both or not limit > 0:
        raise ValueError(f"exceedance: limit {limit:g} must be positive, and {sorted(both) or 'no input'} cannot be both fuzzy and random")
    rng = rng or np.random.default_rng(0)
    cuts = boxes(inputs, alpha)
    draws = np.column_stack([sampler(rng, samples) for sampler in random.values()]) if random else np.zeros((1, 0))
    flow = _flow(system, (*cuts.names, *random), duration, step)
    tried = [_tried(cuts, level, spread) for level in range(len(cuts.alpha))]
    low, high, runs, total = np.empty(len(tried)), np.empty(len(tried)), 0, sum(map(len, tried)) * len(draws)
    least, most = 1.0, 0.0
    for level in reversed(range(len(tried))):
        for point in tried[level]:
            values = flow.values(np.hstack([np.tile(point, (len(draws), 1)), draws]))[:, :, output]
            share = float((np.abs(values).max(1) > limit).mean())
            least, most, runs = min(least, share), max(most, share), runs + len(draws)
            if progress:
                progress(runs / total)
        low[level], high[level] = least, most
    deviation = float(np.sqrt(np.max([low * (1 - low), high * (1 - high)]) / len(draws)))
    return FuzzyProbability(cuts.alpha, low, high, deviation, runs)


def _flow(system: LinearSystem | LagrangianSystem, names: tuple[str, ...], duration: float, step: float) -> Flow:
    if isinstance(system, LagrangianSystem):
        return LagrangianFlow(system, names, duration, step)
    return LinearFlow(system, names, duration, step, Exact())


def _tried(cuts: Boxes, level: int, spread: int) -> Array:
    from frame.sampling import corners

    lower, upper = cuts.unit(level)
    if not (upper > lower).any():
        return cuts.modal[None]
    inner = (lower + upper) / 2 + (upper - lower) / 2 * chebyshev_points(len(lower), spread)
    points = np.vstack([corners(lower, upper), inner]) if len(lower) <= 8 else inner
    return cuts.to_physical(points)
