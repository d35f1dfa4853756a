"""Quantities as engineers write them: "80 GPa", "[75, 80, 85] GPa", "20 t ± 5 %".

One number is crisp, two are an interval, three a triangle (lower, modal, upper), four a trapezoid;
a spread "± 5 %" is an interval.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from decimal import Decimal

from alphacut.fuzzy import Crisp, FuzzyNumber, Interval, Trapezoidal, Triangular
from alphacut.io.units import GREATEST, LEAST, factor

NUMBER = r"[-+\u2212]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?"
LIST = re.compile(r"\[(.*)\]\s*(.*)", re.DOTALL)
SPREAD = re.compile(rf"({NUMBER})\s*(.*?)\s*(?:±|\+/-)\s*({NUMBER})\s*(.*)")
SINGLE = re.compile(rf"({NUMBER})\s*(.*)")
SHAPES: tuple[Callable[..., FuzzyNumber], ...] = (Crisp, Interval, Triangular, Trapezoidal)
LONGEST = 1000
"""Characters of a quantity; no longer text is read."""


def decimal(text: str) -> Decimal:
    """A decimal number; a typographic minus is taken as one."""
    return Decimal(text.replace("\u2212", "-"))


def one(text: str, si: str) -> Decimal:
    """A single quantity such as "80 GPa", in `si`.

    Raises:
        ValueError: It begins with no number, or its unit is wrong.
    """
    match = SINGLE.fullmatch(text.strip())
    if match is None:
        raise ValueError(f'"{text.strip()}" does not begin with a number')
    if match[2].startswith((",", "_")):
        raise ValueError(f'"{text.strip()}" is no number; write a point, and no _')
    return decimal(match[1]) * factor(match[2].strip(), si)


def spread(match: re.Match[str], si: str) -> tuple[Decimal, Decimal]:
    """Both ends of the interval "20 t ± 5 %" or "20 t ± 1 t"."""
    middle = one(f"{match[1]} {match[2]}", si)
    share = match[4].strip() == "%" and (si or match[2].strip() != "%")
    half = abs(middle) * decimal(match[3]) / 100 if share else one(f"{match[3]} {match[4]}", si)
    return middle - half, middle + half


def numbers(value: object, si: str) -> tuple[float, ...]:
    """Every number of a quantity, in `si`.

    Args:
        value: Text with a unit, or a bare number or array where no unit is needed.
        si: SI unit; empty for a number without a unit.

    Raises:
        ValueError: It is no quantity, its unit is wrong, or it is too large or small.
    """
    if isinstance(value, list):
        value = "[" + ", ".join(map(str, value)) + "]"
    text, kind = str(value).strip(), isinstance(value, str | int | float)
    if isinstance(value, bool) or not kind or len(text) > LONGEST:
        raise ValueError("this is no quantity" if len(text) <= LONGEST else "this is too long")
    if match := LIST.fullmatch(text):
        items = [item.strip() for item in match[1].split(",")]
        values = tuple(one(f"{item} {match[2]}" if match[2] else item, si) for item in items)
    elif match := SPREAD.fullmatch(text):
        values = spread(match, si)
    else:
        values = (one(text, si),)
    return tuple(_sized(x) for x in values)


def _sized(value: Decimal) -> float:
    size = abs(float(value))
    if not (size == 0 or LEAST <= size <= GREATEST) or not math.isfinite(size):
        raise ValueError(f"magnitudes go from {LEAST:g} to {GREATEST:g} in SI, or are 0")
    return float(value)


def number(value: object, si: str) -> float:
    """A single crisp quantity, in `si`.

    Raises:
        ValueError: As of `numbers`, or there are several.
    """
    values = numbers(value, si)
    if len(values) != 1:
        raise ValueError(f"{len(values)} values stand where one is needed")
    return values[0]


def fuzzy(value: object, si: str) -> FuzzyNumber:
    """A crisp or fuzzy quantity, in `si`.

    Raises:
        ValueError: As of `numbers`, more than four values, or values that do not rise.
    """
    values = numbers(value, si)
    if len(values) > len(SHAPES) or list(values) != sorted(values):
        raise ValueError(f"{len(values)} values stand where one to four that rise are needed")
    return SHAPES[len(values) - 1](*values)
