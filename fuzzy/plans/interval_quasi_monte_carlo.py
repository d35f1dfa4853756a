"""Interval quasi-Monte Carlo: random inputs with fuzzy parameters (section 7, [46]).

Each quasi-random probability u becomes, per α, the interval of quantiles that the fuzzy parameters
allow; the model is bounded over these intervals and the cuts of the other fuzzy inputs. Averages
over u bound the mean, the distribution and every quantile of the response.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product

import numpy as np
from numpy.typing import ArrayLike

from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.campaign.call import Function
from alphacut.fuzzy.knowledge.known import Known
from alphacut.fuzzy.plans.design import Method
from alphacut.fuzzy.plans.transformation import Reduced
from alphacut.fuzzy.propagation import propagate
from alphacut.fuzzy.refused import real, require
from alphacut.fuzzy.result import Bounds, Nature
from alphacut.fuzzy.sets.boxes import fuzzy_inputs
from alphacut.fuzzy.sets.numbers import FuzzyNumber, PiecewiseLinear


@dataclass(frozen=True)
class RandomInput:
    """A random input with fuzzy parameters.

    Args:
        quantile: From a probability and the parameters by name to a quantile, monotone in each
            parameter.
        parameters: The fuzzy parameters by name; a plain number is crisp.
    """

    quantile: Callable[..., float]
    parameters: Mapping[str, FuzzyNumber | float]

    def at(self, u: float, alpha: Sequence[float]) -> PiecewiseLinear:
        """Quantiles at a probability that the cuts of the parameters allow, as a fuzzy number."""
        numbers = fuzzy_inputs(self.parameters)
        rows = []
        for level in (grid := sorted({0.0, *alpha, 1.0})):
            corners = product(*(number.cut(level) for number in numbers.values()))
            rows.append([self.quantile(u, **dict(zip(numbers, x, strict=True))) for x in corners])
        low = np.maximum.accumulate(np.min(rows, axis=1))  # nested to round-off
        high = np.maximum(np.minimum.accumulate(np.max(rows, axis=1)), low[-1])
        return PiecewiseLinear(tuple(grid), tuple(low), tuple(high))


@dataclass(frozen=True, eq=False)
class IntervalResponse:
    """A response with bounds at every quasi-random point.

    Args:
        bounds: Bounds at each point.
    """

    bounds: Sequence[Bounds]

    @property
    def evaluations(self) -> int:
        """Evaluations of the model."""
        return sum(one.evaluations for one in self.bounds)

    @property
    def nature(self) -> Nature:
        """The weakest of the points; averages have the error of quasi-Monte Carlo besides."""
        return Nature.weakest(one.nature for one in self.bounds)

    def mean(self, output: str = "y") -> tuple[Array, Array]:
        """Bounds of the mean on every level, two arrays (levels,)."""
        lower, upper = self._ends(output)
        return lower.mean(axis=0), upper.mean(axis=0)

    def p_box(self, at: ArrayLike, output: str = "y") -> tuple[Array, Array]:
        """Bounds of the distribution function at responses `at` (m,), two arrays (levels, m)."""
        lower, upper = self._ends(output)
        responses = np.atleast_1d(np.asarray(at, float))
        least = (upper[..., None] <= responses).mean(axis=0)
        return least, (lower[..., None] <= responses).mean(axis=0)

    def quantile(self, probability: ArrayLike, output: str = "y") -> tuple[Array, Array]:
        """Bounds of quantiles at probabilities (m,), two arrays (levels, m)."""
        lower, upper = self._ends(output)
        at = np.atleast_1d(np.asarray(probability, float))
        return np.quantile(lower, at, axis=0).T, np.quantile(upper, at, axis=0).T

    def _ends(self, output: str) -> tuple[Array, Array]:
        """Ends at every point, two arrays (points, levels)."""
        ends = np.array([one.bounds(output) for one in self.bounds])
        return ends[:, 0], ends[:, 1]


@dataclass(frozen=True)
class IntervalQuasiMonteCarlo:
    """Sampling of a model with random and fuzzy inputs.

    Args:
        points: Quasi-random points, best a power of 2.
        seed: Where their scrambling starts from.
        method: How the model is bounded over the box of each point; corners, the default, are exact
            where the model is monotone, and too narrow where it is not.
    """

    points: int = 256
    seed: int = 0
    method: Method = field(default_factory=Reduced)

    def __post_init__(self) -> None:
        real("points", self.points, positive=True, whole=True)
        real("seed", self.seed, whole=True)

    def run(
        self,
        function: Function,
        random: Mapping[str, RandomInput],
        inputs: Mapping[str, FuzzyNumber | float],
        *,
        alpha: Sequence[float],
        known: Known | None = None,
    ) -> IntervalResponse:
        """Bound the response at every point and level.

        Args:
            function: Gets random and fuzzy inputs by name.
            random: The random inputs.
            inputs: The fuzzy inputs, which may be none; a plain number is crisp.
            alpha: Rising levels within 0 to 1.
            known: Facts about the function.

        Raises:
            RefusedError: There is no random input, or an input is named twice.
        """
        from scipy.stats import qmc

        apart = bool(random) and not set(random) & set(inputs)
        require(apart, "random inputs", tuple(random), "one or more, none of them fuzzy")
        sobol = qmc.Sobol(len(random), rng=np.random.default_rng(self.seed))
        results = []
        for u in sobol.random(self.points):
            drawn = {x: one.at(p, alpha) for (x, one), p in zip(random.items(), u, strict=True)}
            results.append(
                propagate(
                    function,
                    {**drawn, **inputs},
                    self.method,
                    alpha=alpha,
                    known=known,
                    progress=False,
                )
            )
        return IntervalResponse(results)
