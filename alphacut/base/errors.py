"""Errors that all packages raise, and checks of arguments that raise them."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence, Set
from contextlib import contextmanager
from math import inf, isfinite, nan
from numbers import Integral, Real
from os import PathLike
from pathlib import Path

import numpy as np

from alphacut.base.arrays import Array

MAX_LENGTH = 300
"""Largest length of a message in characters, about three lines of a terminal."""
SHORT_PLACE = 40
"""Characters of the end of a place that always stand in a message."""


def printable(value: object, most: int = MAX_LENGTH) -> str:
    """Return a value as one line of at most `most` printable characters.

    Longer texts end with "…". Characters that a terminal would execute or hide become blanks, and
    several blanks become one. An integer of thousands of digits is described in words.
    """
    try:
        # What follows goes through the characters one by one, which takes long for a large text.
        # Four times the length is enough unless most of the characters are blanks.
        text = str(value)[: 4 * most]
    except ValueError:
        # Python refuses to write integers of more than some thousands of digits.
        text = "a number of thousands of digits"
    shown = "".join(x if x.isprintable() else " " for x in text)
    line = " ".join(shown.split())
    if len(line) <= most:
        return line
    return f"{line[: most - 1]}…"


def fit_message(
    value: str, allowed: str, compose: Callable[[str, str], str], cure: str = ""
) -> str:
    """Return a message of at most 300 characters (`MAX_LENGTH`) that ends with a hint.

    If the message is too long, the value is shortened first and the allowed values next, to 20
    characters each, and then the end of the sentence. The hint is never shortened: with one of more
    than 280 characters the message is longer.

    Args:
        value: The value that was refused, as text.
        allowed: The allowed values, as text.
        compose: Function that makes a sentence from both texts, whole or shortened.
        cure: The hint, which follows after "; "; empty for none.
    """
    # A user can do most with the hint and with the allowed values; of the value, which they have
    # written themselves, the beginning is enough to find it.
    min_shown = 20
    end = ""
    if cure:
        end = f"; {printable(cure, len(cure))}"
    room = max(MAX_LENGTH - len(end), min_shown)
    excess = max(len(compose(value, allowed)) - room, 0)
    value = printable(value, max(min_shown, len(value) - excess))
    excess = max(len(compose(value, allowed)) - room, 0)
    allowed = printable(allowed, max(min_shown, len(allowed) - excess))
    return printable(compose(value, allowed), room) + end


def cure_of(text: str, cures: Mapping[str, str], default: str = "") -> str:
    """Return the hint of the first regular expression that is found anywhere in a text.

    Args:
        text: The text that is refused, as a user has written it.
        cures: Hints what to write instead, by regular expressions, which are tried in this order.
        default: Hint for a text in which none is found.
    """
    for pattern, cure in cures.items():
        if re.search(pattern, text):
            return cure
    return default


class RefusedError(ValueError):
    """An argument or a key of a case has a value that is not allowed.

    Args:
        key: Name of the argument or of the key, such as "mesh.size".
        value: The value as the caller wrote it; None if it is missing.
        allowed: The allowed values, such as "values in (0, 1]".
        cure: What the caller can do, where `allowed` does not say it.
        place: File, and line, of the value; empty where the key is enough to find it. Of a message
            that is too long its begin is left out before anything else.

    Example:
        >>> RefusedError("mesh.size", -1, "values in (0, 1]")
        RefusedError('mesh.size is -1; allowed: values in (0, 1]')
    """

    def __init__(
        self, key: str, value: object, allowed: str, cure: str = "", place: str = ""
    ) -> None:
        self.key = key
        self.value = value
        self.allowed = allowed
        self.cure = cure
        self.place = place

        def sentence(value_text: str, allowed_text: str) -> str:
            """Return "PLACE: KEY is VALUE; allowed: ALLOWED", with key and place of this error.

            "KEY is missing" stands there if the value of this error is None, and "KEY is empty" if
            `value_text` is empty. An empty place, and empty allowed values, are left out.
            """
            text = f"{key} is {value_text or 'empty'}"
            if value is None:
                text = f"{key} is missing"
            if shown_place:
                text = f"{shown_place}: {text}"
            if allowed_text:
                text = f"{text}; allowed: {allowed_text}"
            return text

        shown_place = place
        excess = len(sentence(printable(value), allowed)) + len(cure) - MAX_LENGTH
        if excess > 0 and len(place) > SHORT_PLACE:
            # Of a path the end says most, the name of the file. "…" and "; " take 3 characters.
            shown_place = f"…{place[-max(SHORT_PLACE, len(place) - excess - 3) :]}"
        super().__init__(fit_message(printable(value), allowed, sentence, cure))

    def __reduce__(self) -> tuple[type[RefusedError], tuple[str, str | None, str, str, str]]:
        """Pickle the error with its value as text, since not every value can be pickled."""
        value = None
        if self.value is not None:
            value = printable(self.value)
        return type(self), (self.key, value, self.allowed, self.cure, self.place)


class FailedError(RuntimeError):
    """A computation ended without a result.

    Args:
        what: What failed.
        cure: What the caller can change.
    """

    def __init__(self, what: str, cure: str = "") -> None:
        self.what = what
        self.cure = cure
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
    """Return a value as a float if it is a finite real number from `least` to `most`.

    Args:
        key: Name of the argument, for the message.
        value: The value as the caller gave it, of any type. Numbers of Python and of NumPy are
            allowed; texts, arrays, True and False are not numbers.
        positive: Whether it must be greater than 0.
        whole: Whether it must be of an integer type and not negative; 2.0 is refused.
        least: Smallest allowed number.
        most: Largest allowed number.

    Raises:
        RefusedError: The value is not such a number, or is an integer too large for a float.
    """
    kind = "finite numbers"
    if whole:
        kind = "whole numbers"
        least = max(least, 0)
    number = nan
    if is_number(value, whole=whole):
        try:
            number = float(value)  # type: ignore[arg-type]
        except OverflowError:  # of a large integer
            number = inf
    allowed = kind
    if positive:
        allowed += " greater than 0"
    elif least > -inf:
        allowed += f" from {least:g} on"
    if most < inf:
        allowed += f", up to {most:g}"
    is_allowed = isfinite(number) and least <= number <= most and (number > 0 or not positive)
    if isinstance(value, Integral):
        shown = printable(value)  # `repr` fails for thousands of digits
    else:
        shown = repr(value)
    require(is_allowed, key, value=shown, allowed=allowed)
    return number


def path_of(key: str, value: object) -> Path:
    """Return the path of a file that a caller gave as a string or a path.

    Raises:
        RefusedError: `value` is neither; `key` is the name of the argument.
    """
    is_path = isinstance(value, str | PathLike) and not isinstance(value, bytes)
    require(is_path, key, repr(value), 'the path of a file, as "NAME"')
    return Path(value)  # type: ignore[arg-type]


def is_number(value: object, *, whole: bool = False) -> bool:
    """Return whether a value is a real number of Python or of NumPy; with `whole`, an integer.

    NaN and infinities are numbers; True, False and arrays are not. The float 2.0 is no integer.
    """
    kind = Real
    if whole:
        kind = Integral
    return isinstance(value, kind) and type(value).__name__ not in ("bool", "bool_")


def array_of_call(key: str, function: object, *points: Array, allowed: str) -> Array:
    """Call a function of the user with arrays, and return its values as floats.

    Args:
        key: Name of the argument that is the function, for the message.
        function: What the user gave as a function.
        points: Its arguments, arrays of one shape.
        allowed: What such a function takes and returns, in words.

    Returns:
        Array of the shape of the points.

    Raises:
        RefusedError: It is not a function, it raises an error, or it returns another shape or
            something else than numbers. Numbers need not be finite.
    """
    if not callable(function):
        raise RefusedError(key, repr(function), allowed)
    try:
        values = np.asarray(function(*points), float)
    except Exception as error:  # a function of the user may raise anything
        value = f"a function that raises {type(error).__name__}: {error}"
        cure = ""
        # NumPy says so where a function for one number, as math.hypot, gets an array.
        if re.search("length-1 arrays|truth value|0-dimensional", str(error)):
            cure = "write it by NumPy's functions, as np.hypot and np.where"
        raise RefusedError(key, value, allowed, cure) from None
    if values.shape != points[0].shape:
        value = f"a function that gives shape {values.shape} at points of shape {points[0].shape}"
        raise RefusedError(key, value, allowed, "of one number for all make np.full_like of it")
    return values


def require_numbers(name: str, values: object) -> None:
    """Raise RefusedError unless `values` is a list, tuple or array of finite real numbers.

    A list may be empty, and an array may have any shape. A list in a list is refused, and so are
    texts, truth values and complex numbers. `name` stands in the message.
    """
    # Sets have no order. A loop over a dictionary would take its keys, one over bytes their codes.
    no_lists = (str, bytes, Mapping, Set)
    is_list = isinstance(values, Collection) and not isinstance(values, no_lists)
    require(is_list, name, value=repr(values), allowed="a list of numbers")
    if isinstance(values, np.ndarray):
        # An array is checked without a loop, which would be slow for large matrices. If it is
        # wrong, the loop below finds the entry for the message.
        if values.dtype.kind in "iuf" and np.isfinite(values).all():
            return
        values = np.ravel(values).tolist()
    for value in values:  # type: ignore[attr-defined]
        checked_number(name, value)


def require_sequence(key: str, values: object, allowed: str) -> None:
    """Raise RefusedError unless `values` is a list, a tuple or an array with an axis.

    Whatever says by `ndim` that it has an axis is an array here, such as a column of pandas.
    """
    is_list = isinstance(values, Sequence) and not isinstance(values, str)
    axes = getattr(values, "ndim", 0)
    is_array = is_number(axes) and axes > 0
    cure = "put a single value into brackets"
    require(is_list or is_array, key, value=type(values).__name__, allowed=allowed, cure=cure)


def require_choice(key: str, value: object, names: Iterable[str]) -> None:
    """Raise RefusedError unless `value` is one of the allowed names."""
    allowed = tuple(names)
    require(value in allowed, key, value=value, allowed=", ".join(allowed))


def require(holds: bool | np.bool_, key: str, value: object, allowed: str, cure: str = "") -> None:
    """Raise `RefusedError(key, value, allowed, cure)` unless the condition `holds`."""
    if not holds:
        raise RefusedError(key, value, allowed, cure)


@contextmanager
def by_keys(key_of: Callable[[str], str]) -> Iterator[None]:
    """Return a context manager that gives each RefusedError of its block another key.

    Args:
        key_of: Function that makes the key which a user knows from the name of an argument.
    """
    try:
        yield
    except RefusedError as error:
        key = key_of(error.key)
        raise RefusedError(key, error.value, error.allowed, error.cure, error.place) from None


def require_ordered(what: str, lower: Array | float, upper: Array | float) -> None:
    """Raise FailedError if a lower bound lies above its upper one, or if a bound is NaN.

    Every object of bounds calls this where it is made, so that no result holds such a pair.

    Args:
        what: What is bounded, for the message.
        lower: Lower bounds, of any shape; −∞ where nothing is known.
        upper: Upper bounds, of a shape that fits; ∞ where nothing is known.
    """
    low, high = np.broadcast_arrays(lower, upper)
    is_wrong = ~(low <= high)  # a comparison with NaN is false
    if is_wrong.any():
        ends = f"{low[is_wrong][0]:.6g} is not below {high[is_wrong][0]:.6g}"
        raise FailedError(f"bounds of {what} contradict each other: {ends}")
