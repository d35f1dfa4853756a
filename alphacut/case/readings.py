"""Fuzzy inputs of a case as they were read: the shape of each, and its values."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields

from alphacut.case.case import Case
from alphacut.case.key import Section, keys_of
from alphacut.fuzzy import Crisp, FuzzyNumber
from alphacut.fuzzy.sets.numbers import Interval, Trapezoidal, Triangular
from alphacut.io.units import engineering

SHAPES = {Interval: "interval", Triangular: "triangle", Trapezoidal: "trapezoid"}
FILED = {"picture": "cell"}  # sections that the file calls otherwise


@dataclass(frozen=True)
class Reading:
    """One fuzzy input.

    Args:
        key: Full name of its key; of a list with the number of the entry, from 1.
        shape: interval, triangle or trapezoid.
        values: Its two to four values, rising, in SI.
        unit: SI unit.
    """

    key: str
    shape: str
    values: tuple[float, ...]
    unit: str

    def __str__(self) -> str:
        """The input in words."""
        told = " … ".join(engineering(value, self.unit) for value in self.values)
        return f"{self.key}: {self.shape} {told}"


def readings(case: Case) -> Iterator[Reading]:
    """Every input of a case that is not crisp and stands in the file."""
    for entry in fields(case.sections):
        section = getattr(case.sections, entry.name)
        if isinstance(section, Section):
            yield from _of(section, FILED.get(entry.name, entry.name), case)


def _of(section: Section, name: str, case: Case) -> Iterator[Reading]:
    for key, about in keys_of(type(section)).items():
        if f"{name}.{key}" not in case.written or not about.kind.startswith("fuzzy"):
            continue
        value = getattr(section, key)
        listed = value if isinstance(value, tuple) else (value,)
        for number, one in enumerate(listed, start=1):
            if isinstance(one, FuzzyNumber) and not isinstance(one, Crisp):
                full = f"{name}.{key}" + (f" {number}" if len(listed) > 1 else "")
                yield Reading(full, *_shape(one), about.unit)


def _shape(number: FuzzyNumber) -> tuple[str, tuple[float, ...]]:
    """Name of a shape and its values, rising; a triangle has one modal value."""
    (low, high), (left, right) = number.support, number.cut(1.0)
    shape = SHAPES[type(number)]
    middle = {"interval": (), "triangle": (left,), "trapezoid": (left, right)}[shape]
    return shape, (low, *middle, high)
