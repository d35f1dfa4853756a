"""Kind, unit, range and default of a key of a case file; sections of keys.

A key's kind says what the file may hold: ``fuzzy`` a crisp or fuzzy quantity, ``number`` a crisp
one, ``fuzzy list`` and ``numbers`` arrays of them, ``integer``, ``text``, ``choice``, ``choices``
(an array of names), ``flag``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field


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
NOT_NEGATIVE = Range("0 or greater", lower=0.0, upper=float("inf"), closed=True)
POISSON = Range("inside (-1, 0.5)", lower=-1.0, upper=0.5)
UNIT = Range("inside (0, 1)", lower=0.0, upper=1.0)
MEMBERSHIP = Range("from 0 to 1", lower=0.0, upper=1.0, closed=True)
RATIO = Range(
    '0 or greater and below 1, such as 0.05 or "5 %"', lower=0.0, upper=1.0, closed=True, below=True
)
COUNT = Range("from 1 to 10000", lower=1.0, upper=1e4, closed=True)
DEVIATIONS = Range("from -10 to 10", lower=-10.0, upper=10.0, closed=True)


@dataclass(frozen=True)
class Key:
    """One key of a case file.

    Args:
        about: What it is, for help texts and docs.
        kind: What the file may hold; see the head of this module.
        unit: SI unit; empty for a number without a unit.
        required: Whether its section cannot do without it.
        default: What stands in for it, in SI, where it is left out.
        allowed: Range of every number in it.
        choices: The names allowed, for the kinds choice and choices.
        alone: Whether an array's one entry may stand without brackets, for all of its places.
    """

    about: str
    kind: str = "fuzzy"
    unit: str = ""
    required: bool = False
    default: object = None
    allowed: Range | None = None
    choices: tuple[str, ...] = ()
    alone: bool = False


@dataclass(frozen=True)
class Section:
    """One table of a case file.

    Args:
        about: What it is, for help texts and docs.
        keys: Its keys by name.
        repeated: Whether it is written ``[[name]]``.
        unless: Keys of which one lifts what others require.
    """

    about: str
    keys: Mapping[str, Key] = field(default_factory=dict)
    repeated: bool = False
    unless: tuple[str, ...] = ()
