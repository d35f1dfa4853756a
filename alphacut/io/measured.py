"""Measured data from files: the ground's acceleration, natural modes."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from alphacut.frame import Accelerogram
from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import RefusedError, require
from alphacut.io.quantity import factor
from alphacut.stochastic.particles.csv_columns import fields, number, text_of

HEAD = re.compile(r"(time|t)\s*[\[(](.+)[\])]|(acceleration|acc|a)\s*[\[(](.+)[\])]", re.IGNORECASE)
RECORD = "time [s],acceleration [m/s^2], [g] or [gal]"
PEER = re.compile(r"UNITS OF G\b.*NPTS\s*=\s*(\d+)\s*,\s*DT\s*=\s*([\d.]+)\s*SEC(.*)", re.S | re.I)
UNEVEN = 0.05
"""Share of a step by which a time may miss its place, as times that are rounded do."""
MODES_HEAD = re.compile(r"mode\s*,\s*frequency(\s*\[Hz\])?(\s*,\s*q[1-9]\d*)*\s*")
MODES = "mode,frequency [Hz],q1,q2 … with the floors that were measured"


def accelerogram(path: Path) -> Accelerogram:
    """A record with even steps from t = 0: a CSV file, or an AT2 file of PEER.

    The header of a CSV file is ``time [s],acceleration [m/s^2]``.

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
        raise RefusedError(f"{path.name}, header", ",".join(head)[:80], RECORD) from None


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
    count, step, text = match.groups() if match else ("1", "", "")
    try:
        values = np.array(text.split(), float).reshape(int(count))
        return Accelerogram(float(step), values * float(factor("g", "m/s^2")))
    except ValueError as error:
        allowed = "a head with UNITS OF G and NPTS= 4000, DT= .0050 SEC, and as many numbers"
        raise RefusedError(path.name, "no record", allowed, str(error)) from None


@dataclass(frozen=True, eq=False)
class ModeRows:
    """All measurements of one mode.

    Args:
        mode: Its number.
        frequencies: In Hz, shape (rows,).
        amplitudes: By floor, each of shape (rows,), to any scale.
    """

    mode: int
    frequencies: Array
    amplitudes: dict[int, Array]


def mode_rows(path: Path) -> tuple[ModeRows, ...]:
    """The measurements of each mode, by rising number, from ``mode,frequency [Hz],q1,q2``.

    An empty amplitude was not measured.

    Raises:
        RefusedError: The file is missing, its header or a row is wrong, or a mode has some
            amplitudes in one row and not in another.
    """
    (_, head), *rows = fields(path)
    floors = (
        [int(cell.strip()[1:]) for cell in head[2:]] if MODES_HEAD.fullmatch(",".join(head)) else []
    )
    whole = len(set(floors)) == len(head) - 2
    require(whole, f"{path.name}, header", ",".join(head)[:80], MODES)
    modes: dict[int, list[list[float]]] = {}
    for row, cells in rows:
        mode, frequency = (number(path, row, cells, k) for k in (0, 1))
        allowed = "a mode from 1 and a frequency above 0"
        right = mode >= 1 and mode % 1 == 0 and frequency > 0
        require(right, f"{path.name}, row {row}", ",".join(cells)[:80], allowed)
        shape = [
            number(path, row, cells, k) if cells[k : k + 1] != [""] else np.nan
            for k in range(2, len(head))
        ]
        modes.setdefault(int(mode), []).append([frequency, *shape])
    return tuple(_mode(mode, np.array(modes[mode]), floors, path) for mode in sorted(modes))


def _mode(mode: int, values: Array, floors: list[int], path: Path) -> ModeRows:
    """The measurements of one mode, shape (rows, 1 + floors)."""
    missing = np.isnan(values[:, 1:])
    if (missing.any(axis=0) != missing.all(axis=0)).any():
        allowed = "an amplitude of a floor in every row of a mode, or in none"
        raise RefusedError(f"{path.name}, mode {mode}", "an amplitude in some rows", allowed)
    shape = {floor: values[:, k] for k, floor in enumerate(floors, 1) if not missing[0, k - 1]}
    return ModeRows(mode, values[:, 0], shape if len(shape) > 1 else {})
