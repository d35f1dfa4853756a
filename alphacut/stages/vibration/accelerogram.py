"""Ground acceleration from a CSV file: ``time [s],acceleration [m/s^2]``."""

from __future__ import annotations

import csv
import math
import re
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from alphacut.io.output_paths import hint
from alphacut.io.problem import BadInput, Problem
from alphacut.io.units import factor

if TYPE_CHECKING:
    from alphacut.frame import Accelerogram

COLUMNS = {"time": "s", "acceleration": "m/s^2"}
ALLOWED = "time [s],acceleration [m/s^2]"
PAIR = "a time and an acceleration, such as 0.02,-0.35, with points and not commas in the numbers"
EVEN = 1e-6  # relative: steps that differ by more are not even


def accelerogram(path: Path, key: str = "frame.accelerogram") -> Accelerogram:
    """Read a record with even steps that begins at t = 0.

    Raises:
        BadInput: The file is missing, a unit is wrong, a row is no pair of numbers, or the steps
            are not even.
    """
    from alphacut.frame import Accelerogram

    (line, first), *rows = table(path, key)
    scales = header(first, path, line, key)
    times, values, lines = [], [], []
    for line, row in rows:
        time, value = pair(row, path, line, key)
        times.append(time * scales[0])
        values.append(value * scales[1])
        lines.append(line)
    if not any(values):
        raise BadInput(
            Problem(
                key,
                "the acceleration is zero throughout",
                str(path),
                "a record that moves the ground",
            )
        )
    return Accelerogram(even_step(times, lines, path, key), np.array(values))


def table(path: Path, key: str, least: int = 2) -> list[tuple[int, list[str]]]:
    """Line and entries of every row that is neither empty nor a comment."""
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except UnicodeDecodeError:
        raise BadInput(
            Problem(key, "the record is not text in UTF-8", str(path), ALLOWED)
        ) from None
    except OSError as error:
        raise BadInput(
            Problem(
                key,
                f"the record cannot be read: {(error.strerror or str(error)).lower()}",
                str(path),
                hint(path),
            )
        ) from None
    kept = [
        (number, line)
        for number, line in enumerate(lines, start=1)
        if line.strip() and not line.startswith("#")
    ]
    if len(kept) <= least:
        rows = "two rows" if least == 2 else "a row"
        raise BadInput(
            Problem(key, f"the record needs a header and {rows} or more", str(path), ALLOWED)
        )
    return [(number, next(csv.reader([line]))) for number, line in kept]


def pair(row: list[str], path: Path, line: int, key: str) -> tuple[float, float]:
    """Time and acceleration of a row."""
    try:
        time, value = (float(text) for text in row)
    except ValueError:
        raise BadInput(
            Problem(
                key,
                "this row is no pair of numbers",
                ",".join(row),
                PAIR,
                file=str(path),
                line=line,
            )
        ) from None
    if not (math.isfinite(time) and math.isfinite(value)):
        raise BadInput(
            Problem(key, "this row is not finite", ",".join(row), PAIR, file=str(path), line=line)
        )
    return time, value


def header(row: list[str], path: Path, line: int, key: str) -> list[float]:
    """Factors that bring the columns to SI, from the units in the header."""
    scales = []
    for text, (name, si) in zip(row, COLUMNS.items(), strict=False):
        match = re.fullmatch(rf"\s*{name}\s*\[([^\]]+)\]\s*", text)
        try:
            if match is None:
                raise ValueError(f"the column {text.strip()!r} is not {name} with its unit")
            scales.append(float(factor(match[1], si)))
        except ValueError as error:
            raise BadInput(
                Problem(key, str(error), file=str(path), line=line, allowed=ALLOWED)
            ) from None
    if len(row) != len(COLUMNS):
        raise BadInput(
            Problem(key, f"got {len(row)} columns", file=str(path), line=line, allowed=ALLOWED)
        )
    return scales


def even_step(times: list[float], lines: list[int], path: Path, key: str) -> float:
    """The step of evenly spaced times from 0."""
    step = times[1] - times[0]
    for index, time in enumerate(times):
        if not step > 0 or abs(time - index * step) > EVEN * step * max(1, index):
            what = f"the times are not evenly spaced from 0: this row is at {time:g} s"
            raise BadInput(
                Problem(
                    key,
                    what,
                    allowed=f"{index * step:g} s here, by the first two rows",
                    file=str(path),
                    line=lines[index],
                )
            )
    # rounding of the first two rows would grow towards the end
    return times[-1] / (len(times) - 1)
