"""Measured natural modes, ``mode,frequency,q1,q2``, or a recorded motion from a CSV file."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from alphacut.io.csv_rows import CsvFile
from alphacut.stochastic.theta.truncated_normal import Array

KEY = "update.measured"
ALLOWED = "mode,frequency [Hz],q1,q2 … with the floors that were measured"
MOST = 1e9
"""Largest frequency in Hz, and amplitude."""


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
    """The measurements of each mode, by rising number.

    Raises:
        BadInput: The file is missing, its header or a row is wrong, or a mode has some amplitudes
            in one row and not in another.
    """
    file = CsvFile(path, KEY, "file of modes", ALLOWED)
    (line, head), *rows = file.rows()
    floors = _floors(file, line, head)
    numbers = [(line, _numbers(file, line, row, len(head))) for line, row in rows]
    modes = sorted({row[0] for _, row in numbers})
    return tuple(
        _mode(int(mode), [(line, row) for line, row in numbers if row[0] == mode], floors, file)
        for mode in modes
    )


def _floors(file: CsvFile, line: int, head: list[str]) -> tuple[int, ...]:
    words = [word.strip() for word in head]
    floors = [re.fullmatch(r"q([1-9]\d*)", word) for word in words[2:]]
    known = tuple(int(match[1]) for match in floors if match)
    first = len(words) > 1 and re.fullmatch(r"frequency(\s*\[Hz\])?", words[1])
    if words[0] != "mode" or not first or len(set(known)) != len(floors):
        raise file.refuse(line, "the header is wrong", ",".join(head), ALLOWED)
    return known


def _numbers(file: CsvFile, line: int, row: list[str], count: int) -> list[float]:
    """Entries of a row; an empty amplitude was not measured."""
    try:
        values = [float(text) if text.strip() else float("nan") for text in row]
    except ValueError:
        values = []
    if (
        len(values) != count
        or not (values[0] >= 1 and values[0] % 1 == 0)
        or not 1 / MOST < values[1] < MOST
        or (np.abs(values[2:]) > MOST).any()
    ):
        allowed = (
            f"a mode from 1, a frequency in Hz above 0 and amplitudes, none above {MOST:g}, with"
            " points in the numbers"
        )
        raise file.refuse(line, "this row is no measured mode", ",".join(row), allowed)
    return values


def _mode(
    mode: int, rows: list[tuple[int, list[float]]], floors: tuple[int, ...], file: CsvFile
) -> ModeRows:
    values = np.array([row for _, row in rows])
    amplitudes = {}
    for column, floor in enumerate(floors, start=2):
        missing = np.isnan(values[:, column])
        if missing.any() and not missing.all():
            line = rows[int(missing.argmax())][0]
            what = f"mode {mode} has an amplitude of floor {floor} in some rows only"
            raise file.refuse(line, what, allowed="one in each row of the mode, or none")
        if not missing.any():
            amplitudes[floor] = values[:, column]
    return ModeRows(mode, values[:, 1], amplitudes if len(amplitudes) > 1 else {})
