"""What all answers of an analysis share: a table of texts, rows of numbers, sentences and files."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from alphacut.base.csv_text import csv_text
from alphacut.base.nature import Nature
from alphacut.base.number_text import Table, text_table
from alphacut.fuzzy.result import of_enclosing_box

if TYPE_CHECKING:
    import xarray

Record = dict[str, str | float | None]
"""Numbers and texts of a row, in SI, by the titles of their columns; None where there is none."""


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Answer(ABC):
    """Answer of an analysis: data that print themselves.

    `key` names its section of a case and its results, `title` is the question in words.

    Args:
        encloses: Name of a set of inputs that the box of their cuts encloses, as "the learned
            set"; empty where all of the box counts. No point of the box is known to belong to it.
    """

    key: ClassVar[str]
    title: ClassVar[str]
    encloses: str = ""

    @abstractmethod
    def table(self) -> Table:
        """Return rows of texts: what, answer and guarantee are the first three columns."""

    @abstractmethod
    def records(self) -> list[Record]:
        """Return rows of numbers in SI, of the same columns each."""

    @abstractmethod
    def words(self) -> str:
        """Return sentences on how to read the answer."""

    def nature_text(self, nature: Nature) -> str:
        """Return the guarantee of a bound, and of which box where that is not the set meant."""
        return f"{nature} {of_enclosing_box(self.encloses)}" if self.encloses else str(nature)

    def __str__(self) -> str:
        """Return the table, then the sentences."""
        return f"{self.title}\n{text_table(*self.table())}{fill(self.all_words(), 100)}\n"

    def all_words(self) -> str:
        """Return the sentences, and those on the box around a set of inputs if there is one."""
        box = [enclosing_box_words(self.encloses)] if self.encloses else []
        return " ".join([self.words(), *box])

    __repr__ = __str__

    def to_csv(self, path: str | Path) -> None:
        """Write the rows of numbers as a CSV file, exact and in SI."""
        rows = self.records()
        cells = [["" if x is None else str(x) for x in row.values()] for row in rows]
        Path(path).write_text(csv_text([*rows[0]], cells), encoding="utf-8")

    def to_dataset(self) -> xarray.Dataset:
        """Return the rows of numbers as an xarray dataset: a variable a column, over `row`.

        Numbers that are not known are nan.
        """
        import xarray

        rows = self.records()
        columns = {title: [row[title] for row in rows] for title in rows[0]}
        variables = {
            title: ("row", [str(x) for x in column])
            if any(isinstance(x, str) for x in column)
            else ("row", np.array(column, float))
            for title, column in columns.items()
        }
        return xarray.Dataset(variables, attrs={"title": self.title, "notes": self.all_words()})


def enclosing_box_words(encloses: str) -> str:
    """Return sentences on bounds of the box around a set, by the set's name."""
    return (
        f"All bounds are those {of_enclosing_box(encloses)}. What is guaranteed holds for"
        f" {encloses} too, but no point of the box is known to belong to it: nothing is known to be"
        " reached."
    )


def known(value: float) -> float | None:
    """Return a number for a row; None of one that is not finite, as an unknown bound."""
    return float(value) if isfinite(value) else None
