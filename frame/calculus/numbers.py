"""Checks that given values are numbers, and limits in words."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from alphacut.fuzzy.refused import RefusedError, require

FINITE = "biuf"
"""Kinds of NumPy's data types that hold real numbers."""


def require_number(name: str, value: object, unit: str) -> None:
    """Refuses what is no real number.

    Args:
        name: What the value is called.
        value: What was given.
        unit: Unit that a number is meant in; empty for none.

    Raises:
        RefusedError: It is a text, a list or nothing.
    """
    array = np.asarray(value)
    if array.ndim or array.dtype.kind not in FINITE:
        raise RefusedError(name, repr(value), f"a number{f', in {unit}' if unit else ''}")


def require_numbers(name: str, values: object, unit: str) -> None:
    """Refuses what is no sequence of real and finite numbers, as `require_number`."""
    if isinstance(values, str) or not isinstance(values, Collection | np.ndarray):
        raise RefusedError(name, repr(values), f"a list of numbers, in {unit}")
    for value in np.ravel(values) if isinstance(values, np.ndarray) else values:
        require_number(name, value, unit)
        require(np.isfinite(value), name, f"{value:g}", "finite numbers")
