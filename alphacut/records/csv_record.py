"""Records in CSV files: a column of times, a column of accelerations, their units in the head."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import require
from alphacut.io.quantity import factor
from alphacut.records.recording import Recording
from alphacut.records.text_file import TextFile, acceleration_factor
from alphacut.stochastic.particles.csv_columns import NUMBER, cells_of

HEAD = re.compile(r"(time|t)\s*[\[(](.+)[\])]|(acceleration|acc|a)\s*[\[(](.+)[\])]", re.IGNORECASE)
ALLOWED = "time [s],acceleration [m/s^2], [g] or [gal]"
UNEVEN = 0.05
"""Share of a step by which a time may miss its place, as times that are rounded do."""


def read_csv_record(file: TextFile) -> Recording:
    """Recording of a CSV file with even steps from t = 0.

    Raises:
        RefusedError: A unit is wrong, a row is no pair of numbers, or the steps are not even.
    """
    (_, head), *rows = table_rows(file)
    time_factor, unit, to_si = _parse_head(file, head)
    table = numbered_rows(file, rows)
    step = even_step(file, time_factor * table[:, 0], [line for line, _ in rows])
    return Recording("CSV", unit, step, to_si * table[:, 1])


def table_rows(file: TextFile) -> list[tuple[int, list[str]]]:
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


def numbered_rows(file: TextFile, rows: Sequence[tuple[int, list[str]]]) -> Array:
    """Numbers of the first two columns, shape (n, 2).

    Raises:
        RefusedError: A cell is no finite number.
    """
    return np.array([[_number(file, row, cells, k) for k in (0, 1)] for row, cells in rows])


def _number(file: TextFile, row: int, cells: Sequence[str], column: int) -> float:
    text = cells[column].strip() if column < len(cells) else ""
    if not NUMBER.fullmatch(text) or not np.isfinite(float(text)):
        what = f"{text[:40]!r} in column {column + 1}"
        raise file.refusal(row, what, "numbers such as 1.25 or 1e-3")
    return float(text)


def even_step(file: TextFile, time: Array, lines: list[int]) -> float:
    """The step in s of times that must rise evenly from 0; `lines` are their lines in the file."""
    even = np.linspace(0, time[-1], len(time))
    deviation = np.abs(time - even)
    worst = int(deviation.argmax())
    if not (len(time) > 1 and time[-1] > 0 and deviation[worst] <= UNEVEN * even[1]):
        value, allowed = f"time {time[worst]:g} s", "even steps from 0 s"
        raise file.refusal(lines[worst], value, allowed, "resample to even steps")
    return float(even[1])
