"""Ground acceleration from a CSV file with units in its header: ``time [s],acceleration [m/s^2]``."""

from __future__ import annotations

import csv
import math
import re
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from alphacut.problem import BadInput, Problem
from alphacut.units import factor

if TYPE_CHECKING:
    from frame import Accelerogram

COLUMNS = {"time": "s", "acceleration": "m/s^2"}
EVEN = 1e-6  # relative: steps that differ by more are not even


def accelerogram(path: Path, key: str = "frame.accelerogram") -> Accelerogram:
    """Read a record with even steps that begins at t = 0.

    Raises:
        BadInput: The file is missing, a unit is wrong, a row is no pair of numbers, or the steps are not even.
    """
    from frame import Accelerogram

    rows = table(path, key)
    scales = header(rows[0], path, key)
    times, values = [], []
    for number, row in enumerate(rows[1:], start=2):
        try:
            time, value = (float(text) for text in row)
        except ValueError:
            raise BadInput(Problem(key, "this row is no pair of numbers", ",".join(row), file=str(path), line=number)) from None
        if not (math.isfinite(time) and math.isfinite(value)):
            raise BadInput(Problem(key, "this row is not finite", ",".join(row), file=str(path), line=number))
        times.append(time * scales[0])
        values.append(value * scales[1])
    return Accelerogram(even_step(times, path, key), np.array(values))


def table(path: Path, key: str) -> list[list[str]]:
    """Rows of the file that are neither empty nor comments; at least a header and two more."""
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise BadInput(Problem(key, f"the record cannot be read: {error}", str(path))) from None
    rows = [row for row in csv.reader(line for line in lines if line.strip() and not line.startswith("#"))]
    if len(rows) < 3:
        raise BadInput(Problem(key, "the record needs a header and two rows or more", str(path), "time [s],acceleration [m/s^2]"))
    return rows


def header(row: list[str], path: Path, key: str) -> list[float]:
    """Factors that bring the columns to SI, from the units in the header."""
    scales = []
    for text, (name, si) in zip(row, COLUMNS.items(), strict=False):
        match = re.fullmatch(rf"\s*{name}\s*\[([^\]]+)\]\s*", text)
        try:
            if match is None:
                raise ValueError(f"the column {text.strip()!r} is not {name} with its unit")
            scales.append(float(factor(match[1], si)))
        except ValueError as error:
            raise BadInput(Problem(key, str(error), file=str(path), line=1, allowed="time [s],acceleration [m/s^2]")) from None
    if len(row) != len(COLUMNS):
        raise BadInput(Problem(key, f"got {len(row)} columns", file=str(path), line=1, allowed="time [s],acceleration [m/s^2]"))
    return scales


def even_step(times: list[float], path: Path, key: str) -> float:
    """The step of evenly spaced times from 0."""
    step = times[1] - times[0]
    for index, time in enumerate(times):
        if not step > 0 or abs(time - index * step) > EVEN * step * max(1, index):
            raise BadInput(Problem(key, f"the times are not evenly spaced from 0: row {index + 1} is at {time:g} s", str(path)))
    return step
