"""Measured natural modes from files."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import RefusedError, require
from alphacut.stochastic.particles.csv_columns import fields, number

MODES_HEAD = re.compile(r"mode\s*,\s*frequency(\s*\[Hz\])?(\s*,\s*q[1-9]\d*)*\s*")
MODES = "mode,frequency [Hz],q1,q2 … with the floors that were measured"


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
