"""Base class of the results of all analyses: tables of texts, rows of numbers, sentences, files."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from alphacut.base.csv_text import csv_text
from alphacut.base.extras import extra_named
from alphacut.base.nature import Nature
from alphacut.base.number_text import ShownUnit, Table, text_table
from alphacut.fuzzy.result import of_enclosing_box

if TYPE_CHECKING:
    import xarray

Record = dict[str, str | float | None]
"""A row of numbers in SI units and of texts, by the titles of the columns; None where unknown."""
Row = Mapping[str, str | float | Nature | None]
"""A row as an analysis states it: guarantees are no texts yet, and unknown numbers not finite."""


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Answer(ABC):
    """Result of an analysis, which can be printed, tabulated and written to files.

    The class attributes are `key`, the name of the section of a case file that asks for the
    analysis, and `title`, the question that it answers. A column stands in one row of texts or of
    numbers alone; tables, files and datasets are made from these.

    Args:
        encloses: Name of the set of inputs, such as "the learned set", that the box of the α-cuts
            encloses; empty if all of the box counts. If it is given, no point of the box is known
            to belong to the set.
    """

    key: ClassVar[str]
    title: ClassVar[str]
    encloses: str = ""

    @abstractmethod
    def text_rows(self) -> Iterator[Row]:
        """Yield the rows of `table`; first come the subject, the result and its guarantee."""

    @abstractmethod
    def number_rows(self) -> Iterator[Row]:
        """Yield the rows of `records`, numbers in SI units; all rows have the same columns."""

    def table(self) -> Table:
        """Return the rows of `text_rows` as a table of texts."""
        return table_of([dict(self._stated(row)) for row in self.text_rows()])

    def records(self) -> list[Record]:
        """Return the rows of `number_rows`, with None for numbers that are not finite."""
        return self.known_records(self.number_rows())

    def known_records(self, rows: Iterable[Row]) -> list[Record]:
        """Return rows with guarantees as texts, and None for numbers that are not finite."""
        return [{title: _known(x) for title, x in self._stated(row)} for row in rows]

    def _stated(self, row: Row) -> Iterator[tuple[str, Any]]:
        """Yield title and value of each column of a row, guarantees as texts."""
        for title, value in row.items():
            yield title, self.nature_text(value) if isinstance(value, Nature) else value

    @abstractmethod
    def words(self) -> str:
        """Return sentences that explain how to read the result."""

    @property
    def stated_units(self) -> dict[str, ShownUnit]:
        """Units in which the limits of outputs are stated, by output; of several the first."""
        return {}

    def further_records(self) -> dict[str, list[Record]]:
        """Return further rows of numbers in SI units, by the names of their files."""
        return {}

    def compared(self) -> dict[str, float | str]:
        """Return the numbers and verdicts without a unit that are compared with another run's."""
        return {}

    def nature_text(self, nature: Nature) -> str:
        """Return the guarantee of a bound as text, with the enclosing box if there is one."""
        if self.encloses:
            return f"{nature} {of_enclosing_box(self.encloses)}"
        return str(nature)

    def all_words(self) -> str:
        """Return the sentences of `words`, and those on the enclosing box if there is one."""
        if self.encloses:
            return f"{self.words()} {enclosing_box_words(self.encloses)}"
        return self.words()

    def __str__(self) -> str:
        """Return the question, the table and the sentences."""
        table = self.table()
        sentences = fill(self.all_words(), 100)
        return f"{self.title}\n{text_table(table.head, table.rows)}{sentences}\n"

    __repr__ = __str__

    def to_csv(self, path: str | Path) -> None:
        """Write the rows of numbers to a CSV file, with all digits and in SI units."""
        Path(path).write_text(records_csv(self.records()), encoding="utf-8")

    def to_dataset(self) -> xarray.Dataset:
        """Return the rows of numbers of the result as an xarray dataset.

        Each column of `records` becomes a variable with the column's title over the dimension
        `row`: an array of texts if the column has a text, with "None" for unknown values, and else
        an array of floats in SI units with NaN for unknown numbers. The title of the result and
        its explaining sentences are the attributes "title" and "notes". Without rows the dataset
        has no variables.
        """
        with extra_named():
            import xarray

        rows = self.records()
        variables = {}
        for title in _titles(rows):
            column = [row[title] for row in rows]
            # A column of unknown numbers alone is one of numbers.
            is_text = any(isinstance(value, str) for value in column)
            variables[title] = ("row", np.array(column, str if is_text else float))
        return xarray.Dataset(variables, attrs={"title": self.title, "notes": self.all_words()})


def records_csv(rows: Sequence[Record]) -> str:
    """Return rows of numbers and texts, with the same columns, as the text of a CSV file."""
    # An empty cell is an unknown number in every spreadsheet.
    cells = [["" if x is None else str(x) for x in row.values()] for row in rows]
    return csv_text(_titles(rows), cells)


def _titles(rows: Sequence[Record]) -> list[str]:
    """Return the titles of the columns of rows; none if there are no rows."""
    if not rows:
        return []
    return list(rows[0])


def enclosing_box_words(encloses: str) -> str:
    """Return sentences on bounds that belong to the box around a set with a name."""
    return (
        f"All bounds are those {of_enclosing_box(encloses)}. What is guaranteed holds for"
        f" {encloses} as well, but no point of the box is known to belong to it: nothing is known"
        " to be reached."
    )


def table_of(rows: Sequence[Mapping[str, str]]) -> Table:
    """Return a table whose rows are given by the titles of the columns, the same in each row."""
    return Table(tuple(rows[0]) if rows else (), [tuple(row.values()) for row in rows])


def _known(value: str | float | None) -> str | float | None:
    """Return a finite number as a float, None for one that is not, and a text as it is."""
    if value is None or isinstance(value, str):
        return value
    return float(value) if isfinite(value) else None
