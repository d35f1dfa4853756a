"""A question to the motion of a case: a section, an answer, a figure, rows of the report.

It is about limits: "drift1 <= 40 mm", "drift1 <= 0.5 %", "q3 <= 80 mm". Each question is one file
beside this one, and one line of `alphacut.case.content`.
"""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, ClassVar

from pydantic import Field, PlainValidator

from alphacut.case.structure import Structure
from alphacut.case.types import Section, Some
from alphacut.frame.questions.peaks import Peaks
from alphacut.frame.structures.quantities import Output
from alphacut.fuzzy import FuzzyNumber
from alphacut.fuzzy.progress_bar import Progress
from alphacut.fuzzy.refused import RefusedError, require
from alphacut.io import quantity
from alphacut.io.files import Document
from alphacut.io.quantity import engineering

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Limit:
    """Largest magnitude allowed of an output.

    Args:
        output: Of the structure.
        value: In the SI unit of the output, or as a share of the storey's height.
        share: Whether it is such a share.
        text: The limit as the user wrote it.
    """

    output: str
    value: float
    share: bool
    text: str

    def si(self, structure: Structure, key: str) -> float:
        """Limit in the SI unit of its output.

        Raises:
            RefusedError: The structure has no height of the storey.
        """
        number = structure.numbers.get(self.output.replace("drift", "l"))
        if self.share and number is None:
            raise RefusedError(
                key, self.text, "a storey of the frame, whose length the share is of"
            )
        return self.value * number.modal if self.share and number else self.value


def _limit(value: object) -> Limit:
    """Limit that a text says."""
    name, bound, text = (part.strip() for part in str(value).partition("<="))
    allowed = "an output, <= and a quantity, as 'drift1 <= 40 mm' or 'drift1 <= 0.5 %'"
    share = name.startswith("drift") and text.endswith("%")
    number, reason = 0.0, ""
    try:
        number = quantity.number(text, "" if share else Output(name).unit)
    except (ValueError, KeyError) as error:
        reason = str(error)
    whole = bool(bound) and re.fullmatch(r"\w+", name) is not None and number > 0
    require(whole, "", value, allowed, reason * bool(bound))
    return Limit(name, number, share, str(value))


One = Annotated[Limit, PlainValidator(_limit, json_schema_input_type=str)]
Limits = Annotated[tuple[One, ...], Some]


def limit_words(output: str, limit: float, unit: str) -> str:
    """A limit for people: "|drift1| ≤ 40.00 mm"; the name of several where it has no unit."""
    return f"|{output}| ≤ {engineering(limit, unit)}" if unit else output


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
class SuiteMotion:
    """Motions of the structure under the records of a suite.

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
class Motion:
    """The motion of [envelope], to which a question is put.

    Args:
        structure: The structure.
        fuzzy: Names of the fuzzy inputs.
        alpha: Levels.
        duration: Length, in s.
        step: Distance of nodes, in s.
        peaks: Peaks of the outputs, under a suite of any record; None where no question reads
            them.
        suite: Records that move the structure one by one; None where there are none.
        progress: Takes the share done.
    """

    structure: Structure
    fuzzy: tuple[str, ...]
    alpha: tuple[float, ...]
    duration: float
    step: float
    peaks: Peaks | None = None
    suite: SuiteMotion | None = None
    progress: Progress | None = None

    @property
    def inputs(self) -> dict[str, FuzzyNumber]:
        """Fuzzy inputs by parameter."""
        return self.structure.inputs(self.fuzzy)


Row = tuple[str, ...]


class Question(Section, ABC):
    """A question about limits of outputs, as a section of the case.

    Its attributes are the name of the section, of its results and its figure; the heading in the
    report; the caption of the figure; the titles of the columns of `rows`; and whether the answer
    is read from the peaks of the limited outputs.
    """

    key: ClassVar[str]
    title: ClassVar[str]
    caption: ClassVar[str]
    head: ClassVar[Row]
    reads_peaks: ClassVar[bool] = False
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

    def require_answerable(self, motion: Motion) -> None:
        """Refuses a motion that the question cannot be put to.

        Raises:
            RefusedError: It is one.
        """
        self.check(motion.structure)

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
