"""Ground acceleration from a file: ``time [s],acceleration [m/s^2]``, or PEER's AT2."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np

from alphacut.frame import Accelerogram
from alphacut.io.csv_rows import CsvFile
from alphacut.io.units import factor
from alphacut.stochastic.theta.truncated_normal import Array

COLUMNS = {"time": "s", "acceleration": "m/s^2"}
PATTERNS = {"time": "time|t", "acceleration": r"acceleration|acc\.?|a"}
ALLOWED = "time [s],acceleration [m/s^2], [g] or [gal]"
PAIR = "a time and an acceleration, such as 0.02,-0.35, with points and not commas in the numbers"
NPTS = re.compile(r"NPTS\s*=\s*(\d+)\s*,\s*DT\s*=\s*(\d*\.?\d+)\s*SEC", re.IGNORECASE)
IN_G = re.compile(r"ACCELERATION .*IN UNITS OF G\b", re.IGNORECASE)
EVEN = 1e-6  # relative: steps that differ by more are not even


def accelerogram(path: Path, key: str = "frame.accelerogram") -> Accelerogram:
    """Read a record with even steps that begins at t = 0: a CSV file, or an AT2 file of PEER.

    Raises:
        BadInput: The file is missing, a unit is wrong, a row is no pair of numbers, or the steps
            are not even.
    """
    file = CsvFile(path, key, "record", ALLOWED)
    lines = file.lines()
    for head, text in enumerate(lines[:9]):
        if found := NPTS.search(text):
            values = peer(file, lines, head, int(found[1]), float(found[2]))
            return Accelerogram(float(found[2]), values)
    (line, first), *rows = file.rows(least=2)
    if len(first) != len(COLUMNS):
        what = f"got {len(first)} columns"
        if len(first) == 1:
            what = "no comma found: commas, semicolons or tabs part columns, and blanks do not"
        raise file.refuse(line, what, allowed=ALLOWED)
    scales = [
        file.scale(line, cell, name, si, pattern=PATTERNS[name])
        for cell, (name, si) in zip(first, COLUMNS.items(), strict=True)
    ]
    values = np.array([pair(file, line, row) for line, row in rows]) * scales
    if not values[:, 1].any():
        what = "the acceleration is zero throughout"
        raise file.unreadable(what, "a record that moves the ground")
    return Accelerogram(even_step(file, values[:, 0], [line for line, _ in rows]), values[:, 1])


def peer(file: CsvFile, lines: list[str], head: int, count: int, step: float) -> Array:
    """Accelerations of a file of PEER's data base: its head ends with NPTS and DT."""
    if not any(IN_G.search(line) for line in lines[:head]):
        what = "the lines above NPTS and DT do not say that the values are accelerations in g"
        raise file.refuse(head + 1, what, allowed="ACCELERATION TIME SERIES IN UNITS OF G")
    try:
        values = np.array(" ".join(lines[head + 1 :]).split(), float)
    except ValueError as error:
        raise file.unreadable(str(error), "numbers below the line of NPTS and DT") from None
    if not (len(values) == count >= 2 and step > 0 and np.isfinite(values).all() and values.any()):
        what = f"{len(values)} numbers follow NPTS = {count} and DT = {step:g} s"
        raise file.unreadable(what, "as many finite numbers, not all 0, at a step above 0")
    return values * float(factor("g", "m/s^2"))


def cut_short(record: Accelerogram, duration: float) -> bool:
    """Whether a simulation leaves out a part of the record that moves the ground."""
    end = (len(record.acceleration) - 1) * record.step
    rest = record.acceleration[math.floor(duration / record.step + EVEN) + 1 :]
    return end - duration > max(record.step, 0.01 * end) and bool(np.any(rest))


def pair(file: CsvFile, line: int, row: list[str]) -> tuple[float, float]:
    """Time and acceleration of a row."""
    try:
        time, value = (float(text) for text in row)
    except ValueError:
        raise file.refuse(line, "this row is no pair of numbers", ",".join(row), PAIR) from None
    if not (math.isfinite(time) and math.isfinite(value)):
        raise file.refuse(line, "this row is not finite", ",".join(row), PAIR)
    return time, value


def even_step(file: CsvFile, times: Array, lines: list[int]) -> float:
    """The step of evenly spaced times from 0."""
    step = times[1] - times[0]
    for index, time in enumerate(times):
        if not step > 0 or abs(time - index * step) > EVEN * step * max(1, index):
            what = f"the times are not evenly spaced from 0: this row is at {time:g} s"
            allowed = f"{index * step:g} s here, by the first two rows"
            raise file.refuse(lines[index], what, allowed=allowed)
    # rounding of the first two rows would grow towards the end
    return float(times[-1]) / (len(times) - 1)
