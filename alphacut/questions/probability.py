"""Probability that limits are exceeded, with some inputs random and the others fuzzy."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated

import numpy as np
from pydantic import Field

from alphacut.case.structure import Structure
from alphacut.case.types import Quantity
from alphacut.figures import style
from alphacut.figures.style import INK, ORANGE, alpha_legend, colours
from alphacut.frame.questions.peaks import ANY
from alphacut.frame.questions.probability import CONFIDENCE, Probability, probabilities
from alphacut.frame.structures.quantities import Output
from alphacut.fuzzy import FuzzyNumber
from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.result import Nature
from alphacut.io.files import Document
from alphacut.io.quantity import between, engineering
from alphacut.questions.question import Motion, Question, Row, event_words

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def shaped_like(number: FuzzyNumber) -> Callable[[np.random.Generator, int], Array]:
    """Independent random values with a density proportional to the membership."""
    grid = np.unique(np.concatenate([np.linspace(*number.support, 4001), *number.cuts[1:]]))
    density = number.membership(grid)
    share = np.concatenate([[0.0], np.cumsum(np.diff(grid) * (density[1:] + density[:-1]) / 2)])

    def draw(rng: np.random.Generator, count: int) -> Array:
        return np.asarray(np.interp(rng.random(count) * share[-1], share, grid))

    return draw


def _document(name: str, answer: Probability, limits: dict[str, float]) -> Document:
    return {
        "limit": limits.get(name, 1.0),
        "unit": "" if name == ANY else Output(name).unit,
        "lower": answer.lower,
        "upper": answer.upper,
        "error": answer.error,
        "interval": {"lower": answer.interval[0], "upper": answer.interval[1]},
        "nature": str(Nature.ATTAINED),
        "evaluations": answer.evaluations,
        "curve": {"limit": answer.limits, "lower": answer.curve[0], "upper": answer.curve[1]},
    }


def cut(one: Document, level: int) -> str:
    """Bounds of a probability on a level."""
    return between(one["lower"][level], one["upper"][level], Nature.ATTAINED, 3)


def interval(one: Document, level: int) -> str:
    """Interval of a probability on a level that holds whatever the draws are, rounded outwards."""
    ends = one["interval"]
    return between(ends["lower"][level], ends["upper"][level], Nature.GUARANTEED, 3)


def _mark(axes: Axes, limit: float, limits: Array, unit: str) -> None:
    """The case's limit, where it is near the curve."""
    words = engineering(limit, unit) if unit else "1"
    near = limit <= 2 * limits[-1]
    if near:
        axes.axvline(limit, color=ORANGE, lw=1.2, ls="--")
    axes.set_title(f"limit {words} ({'dashed' if near else 'far off'})", loc="left", fontsize=10)


class ProbabilitySection(Question):
    """Fuzzy probability that limits are exceeded; inputs that are not random stay fuzzy."""

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

    random: tuple[str, ...] = Field(
        default=(), description="inputs that are random, with the shape of their membership"
    )
    samples: Annotated[int, Quantity(least=1, most=10_000, whole=True)] = Field(
        default=200, description="random draws at each fuzzy point"
    )

    def check(self, structure: Structure) -> None:
        """Refuses limits and random inputs that the structure does not have.

        Raises:
            RefusedError: It has no such output or input.
        """
        super().check(structure)
        structure.inputs([x for x in self.random if x != "E"], "probability.random")

    def answer(self, motion: Motion) -> Document:
        """Probabilities of exceeding each limit, and any of several."""
        structure = motion.structure
        limits = self.in_si(structure)
        random = structure.inputs(self.random, "probability.random")
        fuzzy = {name: number for name, number in motion.inputs.items() if name not in random}
        crisp = {x: number for x, number in structure.numbers.items() if number.support.width == 0}
        answers = probabilities(
            motion.structure.observing("probability.limits", tuple(limits)),
            fuzzy or dict([next(iter(crisp.items()))]),
            {name: shaped_like(number) for name, number in random.items()},
            limits,
            duration=motion.duration,
            step=motion.step,
            alpha=motion.alpha,
            samples=self.samples,
            rng=np.random.default_rng(0),
            progress=motion.progress,
        )
        return {
            "fuzzy": list(fuzzy),
            "random": list(random),
            "samples": self.samples,
            "step": motion.step,
            "alpha": motion.alpha,
            "events": {name: _document(name, one, limits) for name, one in answers.items()},
        }

    @staticmethod
    def rows(document: Document) -> list[Row]:
        """A row for each limit."""
        return [
            (
                event_words(name, one["limit"], one["unit"]),
                cut(one, 0),
                one["nature"],
                cut(one, -1),
                interval(one, 0),
                f"{max(one['error']):.2g}",
            )
            for name, one in document["events"].items()
        ]

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

    @staticmethod
    def figure(document: Document) -> Figure:
        """Probability over the limit, for the last event, between its bounds by level."""
        name, one = list(document["events"].items())[-1]
        alpha = np.asarray(document["alpha"], float)
        limits = np.asarray(one["curve"]["limit"], float)
        lower, upper = (np.asarray(one["curve"][side], float) for side in ("lower", "upper"))
        drawn, axes = style.figure(7.2, 3.6)
        for low, high, shade in zip(lower[:-1], upper[:-1], colours(alpha), strict=False):
            axes.fill_between(limits, low, high, color=shade, lw=0)
        for end in (lower[-1], upper[-1]):
            axes.plot(limits, end, color=INK, lw=1)
        _mark(axes, one["limit"], limits, one["unit"])
        title = f"limit of |{name}|" if one["unit"] else "all limits, over those of the case"
        style.prefix_axis(axes, title, one["unit"], across=True)
        axes.set_ylabel("probability of exceeding it")
        axes.set_ylim(0, 1.02)
        alpha_legend(axes, alpha)
        return drawn
