"""Measured moduli from a CSV file with a unit, ``E [GPa]``, in place of the cell."""

from __future__ import annotations

import math
from pathlib import Path

from alphacut.case.case import Case
from alphacut.fuzzy import FuzzyNumber, from_data
from alphacut.io.csv_rows import CsvFile

HEADER = "E [GPa]"
NAMES = r"E|E_?c?m?|E_?mod(ul(us)?)?|(young'?s?[\s_-]*)?modul(us|i)|elastic[\s_-]modulus"


def measured_modulus(case: Case, file: str) -> FuzzyNumber:
    """The fuzzy modulus in Pa of measured values, with the claim that the case names.

    Args:
        case: With the section modulus.
        file: CSV file, from the case's folder.

    Raises:
        BadInput: The file is missing, its header has no unit, a row is no positive number, or the
            values do not decide what is claimed.
    """
    key, wanted = "modulus.measured", case.modulus
    values = measured_values(case.beside(file), key)
    bounds = None if wanted.bounds is None else wanted.bounds.support
    try:
        number = from_data(values, wanted.claim, bounds=bounds, law=wanted.law)
        number.cut(0.0)
    except ValueError as error:
        raise case.refuse(key, str(error), 'bounds such as bounds = "[10, 60] GPa"') from None
    return number


def measured_values(path: Path, key: str = "modulus.measured") -> list[float]:
    """Measured moduli in Pa, shape (n,).

    Raises:
        BadInput: The file is missing, its header has no unit, or a row is no positive number.
    """
    file = CsvFile(path, key, "file", HEADER)
    (line, first), *rows = file.rows()
    scale = file.scale(line, ",".join(first), "a modulus", "Pa", pattern=NAMES)
    return [scale * positive(file, line, ",".join(row)) for line, row in rows]


def positive(file: CsvFile, line: int, text: str) -> float:
    """One value of the column."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value > 0):
        raise file.refuse(line, "this row is no positive number", text)
    return value
