"""Interval quasi-Monte Carlo: random inputs with fuzzy parameters (section 7, [46]).

Each quasi-random probability u becomes, per α, the interval of quantiles that the fuzzy parameters
allow; the model is bounded over these intervals and the cuts of the other fuzzy inputs. Averages
over u bound the mean, the distribution and every quantile of the response.

The points come in eight independent scramblings of Sobol's sequence (Owen, 1995). The scatter
of the averages over each of them gives the t-interval of their mean.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.campaign.call import Function
from alphacut.fuzzy.knowledge.known import Knowledge
from alphacut.fuzzy.plans.design import Plan
from alphacut.fuzzy.plans.transformation import Reduced
from alphacut.fuzzy.propagation import propagate
from alphacut.fuzzy.refused import checked_number, require
from alphacut.fuzzy.result import Bounds, Nature
from alphacut.fuzzy.sets.boxes import fuzzy_inputs
from alphacut.fuzzy.sets.numbers import FuzzyNumber, PiecewiseLinear

SCRAMBLINGS = 8
"""Independent scramblings of the points."""
CONFIDENCE = 0.95
"""Probability with which a t-interval holds the true average over the random inputs."""


@dataclass(frozen=True)
class RandomInput:
    """A random input with fuzzy parameters.

    Args:
        quantile: From a probability and the parameters by name to a quantile, monotone in each
            parameter.
        parameters: The fuzzy parameters by name; a plain number is crisp.

    Example:
        >>> from alphacut.fuzzy import Interval
        >>> uniform = RandomInput(lambda u, start: start + u, {"start": Interval(0, 1)})
        >>> uniform.at(0.5, [0.0]).support
        Cut(lower=0.5, upper=1.5)
    """

    quantile: Callable[..., float]
    parameters: Mapping[str, FuzzyNumber | float]

    def at(self, u: float, alpha: Sequence[float]) -> PiecewiseLinear:
        """Return the fuzzy number of quantiles at probability u, from the cuts of the parameters.

        Each cut is spanned by the quantiles at the corners of the box of parameters, since the
        quantile is monotone in each of them.

        Args:
            u: Probability in (0, 1).
            alpha: Levels in [0, 1] of the cuts, beside 0 and 1.
        """
        numbers, levels = fuzzy_inputs(self.parameters), sorted({0.0, *alpha, 1.0})
        quantiles = []  # by level, at all corners
        for level in levels:
            corners = product(*(number.cut(level) for number in numbers.values()))
            parameters = (dict(zip(numbers, corner, strict=True)) for corner in corners)
            quantiles.append([self.quantile(u, **values) for values in parameters])
        low = np.maximum.accumulate(np.min(quantiles, axis=1))  # nested despite round-off
        high = np.maximum(np.minimum.accumulate(np.max(quantiles, axis=1)), low[-1])
        return PiecewiseLinear(tuple(levels), tuple(low), tuple(high))


class Estimate(NamedTuple):
    """Bounds of an average over the random inputs, on each level.

    Args:
        lower: Lower bounds, shape (levels, …).
        upper: Upper bounds, same shape.
        lower_error: Half-width of the 95 % t-interval of each lower bound, same shape.
        upper_error: Half-width of the 95 % t-interval of each upper bound, same shape.
    """

    lower: Array
    upper: Array
    lower_error: Array
    upper_error: Array


@dataclass(frozen=True, eq=False)
class IntervalResponse:
    """A response with bounds at every quasi-random point.

    Args:
        bounds: Bounds at each point, scrambling by scrambling.
    """

    bounds: Sequence[Bounds]

    @property
    def evaluations(self) -> int:
        """Evaluations of the model."""
        return sum(bounds.evaluations for bounds in self.bounds)

    @property
    def nature(self) -> Nature:
        """The weakest nature at any point; it leaves out the error of quasi-Monte Carlo."""
        return Nature.weakest(bounds.nature for bounds in self.bounds)

    def mean(self, output: str = "y") -> Estimate:
        """Bounds of the mean on every level, arrays of shape (levels,)."""
        return self._estimate(output, lambda bounds: np.asarray(bounds.mean(axis=0)))

    def p_box(self, at: ArrayLike, output: str = "y") -> Estimate:
        """Bounds of the distribution function at responses (m,): arrays of shape (levels, m)."""
        responses = np.atleast_1d(np.asarray(at, float))

        def cdf(bounds: Array) -> Array:
            return np.asarray((bounds[..., None] <= responses).mean(axis=0))

        lower, upper, lower_error, upper_error = self._estimate(output, cdf)
        # the distribution function of the upper bounds of the response is the lower one
        return Estimate(upper, lower, upper_error, lower_error)

    def quantile(self, probability: ArrayLike, output: str = "y") -> Estimate:
        """Bounds of the quantiles at probabilities (m,): arrays of shape (levels, m)."""
        probabilities = np.atleast_1d(np.asarray(probability, float))

        def quantiles(bounds: Array) -> Array:
            return np.asarray(np.quantile(bounds, probabilities, axis=0).T)

        return self._estimate(output, quantiles)

    def _estimate(self, output: str, average: Callable[[Array], Array]) -> Estimate:
        """Return bounds of an average over the points, with the half-widths of their t-intervals.

        Args:
            output: Name of the output.
            average: From lower or upper bounds at n points, shape (n, levels), to their average,
                shape (levels, …).
        """
        from scipy.stats import t

        bounds = np.array([x.bounds(output) for x in self.bounds])  # (points, 2, levels)
        factor = t.ppf((1 + CONFIDENCE) / 2, SCRAMBLINGS - 1) / np.sqrt(SCRAMBLINGS)

        def half_width(end: Array) -> Array:
            averages = [average(part) for part in np.split(end, SCRAMBLINGS)]
            return np.asarray(factor * np.std(averages, axis=0, ddof=1))

        lower, upper = bounds[:, 0], bounds[:, 1]
        return Estimate(average(lower), average(upper), half_width(lower), half_width(upper))


@dataclass(frozen=True)
class IntervalQuasiMonteCarlo:
    """Sampling of a model with random and fuzzy inputs.

    Args:
        points: Quasi-random points of all eight scramblings, a multiple of 8, best a power of 2.
        seed: Seed of the scramblings.
        method: How the model is bounded over the box of each point; corners, the default, are exact
            where the model is monotone, and too narrow where it is not.

    Example:
        >>> from alphacut.fuzzy import Interval
        >>> uniform = RandomInput(lambda u, start: start + u, {"start": Interval(0, 1)})
        >>> method = IntervalQuasiMonteCarlo(64)
        >>> mean = method.run(lambda r: r, {"r": uniform}, {}, alpha=[0]).mean()
        >>> mean.lower.round(2).item(), mean.upper.round(2).item()
        (0.5, 1.5)
    """

    points: int = 256
    seed: int = 0
    method: Plan = field(default_factory=Reduced)

    def __post_init__(self) -> None:
        checked_number("points", self.points, positive=True, whole=True)
        allowed = f"multiples of {SCRAMBLINGS}, one part for each scrambling"
        require(self.points % SCRAMBLINGS == 0, "points", value=self.points, allowed=allowed)
        checked_number("seed", self.seed, whole=True)

    def run(
        self,
        function: Function,
        random: Mapping[str, RandomInput],
        inputs: Mapping[str, FuzzyNumber | float],
        *,
        alpha: Sequence[float],
        knowledge: Knowledge | None = None,
    ) -> IntervalResponse:
        """Bounds of the response on every level at each quasi-random point of the random inputs.

        Args:
            function: Gets random and fuzzy inputs by name.
            random: The random inputs.
            inputs: The fuzzy inputs, which may be none; a plain number is crisp.
            alpha: Rising levels within 0 to 1.
            knowledge: Facts about the function.

        Raises:
            RefusedError: There is no random input, or an input is named twice.
        """
        is_disjoint = bool(random) and not set(random) & set(inputs)
        allowed = "one or more, none of them fuzzy"
        require(is_disjoint, "random inputs", value=tuple(random), allowed=allowed)
        results = []
        for point in self._probabilities(len(random)):
            pairs = zip(random.items(), point, strict=True)
            quantiles = {name: number.at(u, alpha) for (name, number), u in pairs}
            bounds = propagate(
                function,
                {**quantiles, **inputs},
                self.method,
                alpha=alpha,
                knowledge=knowledge,
                progress=False,
            )
            results.append(bounds)
        return IntervalResponse(results)

    def _probabilities(self, inputs: int) -> Array:
        """Sobol points of the unit cube, one scrambling after another, shape (points, inputs)."""
        from scipy.stats import qmc

        count = self.points // SCRAMBLINGS
        rngs = np.random.default_rng(self.seed).spawn(SCRAMBLINGS)
        return np.concatenate([qmc.Sobol(inputs, rng=rng).random(count) for rng in rngs])
