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
from alphacut.io.quantity import between
from alphacut.questions.question import Motion, NumberRow, Question, Row, event_words


def shaped_like(number: FuzzyNumber) -> Callable[[np.random.Generator, int], Array]:
    """Independent random values with a density proportional to the membership."""
    grid = np.unique(np.concatenate([np.linspace(*number.support, 4001), *number.cuts[1:]]))
    density = number.membership(grid)
    share = np.concatenate([[0.0], np.cumsum(np.diff(grid) * (density[1:] + density[:-1]) / 2)])

    def draw(rng: np.random.Generator, count: int) -> Array:
        return np.asarray(np.interp(rng.random(count) * share[-1], share, grid))

    return draw


def _document(answer: Probability, limit: float, unit: str) -> Document:
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


def cut(event: Document, level: int) -> str:
    """Bounds of a probability on a level."""
    return between(event["lower"][level], event["upper"][level], Nature.ATTAINED, 3)


def interval(event: Document, level: int) -> str:
    """Interval of a probability on a level that holds whatever the draws are, rounded outwards."""
    ends = event["interval"]
    return between(ends["lower"][level], ends["upper"][level], Nature.GUARANTEED, 3)


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

    def answer(self, motion: Motion) -> Document:
        """Probabilities of exceeding each limit, and any of several."""
        structure = motion.structure
        limits = self.section.in_si(structure)
        random = structure.inputs(self.section.random, "probability.random")
        fuzzy = {name: number for name, number in motion.inputs.items() if name not in random}
        crisp = {x: number for x, number in structure.numbers.items() if number.support.width == 0}
        answers = probabilities(
            structure.model_with_outputs("probability.limits", tuple(limits)),
            fuzzy or dict([next(iter(crisp.items()))]),
            {name: shaped_like(number) for name, number in random.items()},
            limits,
            duration=motion.duration,
            step=motion.step,
            alpha=motion.alpha,
            samples=self.section.samples,
            rng=np.random.default_rng(0),
            progress=motion.progress,
        )
        return {
            "fuzzy": list(fuzzy),
            "random": list(random),
            "samples": self.section.samples,
            "step": motion.step,
            "alpha": motion.alpha,
            "events": {
                name: _document(
                    answer,
                    limits.get(name, 1.0),
                    self.section.peak_and_unit(name, structure)["unit"],
                )
                for name, answer in answers.items()
            },
        }

    @staticmethod
    def rows(document: Document) -> list[Row]:
        """A row for each limit."""
        return [
            (
                event_words(name, event["limit"], event["unit"]),
                cut(event, 0),
                event["nature"],
                cut(event, -1),
                interval(event, 0),
                f"{max(event['error']):.2g}",
            )
            for name, event in document["events"].items()
        ]

    @staticmethod
    def number_rows(document: Document) -> tuple[Row, list[NumberRow]]:
        """A row for each limit and level."""
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
                ends = (alpha, event["lower"][k], event["upper"][k], event["nature"])
                outer = (interval["lower"][k], interval["upper"][k], event["error"][k])
                rows.append((*first, *ends, *outer))
        return head, rows

    @staticmethod
    def words(document: Document) -> str:
        """How the probability was computed."""
        random = ", ".join(document["random"]) or "no input"
        return (
            f"Random: {random}, with {document['samples']} independent draws at each fuzzy point."
            " The bounds are those of the fuzzy points tried; other points may have more or less."
            f" With a probability of {CONFIDENCE:.0%} the interval holds the probabilities of all"
            " fuzzy points at once (Clopper and Pearson, Bonferroni over the points). Peaks are"
            f" those at nodes every {document['step']:g} s; the last column says what lies between"
            " them."
        )
