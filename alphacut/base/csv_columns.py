"""Columns of lengths from a CSV file, their units in its header: ``x [mm], y [mm], d [mm]``."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from math import isfinite
from pathlib import Path
from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.base.errors import RefusedError
from alphacut.base.memory import require_text
from alphacut.base.seen_folders import unseen
from alphacut.base.stated import LENGTHS
from alphacut.base.units import factor_of

NUMBER = re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?")
"""A number in plain ASCII digits."""


REMARK = re.compile(
    r"(?:^|(?<=[\d.]))\s*(?:[#!]|//|(?:\s;\s*|;\s+)(?!nan|inf)(?=[^\W\d])).*", re.IGNORECASE
)
"""A comment, on a line of its own or behind a number, with its mark."""


def length_columns(path: Path, columns: Sequence[str]) -> tuple[Ints, Array]:
    """Read columns of lengths from a CSV file, separated by commas, semicolons or tabs.

    The header names each column with its unit, as ``x [mm]``. Empty lines and lines that begin with
    # are skipped. A column d of diameters may stand in for "r" and is halved.

    Args:
        path: The file, text in UTF-8.
        columns: Names of the columns.

    Returns:
        Row numbers as an editor shows them, from 1, shape (n,), and the columns in m, shape (n,
        columns), n at least 1.

    Raises:
        RefusedError: The file cannot be read or has no rows below the header, a column or its unit
            is missing or unknown, a row has more fields than the header and none is empty, or a
            field is no number.
    """
    header, *rows = fields(path)
    found = [_column(header.cells, name, path) for name in columns]
    values = np.empty((len(rows), len(columns)))
    for k, line in enumerate(rows):
        n_cells = len(line.cells)
        # Empty fields at the end of a row are common in files of spreadsheets and mean nothing.
        if n_cells > len(header.cells) and all(line.cells):
            what = f"{n_cells} fields below a header of {len(header.cells)}"
            cure = "write decimal points, if these are decimal commas"
            key = f"{path.name}, row {line.row}"
            raise RefusedError(key, what, "as many fields as the header has", cure)
        numbers = [number(path, line.row, line.cells, column) for column, _ in found]
        values[k] = np.multiply(numbers, [factor for _, factor in found])
    return np.array([line.row for line in rows]), values


class ColumnHead(NamedTuple):
    """Name of a column, and its unit, empty where its head states none."""

    name: str
    unit: str

    @classmethod
    def of(cls, cell: str, *dimensions: str) -> ColumnHead:
        """Return name and unit from a cell of the head of a table.

        A unit stands in brackets, "Accel. [g]" or "acc (g)", and may then be anything; or it is the
        last words, "acc, g", "acc g", "acc_milli_g" or "f / Hz", and then must be of one of some
        dimensions. Blanks and quotes around the cell are left out.
        """
        text = cell.strip(' "')
        if match := re.fullmatch(r"(.*?)[\s,_/]*[\[(]\s*([^\])]*?)\s*[\])]?", text):
            return cls(match[1], match[2])
        # Without brackets the last words are a unit only if they are known and whole: "ground
        # acceleration" has none.
        text = re.sub(r"(?i)^(t|time|a|acc\w*|f|freq\w*)\s*/\s*", r"\1 ", text)
        for match in re.finditer(r"[\s,_]+(?=[^\W\d]|[%‰])", text):
            if factor_of(text[match.end() :], *dimensions):
                return cls(text[: match.start()], text[match.end() :])
        return cls(text, "")


class Line(NamedTuple):
    """Number of a line, as an editor shows it, and its fields."""

    row: int
    cells: list[str]


def fields(path: Path) -> list[Line]:
    """Return each line of a CSV file that is neither empty nor a comment, the header first.

    The separator is the semicolon or the tab if the header has one, else the comma; commas between
    digits are then decimal commas, unless numbers have points. Comments are lines that begin
    with #, and what stands behind a number and # or a lone semicolon.

    Returns:
        Number of each line as an editor shows it, from 1, and its fields; two lines at least.

    Raises:
        RefusedError: The file cannot be read, has fewer than two such lines, or a field that is
            longer than the module csv allows.
    """
    texts = dict(enumerate(text_of(path).splitlines(), 1))
    texts = {row: x for row, x in texts.items() if x.strip() and not x.startswith("#")}
    if len(texts) < 2:
        allowed = "a header with units, and rows of numbers below it"
        raise RefusedError(path.name, f"{len(texts)} lines", allowed)
    header = next(iter(texts.values()))
    separator = next((mark for mark in ";\t" if mark in header), ",")
    # A comma beside another separator is a decimal comma, if no number has a point.
    has_commas = separator != "," and not re.search(r"\d\.\d", "".join(texts.values()))
    # Line by line, so that each row keeps the number that an editor shows.
    rows: list[Line] = []
    for row, line in texts.items():
        if rows:
            line = REMARK.sub("", line)
        if has_commas and rows:
            line = re.sub(r"(?<=\d),(?=\d)", ".", line)
        try:
            rows.append(Line(row, next(csv.reader([line], delimiter=separator))))
        except csv.Error:  # a field is too long
            what, most = f"{len(line):,} letters", f"{csv.field_size_limit():,}"
            allowed = f"fields up to {most} letters"
            raise RefusedError(f"{path.name}, row {row}", what, allowed) from None
    return rows


def text_of(path: Path) -> str:
    """Return the text of a file in UTF-8, without a byte order mark.

    Raises:
        RefusedError: The file does not exist, cannot be read, is a folder, a pipe or a device, is
            too large for the free memory, or is no text in UTF-8.
    """
    try:
        require_text(path)
        return path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        reason = str(getattr(error, "strerror", None) or "no text").lower().removeprefix("is ")
        raise RefusedError(str(path), reason, "text files in UTF-8", unseen(path)) from None


def number(path: Path, row: int, cells: Sequence[str], column: int) -> float:
    """Return the number in a field of a row.

    Args:
        path: The file, for the message.
        row: Number of the row, for the message.
        cells: Fields of the row, with or without blanks around.
        column: Index of the field, from 0; it may be beyond the end of the row.

    Raises:
        RefusedError: The field is missing, longer than 100 letters, or no finite decimal number in
            ASCII digits: NaN, infinity and 1_000 are none.
    """
    text = cells[column].strip() if column < len(cells) else ""
    # `float` alone would take "nan", "1_000" and digits of other scripts.
    if len(text) > 100 or not NUMBER.fullmatch(text) or not isfinite(float(text)):
        allowed = "numbers such as 1.25 or 1e-3"
        cure = "write decimal points, and separate fields by the mark of the header"
        key = f"{path.name}, row {row}, column {column + 1}"
        raise RefusedError(key, repr(text[:40]), allowed, cure)
    return float(text)


def _column(header: list[str], name: str, path: Path) -> tuple[int, float]:
    """Return the index of the column `name` in the header, and the factor that makes it metres.

    For "r" the names radius, d, diameter and size are taken too, the last three with half the
    factor. Upper and lower case do not matter in names, but in units. The first column whose name
    and unit fit is taken.

    Args:
        header: Fields of the header, each a name and a unit in brackets.
        name: Name of the column in lower case.
        path: The file, for the message.

    Raises:
        RefusedError: There is no such column, or its unit is missing or unknown.
    """
    factors = {name: 1.0}
    if name == "r":
        factors = {"r": 1.0, "radius": 1.0, "d": 0.5, "diameter": 0.5, "size": 0.5}
    for column, cell in enumerate(header):
        head = ColumnHead.of(cell)
        if head.name.lower() in factors and (metres := factor_of(head.unit, "m")):
            return column, metres * factors[head.name.lower()]
    allowed = f"a column '{name} [mm]'"
    if name == "r":
        allowed += " or 'd [mm]'"
    units = f"units are {LENGTHS}"
    raise RefusedError(f"{path.name}, header", ",".join(header)[:80], allowed, units)
