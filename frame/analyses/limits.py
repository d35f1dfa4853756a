"""Limits of outputs, and what the answers about them have in common."""

from __future__ import annotations

import re
from abc import abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Generic, Literal, TypedDict, TypeVar

from alphacut.base.arrays import Array
from alphacut.base.errors import checked_number, require, require_choice
from alphacut.base.number_text import MINUS, ShownUnit, Table, engineering
from alphacut.frame.analyses.answer import Answer, Record
from alphacut.frame.structures.quantities import Output

Side = Literal["", "max", "min", "mean"]
"""Of a magnitude; of the largest or the least value; of the mean magnitude over records."""
ANY = "any of them"
"""Name of the event that any of several limits is exceeded."""


@dataclass(frozen=True)
class Limit:
    """Limit of an output, by default of its magnitude.

    Args:
        output: Name of the output, as "drift1".
        value: In the SI unit of the output. Two values are the ends between which it must stay.
        largest: True for the largest value of the output in place of its magnitude, False for the
            least one, which must not fall below `value`.
        mean: Whether it is the mean of the magnitudes over the records of a suite.
        stated: The value as whoever set it wrote it, as "1 %"; empty: with its SI unit.
        event: Name that several limits share of which any is exceeded, as "drift <= 1 %" of those
            of all storeys; empty of a limit that stands alone.

    Example:
        >>> [str(limit) for limit in Limit("q3", (-0.06, 0.08)).one_sided]
        ['min q3 ≥ −60.00 mm', 'max q3 ≤ 80.00 mm']
    """

    output: str
    value: float | tuple[float, float]
    largest: bool | None = None
    mean: bool = False
    stated: str = ""
    event: str = ""

    @property
    def one_sided(self) -> tuple[Limit, ...]:
        """The limit itself, or those of both ends."""
        if not isinstance(self.value, Sequence):
            return (self,)
        least, largest = self.value
        return (
            replace(self, value=least, largest=False),
            replace(self, value=largest, largest=True),
        )

    @property
    def side(self) -> Side:
        """What is limited, in the word that a case has for it."""
        if self.mean:
            return "mean"
        return "" if self.largest is None else "max" if self.largest else "min"

    @property
    def peak(self) -> str:
        """Name of the limited peak, such as "max q3"."""
        return f"{self.side} {self.output}".strip()

    @property
    def number(self) -> float:
        """The value of a limit with one side."""
        return float(self.value)  # type: ignore[arg-type]

    @property
    def outwards(self) -> float:
        """The value; of a least value its negative, which the peak of −q must not exceed."""
        return 0.0 + (-self.number if self.side == "min" else self.number)  # no negative zero

    @property
    def text(self) -> str:
        """The limit as a case states it, such as "min q3 >= -0.06"."""
        relation = ">=" if self.side == "min" else "<="
        return f"{self.peak} {relation} {self.stated or f'{self.number:g}'}"

    def __str__(self) -> str:
        """Return the limit in words, with the unit of the storey frame's output of its kind."""
        unit = Output(self.output).unit.replace("SI", "")  # of names that are no storey frame's
        return About(**facts_of(self, unit)).words


def limits_by_name(
    limits: Limit | Sequence[Limit], outputs: Sequence[str], *, magnitudes: bool = False
) -> dict[str, Limit]:
    """Return limits of one side each by name: the peak, or the text where a peak has several.

    Args:
        limits: One limit or several.
        outputs: Names of the peaks that there are; empty to accept all.
        magnitudes: Whether each output may have one limit, of its magnitude, alone.

    Raises:
        RefusedError: There is no limit, one stands twice, names no output, is not finite, or is one
            of a magnitude and not positive.
    """
    given = [limits] if isinstance(limits, Limit) else list(limits)
    single = [side for limit in given for side in limit.one_sided]
    texts = ", ".join(limit.text for limit in single)
    require(bool(single), "limits", value=None, allowed='one limit or more: Limit("q3", 0.1)')
    for limit in single:
        if outputs:
            require_choice("limits", limit.output, outputs)
        is_magnitude = limit.side in ("", "mean")
        checked_number(f"limit of {limit.peak}", limit.number, positive=is_magnitude)
    peaks = [limit.peak for limit in single]
    named = {x.peak if peaks.count(x.peak) == 1 else x.text: x for x in single}
    require(len(named) == len(single), "limits", value=texts, allowed="each limit once")
    if magnitudes:
        is_one_each = all(name == limit.output for name, limit in named.items())
        allowed = "one limit of the magnitude for each output"
        require(is_one_each, "limits", value=texts, allowed=allowed)
    return named


