"""Reading quantities as engineers write them: "80 GPa", "[75, 80, 85] GPa", "20 t ± 5 %".

One number is crisp, two are an interval, three a triangle (lower, modal, upper), four a trapezoid.
A spread "± 5 %" is an interval: nothing in it is more possible than the rest.
"""

from __future__ import annotations

import math
import re
from decimal import Decimal

from alphacut.fuzzy import Crisp, FuzzyNumber, Interval, Trapezoidal, Triangular
from alphacut.io.units import factor, size_problem

NUMBER = r"[-+\u2212]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
LIST = re.compile(r"\[(.*)\]\s*(.*)", re.DOTALL)
SPREAD = re.compile(rf"({NUMBER})\s*(.*?)\s*(?:±|\+/-|\+-)\s*({NUMBER})\s*(.*)")
PER_CENT = re.compile(r"(?:%|per ?cent)[\s*·)]*([^\s*·)].*)")
SINGLE = re.compile(rf"({NUMBER})\s*(.*)")
ORDERS = {
    2: "lower ≤ upper",
    3: 'lower ≤ modal ≤ upper, as in "[90, 95, 105] GPa"',
    4: "four values that rise",
}
SHAPES = {1: "crisp", 2: "interval", 3: "triangle", 4: "trapezoid"}


def decimal(text: str) -> Decimal:
    """A plain finite decimal number; a typographic minus is taken as one."""
    return Decimal(text.replace("\u2212", "-"))


def one(text: str, si: str) -> Decimal:
    """A single quantity such as "80 GPa", in `si`."""
    if comma := re.match(r"([-+\u2212]?\d+),(\d+)", text.strip()):
        raise ValueError(f"a comma stands in the number: write {comma[1]}.{comma[2]} with a point")
    match = SINGLE.fullmatch(text.strip())
    if match is None:
        raise ValueError(f'"{text.strip()}" does not begin with a number')
    return decimal(match[1]) * factor(match[2].strip(), si)


def listed(inner: str, unit: str, si: str) -> tuple[Decimal, ...]:
    """The numbers between brackets: the unit stands behind the bracket or behind each number."""
    if (comma := re.search(r"(\d+),(\d+)", inner)) and re.search(r",\s", inner):
        raise ValueError(
            f"a comma may stand in a number: write {comma[1]}.{comma[2]} with a point, or a blank"
            " after every comma"
        )
    items = [item.strip() for item in inner.split(",")]
    for item in items:
        if two := re.match(rf"({NUMBER})\s+({NUMBER})", item):
            raise ValueError(f"a comma is missing: write {two[1]}, {two[2]}")
        if SINGLE.fullmatch(item) is None:
            raise ValueError(f'"{item}" does not begin with a number')
    return tuple(one(f"{item} {unit}" if unit else item, si) for item in items)


def spread(match: re.Match[str], si: str) -> tuple[Decimal, ...]:
    """Both ends of the interval "20 t ± 5 %", "20 t ± 1 t" or "20 ± 1 t"."""
    middle, unit, width, width_unit = match[1], match[2].strip(), match[3], match[4].strip()
    if si and (before := PER_CENT.match(width_unit)):
        told = f"{middle} {unit if unit[:1].isalpha() else before[1]} ± {width} %"
        raise ValueError(f"a percentage stands before the unit: write {told}")
    if (unit and not width_unit) or unit == width_unit == "%":
        cure = "the ends, such as [2, 4] %" if unit == "%" else f"± {width} % or ± {width} {unit}"
        raise ValueError(f"the spread ± {width} may mean two things: write {cure}")
    if width_unit == "%":
        modal = decimal(middle) * factor(unit, si)
        half = abs(modal) * decimal(width) / 100
    else:
        modal = decimal(middle) * factor(unit or width_unit, si)
        half = decimal(width) * factor(width_unit or unit, si)
    return modal - half, modal + half


def numbers(value: object, si: str) -> tuple[float, ...]:
    """Every number of a quantity, in `si`.

    Args:
        value: What the TOML file holds: text with a unit, or a bare number or array where no unit
            is needed.
        si: SI unit; empty for a number without a unit.

    Raises:
        ValueError: Not a quantity, its unit is missing or wrong, or it is too large or small.
    """
    if isinstance(value, bool) or not isinstance(value, str | int | float | list):
        raise ValueError("this is not a quantity")
    if isinstance(value, list):
        value = (
            "[" + ", ".join(item if isinstance(item, str) else repr(item) for item in value) + "]"
        )
    text = str(value).strip() if isinstance(value, str) else repr(value)
    if match := LIST.fullmatch(text):
        found = listed(match[1], match[2].strip(), si)
    elif match := SPREAD.fullmatch(text):
        found = spread(match, si)
    else:
        found = (one(text, si),)
    if not all(math.isfinite(float(x)) for x in found):
        raise ValueError("the number is too large")
    for x in found:
        if problem := size_problem(float(x), si):
            raise ValueError(problem)
    return tuple(float(x) for x in found)


def number(value: object, si: str) -> float:
    """A single crisp quantity, in `si`."""
    found = numbers(value, si)
    if len(found) != 1:
        raise ValueError(f"got {len(found)} values where one is wanted")
    return found[0]


def fuzzy(value: object, si: str) -> FuzzyNumber:
    """A crisp or fuzzy quantity, in `si`.

    Raises:
        ValueError: Not a quantity, more than four values, or values that are not in rising order.
    """
    found = numbers(value, si)
    if len(found) not in SHAPES:
        raise ValueError(
            f"got {len(found)} values; one is crisp, two an interval, three a triangle, four a"
            " trapezoid"
        )
    if list(found) != sorted(found):
        raise ValueError(f"the {SHAPES[len(found)]} is not in rising order: {ORDERS[len(found)]}")
    if len(found) == 1:
        return Crisp(found[0])
    if len(found) == 2:
        return Interval(*found)
    return Triangular(*found) if len(found) == 3 else Trapezoidal(*found)
