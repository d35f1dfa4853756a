"""Ground acceleration from a file: ``time [s],acceleration [m/s^2]``, or PEER's AT2."""

from __future__ import annotations

import re
from decimal import Decimal
from pathlib import Path

import numpy as np

from alphacut.frame import Accelerogram
from alphacut.fuzzy.arrays import Array
from alphacut.io.csv_rows import CsvFile, Rows
from alphacut.io.units import factor

COLUMNS = [("time", "s", "time|t"), ("acceleration", "m/s^2", r"acceleration|acc\.?|a")]
ALLOWED = "time [s],acceleration [m/s^2], [g] or [gal]"
PAIR = "a finite time and acceleration, such as 0.02,-0.35, with points and no decimal commas"
NPTS = re.compile(r"NPTS\s*=\s*(\d*)\s*,\s*DT\s*=\s*(\d*\.?\d+)?\s*(SEC)?", re.IGNORECASE)
PARTS = ("NPTS", "DT", "SEC as its unit")
IN_G = re.compile(r"ACCELERATION .*IN UNITS OF G\b", re.IGNORECASE)
EVEN = 1e-6  # relative: steps that differ by more are not even


def accelerogram(path: Path, key: str = "frame.accelerogram") -> Accelerogram:
    """Read a record with even steps that begins at t = 0: a CSV file, or an AT2 file of PEER.

    Raises:
        BadInput: The file is missing, a unit is wrong, a row is no pair of numbers, or the steps
            are not even.
    """
    file = CsvFile(path, key, "record", ALLOWED)
    for head, text in enumerate(file.lines[:9]):
        if parts := NPTS.search(text):
            return peer(file, head, dict(zip(PARTS, parts.groups(), strict=True)))
    (line, first), *rows = file.rows(least=2)
    if len(first) != len(COLUMNS):
        what = f"got {len(first)} columns"
        if len(first) == 1:
            what = "no comma found: commas, semicolons or tabs part columns, and blanks do not"
        raise file.refuse(line, what, allowed=ALLOWED)
    scales = [
        file.scale(line, cell, name, si, pattern=pattern)
        for cell, (name, si, pattern) in zip(first, COLUMNS, strict=True)
    ]
    values = file.finite(rows, 2, "no pair of numbers", PAIR) * scales
    if not values[:, 1].any():
        raise file.unreadable("the acceleration is zero throughout", "one that moves the ground")
    return Accelerogram(even_step(file, rows, scales[0]), values[:, 1])


def peer(file: CsvFile, head: int, parts: dict[str, str | None]) -> Accelerogram:
    """A file of PEER's data base: its head ends with NPTS and DT, here the text of each part."""
    if lacking := [part for part, text in parts.items() if not text]:
        what = f"the head of this AT2 file lacks {' and '.join(lacking)}"
        raise file.refuse(head + 1, what, file.lines[head].strip(), "NPTS= 4000, DT= .0050 SEC")
    count, step = int(parts["NPTS"] or 0), float(parts["DT"] or 0)
    if not any(IN_G.search(line) for line in file.lines[:head]):
        what = "the lines above NPTS and DT do not say that the values are accelerations in g"
        raise file.refuse(head + 1, what, allowed="ACCELERATION TIME SERIES IN UNITS OF G")
    try:
        values = np.array(" ".join(file.lines[head + 1 :]).split(), float)
    except ValueError as error:
        raise file.unreadable(str(error), "numbers below the line of NPTS and DT") from None
    if not (len(values) == count >= 2 and step > 0 and np.isfinite(values).all() and values.any()):
        what = f"{len(values)} numbers follow NPTS = {count} and DT = {step:g} s"
        raise file.unreadable(what, "as many finite numbers, not all 0, at a step above 0")
    return Accelerogram(step, values * float(factor("g", "m/s^2")))


def even_step(file: CsvFile, rows: Rows, scale: float) -> float:
    """The step of the times in column 0, which are even from 0 but for rounding in the file."""
    written = [Decimal(row[0]) for _, row in rows]
    times = scale * np.array(written, float)
    if times[0] != 0:
        what = f"the times begin at {times[0]:g} s"
        raise file.refuse(rows[0][0], what, allowed="0 s; subtract the first time from all")
    even, half = np.linspace(0, times[-1], len(times)), scale * half_digits(written)
    # that of the last row is in the step too; from step/4 on, a missing row might pass for rounding
    half = np.where(half < even[1] / 4, half, 0)
    off = half + np.linspace(0, half[-1], len(half))
    if times[-1] > 0 and (abs(times - even) <= off + EVEN * np.maximum(even, even[1])).all():
        return float(even[1])
    gaps = np.diff(times)
    worst, usual = int(abs(gaps - np.median(gaps)).argmax()), np.median(gaps)
    what = f"the times are not evenly spaced: {gaps[worst]:g} s to this row, mostly {usual:g} s"
    raise file.refuse(rows[worst + 1][0], what, allowed="even steps above 0 s; resample to them")


def half_digits(written: list[Decimal]) -> Array:
    """Half a unit of the last digit to which each was rounded, zeros there written or not."""
    last = min(int(number.as_tuple().exponent) for number in written)
    most = max(len(number.as_tuple().digits) for number in written)
    return 0.5 * 10.0 ** np.array([max(last, x.adjusted() + 1 - most) for x in written])