@dataclass(frozen=True, eq=False, kw_only=True)
class About:
    """Part of an answer about one limit, or about an event of several.

    Args:
        side: What is limited.
        output: The output; of an event of several limits its name.
        unit: SI unit of the output; empty of several limits.
        limit: The limit, in that unit; 1 of several.
        stated: The limit as it was given; empty for the number with its unit.
        is_event: Whether it is about several limits.
        event_name: Name of the event of several limits of which it is a part; empty of none.
    """

    side: Side = ""
    output: str
    unit: str = ""
    limit: float = 1.0
    stated: str = ""
    is_event: bool = False
    event_name: str = ""

    @property
    def peak_name(self) -> str:
        """Name of the limited peak, such as "max q3"."""
        return f"{self.side} {self.output}".strip()

    @property
    def words(self) -> str:
        """Text of the limit as it was given, as "|drift1| ≤ 1 % (30.00 mm)", or of the event."""
        if self.is_event:
            return self.output
        output = f"|{self.output}|" if self.side in ("", "mean") else self.output
        relation = "≥" if self.side == "min" else "≤"
        return f"{self.side} {output} {relation} {self.value_words}".strip()

    @property
    def value_words(self) -> str:
        """The value as it was given; beside a fraction stands what it means in SI."""
        in_si = engineering(self.limit, self.unit)
        if not self.stated:
            return in_si
        stated = re.sub(r"-(?=[\d.])", MINUS, self.stated)
        is_fraction = stated.endswith("%") or re.fullmatch(r"1\s*/\s*\d+", stated)
        return f"{stated} ({in_si})" if is_fraction and self.unit else stated

    @property
    def stated_unit(self) -> ShownUnit | None:
        """The unit in which the limit was given; None of a fraction, and of a plain number."""
        stated = self.stated.replace(MINUS, "-")
        match = re.fullmatch(r"([-+]?[\d.]+(?:[eE][-+]?\d+)?)\s*([^\d\s%/].*)", stated)
        if match is None or not self.limit or not float(match[1]):
            return None
        return ShownUnit(match[2], float(match[1]) / self.limit)

    def text_of_value(self, value: float) -> str:
        """Text of a value of the output in SI, in the unit of the limit if that has one."""
        unit = self.stated_unit
        return engineering(value, self.unit) if unit is None else unit.text(value)

    @property
    def event(self) -> str:
        """The event that it is exceeded: "|drift1| > 40.00 mm", or "any of them exceeded"."""
        words = f"{self.output} exceeded" if self.is_event else self.words
        return words.translate({ord("≤"): ">", ord("≥"): "<"})


class LimitFacts(TypedDict):
    """Fields of `About` that a limit gives."""

    side: Side
    output: str
    unit: str
    limit: float
    stated: str


def facts_of(limit: Limit, unit: str) -> LimitFacts:
    """Return the fields of `About` that a limit of an output in a unit gives."""
    return {
        "side": limit.side,
        "output": limit.output,
        "unit": unit,
        "limit": limit.number,
        "stated": limit.stated,
    }


P = TypeVar("P", bound=About)


class LimitsAnswer(Answer, Generic[P]):
    """Answer with a part for each limit, and for events of several, by their names."""

    alpha: Array

    @property
    @abstractmethod
    def parts(self) -> dict[str, P]:
        """The parts by the names of their limits."""

    @abstractmethod
    def texts_of(self, part: P) -> dict[str, str]:
        """Return the texts of the row of a part by the titles of their columns."""

    @abstractmethod
    def numbers_of(self, part: P) -> Iterator[Record]:
        """Yield the numbers of a part, a record a row; output, unit and limit stand before."""

    def table(self) -> Table:
        """Return a row of texts for each limit."""
        rows = [self.texts_of(part) for part in self.parts.values()]
        return Table(tuple(rows[0]), [tuple(row.values()) for row in rows])

    def records(self) -> list[Record]:
        """Return the rows of each limit."""
        return [
            {"limited output": name, "unit": part.unit, "limit": part.limit, **record}
            for name, part in self.parts.items()
            for record in self.numbers_of(part)
        ]
