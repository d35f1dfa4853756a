"""Quantities of a case as they were read, fuzzy or not, and its limits."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from itertools import groupby

from alphacut.case.case import Case
from alphacut.case.key import Section, keys_of
from alphacut.case.limits import exceeded_limits, limits_of, storey_height
from alphacut.fuzzy import Crisp, FuzzyNumber
from alphacut.fuzzy.sets.numbers import Interval, Trapezoidal, Triangular
from alphacut.io.units import engineering

SHAPES = {Crisp: "crisp", Interval: "interval", Triangular: "triangle", Trapezoidal: "trapezoid"}
FILED = {"picture": "cell"}  # sections that the file calls otherwise


@dataclass(frozen=True)
class Reading:
    """One quantity.

    Args:
        key: Full name of its key; of a list with the numbers of the entries, from 1; of a limit
            with its output.
        shape: crisp, interval, triangle, trapezoid, limit; flag or choice without.
        values: Its one to four values, rising, in SI.
        unit: SI unit.
        beside: What else a limit amounts to, in words.
    """

    key: str
    shape: str
    values: tuple[float, ...]
    unit: str
    beside: str = ""

    def __str__(self) -> str:
        """The quantity in words."""
        told = " … ".join(engineering(value, self.unit) for value in self.values)
        shape = f"{self.shape} " if len(self.values) > 1 else ""
        return f"{self.key}: {shape}{told}{self.beside}"


def readings(case: Case) -> Iterator[Reading]:
    """Every quantity that stands in the file, defaults of a frame's stiffness, every limit."""
    from alphacut.frame.structures.quantities import Output

    for entry in fields(case.sections):
        section = getattr(case.sections, entry.name)
        if isinstance(section, Section):
            yield from _of(section, FILED.get(entry.name, entry.name), case)
    for key, output, limit in limits(case):
        height = storey_height(case, output)
        beside = f", {100 * limit / height:.3g} % of the storey's height" if height else ""
        yield Reading(f"{key} limit of {output}", "limit", (limit,), Output(output).unit, beside)


def limits(case: Case) -> Iterator[tuple[str, str, float]]:
    """Section, output and value in SI of each limit of a case."""
    if case.sections.exceedance:
        yield from (("exceedance", *one) for one in exceeded_limits(case).items())
    if case.sections.decision:
        yield from (("decision", one.output, one.value) for one in limits_of(case))


def _of(section: Section, name: str, case: Case) -> Iterator[Reading]:
    for key, about in keys_of(type(section)).items():
        fuzzy = about.kind.startswith("fuzzy")
        given = f"{name}.{key}" in case.written
        if key == "p_delta" or (given and about.kind in ("flag", "choice")):
            told = f"{getattr(section, key)}".replace("True", "true").replace("False", "false")
            yield Reading(f"{name}.{key}", about.kind, (), "", told + " (default)" * (not given))
        assumed = key == "columns" and case.frame.stiffness is None
        if not (given or assumed) or not (fuzzy or about.unit):
            continue
        value = getattr(section, key, None)
        listed = value if isinstance(value, tuple) else (value,)
        for one, places in _alike(listed):
            more = f" to {places[-1]}" if len(places) > 1 else ""
            full = f"{name}.{key}" + (f" {places[0]}{more}" if len(listed) > 1 else "")
            beside = "" if given else " (default); second_moment is of one"
            yield Reading(full, *_shape(one), about.unit, beside)


def _alike(listed: Sequence[object]) -> Iterator[tuple[FuzzyNumber, Sequence[int]]]:
    """Numbers of a list with their places, from 1; crisp ones that follow each other are one."""
    numbers = [Crisp(one) if isinstance(one, float) else one for one in listed]
    placed = [(k, one) for k, one in enumerate(numbers, start=1) if isinstance(one, FuzzyNumber)]
    for _, run in groupby(placed, lambda pair: pair[isinstance(pair[1], Crisp)]):
        alike = list(run)
        yield alike[0][1], [k for k, _ in alike]


def _shape(number: FuzzyNumber) -> tuple[str, tuple[float, ...]]:
    """Name of a shape and its values, rising; a triangle has one modal value."""
    (low, high), (left, right) = number.support, number.cut(1.0)
    shape = SHAPES[type(number)]
    values = {"crisp": (low,), "interval": (low, high), "triangle": (low, left, high)}
    return shape, values.get(shape, (low, left, right, high))
