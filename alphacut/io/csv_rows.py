"""Rows of a CSV file with a header that holds units: ``time [s],acceleration [m/s^2]``."""

from __future__ import annotations

import csv
import re
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.io.problem import BadInput, Problem
from alphacut.io.units import factor
from alphacut.stochastic.particles.csv_columns import NUMBER

Rows = list[tuple[int, list[str]]]


@dataclass(frozen=True)
class CsvFile:
    """A file that a key of the case names.

    Args:
        path: The file.
        key: The key, for messages.
        what: What it holds, for messages: ``record``.
        allowed: Its header, for messages.
    """

    path: Path
    key: str
    what: str
    allowed: str

    def rows(self, least: int = 1) -> Rows:
        """Line and entries of the header and of each row; empty lines and comments are left out.

        Commas separate them, or semicolons or tabs.

        Args:
            least: Rows that there must be below the header.

        Raises:
            BadInput: The file cannot be read, or has fewer rows.
        """
        kept = [
            (number, line)
            for number, line in enumerate(self.lines, start=1)
            if line.strip() and not line.startswith("#")
        ]
        if len(kept) <= least:
            what = f"the {self.what} needs a header and {['a row', 'two rows'][least - 1]} or more"
            raise self.unreadable(what, self.allowed)
        header = kept[0][1]
        separator = ";" if ";" in header else "\t" if "\t" in header else ","
        return [(number, next(csv.reader([line], delimiter=separator))) for number, line in kept]

    def finite(self, rows: Rows, count: int, what: str, allowed: str) -> Array:
        """The rows as numbers, shape (rows, count); BadInput where one is not `count` of them."""
        table = np.full((len(rows), count), np.nan)
        for values, (line, row) in zip(table, rows, strict=True):
            if len(row) == count and all(NUMBER.fullmatch(text.strip()) for text in row):
                values[:] = [float(text) for text in row]
            if not np.isfinite(values).all():
                raise self.refuse(line, f"this row is {what}", ",".join(row), allowed)
        return table

    @cached_property
    def lines(self) -> list[str]:
        """All lines of the file as text, read once, since a pipe gives them once.

        Raises:
            BadInput: The file cannot be read.
        """
        try:
            return self.path.read_text(encoding="utf-8-sig").splitlines()
        except UnicodeDecodeError:
            what = f"the {self.what} is not text in UTF-8"
            raise self.unreadable(what, self.allowed) from None
        except OSError as error:
            reason = (error.strerror or str(error)).lower()
            what = f"the {self.what} cannot be read: {reason}"
            raise self.unreadable(what, self.allowed) from None

    def unreadable(self, what: str, allowed: str) -> BadInput:
        """The error of the file as a whole."""
        return BadInput.of(self.key, what, str(self.path), allowed)

    def refuse(self, line: int, what: str, value: str = "", allowed: str = "") -> BadInput:
        """The error of one line."""
        problem = Problem(self.key, what, value, allowed, file=str(self.path), line=line)
        return BadInput(problem)

    def scale(self, line: int, cell: str, name: str, si: str, *, pattern: str = "") -> float:
        """Factor that brings a column to SI, from the unit in its header.

        Args:
            line: Line of the header.
            cell: Its entry, ``time [s]`` or ``time (s)``.
            name: What the column is called, for messages.
            si: SI unit.
            pattern: Regular expression of its names; `name` unless given.

        Raises:
            BadInput: It has another name, or no unit of that kind.
        """
        match = re.fullmatch(r"\s*(.+?)\s*(?:\[([^\]]+)\]|\(([^()]+)\))\s*", cell)
        try:
            if match is None or not re.fullmatch(pattern or name, match[1], re.IGNORECASE):
                raise ValueError(f"the column {cell.strip()!r} is not {name} with its unit")
            return float(factor(match[2] or match[3], si))
        except ValueError as error:
            raise self.refuse(line, str(error), allowed=self.allowed) from None
