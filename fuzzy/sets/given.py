"""Plain numbers that a caller gives: real, finite, of the right kind, or refused in one line."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from math import isfinite
from numbers import Integral, Real
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from _typeshed import DataclassInstance


def is_real(value: object) -> bool:
    """Whether a value is a real number; True and False are none."""
    return isinstance(value, Real) and not _truth(value)


def _truth(value: object) -> bool:
    return isinstance(value, bool) or type(value).__name__ in ("bool", "bool_")


def finite(what: str, value: object) -> float:
    """A finite number.

    Raises:
        ValueError: It is none.
    """
    if isinstance(value, Real) and not _truth(value) and isfinite(value):
        return float(value)
    raise ValueError(f"{what} is {value!r}; it must be a finite number")


def positive(what: str, value: object) -> float:
    """A finite number greater than 0.

    Raises:
        ValueError: It is none.
    """
    if is_real(value) and (number := finite(what, value)) > 0:
        return number
    raise ValueError(f"{what} is {value!r}; it must be positive and finite")


def finite_by_name(what: str, given: object, example: str) -> dict[str, float]:
    """Finite numbers by name, one at least.

    Args:
        what: What they are, in the plural.
        given: A mapping of names to numbers.
        example: How they are written, for the message.

    Raises:
        ValueError: They are no mapping, none, or one is no finite number.
    """
    if not isinstance(given, Mapping) or not given:
        raise ValueError(f"the {what} are {given!r}; they must be numbers by name, as {example}")
    return {name: finite(f"{name!r} of the {what}", value) for name, value in given.items()}


def require_fields(owner: DataclassInstance) -> None:
    """Refuse settings that are no numbers where a dataclass declares `int` or `float`.

    Raises:
        ValueError: A whole number is none, a number is none or not finite, or a seed is negative.
    """
    kinds = {"int": (Integral, "a whole number"), "float": (Real, "a finite number")}
    for field in fields(owner):
        kind, words = kinds.get(str(field.type).removesuffix(" | None"), (None, ""))
        value = getattr(owner, field.name)
        if value is None and str(field.type).endswith(" | None"):
            continue
        least = " >= 0" if field.name == "seed" else ""
        good = kind is None or (isinstance(value, kind) and not _truth(value) and isfinite(value))
        if not good or (least and value < 0):
            raise ValueError(
                f"{field.name} of {type(owner).__name__} is {value!r}; it must be {words}{least}"
            )


def require_end(tolerance: float, budget: int) -> None:
    """Refuse a search without an end."""
    if not (tolerance > 0 and budget >= 1):
        both = f"tolerance and budget are {tolerance:g} and {budget}"
        raise ValueError(f"{both}; both must be positive")
