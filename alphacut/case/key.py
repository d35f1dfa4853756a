"""Keys of a case file: what a field of a section may hold, from its type and its metadata.

A section is a frozen dataclass. The type of a field says what the file may hold (its `kind`), its
default stands in where the file leaves it out, and `Key` adds meaning, unit and range.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, dataclass, fields, replace
from functools import partial
from types import MappingProxyType, NoneType
from typing import TYPE_CHECKING, ClassVar, Literal, get_args, get_origin, get_type_hints

from alphacut.fuzzy import FuzzyNumber

ALPHA = (0.0, 0.25, 0.5, 0.75, 1.0)
"""α-levels where a case names none."""


@dataclass(frozen=True)
class Range:
    """Allowed values, in SI: between two ends that belong to it or not, told in words."""

    words: str
    lower: float = float("-inf")
    upper: float = float("inf")
    closed: bool = False
    below: bool = False  # closed, but without its upper end

    def holds(self, value: float) -> bool:
        """True if `value` is allowed; never for nan."""
        if self.below:
            return self.lower <= value < self.upper
        return self.lower <= value <= self.upper if self.closed else self.lower < value < self.upper


POSITIVE = Range("greater than 0", lower=0.0)
NOT_NEGATIVE = Range("0 or greater", lower=0.0, closed=True)
NATURAL = Range("from 0 to 1e18", lower=0.0, upper=1e18, closed=True)
POISSON = Range("inside (-1, 0.5)", lower=-1.0, upper=0.5)
UNIT = Range("inside (0, 1)", lower=0.0, upper=1.0)
SHARE = Range("from 1e-6 to 1", lower=1e-6, upper=1.0, closed=True)
MEMBERSHIP = Range("from 0 to 1", lower=0.0, upper=1.0, closed=True)
RATIO = Range(
    '0 or greater and below 1, such as 0.05 or "5 %"', lower=0.0, upper=1.0, closed=True, below=True
)
COUNT = Range("from 1 to 10000", lower=1.0, upper=1e4, closed=True)
DEVIATIONS = Range("from -10 to 10", lower=-10.0, upper=10.0, closed=True)

KINDS: dict[object, str] = {
    FuzzyNumber: "fuzzy",
    float: "number",
    int: "integer",
    str: "text",
    bool: "flag",
    tuple[FuzzyNumber, ...]: "fuzzy list",
    tuple[float, ...]: "numbers",
    tuple[str, ...]: "choices",
}


@dataclass(frozen=True)
class Key:
    """One key of a case file; `keys_of` completes what a section's field states.

    Args:
        about: What it is, for help texts and docs.
        unit: SI unit; empty for a number without a unit.
        allowed: Range of every number in it.
        alone: Whether an array's one entry may stand without brackets, for all of its places.
        file: Whether it names a file.
        beside: Another key of the section and its value, with which the section cannot do without
            this one.
        of_inputs: Whether it names inputs of a structure, which their keys may stand for.
        kind: ``fuzzy`` a crisp or fuzzy quantity, ``number`` a crisp one, ``fuzzy list`` and
            ``numbers`` arrays of them, ``integer``, ``text``, ``choice``, ``choices`` (an array of
            names), ``flag``.
        choices: The names allowed, for the kinds choice and choices.
        required: Whether its section cannot do without it.
        default: What stands in for it, in SI, where it is left out.
    """

    about: str
    unit: str = ""
    allowed: Range | None = None
    alone: bool = False
    file: bool = False
    beside: tuple[str, str] | None = None
    of_inputs: bool = False
    kind: str = ""
    choices: tuple[str, ...] = ()
    required: bool = False
    default: object = None


positive = partial(Key, allowed=POSITIVE)
"""A key of numbers greater than 0."""


class UnknownValueError(AttributeError):
    """Raised where a value is asked for that the file gives wrongly, or not at all."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Section:
    """One table of a case file.

    A section is `repeated` if it is written ``[[name]]``; of its keys `unless` one lifts what the
    others require; keys of `parts` are its own.
    """

    repeated: ClassVar[bool] = False
    unless: ClassVar[tuple[str, ...]] = ()
    parts: ClassVar[tuple[type[Section], ...]] = ()

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> object:
            """Reached only where a field was never set, its value in the file being wrong."""
            raise UnknownValueError(name)


def about_of(section: type[Section]) -> str:
    """A section in words: its docstring as one line."""
    return " ".join((section.__doc__ or "").split())


def keys_of(section: type[Section]) -> Mapping[str, Key]:
    """Keys of a section by name; fields without a `Key` are sections of their own."""
    if section not in _KEYS:
        _KEYS[section] = MappingProxyType(_keys_of(section))
    return _KEYS[section]


_KEYS: dict[type[Section], Mapping[str, Key]] = {}


def _keys_of(section: type[Section]) -> dict[str, Key]:
    hints = get_type_hints(section, include_extras=True)
    found: dict[str, Key] = {}
    for entry in fields(section):
        of_type, *metadata = get_args(hints[entry.name])
        if metadata and isinstance(metadata[0], Key):
            kind, choices = kind_of(of_type)
            missing = entry.default is MISSING
            found[entry.name] = replace(
                metadata[0],
                kind=kind,
                choices=choices,
                required=missing,
                default=None if missing else entry.default,
            )
    for part in section.parts:
        found |= keys_of(part)
    return found


def kind_of(of_type: object) -> tuple[str, tuple[str, ...]]:
    """Kind and choices of a field's type: ``float | None`` is a number."""
    inner = [part for part in get_args(of_type) if part is not NoneType]
    if NoneType in get_args(of_type):
        return kind_of(inner[0])
    if get_origin(of_type) is Literal:
        return "choice", tuple(inner)
    if inner and get_origin(inner[0]) is Literal:
        return "choices", get_args(inner[0])
    return KINDS[of_type], ()
