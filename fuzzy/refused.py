"""Errors of every package, with what a caller needs to know as fields."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from math import inf, isfinite, nan
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


def real(
    key: str,
    value: object,
    *,
    positive: bool = False,
    whole: bool = False,
    least: float = -inf,
    most: float = inf,
) -> float:
    """A finite number; True and False are none.

    Args:
        key: Name of the argument.
        value: What stands for it.
        positive: Whether it must be greater than 0.
        whole: Whether it must be a whole number, 0 or more.
        least: Least one that has a meaning.
        most: Greatest one.

    Raises:
        RefusedError: It is none.
    """
    least, kind = (max(least, 0), Integral) if whole else (least, Real)
    truth = type(value).__name__ in ("bool", "bool_")
    number = float(value) if isinstance(value, kind) and not truth else nan
    allowed = "whole numbers" if whole else "finite numbers"
    allowed += " greater than 0" if positive else f" from {least:g} on" if least > -inf else ""
    allowed += f", up to {most:g}" if most < inf else ""
    inside = isfinite(number) and least <= number <= most and (number > 0 or not positive)
    require(inside, key, repr(value), allowed)
    return number


def require_numbers(name: str, values: object) -> None:
    """Refuse what is no sequence of real and finite numbers.

    Raises:
        RefusedError: It is a text or a single number, or holds something else.
    """
    listed = isinstance(values, Collection) and not isinstance(values, str)
    require(listed, name, repr(values), "a list of numbers")
    for value in np.ravel(values).tolist() if isinstance(values, np.ndarray) else values:  # type: ignore[attr-defined]
        real(name, value)


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
