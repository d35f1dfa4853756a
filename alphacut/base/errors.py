"""Errors of every package, with what a caller needs to know as fields."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable, Sequence
from math import inf, isfinite, nan
from numbers import Integral, Real
from os import PathLike
from pathlib import Path

import numpy as np

from alphacut.base.arrays import Array

MAX_LENGTH = 300
"""Characters of a message; beyond it value and allowed values are cut, and never the cure."""
MIN_SHOWN = 20  # characters that remain of a value or of allowed values


def printable(value: object, most: int = MAX_LENGTH) -> str:
    """Return a value as one line of printable characters, cut off after `most` of them."""
    try:
        text = str(value)[: 4 * most]
    except ValueError:  # of an integer longer than Python writes
        text = "a number of thousands of digits"
    line = " ".join("".join(c if c.isprintable() else " " for c in text).split())
    return line if len(line) <= most else f"{line[: most - 1]}…"


def fit_message(
    value: str, allowed: str, compose: Callable[[str, str], str], cure: str = ""
) -> str:
    """Return `compose(value, allowed)` and then the cure, of at most `MAX_LENGTH` characters.

    The value is cut off first, the allowed values next, the cure never.
    """
    end = f"; {cure}" if cure else ""
    room = max(MAX_LENGTH - len(end), MIN_SHOWN)
    excess = max(len(compose(value, allowed)) - room, 0)
    value = printable(value, max(MIN_SHOWN, len(value) - excess))
    excess = max(len(compose(value, allowed)) - room, 0)
    allowed = printable(allowed, max(MIN_SHOWN, len(allowed) - excess))
    return printable(compose(value, allowed), room) + end


class RefusedError(ValueError):
    """A value that is not allowed for this argument or key.

    Args:
        key: Name of the argument or of the case key, such as "mesh.size".
        value: The value as the caller wrote it; None where it is missing.
        allowed: The allowed values, such as "values in (0, 1]".
        cure: What to do, where `allowed` does not say it.
        place: File, and line, that the value stands in; empty where the key says it.

    Example:
        >>> RefusedError("mesh.size", -1, "values in (0, 1]")
        RefusedError('mesh.size is -1; allowed: values in (0, 1]')
    """

    def __init__(
        self, key: str, value: object, allowed: str, cure: str = "", place: str = ""
    ) -> None:
        self.key, self.value, self.allowed, self.cure, self.place = key, value, allowed, cure, place

        def line(value_text: str, allowed_text: str) -> str:
            has = "is missing" if value is None else f"is {value_text or 'empty'}"
            text = f"{place}: {key} {has}" if place else f"{key} {has}"
            return f"{text}; allowed: {allowed_text}" if allowed_text else text

        super().__init__(fit_message(printable(value), allowed, line, cure))

    def __reduce__(self) -> tuple[type[RefusedError], tuple[str, str | None, str, str, str]]:
        """For pickle, which sends it to other processes: the value as text."""
        value = None if self.value is None else printable(self.value)
        return type(self), (self.key, value, self.allowed, self.cure, self.place)


class FailedError(RuntimeError):
    """A computation that ended without an answer: what failed, and what the caller can change."""

    def __init__(self, what: str, cure: str = "") -> None:
        self.what, self.cure = what, cure
        super().__init__(fit_message(what, "", lambda text, _: text, cure))


def checked_number(
    key: str,
    value: object,
    *,
    positive: bool = False,
    whole: bool = False,
    least: float = -inf,
    most: float = inf,
) -> float:
    """Return a finite real number from `least` to `most` as a float; True and False are refused.

    Args:
        key: Name of the argument, for the message.
        value: The value as the caller gave it.
        positive: Whether it must be greater than 0.
        whole: Whether it must be an integer, 0 or more.
        least: Least allowed number.
        most: Greatest allowed number.

    Raises:
        RefusedError: It is not such a number.
    """
    least, kind = (max(least, 0), Integral) if whole else (least, Real)
    is_bool = type(value).__name__ in ("bool", "bool_")
    try:
        number = float(value) if isinstance(value, kind) and not is_bool else nan
    except OverflowError:  # of an integer
        number = inf
    allowed = "whole numbers" if whole else "finite numbers"
    if positive:
        allowed += " greater than 0"
    elif least > -inf:
        allowed += f" from {least:g} on"
    allowed += f", up to {most:g}" if most < inf else ""
    is_allowed = isfinite(number) and least <= number <= most and (number > 0 or not positive)
    shown = printable(value) if isinstance(value, Integral) else repr(value)
    require(is_allowed, key, value=shown, allowed=allowed)
    return number


def path_of(key: str, value: object) -> Path:
    """Return the path of a file that a caller names by a text or a path; refuses others."""
    is_path = isinstance(value, str | PathLike) and not isinstance(value, bytes)
    require(is_path, key, repr(value), 'the path of a file, as "NAME"')
    return Path(value)  # type: ignore[arg-type]


def is_number(value: object, *, whole: bool = False) -> bool:
    """True for a real number, or a whole one, of Python or NumPy; not for True and False."""
    kind = Integral if whole else Real
    return isinstance(value, kind) and type(value).__name__ not in ("bool", "bool_")


def array_of_call(key: str, function: object, *points: Array, allowed: str) -> Array:
    """Return what a function of the caller's gives at arrays of points, of their shape, as floats.

    Args:
        key: Name of the function, for the message.
        function: What the caller gave as one.
        points: Its arguments, arrays of one shape.
        allowed: What the function takes and gives, in words.

    Raises:
        RefusedError: It is no function, raises an error, or gives an array of another shape.
    """
    if not callable(function):
        raise RefusedError(key, repr(function), allowed)
    try:
        values = np.asarray(function(*points), float)
    except Exception as error:  # whatever the caller's function raises
        value = f"a function that raises {type(error).__name__}: {error}"
        is_of_one_number = re.search("length-1 arrays|truth value|0-dimensional", str(error))
        cure = "write it by NumPy's functions, as np.hypot and np.where" if is_of_one_number else ""
        raise RefusedError(key, value, allowed, cure) from None
    if values.shape != points[0].shape:
        value = f"a function that gives shape {values.shape} at points of shape {points[0].shape}"
        raise RefusedError(key, value, allowed, "of one number for all make np.full_like of it")
    return values


def require_numbers(name: str, values: object) -> None:
    """Refuse values that are not a list, tuple or array of finite real numbers."""
    is_list = isinstance(values, Collection) and not isinstance(values, str)
    require(is_list, name, value=repr(values), allowed="a list of numbers")
    if isinstance(values, np.ndarray) and values.dtype.kind in "iuf" and np.isfinite(values).all():
        return  # without a loop: matrices have many entries
    for value in np.ravel(values).tolist() if isinstance(values, np.ndarray) else values:  # type: ignore[attr-defined]
        checked_number(name, value)


def require_sequence(key: str, values: object, allowed: str) -> None:
    """Refuse what is no list, tuple or array of one dimension or more, as a number or a text."""
    is_list = isinstance(values, Sequence) and not isinstance(values, str)
    is_array = isinstance(values, np.ndarray) and values.ndim > 0
    cure = "put a single value into brackets"
    require(is_list or is_array, key, value=type(values).__name__, allowed=allowed, cure=cure)


def require_choice(key: str, value: object, names: Iterable[str]) -> None:
    """Refuse a value that is not one of the allowed names."""
    allowed = tuple(names)
    require(value in allowed, key, value=value, allowed=", ".join(allowed))


def require(holds: bool | np.bool_, key: str, value: object, allowed: str, cure: str = "") -> None:
    """Raise `RefusedError`(key, value, allowed, cure) unless the condition `holds`."""
    if not holds:
        raise RefusedError(key, value, allowed, cure)
