"""Columns of lengths from a CSV file, their units in its header: ``x [mm], y [mm], d [mm]``."""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from alphacut.stochastic.theta.truncated_normal import Array

Rows = list[tuple[int, list[str]]]
DIAMETERS = ("d", "diameter", "size", "sieve")
SIZES = ("radius", *DIAMETERS)  # columns that may stand in for r


@dataclass(frozen=True, eq=False)
class LengthColumns:
    """Columns of lengths and the unit that they are written in.

    Args:
        rows: Row numbers as an editor shows them, shape (n,).
        values: The columns in m, shape (n, columns); NaN where there is no number.
        unit: Unit of the first column in the file, for messages.
        metres: Metres in one such unit.
    """

    rows: Array
    values: Array
    unit: str
    metres: float

    def told(self, length: float, digits: int = 6) -> str:
        """A length in m, in words of the file: ``6.59 mm``."""
        return f"{length / self.metres:.{digits}g} {self.unit}"


def length_columns(
    path: Path, columns: Sequence[str], unit: str = "", also: Sequence[str] = ()
) -> LengthColumns:
    """The columns of a file that are wanted.

    Args:
        path: The file; separated by commas, semicolons or tabs; empty lines and those behind # are
            passed over.
        columns: Names of the columns; one of `SIZES` may stand in for "r".
        unit: Unit of columns whose header names none; empty if each does.
        also: Names of columns that the caller reads by itself.

    Raises:
        ValueError: The file cannot be read, a column or its unit is missing, two give the same or a
            column is not read (`_refuse_unread`), a row has more fields than the header, or
            a number has a decimal comma where commas separate fields or others have points.
    """
    header, rows = _fields(path, _wanted(columns))
    places = _places(header, columns, unit, path)
    wanted = max(place for place, cell in enumerate(header, 1) if cell.strip())
    table = []
    for number, fields in rows:
        _refuse_surplus(path, number, fields, wanted)
        cells = [(fields[k] if k < len(fields) else "", factor) for k, factor, _ in places]
        table.append([factor * _number(cell, path, number) for cell, factor in cells])
    if "r" in columns:
        shares = {[*map(_name, header)].index(name) for name in also}
        _refuse_unread(path, header, rows, {place for place, _, _ in places} | shares)
    first = places[0][2]
    values = np.array(table, float).reshape(-1, len(columns))
    numbers = np.array([number for number, _ in rows], int)
    return LengthColumns(numbers, values, first, _metres(first, columns[0], path))


def share_column(path: Path, name: str) -> Array | None:
    """Shares in the column `name`, in [0, 1], shape (n,); None without such a column.

    Its header names % or 1 as the unit; without one the numbers are taken as % if one is above 1.
    Fields without a number give NaN.

    Args:
        path: The file, as `length_columns` takes it.
        name: Name of the column.

    Raises:
        ValueError: The file cannot be read, the column has another unit, or a share lies outside.
    """
    header, rows = _fields(path, f"'d [mm]' or 'r [mm]', or 'size [mm],{name} [%]'")
    places = [k for k, cell in enumerate(header) if _name(cell) == name]
    if not places:
        return None
    place, match = places[0], re.fullmatch(HEADER, header[places[0]])
    unit = match and match[2]
    if unit not in (None, "%", "1", "-"):
        raise ValueError(f"{path}: column {name!r} has the unit {unit!r}; it takes % or 1")
    values = np.array([_number(f[place] if place < len(f) else "", path, n) for n, f in rows])
    percent = unit == "%" or (unit is None and bool((values > 1).any()))
    shares = values / 100 if percent else values
    if (outside := (shares < 0) | (shares > 1)).any():
        row = rows[int(np.argmax(outside))][0]
        raise ValueError(f"{path}: row {row} has a share outside 0 to {'100 %' if percent else 1}")
    return np.asarray(shares)


def has_places(path: Path) -> bool:
    """Whether a file can be read and tells where its particles lie, in columns x and y."""
    with suppress(ValueError):
        return {"x", "y"} <= {*map(_name, _fields(path, "")[0])}
    return False


