"""Probability that limits are exceeded, with some inputs random and the others fuzzy."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from alphacut.case.limits import ProbabilitySection
from alphacut.frame.questions.probability import CONFIDENCE, Probability, probabilities
from alphacut.fuzzy import FuzzyNumber
from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.result import Nature
from alphacut.io.files import Document
from alphacut.io.quantity import range_text
from alphacut.questions.question import FuzzyResponse, NumberRow, Question, Row, event_words


def shaped_like(number: FuzzyNumber) -> Callable[[np.random.Generator, int], Array]:
    """A function (generator, count) that draws values with a density like the membership."""
    grid = np.unique(np.concatenate([np.linspace(*number.support, 4001), *number.cuts[1:]]))
    membership = number.membership(grid)
    areas = np.diff(grid) * (membership[1:] + membership[:-1]) / 2
    integral = np.concatenate([[0.0], np.cumsum(areas)])

    def draw(rng: np.random.Generator, count: int) -> Array:
        return np.asarray(np.interp(rng.random(count) * integral[-1], integral, grid))

    return draw


def _event_document(answer: Probability, limit: float, unit: str) -> Document:
    """Numbers on the event that a limit, in the SI unit `unit`, is exceeded, by level."""
    return {
        "limit": limit,
        "unit": unit,
        "lower": answer.lower,
        "upper": answer.upper,
        "error": answer.error,
        "interval": {"lower": answer.interval[0], "upper": answer.interval[1]},
        "nature": str(Nature.ATTAINED),
        "evaluations": answer.evaluations,
        "curve": {"limit": answer.limits, "lower": answer.curve[0], "upper": answer.curve[1]},
    }


def bounds_text(event: Document, level: int) -> str:
    """Bounds of a probability on a level."""
    return range_text(event["lower"][level], event["upper"][level], Nature.ATTAINED, 3)


def interval_text(event: Document, level: int) -> str:
    """Interval of a probability on a level that holds whatever the draws are, rounded outwards."""
    ends = event["interval"]
    return range_text(ends["lower"][level], ends["upper"][level], Nature.GUARANTEED, 3)


@dataclass(frozen=True)
class ProbabilityQuestion(Question):
    """Fuzzy probability that limits are exceeded; inputs that are not random stay fuzzy."""

    section: ProbabilitySection
    key = "probability"
    title = "How probable is it that limits are exceeded?"
    caption = "Fuzzy probability of exceeding a limit, over the limit"
    head = (
        "limit",
        "at the lowest α",
        "nature",
        "at the highest α",
        f"{CONFIDENCE:.0%} interval at the lowest α",
        "between nodes",
    )

    def answer(self, response: FuzzyResponse) -> Document:
        """Bounds of the probability of exceeding each limit, and any of several, by level."""
        structure = response.structure
        limits = self.section.in_si(structure)
        random = structure.inputs(self.section.random, "probability.random")
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
            samples=self.section.samples,
            rng=np.random.default_rng(0),
            progress=response.progress,
        )
        return {
            "fuzzy": list(fuzzy),
            "random": list(random),
            "samples": self.section.samples,
            "step": response.step,
            "alpha": response.alpha,
            "events": {
                name: _event_document(
                    answer,
                    limits.get(name, 1.0),
                    self.section.peak_and_unit(name, structure)["unit"],
                )
                for name, answer in answers.items()
            },
        }

    @staticmethod
    def rows(document: Document) -> list[Row]:
        """Table of the report, with the columns of `head`: a row for each limit."""
        return [
            (
                event_words(name, event["limit"], event["unit"]),
                bounds_text(event, 0),
                event["nature"],
                bounds_text(event, -1),
                interval_text(event, 0),
                f"{max(event['error']):.2g}",
            )
            for name, event in document["events"].items()
        ]

    @staticmethod
    def number_rows(document: Document) -> tuple[Row, list[NumberRow]]:
        """Titles of the columns, and a row for each limit and level."""
        head: Row = ("limited output", "unit", "limit", "α", "at least", "at most", "nature")
        head += (
            f"{CONFIDENCE:.0%} interval from",
            f"{CONFIDENCE:.0%} interval to",
            "between nodes",
        )
        rows: list[NumberRow] = []
        for name, event in document["events"].items():
            interval, first = event["interval"], (name, event["unit"], event["limit"])
            for k, alpha in enumerate(document["alpha"]):
                bounds = (event["lower"][k], event["upper"][k], event["nature"])
                outer = (interval["lower"][k], interval["upper"][k], event["error"][k])
                rows.append((*first, alpha, *bounds, *outer))
        return head, rows

    @staticmethod
    def words(document: Document) -> str:
        """Sentences on how the probability was computed, and on what its interval holds."""
        random = ", ".join(document["random"]) or "no input"
        return (
            f"Random: {random}, with {document['samples']} independent draws at each fuzzy point."
            " The bounds are those of the fuzzy points tried; other points may have more or less."
            f" With a probability of {CONFIDENCE:.0%} the interval holds the probabilities of all"
            " fuzzy points at once (Clopper and Pearson, Bonferroni over the points). Peaks are"
            f" those at nodes every {document['step']:g} s; the last column says what lies between"
            " them."
        )
