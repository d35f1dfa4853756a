"""Records and forces in tables: times and values, in CSV with units in the head, or without a head.

Without a head the case says the unit, and of a single column the step as well.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import require
from alphacut.io.quantity import factor
from alphacut.records.recording import Recording
from alphacut.records.text_file import ACCELERATION_UNITS, TextFile, acceleration_factor
from alphacut.stochastic.particles.csv_columns import NUMBER, cells_of

HEAD = re.compile(r"(time|t)\s*[\[(](.+)[\])]|(acceleration|acc|a)\s*[\[(](.+)[\])]", re.IGNORECASE)
ALLOWED = "time [s],acceleration [m/s^2], [g] or [gal]"
TIME = re.compile(r"(?:time|t)\s*[\[(](.+)[\])]", re.IGNORECASE)
FORCE = re.compile(r"(?:force|load|f)\s*(?:[\[(](.+)[\])])?", re.IGNORECASE)
ALLOWED_FORCE = "time [s],force [kN], or time [s],force of a course without a unit"
UNEVEN = 0.05
"""Share of a step by which a time may miss its place, as times that are rounded do."""
Row = tuple[int, list[str]]
"""Number of a line, from 0, and its cells."""


@dataclass(frozen=True)
class Layout:
    """What a case says of files that do not: the step in s and the unit of their samples."""

    step: float | None = None
    unit: str = ""


def is_table(file: TextFile) -> bool:
    """True if the first line is a head of times and accelerations, or the last one a row of one."""
    lines = [line for line in file.lines if line.strip() and not line.startswith("#")]
    if not lines:
        return False
    head = re.split("[,;\t]", lines[0])
    cells = _cells(lines[-1])
    is_row = len(cells) in (1, 2) and all(NUMBER.fullmatch(cell) for cell in cells)
    return bool(HEAD.fullmatch(head[0].strip())) or is_row


def read_table(file: TextFile, layout: Layout) -> Recording:
    """Recording of a table with even steps: times and accelerations, or accelerations alone.

    Raises:
        RefusedError: A unit is wrong or missing, a row is no pair of numbers, or the steps are not
            even.
    """
    rows = table_rows(file)
    if all(NUMBER.fullmatch(cell) for cell in _cells(file.lines[rows[0][0]])):
        return _read_without_head(file, layout)
    (_, head), *rows = rows
    time_factor, unit, to_si = _parse_head(file, head)
    table = numbered_rows(file, rows, 2)
    step, remarks = even_step(file, time_factor * table[:, 0], [line for line, _ in rows])
    return Recording("CSV", unit, step, to_si * table[:, 1], remarks=remarks)


def _cells(line: str) -> list[str]:
    """Cells of a row of numbers, parted by commas, semicolons or blanks."""
    return [cell for cell in re.split(r"[,;\s]+", line.strip()) if cell]


def _read_without_head(file: TextFile, layout: Layout) -> Recording:
    """Recording of one column, or of times in s and accelerations, in the case's unit."""
    rows = [(k, _cells(x)) for k, x in enumerate(file.lines) if x.strip() and x[0] != "#"]
    columns = len(rows[0][1])
    to_si = acceleration_factor(layout.unit)
    is_complete = to_si is not None and (columns > 1 or layout.step is not None)
    if not is_complete or columns > 2:
        cure = 'say records.unit = "g"' + (', records.step = "0.005 s"' if columns == 1 else "")
        allowed = f"a unit of {ACCELERATION_UNITS}" + (", and a step" if columns == 1 else "")
        raise file.refusal(rows[0][0], f"{columns} columns without a head", allowed, cure)
    assert to_si is not None
    table = numbered_rows(file, rows, columns)
    if columns == 1:
        assert layout.step is not None
        return Recording("one column", layout.unit, layout.step, to_si * table[:, 0])
    step, remarks = even_step(file, table[:, 0], [line for line, _ in rows])
    return Recording("two columns", layout.unit, step, to_si * table[:, 1], remarks=remarks)


