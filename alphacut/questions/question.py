"""What questions are about, and what is common to their answers."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import ClassVar, Generic, NamedTuple, Self, TypeVar

from alphacut.base.number_text import engineering
from alphacut.base.progress_bar import Progress
from alphacut.case.limits import QuestionSection, Side
from alphacut.case.structure import Structure
from alphacut.frame.analyses.peaks import ANY, Peaks
from alphacut.fuzzy import FuzzyNumber
from alphacut.fuzzy.result import Nature, of_enclosing_box
from alphacut.fuzzy.sets.numbers import enclosed_set
from alphacut.stages.store import Numbers, Values
from alphacut.stages.suite import IncrementalResult, SuiteResult

Row = tuple[str, ...]


class Table(NamedTuple):
    """Titles of the columns, and rows of texts."""

    head: Row
    rows: list[Row]


Texts = dict[str, str]
"""Texts of a row by the titles of their columns."""
Record = dict[str, str | float | None]
"""Numbers and texts of a row in SI, by the titles of their columns; for CSV."""


@dataclass(frozen=True)
class FuzzyResponse:
    """Fuzzy response of the structure, as section [envelope] names it: what questions are about.

    `peaks` are those of the outputs, under a suite of any record; None where no question reads
    them. `suite` has the results under each record, if there is a suite of them, and `increments`
    those over its scales, of a frame that yields.
    """

    structure: Structure
    fuzzy: tuple[str, ...]
    alpha: tuple[float, ...]
    duration: float
    step: float
    peaks: Peaks | None = None
    suite: SuiteResult | None = None
    increments: Mapping[str, IncrementalResult] = field(default_factory=dict)
    progress: Progress | None = None

    @property
    def inputs(self) -> dict[str, FuzzyNumber]:
        """Fuzzy inputs by parameter."""
        return self.structure.inputs(self.fuzzy)

    @property
    def encloses(self) -> str:
        """Name of the set of inputs that the box of their cuts encloses; empty without one."""
        return enclosed_set(self.inputs.values())


def enclosing_box_words(encloses: str) -> str:
    """Sentences on bounds of the box around a set, by the set's name."""
    return (
        f"All bounds are those {of_enclosing_box(encloses)}. What is guaranteed holds for"
        f" {encloses} too, but no point of the box is known to belong to it: nothing is known to be"
        " reached."
    )


class Answer(Numbers):
    """Answer to a question about limits of outputs, in SI; `key` names its section and results.

    `encloses` is that of the inputs, see `FuzzyResponse`.
    """

    key: ClassVar[str]
    title: ClassVar[str]
    caption: ClassVar[str]
    encloses: str = ""

    @abstractmethod
    def table(self) -> Table:
        """The answer as texts: what, answer and nature are the first three columns."""

    @abstractmethod
    def records(self) -> list[Record]:
        """The answer as numbers for CSV: titles with units, or with a column for them."""

    @abstractmethod
    def words(self) -> str:
        """Sentences on how to read it."""

    def nature_text(self, nature: Nature) -> str:
        """The nature of a bound, and the box that it is of where this is not the set meant."""
        return f"{nature} {of_enclosing_box(self.encloses)}" if self.encloses else str(nature)

    def words_on_box(self) -> str:
        """Sentences on the box around a set of inputs; empty where the box itself is meant."""
        return enclosing_box_words(self.encloses) if self.encloses else ""


class LimitAnswer(Numbers):
    """Part of an answer about one limit, or about `ANY` of several, which have no unit.

    `side` is that of a `Limit`, the limit as the case gives it, in SI; 1 of several.
    """

    side: Side
    output: str
    unit: str
    limit: float

    @classmethod
    def of(
        cls, section: QuestionSection, name: str, structure: Structure, **numbers: object
    ) -> Self:
        """The part about a limit by its name in a section, or about several, with its numbers."""
        fields: dict[str, object] = {"side": "", "output": name, "unit": "", "limit": 1.0}
        if (limit := section.limits_by_name.get(name)) is not None:
            value = limit.value_in_si(structure, f"{section.key}.limits")
            unit = structure.unit(limit.output)
            fields = {"side": limit.side, "output": limit.output, "unit": unit, "limit": value}
        return cls.model_validate(fields | numbers)

    @property
    def peak_name(self) -> str:
        """Name of the limited peak, such as "max q3"."""
        return f"{self.side} {self.output}".strip()

    @property
    def words(self) -> str:
        """Text of the limit, as "|drift1| ≤ 40.00 mm", or as "any of them"."""
        if self.output == ANY:
            return ANY
        output = f"|{self.output}|" if self.side in ("", "mean") else self.output
        relation = "≥" if self.side == "min" else "≤"
        return f"{self.side} {output} {relation} {engineering(self.limit, self.unit)}".strip()

    @property
    def event(self) -> str:
        """The event that it is exceeded: "|drift1| > 40.00 mm", or "any of them exceeded"."""
        words = f"{ANY} exceeded" if self.output == ANY else self.words
        return words.translate({ord("≤"): ">", ord("≥"): "<"})


L = TypeVar("L", bound=LimitAnswer)


class LimitsAnswer(Answer, Generic[L]):
    """Answer with a part for each limit, and for any of several, by their names."""

    alpha: Values
    limits: dict[str, L]

    @abstractmethod
    def texts_of(self, limit: L) -> Texts:
        """Row of texts of a limit."""

    @abstractmethod
    def numbers_of(self, limit: L) -> Iterator[Record]:
        """Yields the numbers of a limit, a record a row; output, unit and limit stand before."""

    def table(self) -> Table:
        """A row of texts for each limit."""
        rows = [self.texts_of(limit) for limit in self.limits.values()]
        return Table(tuple(rows[0]), [tuple(row.values()) for row in rows])

    def records(self) -> list[Record]:
        """The rows of each limit."""
        return [
            {"limited output": name, "unit": limit.unit, "limit": limit.limit, **record}
            for name, limit in self.limits.items()
            for record in self.numbers_of(limit)
        ]
