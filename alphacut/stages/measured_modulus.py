"""Measured moduli from a CSV file with a unit, ``E [GPa]``, in place of the cell."""

from __future__ import annotations

import math
import re
from pathlib import Path

from alphacut.fuzzy import FuzzyNumber
from alphacut.io.output_paths import hint
from alphacut.io.problem import BadInput, Problem
from alphacut.io.units import factor

HEADER = "E [GPa]"
NAMES = r"E|E_?c?m?|E_?mod(ul(us)?)?|(young'?s?[\s_-]*)?modul(us|i)|elastic[\s_-]modulus"


def measured_modulus(path: Path, key: str = "modulus.measured") -> FuzzyNumber:
    """Fuzzy modulus in Pa of measured values: the middle share 1 − α at each α.

    Raises:
        BadInput: The file is missing, its header has no unit, or a row is no positive number.
    """
    from alphacut.fuzzy.sets.membership import from_data

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
    values = [scale * positive(text, path, number, key) for number, text in rows[1:]]
    if len(values) == 1:
        raise BadInput(
            Problem(
                key,
                "the file holds one value, which has no spread",
                rows[1][1],
                "two values or more; or modulus.value",
            )
        )
    return from_data(values)


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
