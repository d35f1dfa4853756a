"""Texts of numbers in SI: with prefixes, as ranges that stay true, in per cent, and as tables."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from alphacut.base.nature import Nature, rounded

STANDARD_GRAVITY = 9.80665
"""In m/s², by the third General Conference on Weights and Measures, 1901."""
PREFIXES = {9: "G", 6: "M", 3: "k", 0: "", -3: "m", -6: "µ", -9: "n"}
MINUS = "\u2212"
PREFIXED = ("m", "m/s", "m/s^2", "N", "N*m", "N/m", "Pa", "s", "rad", "W", "J")


class Table(NamedTuple):
    """Titles of the columns, and rows of texts."""

    head: tuple[str, ...]
    rows: list[tuple[str, ...]]


class ShownUnit(NamedTuple):
    """Unit in which a quantity is shown.

    Args:
        label: The unit, as "mm"; empty for none.
        factor: Number in this unit of one SI unit.
    """

    label: str
    factor: float

    def text(self, value: float, *, digits: int = 4) -> str:
        """Text of a value in SI: ``40.00 mm``."""
        scaled = value * self.factor + 0.0  # without the sign of −0
        places = max(digits, len(f"{abs(scaled):.0f}"))
        number = f"{scaled:#.{places}g}".rstrip(".")
        return f"{number} {self.label}".strip().replace("-", MINUS)


def engineering(value: float, si: str, *, digits: int = 4) -> str:
    """Text of a value in the SI unit `si`, with a prefix if the unit takes one: ``−3.590 MN``."""
    rounded_text = f"{value + 0.0:.{digits}g}"  # without the sign of −0
    rounded_value = float(rounded_text)
    if si not in PREFIXED or not 1e-12 <= abs(rounded_value) < 1e12:
        # without an exponent where that is short enough
        plain = f"{rounded_value:.0f}" if 1e4 <= abs(value) < 1e7 else rounded_text
        return f"{plain} {si}".strip().replace("-", MINUS)
    exponent = _exponent(abs(rounded_value))
    scaled = rounded_value / 10.0**exponent
    places = max(digits, len(f"{abs(scaled):.0f}"))
    number = f"{scaled:#.{places}g}".rstrip(".")
    return f"{number} {PREFIXES[exponent]}{si}".replace("-", MINUS)


def _exponent(largest: float) -> int:
    return min(9, max(-9, 3 * math.floor(math.log10(largest) / 3)))


def rounded_ends(low: float, high: float, nature: Nature, digits: int = 4) -> tuple[float, float]:
    """Both ends of a range, rounded in- or outwards as its nature demands, never past each other.

    Ends that agree, or that would pass each other, are rounded to the nearest number.
    """
    lower, upper = rounded(low, "lower", nature, digits), rounded(high, "upper", nature, digits)
    if high <= low + 1e-9 * abs(low) or lower > upper:
        return float(f"{low:.{digits}g}"), float(f"{high:.{digits}g}")
    return lower, upper


def range_text(low: float, high: float, nature: Nature, digits: int = 4) -> str:
    """A range rounded in- or outwards as its nature demands; one number where its ends agree."""
    ends = rounded_ends(low, high, nature, digits)
    return " … ".join(dict.fromkeys(number_text(end, digits) for end in ends))


def number_text(value: float, digits: int = 4) -> str:
    """A number with its significant digits, also those that are 0."""
    return f"{value + 0.0:#.{digits}g}".rstrip(".").replace("-", MINUS)


def percent_text(share: float, places: int = 1) -> str:
    """A share in per cent."""
    return f"{round(share, places + 2) + 0.0:.{places}%}".replace("-", MINUS)


def axis_prefix(largest: float, si: str) -> tuple[float, str]:
    """Factor and unit for an axis whose values reach `largest`."""
    if si not in PREFIXED or not math.isfinite(largest) or largest <= 0 or 0.1 <= largest < 1000:
        return 1.0, si
    return 10.0 ** -_exponent(largest), f"{PREFIXES[_exponent(largest)]}{si}"


def text_table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Lines of a table of texts: the first column to the left, the others to the right."""
    lines = [[*head], *map(list, rows)]
    first, *further_widths = (max(len(line[k]) for line in lines) for k in range(len(head)))
    aligned = ([line[0].ljust(first), *map(str.rjust, line[1:], further_widths)] for line in lines)
    return "".join(f"{'  '.join(line).rstrip()}\n" for line in aligned)
