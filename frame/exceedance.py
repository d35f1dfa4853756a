"""Fuzzy peaks and fuzzy probabilities of exceeding a limit."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Protocol

import numpy as np

from alphacut.frame.boxes import ALPHA, Boxes, boxes
from alphacut.frame.calculus.jet import Array
from alphacut.frame.calculus.low_discrepancy import chebyshev_points, corners
from alphacut.frame.calculus.numbers import require_count
from alphacut.frame.checks.admissible import require_motion, require_size
from alphacut.frame.checks.between_nodes import stray
from alphacut.frame.checks.step_error import MARGIN, deviations, exact
from alphacut.frame.dynamics.flow import Flow, LinearFlow
from alphacut.frame.dynamics.integrators import Exact
from alphacut.frame.dynamics.nonlinear import LagrangianFlow
from alphacut.frame.envelope import Envelope
from alphacut.frame.structures.lagrangian import LagrangianSystem
from alphacut.frame.structures.linear import LinearSystem
from alphacut.frame.structures.quantities import Output
from alphacut.fuzzy import FuzzyNumber
from alphacut.fuzzy.counted import counted
from alphacut.fuzzy.progress_bar import Progress, told
from alphacut.fuzzy.sets.given import positive
from alphacut.fuzzy.tables import html_table

LIMITS = 201
"""Limits for which the probability is computed besides."""
LOOKED_AT = 4
"""Fuzzy points, and draws of each, whose motion between nodes is looked at."""


class Distribution(Protocol):
    """A frozen distribution of `scipy.stats`."""

    def rvs(self, *, size: int, random_state: np.random.Generator) -> Array:
        """Values drawn from it, shape (size,)."""


Sampler = Callable[[np.random.Generator, int], Array] | Distribution


@dataclass(frozen=True, eq=False, repr=False)
class FuzzyPeaks:
    """Largest magnitude of each output over time, as intervals by level.

    Args:
        alpha: Levels, shape (A,).
        lower: What the peak is at least, shape (A, m).
        upper: What it is at most at the nodes, shape (A, m).
        error: What the peak may lie outside these by: between nodes and, where the envelope is not
            guaranteed, by its own error; shape (A, m). None where the envelope has no estimate.
        below: The part of it that the lower ends may lie too high by: a peak over time is no less
            than one at the nodes, so steps between them have none; shape (A, m), or None.
        outputs: Their names, shape (m,).
    """

    alpha: Array
    lower: Array
    upper: Array
    error: Array | None = None
    below: Array | None = None
    outputs: tuple[str, ...] = ()

    def __repr__(self) -> str:
        """A line for each output: its peak at the lowest level, and the error of that."""
        lines = [f"fuzzy peaks on {counted(len(self.alpha), 'level')}"]
        for k, (low, high) in enumerate(zip(self.lower[0], self.upper[0], strict=True)):
            name = self.outputs[k] if self.outputs else f"output {k}"
            unit = f" {Output(name).unit}" if self.outputs else ""
            error = "not estimated" if self.error is None else f"{self.error[0, k]:.2g}{unit}"
            cut = f"{low:.6g} … {high:.6g}{unit} at α = {self.alpha[0]:g}"
            lines.append(f"  {name}: {cut}, error {error}")
        return "\n".join(lines)


def peaks(envelope: Envelope) -> FuzzyPeaks:
    """Fuzzy peaks of |output|: upper ends of the envelope, lower ends from below.

    At the nodes no trajectory peaks higher than the envelope, and each has at least the magnitude
    that its band is away from zero; `error` says what the steps between may add.
    """
    size = np.maximum(envelope.upper, -envelope.lower)
    least = np.maximum(np.maximum(envelope.lower, -envelope.upper), 0.0)
    upper, lower = size.max(1), least.max(1)
    if envelope.between is None:
        return FuzzyPeaks(envelope.alpha, lower, upper, outputs=envelope.outputs)
    own = 0.0 if envelope.inner_lower is not None or envelope.error is None else envelope.error
    above = within_steps(size + own, envelope.between).max(1) - upper
    below = lower - np.maximum(least - own, 0.0).max(1)
    error = np.maximum(above, below)
    return FuzzyPeaks(envelope.alpha, lower, upper, error, below, envelope.outputs)


def within_steps(size: Array, between: Array) -> Array:
    """Bound of a magnitude in the step to each node, shape (…, T, m).

    Args:
        size: The magnitude at the nodes, shape (…, T, m).
        between: What it may exceed both ends of each step by, shape (T, m).
    """
    out = size.copy()
    out[..., 1:, :] = np.maximum(size[..., 1:, :], size[..., :-1, :]) + between[1:]
    return out


def tried_peaks(flow: Flow, cuts: Boxes, *, spread: int = 32) -> Array:
    """Least peak of |output| at the nodes among points tried on each level, shape (A, m).

    The true lower end of the fuzzy peak lies between that of `peaks` and this.

    Args:
        flow: The trajectories.
        cuts: The boxes.
        spread: Points tried besides corners, on each level.
    """
    least, found = np.full(len(flow.outputs), np.inf), []
    for level in reversed(range(len(cuts.alpha))):
        size = np.abs(flow.values(_tried(cuts, level, spread, corner=5)))
        least = np.minimum(least, size.max(1).min(0))
        found.append(least)
    return np.array(found[::-1])


@dataclass(frozen=True, eq=False, repr=False)
class FuzzyProbability:
    """Probability that |output| exceeds a limit within the duration, as intervals by level.

    Args:
        alpha: Levels, shape (A,).
        lower: Least probability over the fuzzy inputs, shape (A,).
        upper: Greatest probability, shape (A,).
        deviation: Largest standard deviation of the estimates; with few draws it stays large where
            none or all of them exceed the limit.
        trajectories: Trajectories computed.
        limits: Other limits, from below the least peak to above the greatest, shape (L,), in the
            output's unit.
        curve_lower: Least probability of exceeding each of them, shape (A, L).
        curve_upper: Greatest probability, shape (A, L).
        error: What the bounds may be short by, since trajectories may peak between nodes, shape
            (A,); estimated from some trajectories.
    """

    alpha: Array
    lower: Array
    upper: Array
    deviation: float
    trajectories: int
    limits: Array
    curve_lower: Array
    curve_upper: Array
    error: Array

    def __str__(self) -> str:
        """A line for each level."""
        head = (
            f"probability of exceeding the limit, attained at the points tried, {self.trajectories}"
            f" trajectories, with peaks between {self.limits[0]:.4g} and {self.limits[-1]:.4g},"
            f" standard deviation up to {self.deviation:.2g}"
        )
        rows = [f"  α = {a}: {low} … {high}, {short}" for a, low, high, short in self._told()]
        return "\n".join([head, *rows])

    __repr__ = __str__

    def _repr_html_(self) -> str:
        """The levels as a table, for notebooks."""
        return html_table(("α", "least", "greatest", "peaks between nodes"), self._told())

    def _told(self) -> list[tuple[str, ...]]:
        rows = zip(self.alpha, self.lower, self.upper, self.error, strict=True)
        return [(f"{a:g}", f"{x:.4g}", f"{y:.4g}", f"may add {e:.2g}") for a, x, y, e in rows]


def exceedance(
    system: LinearSystem | LagrangianSystem,
    inputs: Mapping[str, FuzzyNumber],
    random: Mapping[str, Sampler],
    *,
    limit: float,
    duration: float,
    step: float,
    output: int | str = 0,
    alpha: Sequence[float] = ALPHA,
    samples: int = 200,
    spread: int = 64,
    rng: np.random.Generator | None = None,
    progress: Progress | bool | None = None,
) -> FuzzyProbability:
    """Fuzzy probability of exceeding a limit when some inputs are random and others fuzzy.

    The same random draws serve every fuzzy point (common random numbers), so differences between
    points are not noise. The bounds are attained at the points tried: corners and a spread of
    points of each box, from the narrowest to the widest.

    Args:
        system: A linear structure, by the exact propagator, or a general system, by the midpoint
            rule.
        inputs: Fuzzy parameters.
        random: Random parameters by name, each a sampler (generator, count) to values of shape
            (count,), or a frozen distribution of `scipy.stats`.
        limit: Magnitude of the output that must not be exceeded, in its unit.
        duration: Length of the simulation, in s.
        step: Distance of nodes, in s.
        output: Name or index of the output.
        alpha: Levels.
        samples: Random draws.
        spread: Points of the box besides its corners, per level.
        rng: Source of the draws; seeded with 0 unless given.
        progress: As for `envelope`.

    Raises:
        ValueError: A parameter is both fuzzy and random, the limit is not positive, there is no
            such output, or a random parameter gives no `samples` numbers, or such as have no
            meaning.

    Warns:
        UserWarning: As `envelope`, of motions that may grow without end or hardly move.
    """
    try:
        name = output if isinstance(output, str) else system.outputs[output]
    except (IndexError, TypeError):
        name = str(output)  # which is refused as others that are none
    times = {"duration": duration, "step": step, "alpha": alpha, "progress": progress}
    how = {"limits": {name: limit}, "samples": samples, "spread": spread, "rng": rng, **times}
    return exceedances(system, inputs, random, **how)[name]  # type: ignore[arg-type]


ANY = "any of them"
"""Name of the event that any of several limits is exceeded."""


def exceedances(
    system: LinearSystem | LagrangianSystem,
    inputs: Mapping[str, FuzzyNumber],
    random: Mapping[str, Sampler],
    *,
    limits: Mapping[str, float],
    duration: float,
    step: float,
    alpha: Sequence[float] = ALPHA,
    samples: int = 200,
    spread: int = 64,
    rng: np.random.Generator | None = None,
    progress: Progress | bool | None = None,
    integrator: str = "midpoint",
) -> dict[str, FuzzyProbability]:
    """Fuzzy probabilities of exceeding several limits, from the same trajectories, as `exceedance`.

    Its arguments are the same, with the limits in their units by output in place of one, and the
    integrator of a general system.

    Returns:
        One for each output, and beside several `ANY`: that any limit is exceeded, over shares of
        all limits.

    Raises:
        ValueError: A parameter is both fuzzy and random, or a limit is not positive.
    """
    if not isinstance(random, Mapping):
        what = "it must map names to samplers or laws, as {'m1': scipy.stats.norm(100, 8)}"
        raise ValueError(f"exceedance: random is {random!r}; {what}")
    sizes, columns = _limits_of(system, limits, set(inputs) & set(random))
    require_count("samples", samples, 1)
    require_count("spread", spread, 1)
    rng = rng or np.random.default_rng(0)
    cuts = boxes(inputs, alpha)
    drawn = [_drawn(name, random[name], rng, samples) for name in random]
    draws = np.column_stack(drawn) if random else np.zeros((1, 0))
    names = *cuts.names, *random
    flow = _trajectories(system, names, duration, step, integrator)
    if isinstance(flow, LinearFlow):
        middle = np.tile(cuts.modal, (len(draws), 1))
        require_motion(flow.system, names, np.hstack([middle, draws]), duration, step)
    for name, values in zip(random, drawn, strict=True):
        require_size(name, system.parameters[name], np.array([values.min(), values.max()]))
    tried = [_tried(cuts, level, spread) for level in range(len(cuts.alpha))]
    least: list[Array] = []
    found: list[Array] = []
    higher: list[Array] = []
    spaced = tried[0][:: -(-len(tried[0]) // LOOKED_AT)]
    few = np.array([[*point, *draw] for point in spaced for draw in draws[:LOOKED_AT]])
    between, off = stray(flow, few), _off(flow, few)
    with told(progress) as tell:
        for point in np.concatenate(tried):
            size = np.abs(flow.values(np.hstack([np.tile(point, (len(draws), 1)), draws])))
            least.append(np.maximum(size - off, 0.0).max(1)[:, columns] / sizes)
            found.append((size + off).max(1)[:, columns] / sizes)
            higher.append(within_steps(size + off, between).max(1)[:, columns] / sizes)
            if tell:
                tell(len(found) / sum(map(len, tried)))
    of = np.repeat(np.arange(len(tried)), [len(points) for points in tried])
    three = [np.array(x) for x in (least, found, higher)]  # (points, draws, limits) each
    chance = partial(_probability, of=of, random=bool(random), alpha=cuts.alpha)
    each = [chance(*(x[..., k] for x in three), size=size) for k, size in enumerate(sizes)]
    if len(each) > 1:
        each.append(chance(*(x.max(-1) for x in three), size=1.0))
    return dict(zip((*limits, ANY), each, strict=False))


def _trajectories(
    system: LinearSystem | LagrangianSystem,
    names: tuple[str, ...],
    duration: float,
    step: float,
    integrator: str,
) -> Flow:
    if isinstance(system, LagrangianSystem):
        return LagrangianFlow(system, names, duration, step, integrator)
    return LinearFlow(system, names, duration, step, Exact())


def _drawn(name: str, given: Sampler, rng: np.random.Generator, samples: int) -> Array:
    """Values of a random parameter, shape (samples,)."""
    try:
        draw = given if callable(given) else lambda rng, n: given.rvs(size=n, random_state=rng)
        values = np.asarray(draw(rng, samples), float)
    except (TypeError, ValueError, AttributeError) as failure:
        raise ValueError(
            f"exceedance: random {name!r} is {given!r}; it must be a function of a generator and a"
            f" count, or a frozen distribution such as scipy.stats.norm(100, 8) ({failure})"
        ) from None
    if values.shape != (samples,) or not np.isfinite(values).all():
        raise ValueError(
            f"exceedance: random {name!r} gives values of shape {values.shape}; they must be"
            f" {samples} finite numbers, one for each sample"
        )
    return values


def _limits_of(
    system: LinearSystem | LagrangianSystem, limits: Mapping[str, float], both: set[str]
) -> tuple[Array, list[int]]:
    """The limits, shape (L,), and the columns of their outputs."""
    for name, limit in limits.items():
        if name not in system.outputs:
            known = ", ".join(system.outputs)
            raise ValueError(f"exceedance: there is no output '{name}'; known are {known}")
        positive(f"exceedance: the limit of {name}", limit)
    if both:
        raise ValueError(f"exceedance: {sorted(both)} cannot be both fuzzy and random")
    if not limits:
        raise ValueError("exceedance: there must be one limit at least")
    return np.array([*limits.values()], float), [system.outputs.index(name) for name in limits]


def _off(flow: Flow, points: Array) -> Array:
    """What trajectories are wrong by, with a margin, from those at some points, shape (T, m)."""
    if exact(flow):
        return np.zeros((len(flow.time), len(flow.outputs)))
    return MARGIN * np.maximum.accumulate(deviations(flow, points)[1].max(0), axis=0)


def _probability(
    least: Array, peak: Array, more: Array, of: Array, size: float, *, random: bool, alpha: Array
) -> FuzzyProbability:
    """Probability that peaks pass 1, from those at each fuzzy point and draw, (S, D).

    Args:
        least: Peaks at nodes over their limit, less what trajectories are wrong by.
        peak: The same with it added.
        more: Those within steps, likewise.
        of: Level of each point, shape (S,).
        size: The limit, which the curve's limits are in units of.
        random: Whether there are draws.
        alpha: Levels.
    """
    limits = np.linspace(0.95 * least.min(), 1.05 * peak.max(), LIMITS)
    low = _bounds(np.sort(least, axis=1), of, np.append(limits, 1.0))[0]
    least_above, high = _bounds(np.sort(peak, axis=1), of, np.append(limits, 1.0))
    above = _bounds(np.sort(more, axis=1), of, np.array([1.0]))
    draws = peak.shape[1]
    shares = (*low[:, -1], *high[:, -1])
    return FuzzyProbability(
        alpha,
        low[:, -1],
        high[:, -1],
        max(_deviation(share, draws) for share in shares) if random else 0.0,
        peak.size,
        limits * size,
        low[:, :-1],
        high[:, :-1],
        np.maximum(above[0][:, 0] - least_above[:, -1], above[1][:, 0] - high[:, -1]),
    )


def _deviation(share: float, draws: int) -> float:
    """Standard deviation of a probability from a share of draws (Laplace's rule)."""
    mean = (share * draws + 1) / (draws + 2)
    return float(np.sqrt(mean * (1 - mean) / (draws + 3)))


def _bounds(peak: Array, of: Array, limits: Array) -> tuple[Array, Array]:
    """Least and greatest share of peaks above each limit, nested over levels."""
    share = np.array([1 - np.searchsorted(row, limits, side="right") / len(row) for row in peak])
    parts = [share[of >= k] for k in range(of.max() + 1)]
    return np.array([part.min(0) for part in parts]), np.array([part.max(0) for part in parts])


def _tried(cuts: Boxes, level: int, spread: int, *, corner: int = 8) -> Array:
    lower, upper = cuts.unit(level)
    if not (upper > lower).any():
        return cuts.modal[None]
    inner = (lower + upper) / 2 + (upper - lower) / 2 * chebyshev_points(len(lower), spread)
    points = np.vstack([corners(lower, upper), inner]) if len(lower) <= corner else inner
    return cuts.to_physical(points)
