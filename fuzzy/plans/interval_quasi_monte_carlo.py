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
from alphacut.fuzzy.plans.method import Method
from alphacut.fuzzy.plans.transformation import Reduced
from alphacut.fuzzy.propagation import propagate
from alphacut.fuzzy.refused import chosen, real, require
from alphacut.fuzzy.result import Nature
from alphacut.fuzzy.sets.boxes import Domain, fuzzy_inputs
from alphacut.fuzzy.sets.numbers import Crisp, FuzzyNumber, PiecewiseLinear


@dataclass(frozen=True)
class RandomInput:
    """A random input with fuzzy parameters.

    Args:
        quantile: From a probability u (n,) and the parameters by name to quantiles (n,), monotone
            in each parameter.
        parameters: The fuzzy parameters by name; a plain number is crisp.
    """

    quantile: Callable[..., Array]
    parameters: Mapping[str, FuzzyNumber | float]

    def interval(self, u: Array, alpha: float) -> tuple[Array, Array]:
        """Least and greatest quantile at probabilities (n,) over the cut, two arrays (n,)."""
        numbers = fuzzy_inputs(self.parameters)
        corners = product(*(number.cut(alpha) for number in numbers.values()))
        rows = [self.quantile(u, **dict(zip(numbers, corner, strict=True))) for corner in corners]
        return np.min(rows, axis=0), np.max(rows, axis=0)


@dataclass(frozen=True, eq=False)
class IntervalResponse:
    """A response with bounds at every quasi-random point.

    Args:
        alpha: Levels.
        outputs: Names of the outputs.
        lower: Lower ends, shape (points, levels, outputs).
        upper: Upper ends, shape (points, levels, outputs).
        evaluations: Of the model.
        nature: The weakest of the bounds at the points; the averages over the points have the error
            of quasi-Monte Carlo besides.
    """

    alpha: tuple[float, ...]
    outputs: tuple[str, ...]
    lower: Array
    upper: Array
    evaluations: int
    nature: Nature = Nature.ATTAINED

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
        chosen("output", output, self.outputs)
        column = self.outputs.index(output)
        return self.lower[..., column], self.upper[..., column]


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

    name = "interval quasi-Monte Carlo"

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
        vectorised: bool = False,
        known: Known | None = None,
    ) -> IntervalResponse:
        """Bound the response at every point and level.

        Args:
            function: Gets random and fuzzy inputs by name.
            random: The random inputs.
            inputs: The fuzzy inputs, which may be none; a plain number is crisp.
            alpha: Rising levels within 0 to 1.
            vectorised: Whether the function takes arrays.
            known: Facts about the function.

        Raises:
            RefusedError: There is no random input, or an input is named twice.
        """
        from scipy.stats import qmc

        apart = bool(random) and not set(random) & set(inputs)
        require(apart, "random inputs", tuple(random), "one or more, none of them fuzzy")
        alpha = Domain({"u": Crisp(0.0)}, alpha).alpha
        u: Array = qmc.Sobol(len(random), rng=np.random.default_rng(self.seed)).random(self.points)
        numbers = [_numbers(one, u[:, i], alpha) for i, one in enumerate(random.values())]
        results = [
            propagate(
                function,
                {**dict(zip(random, drawn, strict=True)), **inputs},
                self.method,
                alpha=alpha,
                vectorised=vectorised,
                known=known,
                progress=False,
            )
            for drawn in zip(*numbers, strict=True)
        ]
        return IntervalResponse(
            tuple(alpha),
            results[0].outputs,
            np.array([one.lower for one in results]),
            np.array([one.upper for one in results]),
            sum(one.evaluations for one in results),
            min((one.nature for one in results), key=list(Nature).index),
        )


def _numbers(one: RandomInput, u: Array, alpha: Sequence[float]) -> list[PiecewiseLinear]:
    """Quantiles at each point as a fuzzy number, nested to round-off, constant beyond levels."""
    ends = np.array([one.interval(u, level) for level in alpha])  # (levels, 2, points)
    low = np.maximum.accumulate(ends[:, 0])
    high = np.maximum(np.minimum.accumulate(ends[:, 1]), low[-1])
    wide = sorted({0.0, *alpha, 1.0})
    rows = [[np.interp(wide, alpha, side[:, k]) for side in (low, high)] for k in range(len(u))]
    return [PiecewiseLinear(tuple(wide), tuple(least), tuple(most)) for least, most in rows]
