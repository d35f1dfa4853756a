"""Ground acceleration from a file: ``time [s],acceleration [m/s^2]``, or PEER's AT2."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from alphacut.frame import Accelerogram
from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import RefusedError, require
from alphacut.io.units import factor
from alphacut.stochastic.particles.csv_columns import fields, number, text_of

HEAD = re.compile(r"(time|t)\s*[\[(](.+)[\])]|(acceleration|acc|a)\s*[\[(](.+)[\])]", re.IGNORECASE)
ALLOWED = "time [s],acceleration [m/s^2], [g] or [gal]"
PEER = re.compile(r"UNITS OF G\b.*NPTS\s*=\s*(\d+)\s*,\s*DT\s*=\s*([\d.]+)\s*SEC(.*)", re.S | re.I)
UNEVEN = 0.05
"""Share of a step by which a time may miss its place, as times that are rounded do."""


def accelerogram(path: Path) -> Accelerogram:
    """A record with even steps from t = 0: a CSV file, or an AT2 file of PEER.

    Raises:
        RefusedError: The file is missing, a unit is wrong, a row is no pair of numbers, or the
            steps are not even.
    """
    if path.suffix.lower() == ".at2":
        return _peer(path)
    (_, head), *rows = fields(path)
    scales = _scales(path, head)
    table = np.array([[number(path, row, cells, k) for k in (0, 1)] for row, cells in rows])
    time, acceleration = (table * scales).T
    return Accelerogram(_even_step(path, time, [row for row, _ in rows]), acceleration)


def _scales(path: Path, head: list[str]) -> list[float]:
    """Factors that bring both columns to SI."""
    names = [HEAD.fullmatch(cell.strip()) for cell in head]
    try:
        time, acceleration = (match[2] or match[4] for match in names if match)
        return [float(factor(time, "s")), float(factor(acceleration, "m/s^2"))]
    except ValueError:
        raise RefusedError(f"{path.name}, header", ",".join(head)[:80], ALLOWED) from None


def _even_step(path: Path, time: Array, rows: list[int]) -> float:
    """The step of times that are even from 0."""
    even = np.linspace(0, time[-1], len(time))
    off = np.abs(time - even)
    worst = int(off.argmax())
    holds = time[-1] > 0 and off[worst] <= UNEVEN * even[1]
    value, allowed = f"time {time[worst]:g} s", "even steps from 0 s; resample to them"
    require(holds, f"{path.name}, row {rows[worst]}", value, allowed)
    return float(even[1])


def _peer(path: Path) -> Accelerogram:
    """A file of PEER's data base, in g; its head ends with NPTS and DT."""
    match = PEER.search(text_of(path))
    allowed = "a head with UNITS OF G and NPTS= 4000, DT= .0050 SEC, and as many numbers"
    try:
        count, step, text = match.groups() if match else ("", "", "")
        values = np.array(text.split(), float)
        whole = match is not None and len(values) == int(count)
        require(whole, path.name, f"{len(values)} numbers", allowed)
        return Accelerogram(float(step), values * float(factor("g", "m/s^2")))
    except ValueError as error:
        raise RefusedError(path.name, "no record", allowed, str(error)) from None
