"""A question to the motion of a case: a section, an answer, a figure, rows of the report.

Each question is one file beside this one, and one line of `alphacut.questions.table`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from pydantic import Field

from alphacut.case.structure import Structure
from alphacut.case.types import Section
from alphacut.fuzzy import FuzzyNumber
from alphacut.fuzzy.progress_bar import Progress
from alphacut.fuzzy.refused import require
from alphacut.io.files import Document
from alphacut.questions.limits import Limits

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Motion:
    """The motion of [envelope], to which a question is put.

    Args:
        structure: The structure.
        fuzzy: Names of the fuzzy inputs.
        alpha: Levels.
        duration: Length, in s.
        step: Distance of nodes, in s.
        progress: Takes the share done.
    """

    structure: Structure
    fuzzy: tuple[str, ...]
    alpha: tuple[float, ...]
    duration: float
    step: float
    progress: Progress | None = None

    @property
    def inputs(self) -> dict[str, FuzzyNumber]:
        """Fuzzy inputs by parameter."""
        return self.structure.inputs(self.fuzzy)


Row = tuple[str, ...]


class Question(Section, ABC):
    """A question about limits of outputs, as a section of the case.

    Its attributes are the name of the section, of its results and its figure; the heading in the
    report; the caption of the figure; and the titles of the columns of `rows`.
    """

    key: ClassVar[str]
    title: ClassVar[str]
    caption: ClassVar[str]
    head: ClassVar[Row]
    limits: Limits = Field(description="limits of outputs, 'drift1 <= 0.5 %', 'a3 <= 2 m/s^2'")

    def in_si(self, structure: Structure) -> dict[str, float]:
        """The limit of each output in its SI unit.

        Raises:
            RefusedError: The structure has no such output, or an output has two limits.
        """
        key = f"{self.key}.limits"
        values = {limit.output: limit.si(structure, key) for limit in self.limits}
        structure.observing(key, tuple(values))
        every = ", ".join(limit.text for limit in self.limits)
        require(len(values) == len(self.limits), key, every, "one limit for each output")
        return values

    def check(self, structure: Structure) -> None:
        """Refuses what the structure does not have.

        Raises:
            RefusedError: It has no such output or input.
        """
        self.in_si(structure)

    @abstractmethod
    def answer(self, motion: Motion) -> Document:
        """Numbers of the answer, in SI, as JSON holds them."""

    @staticmethod
    @abstractmethod
    def rows(document: Document) -> list[Row]:
        """The answer as a table: what, answer, nature first."""

    @staticmethod
    @abstractmethod
    def words(document: Document) -> str:
        """Sentence on how to read it."""

    @staticmethod
    @abstractmethod
    def figure(document: Document) -> Figure:
        """Drawing of an answer."""
