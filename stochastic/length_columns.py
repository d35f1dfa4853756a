"""Columns of lengths from a CSV file, their units in its header: ``x [mm], y [mm], d [mm]``."""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from stochastic.truncated_normal import Array


def length_columns(path: Path, columns: Sequence[str], unit: str = "") -> tuple[Array, Array]:
    """Row numbers as an editor shows them, shape (n,), and the columns in m, shape (n, len(columns)); NaN where there is no number.

    Args:
        path: The file; separated by commas, semicolons or tabs; empty lines and those behind # are passed over.
        columns: Names of the columns; a column "d" (diameter) may stand in for "r".
        unit: Unit of columns whose header names none; empty if each does.

    Raises:
        ValueError: The file cannot be read, or a column or its unit is missing.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise ValueError(f"{path} cannot be read as text: {error}") from error
    lines = [(number, line) for number, line in enumerate(text.splitlines(), 1) if line.strip() and not line.lstrip().startswith("#")]
    if not lines:
        raise ValueError(f"{path} is empty; it needs a header {', '.join(columns)} and a row for each particle")
    separator = ";" if ";" in lines[0][1] else "\t" if "\t" in lines[0][1] else ","
    places = _places(next(csv.reader([lines[0][1]], delimiter=separator)), columns, unit, path)
    fields = list(csv.reader([line for _, line in lines[1:]], delimiter=separator))
    table = np.array([[factor * _number(row[place] if place < len(row) else "") for place, factor in places] for row in fields], float)
    return np.array([number for number, _ in lines[1:]], int), table.reshape(-1, len(columns))


def _places(header: list[str], columns: Sequence[str], unit: str, path: Path) -> list[tuple[int, float]]:
    """Place of each column in a row and the factor that makes metres of it."""
    named: dict[str, tuple[int, float]] = {}
    for place, cell in enumerate(header):
        match = re.fullmatch(r"\s*(\w+)\s*(?:[\[(]\s*([^\])]+?)\s*[\])])?\s*", cell)
        name = match[1].lower() if match else ""
        radius = "r" if name == "d" else name
        if match and radius in columns:
            named[radius] = (place, _metres(match[2] or unit, cell.strip(), path) * (0.5 if name == "d" else 1.0))
    missing = [name for name in columns if name not in named]
    if missing:
        told = f"the header {', '.join(map(str.strip, header))!r} has no column {', '.join(missing)}"
        wanted = ", ".join(f"{name} [mm]" for name in columns)
        raise ValueError(f"{path}: {told}; it needs '{wanted}', units in the header; d for diameters may stand in for r")
    return [named[name] for name in columns]


def _metres(unit: str, column: str, path: Path) -> float:
    """Metres in one `unit` of length."""
    from pint import UnitRegistry
    from pint.errors import PintError

    if not unit:
        raise ValueError(f"{path}: column {column!r} has no unit; write it in the header, such as 'r [mm]', or give a unit for all")
    registry: Callable[[str], object] = UnitRegistry().Quantity
    try:
        return float(registry(f"1 {unit}").to("m").magnitude)  # type: ignore[attr-defined]
    except (PintError, AttributeError, ValueError) as error:
        raise ValueError(f"{path}: column {column!r} has the unit {unit!r}, which is not a length; take mm, cm, m, …") from error


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return float("nan")
