"""Errors of every package, with what a caller needs to know as fields."""

from __future__ import annotations

from collections.abc import Iterable
from math import isfinite, nan
from numbers import Integral, Real

import numpy as np


class RefusedError(ValueError):
    """A value that has no meaning where it stands.

    Args:
        key: Name of the argument or of the case key, such as "mesh.size".
        value: The value as the caller wrote it; None where it is missing.
        allowed: The values that have a meaning, such as "values in (0, 1]".
        cure: What to do where that is not obvious from `allowed`.
    """

    def __init__(self, key: str, value: object, allowed: str, cure: str = "") -> None:
        self.key, self.value, self.allowed, self.cure = key, value, allowed, cure
        has = "is missing" if value is None else f"is {value}"
        super().__init__(f"{key} {has}; allowed: {allowed}" + (f"; {cure}" if cure else ""))


class FailedError(RuntimeError):
    """A computation that ended without an answer.

    Args:
        what: What failed, with its numbers.
        cure: What the caller can change.
    """

    def __init__(self, what: str, cure: str = "") -> None:
        self.what, self.cure = what, cure
        super().__init__(what + (f"; {cure}" if cure else ""))


def real(key: str, value: object, *, positive: bool = False, whole: bool = False) -> float:
    """A finite number; True and False are none.

    Args:
        key: Name of the argument.
        value: What stands for it.
        positive: Whether it must be greater than 0.
        whole: Whether it must be a whole number; then 1 or more where `positive`, else 0 or more.

    Raises:
        RefusedError: It is none.
    """
    kind = Integral if whole else Real
    truth = type(value).__name__ in ("bool", "bool_")
    number = float(value) if isinstance(value, kind) and not truth else nan
    if not isfinite(number) or (positive and number <= 0) or (whole and number < 0):
        what = "whole numbers" if whole else "finite numbers"
        least = " greater than 0" if positive else " of 0 or more" if whole else ""
        raise RefusedError(key, repr(value), what + least)
    return number


def chosen(key: str, value: object, names: Iterable[str]) -> None:
    """Refuse a word that is none of those.

    Raises:
        RefusedError: It is none.
    """
    known = tuple(names)
    require(value in known, key, value, ", ".join(known))


def require(holds: bool | np.bool_, key: str, value: object, allowed: str, cure: str = "") -> None:
    """Refuse a value unless something holds; the other arguments are those of `RefusedError`.

    Raises:
        RefusedError: It does not hold.
    """
    if not holds:
        raise RefusedError(key, value, allowed, cure)
