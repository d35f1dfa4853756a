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

from alphacut.fuzzy.arguments import fuzzy_inputs, known_facts
from alphacut.fuzzy.campaign.call import Call, Function
from alphacut.fuzzy.campaign.campaign import Campaign
from alphacut.fuzzy.knowledge.known import Known
from alphacut.fuzzy.plans.transformation import Reduced
from alphacut.fuzzy.progress_bar import Progress, told
from alphacut.fuzzy.samples.nature import Nature
from alphacut.fuzzy.samples.result import FuzzyResult, Plan
from alphacut.fuzzy.sets.boxes import Domain
from alphacut.fuzzy.sets.given import require_fields
from alphacut.fuzzy.sets.numbers import Array, Crisp, FuzzyNumber, PiecewiseLinear

_NOTES = 5  # of the plan at its many points that are kept
_INNER = (
    "the bounds are inner: too narrow where the model turns between the samples of a box; take"
    " General or Optimisation as plan there"
)


@dataclass(frozen=True)
class RandomInput:
    """A random input with fuzzy parameters.

    Args:
        quantile: From a probability u (n,) and the parameters by name to quantiles (n,), monotone
            in each parameter.
        parameters: The fuzzy parameters by name.
    """

    quantile: Callable[..., Array]
    parameters: Mapping[str, FuzzyNumber]

    def interval(self, u: Array, alpha: float) -> tuple[Array, Array]:
        """Least and greatest quantile at probabilities (n,) over the cut, two arrays (n,)."""
        corners = product(*(number.cut(alpha) for number in self.parameters.values()))
        values = np.array(
            [
                self.quantile(u, **dict(zip(self.parameters, corner, strict=True)))
                for corner in corners
            ]
        )
        return values.min(axis=0), values.max(axis=0)


@dataclass(frozen=True, eq=False)
class IntervalResponse:
    """A response with bounds at every quasi-random point.

    Args:
        alpha: Levels.
        outputs: Names of the outputs.
        lower: Lower ends, shape (points, levels, outputs).
        upper: Upper ends, shape (points, levels, outputs).
        runs: Samples of the model.
        nature: What the bounds at the points are worth: inner where the plan has seen corners or
            samples only, so that the bounds of a mean or a probability may be too narrow; the
            averages over the points have the error of quasi-Monte Carlo besides.
        notes: What the plan found on its way, one sentence each.
    """

    alpha: tuple[float, ...]
    outputs: tuple[str, ...]
    lower: Array
    upper: Array
    runs: int
    nature: Nature = Nature.INNER
    notes: tuple[str, ...] = ()

    def mean(self, output: str = "y") -> tuple[Array, Array]:
        """Bounds of the mean on every level, two arrays (levels,)."""
        lower, upper = self._ends(output)
        return lower.mean(axis=0), upper.mean(axis=0)

    def p_box(self, at: ArrayLike, output: str = "y") -> tuple[Array, Array]:
        """Bounds of the distribution function at responses `at` (m,), two arrays (levels, m)."""
        lower, upper = self._ends(output)
        wanted = np.atleast_1d(np.asarray(at, float))
        return (upper[..., None] <= wanted).mean(axis=0), (lower[..., None] <= wanted).mean(axis=0)

    def exceedance(self, limit: ArrayLike, output: str = "y") -> tuple[Array, Array]:
        """Bounds of the probability to exceed each limit (m,), two arrays (levels, m)."""
        lower, upper = self.p_box(limit, output)
        return 1 - upper, 1 - lower

    def quantile(self, probability: ArrayLike, output: str = "y") -> tuple[Array, Array]:
        """Bounds of quantiles at probabilities (m,), two arrays (levels, m)."""
        lower, upper = self._ends(output)
        wanted = np.atleast_1d(np.asarray(probability, float))
        return np.quantile(lower, wanted, axis=0).T, np.quantile(upper, wanted, axis=0).T

    def _ends(self, output: str) -> tuple[Array, Array]:
        if output not in self.outputs:
            raise ValueError(f"there is no output {output!r}; there are {', '.join(self.outputs)}")
        column = self.outputs.index(output)
        return self.lower[..., column], self.upper[..., column]