def table_rows(file: TextFile) -> list[Row]:
    """Number (from 0) and cells of each line that is neither empty nor a comment, head first."""
    lines = [(k, x) for k, x in enumerate(file.lines) if x.strip() and not x.startswith("#")]
    allowed = "a header with units, and rows of numbers below it"
    require(len(lines) > 1, file.name, value=f"{len(lines)} lines", allowed=allowed)
    head = lines[0][1]
    separator = next((mark for mark in ";\t" if mark in head), ",")
    return [(number, cells_of(file.name, number + 1, x, separator)) for number, x in lines]


def _parse_head(file: TextFile, head: list[str]) -> tuple[float, str, float]:
    """Factor of times to s; unit of acceleration as the head states it; its factor to m/s²."""
    matches = [HEAD.fullmatch(cell.strip()) for cell in head]
    if len(matches) == 2 and matches[0] and matches[0][2] and matches[1] and matches[1][4]:
        time_unit, unit = matches[0][2], matches[1][4]
        try:
            to_si = acceleration_factor(unit) or float(factor(unit, "m/s^2"))
            return float(factor(time_unit, "s")), unit, to_si
        except ValueError:  # an unknown unit
            pass
    raise file.refusal(0, ",".join(head)[:80], ALLOWED)


def numbered_rows(file: TextFile, rows: Sequence[Row], columns: int) -> Array:
    """Numbers of the first columns, shape (n, columns); refuses cells that are none."""
    return np.array([[_number(file, row, cells, k) for k in range(columns)] for row, cells in rows])


def _number(file: TextFile, row: int, cells: Sequence[str], column: int) -> float:
    text = cells[column].strip() if column < len(cells) else ""
    if not NUMBER.fullmatch(text) or not np.isfinite(float(text)):
        what = f"{text[:40]!r} in column {column + 1}"
        raise file.refusal(row, what, "numbers such as 1.25 or 1e-3")
    return float(text)


def even_step(
    file: TextFile, time: Array, lines: list[int], *, from_zero: bool = False
) -> tuple[float, tuple[str, ...]]:
    """Return the step in s of times that must rise evenly, and a remark if they begin after 0.

    `lines` are their lines in the file; `from_zero` refuses times that begin elsewhere.
    """
    first = 0.0 if from_zero else time[0]
    even = np.linspace(first, time[-1], len(time))
    deviation = np.abs(time - even)
    worst = int(deviation.argmax())
    step = float(even[1] - even[0]) if len(time) > 1 else 0.0
    if not (step > 0 and deviation[worst] <= UNEVEN * step):
        value = f"time {time[worst]:g} s"
        allowed = "even steps from 0 s" if from_zero else "even steps"
        raise file.refusal(lines[worst], value, allowed, "resample to even steps")
    is_shifted = abs(first) > UNEVEN * step
    return step, (f"its times begin at {first:g} s, taken as 0",) if is_shifted else ()


@dataclass(frozen=True, eq=False)
class ForceSamples:
    """Samples of a course.

    Args:
        step: Time between samples, in s.
        samples: Samples from t = 0 on, shape (n,), in N, or without a unit.
        has_unit: Whether the head gives a unit.
    """

    step: float
    samples: Array
    has_unit: bool


def read_force_history(path: Path) -> ForceSamples:
    """Samples of a force in a CSV file with even steps from t = 0.

    Raises:
        RefusedError: A unit is wrong, a row is no pair of numbers, or the steps are not even.
    """
    file = TextFile.read(path)
    (_, head), *rows = table_rows(file)
    matches = [x.fullmatch(cell.strip()) for x, cell in zip((TIME, FORCE), head, strict=False)]
    if len(head) != 2 or None in matches:
        raise file.refusal(0, ",".join(head)[:80], ALLOWED_FORCE)
    time_unit, force_unit = (match[1] if match else None for match in matches)
    try:
        time_factor = float(factor(str(time_unit), "s"))
        force_factor = float(factor(force_unit, "N")) if force_unit else 1.0
    except ValueError as error:
        raise file.refusal(0, ",".join(head)[:80], ALLOWED_FORCE, str(error)) from None
    table = numbered_rows(file, rows, 2)
    times, lines = time_factor * table[:, 0], [line for line, _ in rows]
    step, _ = even_step(file, times, lines, from_zero=True)
    samples = np.asarray(force_factor * table[:, 1])
    if not samples.any():
        raise file.refusal(0, "zeros throughout", "a force that moves something")
    return ForceSamples(step, samples, force_unit is not None)