BY_AREA = ": in a table of areas add a column 'd [unit]' of 2·√(Area/π)"
HEADER = r"\s*(\w+)\s*(?:[\[(]\s*([^\])]+?)\s*[\])])?\s*"
"""Name of a column, and its unit in brackets."""
PRINTED = r"pixel|px\b|\b(pel|dot|pt)s?\b|pica|point|didot|cicero|\b[pb]p\b"


def _name(cell: str) -> str:
    """Name of a column; empty where the header has none."""
    match = re.fullmatch(HEADER, cell)
    return match[1].lower() if match else ""


def _wanted(columns: Sequence[str]) -> str:
    """The header that these columns need, in words."""
    needed = ",".join(f"{name} [mm]" for name in columns)
    return f"'{needed}', units in the header{'; d may stand for r' if 'r' in columns else ''}"


def _fields(path: Path, wanted: str) -> tuple[list[str], Rows]:
    """Fields of the header, and of the rows with their numbers; `wanted` tells what it needs."""
    lines = _lines(path, wanted)
    separator = ";" if ";" in lines[0][1] else "\t" if "\t" in lines[0][1] else ","
    try:
        split = [(number, next(csv.reader([line], delimiter=separator))) for number, line in lines]
    except csv.Error as error:
        raise ValueError(f"{path} cannot be read as rows of numbers: {error}") from error
    rows = split[1:]
    return split[0][1], rows if separator == "," else with_points(rows, path)


COMMA, POINT = (rf"\s*[-+]?\d*{mark}\d+([eE][-+]?\d+)?\s*" for mark in (",", r"\."))
"""Numbers with a decimal comma, and with a point."""


def with_points(rows: list[tuple[int, list[str]]], path: Path) -> list[tuple[int, list[str]]]:
    """Numbered rows with points in place of decimal commas, for files that commas do not separate.

    Raises:
        ValueError: Some numbers have commas and others points.
    """
    first: dict[str, tuple[int, str]] = {}
    for number, fields in rows:
        for field in fields:
            for pattern in (COMMA, POINT):
                if re.fullmatch(pattern, field):
                    first.setdefault(pattern, (number, field.strip()))
    if len(first) == 2:
        (row, comma), (other, point) = first[COMMA], first[POINT]
        raise ValueError(
            f"{path}: row {row} holds {comma!r}, a decimal comma, and row {other} {point!r}, a"
            " point; write all numbers with a point"
        )
    return [
        (number, [x.replace(",", ".") if re.fullmatch(COMMA, x) else x for x in fields])
        for number, fields in rows
    ]


BEGINNINGS = {
    b"\x89PNG": "is a PNG image",
    b"\xff\xd8\xff": "is a JPEG image",
    b"II*\0": "is a TIFF image",
    b"MM\0*": "is a TIFF image",
    b"PK\3\4": "is a spreadsheet or another archive; save the table as CSV",
    b"\x89HDF": "is an HDF5 or NetCDF file",
}
"""First bytes of files that are taken for tables, and what they are."""


def not_text(path: Path) -> str:
    """What a file is that cannot be read as text."""
    first = path.read_bytes()[:4]
    known = [what for bytes_, what in BEGINNINGS.items() if first.startswith(bytes_)]
    return known[0] if known else "is not text in UTF-8; save it as CSV in UTF-8"


