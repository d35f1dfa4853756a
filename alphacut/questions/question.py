"""A question to the motion of a case: an answer, and the rows and words of the report."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from alphacut.case.limits import QuestionSection
from alphacut.case.structure import Structure
from alphacut.frame.questions.peaks import Peaks
from alphacut.fuzzy import FuzzyNumber
from alphacut.fuzzy.progress_bar import Progress
from alphacut.io.files import Document
from alphacut.io.quantity import engineering

PEAK_ERROR = 5e-3
"""Error of the peaks of limited outputs that is aimed at, as a share of each."""


def limit_words(peak: str, limit: float, unit: str) -> str:
    """Text of a limit, as "|drift1| ≤ 40.00 mm"; without a unit `peak` alone, as "any of them"."""
    if not unit:
        return peak
    if peak.startswith("min "):  # whose limit is that of −q
        return f"{peak} ≥ {engineering(-limit, unit)}"
    if peak.startswith("max "):
        return f"{peak} ≤ {engineering(limit, unit)}"
    mean = "mean " if peak.startswith("mean ") else ""
    return f"{mean}|{peak.removeprefix('mean ')}| ≤ {engineering(limit, unit)}"


def event_words(output: str, limit: float, unit: str) -> str:
    """The event that a limit is exceeded: "|drift1| > 40.00 mm", or "any of them exceeded"."""
    return f"|{output}| > {engineering(limit, unit)}" if unit else f"{output} exceeded"


def peak_document(peaks: Peaks, output: str) -> Document:
    """Peak of an output on every level, in SI, as tables show it."""
    column = peaks.outputs.index(output)
    ends = {"lower": peaks.lower, "upper": peaks.upper, "error": peaks.error}
    ends |= {"reached": peaks.reached}
    return {end: values[:, column] for end, values in ends.items()}


@dataclass(frozen=True)
class SuiteResponse:
    """Peaks of the structure under the records of a suite.

    Args:
        period: First natural period at the most plausible inputs, in s.
        ratio: Damping ratio of that mode.
        measures: Measures of each record by its name, such as {"PGA": 2.1}.
        peaks: Peaks under each record by its name.
    """

    period: float
    ratio: float
    measures: Mapping[str, Mapping[str, float]]
    peaks: Mapping[str, Peaks]


@dataclass(frozen=True)
class FuzzyResponse:
    """Fuzzy response of the structure, as section [envelope] names it: what questions are about.

    Args:
        structure: The structure.
        fuzzy: Names of the fuzzy inputs.
        alpha: Levels.
        duration: Length, in s.
        step: Distance of nodes, in s.
        peaks: Peaks of the outputs, under a suite of any record; None where no question reads them.
        suite: Records that move the structure one by one; None where there are none.
        progress: Takes the share done.
    """

    structure: Structure
    fuzzy: tuple[str, ...]
    alpha: tuple[float, ...]
    duration: float
    step: float
    peaks: Peaks | None = None
    suite: SuiteResponse | None = None
    progress: Progress | None = None

    @property
    def inputs(self) -> dict[str, FuzzyNumber]:
        """Fuzzy inputs by parameter."""
        return self.structure.inputs(self.fuzzy)


Row = tuple[str, ...]
NumberRow = tuple[str | float | None, ...]


@dataclass(frozen=True)
class Question(ABC):
    """A question about limits of outputs: its answer, and how that is read.

    `key` names its section, results and figure, `head` the columns of `rows`.
    """

    section: QuestionSection
    key: ClassVar[str]
    title: ClassVar[str]
    caption: ClassVar[str]
    head: ClassVar[Row]

    def require_answerable(self, response: FuzzyResponse) -> None:
        """Refuses a response about which this question cannot be answered."""
        self.section.check(response.structure)

    @abstractmethod
    def answer(self, response: FuzzyResponse) -> Document:
        """Numbers of the answer, in SI, as JSON holds them."""

    @staticmethod
    @abstractmethod
    def rows(document: Document) -> list[Row]:
        """The answer as a table: what, answer, nature first."""

    @staticmethod
    @abstractmethod
    def number_rows(document: Document) -> tuple[Row, list[NumberRow]]:
        """The answer as numbers in SI for CSV: titles with units, or with a column for them."""

    @staticmethod
    @abstractmethod
    def words(document: Document) -> str:
        """Sentence on how to read it."""
