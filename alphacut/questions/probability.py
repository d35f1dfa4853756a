"""Probability that limits are exceeded, with some inputs random and the others fuzzy."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from pydantic import Field

from alphacut.base.arrays import Array
from alphacut.base.number_text import MINUS, range_text
from alphacut.case.limits import ProbabilitySection
from alphacut.frame.analyses.probability import CONFIDENCE, probabilities
from alphacut.fuzzy import FuzzyNumber
from alphacut.fuzzy.result import Ends, Nature
from alphacut.questions.question import FuzzyResponse, LimitAnswer, LimitsAnswer, Record, Texts
from alphacut.stages.store import CutsResult, Values


class LimitProbability(LimitAnswer):
    """Bounds of the probability that a limit is exceeded, on each level.

    Peaks between nodes may add `error`; `interval` holds the probabilities of all fuzzy points
    with `CONFIDENCE`; `curve` has "limit", other limits (L,), and "lower" and "upper" bounds of the
    probability of exceeding them, (levels, L).
    """

    lower: Values
    upper: Values
    error: Values
    interval: CutsResult
    nature: Nature = Nature.ATTAINED
    curve: dict[str, Values]

    def bounds_text(self, level: int) -> str:
        """Bounds of the probability on a level."""
        return range_text(float(self.lower[level]), float(self.upper[level]), self.nature, 3)


class ProbabilityAnswer(LimitsAnswer[LimitProbability]):
    """Fuzzy probability that limits are exceeded, by their names."""

    key = "probability"
    title = "How probable is it that limits are exceeded?"
    caption = "Fuzzy probability of exceeding a limit, over the limit"
    limits: dict[str, LimitProbability] = Field(alias="events")
    fuzzy: tuple[str, ...]
    random: tuple[str, ...]
    samples: int
    step: float

    def texts_of(self, limit: LimitProbability) -> Texts:
        """Bounds on the lowest and the highest level, and what they may miss."""
        interval = range_text(*limit.interval[0], Nature.GUARANTEED, 3)  # rounded outwards
        return {
            "limit": limit.event,
            "at the lowest α": limit.bounds_text(0),
            "nature": self.nature_text(limit.nature),
            "at the highest α": limit.bounds_text(-1),
            f"{CONFIDENCE:.0%} interval at the lowest α": interval,
            "between nodes": f"{limit.error.max():.2g}".replace("-", MINUS),
        }

    def numbers_of(self, limit: LimitProbability) -> Iterator[Record]:
        """Yields a record for each level."""
        for k, alpha in enumerate(self.alpha):
            yield {
                "α": float(alpha),
                "at least": float(limit.lower[k]),
                "at most": float(limit.upper[k]),
                "nature": self.nature_text(limit.nature),
                f"{CONFIDENCE:.0%} interval from": limit.interval[k][0],
                f"{CONFIDENCE:.0%} interval to": limit.interval[k][1],
                "between nodes": float(limit.error[k]),
            }

    def words(self) -> str:
        """Sentences on how the probability was computed, and on what its interval holds."""
        random = ", ".join(self.random) or "no input"
        text = (
            f"Random: {random}, with {self.samples} independent draws at each fuzzy point."
            " The bounds are those of the fuzzy points tried; other points may have more or less."
            f" With a probability of {CONFIDENCE:.0%} the interval holds the probabilities of all"
            " fuzzy points at once (Clopper and Pearson, Bonferroni over the points). Peaks are"
            f" those at nodes every {self.step:g} s; the last column says what lies between them."
        )
        return f"{text} {self.words_on_box()}".strip()


def probability(section: ProbabilitySection, response: FuzzyResponse) -> ProbabilityAnswer:
    """Bounds of the probability of exceeding each limit, and any of several, by level."""
    structure = response.structure
    limits = section.limits_in_si(structure)
    random = structure.inputs(section.random, "probability.random")
    fuzzy = {name: number for name, number in response.inputs.items() if name not in random}
    crisp = {x: number for x, number in structure.numbers.items() if number.support.width == 0}
    stand_in = dict([*crisp.items()][:1])  # for no fuzzy input
    answers = probabilities(
        structure.model_with_outputs("probability.limits", tuple(limits)),
        fuzzy or stand_in,
        {name: shaped_like(number) for name, number in random.items()},
        limits,
        duration=response.duration,
        step=response.step,
        alpha=response.alpha,
        samples=section.samples,
        rng=np.random.default_rng(0),
        progress=response.progress,
    )
    return ProbabilityAnswer(
        encloses=response.encloses,
        fuzzy=tuple(fuzzy),
        random=tuple(random),
        samples=section.samples,
        step=response.step,
        alpha=np.array(response.alpha),
        events={
            name: LimitProbability.of(
                section,
                name,
                structure,
                lower=answer.lower,
                upper=answer.upper,
                error=answer.error,
                interval=CutsResult.of(answer.interval.T),
                curve={"limit": answer.limits, **Ends(*answer.curve)._asdict()},
            )
            for name, answer in answers.items()
        },
    )


def shaped_like(number: FuzzyNumber) -> Callable[[np.random.Generator, int], Array]:
    """A function (generator, count) that draws values with a density like the membership."""
    grid = np.unique(np.concatenate([np.linspace(*number.support, 4001), *number.cuts[1:]]))
    membership = number.membership(grid)
    areas = np.diff(grid) * (membership[1:] + membership[:-1]) / 2
    integral = np.concatenate([[0.0], np.cumsum(areas)])

    def draw(rng: np.random.Generator, count: int) -> Array:
        return np.asarray(np.interp(rng.random(count) * integral[-1], integral, grid))

    return draw