def _lines(path: Path, wanted: str) -> list[tuple[int, str]]:
    """Numbered lines that are neither empty nor comments, the header first."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise ValueError(f"{path} is no CSV file: it {not_text(path)}") from None
    except OSError as error:
        raise ValueError(f"{path} cannot be read: {error.strerror}") from error
    lines = [
        (number, line)
        for number, line in enumerate(text.splitlines(), 1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    if not lines:
        raise ValueError(f"{path} is empty; it needs rows of numbers below the header {wanted}")
    return lines


def _refuse_surplus(path: Path, number: int, fields: list[str], wanted: int) -> None:
    """Refuse a row with more fields than the header, as decimal commas make them."""
    if any(field.strip() for field in fields[wanted:]):
        raise ValueError(
            f"{path}: row {number} holds {','.join(fields)!r}, {len(fields)} fields where the"
            f" header has {wanted}: a decimal comma? write 1.25, not 1,25, or name every column"
        )


IDENTIFIER = r"(.* )?(id|label|name|notes?|comment|index)|particle|circle|image|row|[xyz]m?"
SHAPE = r"area|perim(eter)?|circ(ularity)?|(min)?feret.*|angle|major|minor|ar|round(ness)?|solidity"
NUMERAL = r"[-+]?(?=[.,]?\d)[\d.,' ]+([eE][-+]?\d+)?\s*%?"


def _refuse_unread(path: Path, header: list[str], rows: Rows, read: set[int]) -> None:
    """Refuse a column of numbers that is not read, such as counts, unless it numbers the rows."""
    for place, cell in enumerate(header):
        fields = [fields[place].strip() for _, fields in rows if place < len(fields)]
        numbers = [int(field) for field in fields if field.isdecimal()]
        counts_up = len(fields) == len(numbers) > 1 and bool((np.diff(numbers) == 1).all())
        words = re.findall(r"[^\W_]+", re.sub(r"[\[(].*", "", cell).lower())
        identifies = counts_up or re.fullmatch(f"{IDENTIFIER}|{SHAPE}", " ".join(words))
        if place not in read and not identifies and any(re.fullmatch(NUMERAL, x) for x in fields):
            raise ValueError(
                f"{path}: column {cell.strip()!r} is not read, and frequencies or shares in it"
                " would be ignored; write one row for each particle, or a sieve curve (size [mm],"
                " passing [%]), or remove it (or name it id if it numbers the rows)"
            )


def _places(
    header: list[str], columns: Sequence[str], unit: str, path: Path
) -> list[tuple[int, float, str]]:
    """Place of each column in a row, the factor that makes metres of it, and its unit."""
    if unit:
        _metres(unit, "unit for all columns", path)
    named: dict[str, tuple[int, float, str]] = {}
    for place, cell in enumerate(header):
        match, name = re.fullmatch(HEADER, cell), _name(cell)
        radius = "r" if name in SIZES else name
        if match and radius in columns:
            if radius in named:
                first = header[named[radius][0]].strip()
                raise ValueError(
                    f"{path}: columns {first!r} and {cell.strip()!r} both give {radius}; it takes"
                    " one of them: rename the other"
                )
            own = match[2] or unit
            metres = _metres(own, cell.strip(), path) * (0.5 if name in DIAMETERS else 1.0)
            named[radius] = (place, metres, own)
    missing = [name for name in columns if name not in named]
    if missing:
        told = f"header {', '.join(map(str.strip, header))!r} has no column {', '.join(missing)}"
        raise ValueError(
            f"{path}: the {told}; it needs {_wanted(columns)}"
            + (BY_AREA if "r" in missing and {"area", "feret"} & {*map(_name, header)} else "")
        )
    return [named[name] for name in columns]


def _metres(unit: str, column: str, path: Path) -> float:
    """Metres in one `unit` of length."""
    if not unit:
        cure = f"write it in the header: '{column} [mm]'"
        raise ValueError(f"{path}: column {column!r} has no unit; {cure}")
    try:
        if re.search(PRINTED, unit, re.IGNORECASE):
            raise ValueError
        return float(_units()(f"1 {unit}").to("m").magnitude)  # type: ignore[attr-defined]
    except Exception as error:  # the reader raises what it likes
        raise ValueError(
            f"{path}: column {column!r} has the unit {unit!r}, which is not a length; take mm, …"
        ) from error


@cache
def _units() -> Callable[[str], object]:
    """Pint's reader of quantities, which takes long to make."""
    from pint import UnitRegistry

    return UnitRegistry().Quantity


def _number(text: str, path: Path, row: int) -> float:
    """The number in a field; NaN where there is none."""
    if re.fullmatch(COMMA, text):
        told = text.strip()
        cure = f"write decimals with a point: {told.replace(',', '.')}"
        raise ValueError(f"{path}: row {row} holds {told!r}, a decimal comma; {cure}")
    with suppress(ValueError):
        return float(text)
    return float("nan")
