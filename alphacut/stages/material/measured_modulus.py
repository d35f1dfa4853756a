"""Measured moduli from a CSV file with a unit, ``E [GPa]``, in place of the cell."""

from __future__ import annotations

import math
import re
from pathlib import Path

from alphacut.case.case import Case
from alphacut.fuzzy import FuzzyNumber, from_data
from alphacut.io.output_paths import hint
from alphacut.io.problem import BadInput, Problem
from alphacut.io.units import factor

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
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except UnicodeDecodeError:
        raise BadInput(Problem(key, "the file is not text in UTF-8", str(path), HEADER)) from None
    except OSError as error:
        raise BadInput(
            Problem(
                key,
                f"the file cannot be read: {(error.strerror or str(error)).lower()}",
                str(path),
                hint(path),
            )
        ) from None
    rows = [
        (number, line.strip())
        for number, line in enumerate(lines, start=1)
        if line.strip() and not line.startswith("#")
    ]
    if len(rows) < 2:
        raise BadInput(
            Problem(key, "the file needs a header and one value or more", str(path), HEADER)
        )
    scale = unit_of(rows[0][1], path, key)
    return [scale * positive(text, path, number, key) for number, text in rows[1:]]


def unit_of(header: str, path: Path, key: str) -> float:
    """Pascals in the header's unit."""
    match = re.fullmatch(r"(.+?)\s*\[([^\]]+)\]", header)
    try:
        if match is None:
            raise ValueError(f"the header {header!r} has no unit")
        if not re.fullmatch(NAMES, match[1], flags=re.IGNORECASE):
            raise ValueError(f"the column {match[1]!r} is not named as a modulus")
        return float(factor(match[2], "Pa"))
    except ValueError as error:
        raise BadInput(Problem(key, str(error), file=str(path), line=1, allowed=HEADER)) from None


def positive(text: str, path: Path, line: int, key: str) -> float:
    """One value of the column."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value > 0):
        raise BadInput(
            Problem(key, "this row is no positive number", text, file=str(path), line=line)
        )
    return value
