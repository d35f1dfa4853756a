"""Checks that given values are numbers, and limits in words."""

from __future__ import annotations

from collections.abc import Collection
from math import floor, log10

import numpy as np

FINITE = "biuf"
"""Kinds of NumPy's data types that hold real numbers."""


def require_number(name: str, value: object, unit: str) -> None:
    """Refuses what is no real number.

    Args:
        name: What the value is called.
        value: What was given.
        unit: Unit that a number is meant in; empty for none.

    Raises:
        ValueError: It is a text, a list or nothing.
    """
    given = np.asarray(value)
    if given.ndim or given.dtype.kind not in FINITE:
        raise ValueError(
            f"{name}: {value!r} is not allowed; it must be a number{f', in {unit}' if unit else ''}"
        )


def require_numbers(name: str, values: object, unit: str) -> None:
    """Refuses what is no sequence of real and finite numbers, as `require_number`."""
    if isinstance(values, str) or not isinstance(values, Collection | np.ndarray):
        raise ValueError(
            f"{name}: {values!r} is not allowed; it must be a list of numbers, in {unit}"
        )
    for value in np.ravel(values) if isinstance(values, np.ndarray) else values:
        require_number(name, value, unit)
        if not np.isfinite(value):
            raise ValueError(f"{name}: {value:g} is not allowed; every value must be finite")


def require_count(name: str, value: object, least: int | None) -> None:
    """Refuses what is no whole number from `least` on; any value where that is None."""
    if least is not None and (not isinstance(value, int | np.integer) or value < least):
        raise ValueError(
            f"{name}: {value!r} is not allowed; it must be a whole number, {least} or greater"
        )


def below(value: float) -> str:
    """A positive limit in two digits, rounded down, so that it keeps itself."""
    unit = 10.0 ** (floor(log10(value)) - 1)
    return f"{floor(value / unit * (1 + 1e-12)) * unit:.2g}"
