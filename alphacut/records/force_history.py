"""Course of a force over time in a CSV file, with its unit in the head or without one."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.io.quantity import factor
from alphacut.records.csv_record import even_step, numbered_rows, table_rows
from alphacut.records.text_file import TextFile

HEAD = re.compile(r"(?:time|t)\s*[\[(](.+)[\])]", re.IGNORECASE)
FORCE = re.compile(r"(?:force|load|f)\s*(?:[\[(](.+)[\])])?", re.IGNORECASE)
ALLOWED = "time [s],force [kN], or time [s],force of a course without a unit"


@dataclass(frozen=True, eq=False)
class ForceSamples:
    """Samples of a course.

    Args:
        step: Time between samples, in s.
        samples: Samples from t = 0 on, shape (n,), in N, or without a unit.
        has_unit: Whether the head gives a unit.
    """

    step: float
    samples: Array
    has_unit: bool


def read_force_history(path: Path) -> ForceSamples:
    """Samples of a force in a CSV file with even steps from t = 0.

    Raises:
        RefusedError: A unit is wrong, a row is no pair of numbers, or the steps are not even.
    """
    file = TextFile.read(path)
    (_, head), *rows = table_rows(file)
    matches = [x.fullmatch(cell.strip()) for x, cell in zip((HEAD, FORCE), head, strict=False)]
    if len(head) != 2 or None in matches:
        raise file.refusal(0, ",".join(head)[:80], ALLOWED)
    time_unit, force_unit = (match[1] if match else None for match in matches)
    try:
        time_factor = float(factor(str(time_unit), "s"))
        force_factor = float(factor(force_unit, "N")) if force_unit else 1.0
    except ValueError as error:
        raise file.refusal(0, ",".join(head)[:80], ALLOWED, str(error)) from None
    table = numbered_rows(file, rows)
    step = even_step(file, time_factor * table[:, 0], [line for line, _ in rows])
    samples = np.asarray(force_factor * table[:, 1])
    if not samples.any():
        raise file.refusal(0, "zeros throughout", "a force that moves something")
    return ForceSamples(step, samples, force_unit is not None)