@dataclass(frozen=True)
class IntervalQuasiMonteCarlo:
    """Sampling plan of a model with random and fuzzy inputs.

    Args:
        points: Quasi-random points, best a power of 2.
        seed: Where their scrambling starts from.
        plan: How the model is bounded over the box of each point; corners, the default, are exact
            where the model is monotone, and too narrow where it is not.

    Raises:
        ValueError: There is no point.
    """

    points: int = 256
    seed: int = 0
    plan: Plan = field(default_factory=Reduced)

    def __post_init__(self) -> None:
        require_fields(self)
        if self.points < 1:
            number = f"the number of quasi-random points is {self.points}"
            raise ValueError(f"{number}; it must be 1 or more")

    def run(
        self,
        function: Function,
        random: Mapping[str, RandomInput],
        inputs: Mapping[str, FuzzyNumber | float],
        *,
        alpha: Sequence[float],
        vectorised: bool = False,
        known: Known | None = None,
        progress: Progress | bool | None = None,
    ) -> IntervalResponse:
        """Bound the response at every point and level.

        Args:
            function: Gets random and fuzzy inputs by name.
            random: The random inputs.
            inputs: The fuzzy inputs, which may be none; a plain number is crisp.
            alpha: Rising levels within 0 to 1.
            vectorised: Whether the function takes arrays.
            known: Facts about the function.
            progress: As for `propagate`.

        Raises:
            ValueError: There is no random input, an input is named twice, or the levels do not rise
                within 0 to 1.
        """
        from scipy.stats import qmc

        fuzzy, random = fuzzy_inputs(inputs), _random_inputs(random)
        alpha = Domain({"u": Crisp(0.0)}, alpha).alpha  # which refuses wrong levels
        twice = sorted(set(random) & set(inputs))
        if twice:
            both = f"{', '.join(twice)} is named among the random and the fuzzy inputs"
            raise ValueError(f"{both}; each must be one of the two")
        facts = known_facts(known, (*random, *fuzzy))
        u: Array = qmc.Sobol(len(random), rng=np.random.default_rng(self.seed)).random(self.points)
        ends = {
            name: [one.interval(u[:, i], level) for level in alpha]
            for i, (name, one) in enumerate(random.items())
        }
        call = Call(function, (*random, *inputs), vectorised=vectorised)
        campaign = Campaign(call, known=facts, stepwise=True)
        response = _Gathered()
        with told(progress) as tell:
            for k in range(self.points):
                drawn = {
                    name: _number(alpha, [cut[0][k] for cut in cuts], [cut[1][k] for cut in cuts])
                    for name, cuts in ends.items()
                }
                response.add(self.plan.run(campaign, Domain({**drawn, **fuzzy}, alpha)), facts)
                if tell:
                    tell((k + 1) / self.points)
        return response.response(tuple(alpha))


@dataclass
class _Gathered:
    """Findings of the plan so far."""

    rows: list[tuple[Array, Array]] = field(default_factory=list)
    outputs: tuple[str, ...] = ()
    runs: int = 0
    natures: set[Nature] = field(default_factory=set)
    notes: dict[str, None] = field(default_factory=dict)  # each once, in their order

    def add(self, result: FuzzyResult, known: Known) -> None:
        """Take the bounds at one more point, confronted with what is stated."""
        result = result.confronted(known.stated(result.inputs, result.outputs))
        self.rows.append((result.lower, result.upper))
        self.outputs, self.runs = result.outputs, self.runs + result.runs
        self.natures.add(result.nature)
        self.notes |= dict.fromkeys(result.notes)

    def response(self, alpha: tuple[float, ...]) -> IntervalResponse:
        """The response over all points, with the weakest of what their bounds are worth."""
        order = Nature.ESTIMATED, Nature.INNER, Nature.GUARANTEED
        weakest = next(nature for nature in order if nature in self.natures)
        notes = (*tuple(self.notes)[:_NOTES], *((_INNER,) if weakest is Nature.INNER else ()))
        low, high = np.array(self.rows).swapaxes(0, 1)
        return IntervalResponse(alpha, self.outputs, low, high, self.runs, weakest, notes)


def _random_inputs(random: Mapping[str, RandomInput]) -> dict[str, RandomInput]:
    """The random inputs, a plain number among their parameters made a crisp one."""
    wrong = [name for name, one in random.items() if not isinstance(one, RandomInput)]
    if wrong or not random:
        first = (f"the random input {name} is {random[name]!r}" for name in wrong)
        got = next(first, "there is no random input")
        cure = "give RandomInput(quantile, parameters), or propagate the fuzzy inputs alone"
        raise ValueError(f"{got}; {cure}")
    return {
        name: RandomInput(one.quantile, fuzzy_inputs(one.parameters))
        for name, one in random.items()
    }


def _number(
    alpha: Sequence[float], lower: Sequence[float], upper: Sequence[float]
) -> PiecewiseLinear:
    """Quantiles of a point as a fuzzy number, nested to round-off, constant beyond the levels."""
    low, high = np.maximum.accumulate(lower), np.minimum.accumulate(upper)
    wide = tuple(sorted({0.0, *alpha, 1.0}))
    ends = (np.interp(wide, alpha, side).tolist() for side in (np.minimum(low, high), high))
    return PiecewiseLinear(wide, *map(tuple, ends))
