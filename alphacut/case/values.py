"""One value of a case file, checked against its key."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable

from alphacut.case.key import Key
from alphacut.fuzzy import FuzzyNumber
from alphacut.io import quantity
from alphacut.io.units import QUANTITIES


class Unfit(ValueError):  # noqa: N818 - it names the value, not the program, as the culprit
    """Value that its key cannot take; `allowed` says what it can, `nearest` what was meant."""

    def __init__(self, what: str, allowed: str = "", nearest: str = "") -> None:
        super().__init__(what)
        self.what, self.allowed, self.nearest = what, allowed, nearest


def nearest(name: str, known: Iterable[str]) -> str:
    """The known name that comes nearest to `name`; empty if none comes near."""
    from difflib import get_close_matches

    known = list(known)
    folded = {option.lower(): option for option in known}
    close = get_close_matches(name.lower().replace("-", "_"), folded, n=1, cutoff=0.6)
    return folded[close[0]] if close else ""


def allowed(key: Key) -> str:
    """Allowed values of a key, in words."""
    if key.choices:
        return ("any of " if key.kind == "choices" else "") + ", ".join(key.choices)
    if key.kind in ("text", "choices"):
        return "text in quotes" if key.kind == "text" else "an array of names"
    if key.kind == "flag":
        return "true or false"
    kind, example = QUANTITIES[key.unit]
    kind = "whole number" if key.kind == "integer" else kind
    many = "an array, each a " if key.kind in ("numbers", "fuzzy list") else "a "
    many = "one for all, or an array, each a " if key.alone else many
    words = f"{many}{kind}" + (f" {key.allowed.words}" if key.allowed else "")
    return words + (f', for example "{example}"' if key.unit else "")


def in_range(values: Iterable[float], key: Key) -> None:
    """Refuse values that are not finite or lie outside the key's range."""
    for value in values:
        if not math.isfinite(value) or (key.allowed and not key.allowed.holds(value)):
            raise Unfit("out of range" if key.unit else f"{value:g} is out of range", allowed(key))


def not_quoted(value: object, key: Key) -> None:
    """Refuse a plain number in quotes: it is text."""
    if isinstance(value, str) and not key.unit and re.fullmatch(quantity.NUMBER, value.strip()):
        raise Unfit("this number stands in quotes", allowed(key))


def read_fuzzy(value: object, key: Key) -> FuzzyNumber:
    """A crisp or fuzzy quantity whose whole support lies in the key's range."""
    not_quoted(value, key)
    number = quantity.fuzzy(value, key.unit)
    in_range([*number.cut(0.0), number.modal], key)
    return number


def read_number(value: object, key: Key) -> float:
    """A crisp quantity in the key's range."""
    not_quoted(value, key)
    number = quantity.number(value, key.unit)
    in_range([number], key)
    return number


def read_integer(value: object, key: Key) -> int:
    """A whole number in the key's range."""
    if isinstance(value, bool) or not isinstance(value, int):
        raise Unfit("this is not a whole number", allowed(key))
    in_range([value], key)
    return value


def array(value: object, key: Key) -> list[object]:
    """A TOML array."""
    if not isinstance(value, list):
        raise Unfit("this is not an array", allowed(key))
    return value


def read_array(value: object, key: Key) -> tuple[object, ...]:
    """An array of quantities, at least one."""
    items = (
        [value]
        if key.alone and isinstance(value, str | float | int) and not isinstance(value, bool)
        else array(value, key)
    )
    if not items:
        raise Unfit("the array is empty", allowed(key))
    read = read_fuzzy if key.kind == "fuzzy list" else read_number
    return tuple(entry(read, item, number, key) for number, item in enumerate(items, start=1))


def entry(read: Callable[[object, Key], object], item: object, number: int, key: Key) -> object:
    """One entry of an array; a complaint says which it is, as the user wrote it."""
    try:
        return read(item, key)
    except Unfit as unfit:
        raise Unfit(
            f'entry {number}, "{item}": {unfit.what}', unfit.allowed, unfit.nearest
        ) from None
    except (ValueError, ArithmeticError) as error:
        raise Unfit(f'entry {number}, "{item}": {error}', allowed(key)) from None


def read_name(value: object, key: Key) -> str:
    """Text, one of the choices if there are any."""
    if not isinstance(value, str):
        raise Unfit("this is not text", allowed(key))
    if key.choices and value not in key.choices:
        raise Unfit("there is no such choice", allowed(key), nearest(value, key.choices))
    if key.required and not value.strip():
        raise Unfit("the text is empty", allowed(key))
    return value


def read_names(value: object, key: Key) -> tuple[str, ...]:
    """An array of names, each one of the choices if there are any."""
    names = tuple(
        str(entry(read_name, item, number, key))
        for number, item in enumerate(array(value, key), start=1)
    )
    if key.of_inputs:
        names = tuple(map(input_name, names))
    if len(set(names)) < len(names):
        raise Unfit("a name stands there twice", allowed(key))
    if key.required and not names:
        raise Unfit("the array is empty", f"{allowed(key)}, one name or more")
    return names


INPUTS = {  # keys of a frame, and what its inputs are called
    "modulus": "E",
    "second_moment": "I",
    "masses": "m",
    "lengths": "l",
    "columns": "c",
    "stiffness": "k",
    "dampers": "d",
    "displacements": "q0",
    "velocities": "v0",
    "damping_ratio": "zeta",
}


def input_name(text: str) -> str:
    """Name of an input that may stand there as its key: ``stiffness[2]`` is k2."""
    found = re.fullmatch(r"(?:frame\.)?(\w+)(?:\[([1-9]\d*)\])?", text)
    if not found or found[1] not in INPUTS:
        return text
    name, entry_of = INPUTS[found[1]], found[2] or ""
    return f"{name[0]}{entry_of}_0" if entry_of and name in ("q0", "v0") else name + entry_of


def read_flag(value: object, key: Key) -> bool:
    """True or false."""
    if not isinstance(value, bool):
        raise Unfit("this is neither true nor false", allowed(key))
    return value


READERS: dict[str, Callable[[object, Key], object]] = {
    "fuzzy": read_fuzzy,
    "number": read_number,
    "integer": read_integer,
    "fuzzy list": read_array,
    "numbers": read_array,
    "text": read_name,
    "choice": read_name,
    "choices": read_names,
    "flag": read_flag,
}


def read(value: object, key: Key) -> object:
    """The value in SI, as its key's kind says.

    Raises:
        Unfit: It cannot be used; says why and what is allowed.
    """
    try:
        return READERS[key.kind](value, key)
    except Unfit:
        raise
    except (ValueError, ArithmeticError) as error:
        raise Unfit(str(error), allowed(key)) from None
