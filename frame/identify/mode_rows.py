"""Measured natural modes from a CSV file."""

from __future__ import annotations

import re
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import require
from alphacut.stochastic.particles.csv_columns import fields, number

HEAD = re.compile(r"\s*(mode|frequency(_std)?\s*(\[Hz\])?|shape_std|q[1-9]\d*)\s*")
ALLOWED = (
    "mode,frequency [Hz],q1,q2 … with the floors that were measured; frequency_std [Hz] and"
    " shape_std may stand before q1"
)


@dataclass(frozen=True, eq=False)
class ModeRows:
    """All measurements of one mode: frequencies in Hz and amplitudes by floor, of shape (rows,).

    Standard deviations are over the mean frequency and over the mode's largest amplitude; None
    where the file states none.
    """

    mode: int
    frequencies: Array
    amplitudes: dict[int, Array]
    frequency_deviation: float | None = None
    shape_deviation: float | None = None


def mode_rows(path: Path) -> tuple[ModeRows, ...]:
    """Reads the measurements of each mode, by rising number, from ``mode,frequency [Hz],q1,q2``.

    An empty amplitude was not measured. Standard deviations may stand in columns of their own.

    Raises:
        RefusedError: The file is missing, its header or a row is wrong, or a mode has some
            amplitudes in one row and not in another.
    """
    (_, head), *rows = fields(path)
    matches = [HEAD.fullmatch(cell) for cell in head]
    names = [match[1].partition("[")[0].strip() if match else "" for match in matches]
    columns = {name: column for column, name in enumerate(names)}
    is_known = "" not in columns and {"mode", "frequency"} <= columns.keys()
    is_complete = is_known and len(columns) == len(head)
    require(is_complete, f"{path.name}, header", ",".join(head)[:80], ALLOWED)
    positive = [columns[x] for x in ("frequency", "frequency_std", "shape_std") if x in columns]
    modes: dict[int, list[list[float]]] = defaultdict(list)
    for row, cells in rows:
        values = [
            number(path, row, cells, column) if cells[column : column + 1] != [""] else np.nan
            for column in range(len(head))
        ]
        mode, allowed = values[columns["mode"]], "a mode from 1, frequency and deviations above 0"
        fits = mode >= 1 and mode % 1 == 0 and all(values[column] > 0 for column in positive)
        require(fits, f"{path.name}, row {row}", ",".join(cells)[:80], allowed)
        modes[int(mode)].append(values)
    return tuple(
        _measurements_of_mode(path, mode, np.array(modes[mode]), columns) for mode in sorted(modes)
    )


def _measurements_of_mode(
    path: Path, mode: int, values: Array, columns: dict[str, int]
) -> ModeRows:
    """The measurements of one mode from its rows, (rows, columns), NaN where none was made."""
    floors = {int(name[1:]): k for name, k in columns.items() if name.startswith("q")}
    amplitudes = {floor: values[:, column] for floor, column in floors.items()}
    missing = {floor: np.isnan(x) for floor, x in amplitudes.items()}
    is_whole = all(gaps.all() or not gaps.any() for gaps in missing.values())
    allowed = "an amplitude of a floor in every row of a mode, or in none"
    require(is_whole, f"{path.name}, mode {mode}", "an amplitude in some rows", allowed)
    shape = {floor: x for floor, x in amplitudes.items() if not missing[floor].all()}
    shape = shape if len(shape) > 1 else {}
    is_moved, allowed = not shape or any(map(np.any, shape.values())), "a shape that moves a floor"
    require(is_moved, f"{path.name}, mode {mode}", "0 at every floor", allowed)
    frequencies = values[:, columns["frequency"]]
    sizes = {"frequency_std": frequencies.mean()}
    sizes |= {"shape_std": max(abs(x).mean() for x in shape.values())} if shape else {}
    deviations = (  # root mean squares
        float(np.sqrt((values[:, columns[name]] ** 2).mean()) / sizes[name])
        if name in columns and name in sizes
        else None
        for name in ("frequency_std", "shape_std")
    )
    return ModeRows(mode, frequencies, shape, *deviations)
