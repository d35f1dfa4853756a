"""Columns of lengths from a CSV file, their units in its header: ``x [mm], y [mm], d [mm]``."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from math import isfinite
from pathlib import Path

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.base.errors import RefusedError
from alphacut.base.memory import require_text

METRES = {"m": 1.0, "dm": 0.1, "cm": 1e-2, "mm": 1e-3, "µm": 1e-6, "μm": 1e-6, "um": 1e-6}
METRES |= {"micron": 1e-6, "nm": 1e-9, "in": 0.0254, "inch": 0.0254, "ft": 0.3048}
DIAMETERS, RADII = ("d", "diameter", "size"), ("r", "radius")
HEADER = r"\s*(\w+)\s*(?:[\[(]\s*([^\])]*?)\s*[\])])?\s*"
"""Name of a column, and its unit in brackets."""
MAX_LENGTH = 100  # characters of a number; a longer field is none
NUMBER = re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?")


def length_columns(path: Path, columns: Sequence[str]) -> tuple[Ints, Array]:
    """Read columns of lengths from a CSV file, separated by commas, semicolons or tabs.

    Empty lines and comments behind # are skipped. A column d of diameters may stand in for "r".

    Returns:
        Row numbers as an editor shows them, shape (n,), and the columns in m, shape (n, columns).

    Raises:
        RefusedError: The file cannot be read, a column or its unit is missing, or a field is no
            number.
    """
    (_, header), *rows = fields(path)
    found = [_column(header, name, path) for name in columns]
    values = [[factor * number(path, row, cells, k) for k, factor in found] for row, cells in rows]
    return np.array([row for row, _ in rows]), np.array(values)


def fields(path: Path) -> list[tuple[int, list[str]]]:
    """Return number and fields of each line of a CSV file that is neither empty nor a comment."""
    lines = [*enumerate(text_of(path).splitlines(), 1)]
    lines = [(row, line) for row, line in lines if line.strip() and not line.startswith("#")]
    if len(lines) < 2:
        allowed = "a header with units, and rows of numbers below it"
        raise RefusedError(path.name, f"{len(lines)} lines", allowed)
    separator = next((mark for mark in ";\t" if mark in lines[0][1]), ",")
    rows = []
    for row, line in lines:
        try:
            rows.append((row, next(csv.reader([line], delimiter=separator))))
        except csv.Error:  # a field is too long
            what, most = f"{len(line):,} letters", f"{csv.field_size_limit():,}"
            allowed = f"fields up to {most} letters"
            raise RefusedError(f"{path.name}, row {row}", what, allowed) from None
    return rows


def text_of(path: Path) -> str:
    """Return the text of a file in UTF-8; refuse what is none."""
    try:
        require_text(path)
        return path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        reason = str(getattr(error, "strerror", None) or "no text").lower().removeprefix("is ")
        raise RefusedError(str(path), reason, "text files in UTF-8") from None


def number(path: Path, row: int, cells: Sequence[str], column: int) -> float:
    """Return the number in a field of a row, in plain ASCII digits; refuse what is none."""
    text = cells[column].strip() if column < len(cells) else ""
    if len(text) > MAX_LENGTH or not NUMBER.fullmatch(text) or not isfinite(float(text)):
        allowed = "numbers such as 1.25 or 1e-3"
        raise RefusedError(f"{path.name}, row {row}, column {column + 1}", repr(text[:40]), allowed)
    return float(text)


def _column(header: list[str], name: str, path: Path) -> tuple[int, float]:
    """Return the index of the column `name` in the header, and the factor of its unit to m."""
    is_radius = name == "r"
    accepted = (*RADII, *DIAMETERS) if is_radius else (name,)
    for column, cell in enumerate(header):
        match = re.fullmatch(HEADER, cell)
        if match and match[1].lower() in accepted and match[2] in METRES:
            is_diameter = match[1].lower() in DIAMETERS
            return column, METRES[match[2]] * (0.5 if is_diameter else 1.0)
    allowed = f"a column '{name} [mm]'" + (" or 'd [mm]'" if is_radius else "")
    units = f"units are {', '.join(METRES)}"
    raise RefusedError(f"{path.name}, header", ",".join(header)[:80], allowed, units)
