"""Numbers as texts: with units and prefixes, as ranges that stay true, in per cent, as tables."""

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
    """A table of texts: titles of the columns, and rows with a text for each column."""

    head: tuple[str, ...]
    rows: list[tuple[str, ...]]


class ShownUnit(NamedTuple):
    """A unit in which a quantity is shown.

    Args:
        label: The unit, such as "mm"; empty for a pure number.
        factor: What one SI unit is in this unit, such as 1000.
    """

    label: str
    factor: float

    def text(self, value: float, *, digits: int = 4) -> str:
        """Return a value in SI as a text in this unit, such as ``40.00 mm``.

        All digits before the point are shown, also where there are more than `digits`.
        """
        scaled = value * self.factor + 0.0  # adding 0 removes the sign of −0
        places = max(digits, len(f"{abs(scaled):.0f}"))
        number = f"{scaled:#.{places}g}".rstrip(".")
        return f"{number} {self.label}".strip().replace("-", MINUS)


def engineering(value: float, si: str, *, digits: int = 4) -> str:
    """Return a value in SI as a text with a suitable prefix, such as ``−3.590 MN``.

    Args:
        value: The value, in the unit `si`.
        si: Unit, such as "N". Those that take no prefix here are kept.
        digits: Significant digits.
    """
    rounded_text = f"{value + 0.0:.{digits}g}"  # adding 0 removes the sign of −0
    rounded_value = float(rounded_text)
    if si not in PREFIXED or not 1e-12 <= abs(rounded_value) < 1e12:
        if 1e4 <= abs(value) < 1e7:
            rounded_text = f"{rounded_value:.0f}"  # short enough without an exponent
        return f"{rounded_text} {si}".strip().replace("-", MINUS)
    exponent = _prefix_exponent(abs(rounded_value))
    scaled = rounded_value / 10.0**exponent
    places = max(digits, len(f"{abs(scaled):.0f}"))
    number = f"{scaled:#.{places}g}".rstrip(".")
    return f"{number} {PREFIXES[exponent]}{si}".replace("-", MINUS)


def _prefix_exponent(magnitude: float) -> int:
    """Return the power of ten of the prefix for a positive number, from −9 to 9."""
    return min(9, max(-9, 3 * math.floor(math.log10(magnitude) / 3)))


def rounded_ends(low: float, high: float, nature: Nature, digits: int = 4) -> tuple[float, float]:
    """Return both ends of a range, rounded in the direction that keeps its guarantee true.

    Ends that agree, or that would pass each other, are rounded to the nearest number.

    Args:
        low: Lower end.
        high: Upper end.
        nature: The guarantee: guaranteed bounds are rounded outwards, attained values inwards.
        digits: Significant digits.
    """
    lower = rounded(low, "lower", nature, digits)
    upper = rounded(high, "upper", nature, digits)
    if high <= low + 1e-9 * abs(low) or lower > upper:
        return float(f"{low:.{digits}g}"), float(f"{high:.{digits}g}")
    return lower, upper


def range_text(low: float, high: float, nature: Nature, digits: int = 4) -> str:
    """Return a range as a text, its ends rounded by `rounded_ends`; one number if they agree."""
    ends = rounded_ends(low, high, nature, digits)
    return " … ".join(dict.fromkeys(number_text(end, digits) for end in ends))


def number_text(value: float, digits: int = 4) -> str:
    """Return a number as a text with all its significant digits, such as ``2.500``."""
    return f"{value + 0.0:#.{digits}g}".rstrip(".").replace("-", MINUS)


def percent_text(fraction: float, places: int = 1) -> str:
    """Return a fraction in per cent, with so many digits after the point."""
    return f"{round(fraction, places + 2) + 0.0:.{places}%}".replace("-", MINUS)


def axis_prefix(largest: float, si: str) -> tuple[float, str]:
    """Return the factor and the unit for an axis whose values reach `largest` in the unit `si`.

    Values from .1 to 1000 keep the unit.
    """
    if si not in PREFIXED or not math.isfinite(largest) or largest <= 0 or 0.1 <= largest < 1000:
        return 1.0, si
    exponent = _prefix_exponent(largest)
    return 10.0**-exponent, f"{PREFIXES[exponent]}{si}"


def text_table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table as lines of text, each with its line end.

    The first column is aligned to the left, all others to the right.
    """
    lines = [list(head)]
    lines.extend(list(row) for row in rows)
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    text = ""
    for line in lines:
        cells = [line[0].ljust(widths[0])]
        cells.extend(map(str.rjust, line[1:], widths[1:]))
        text += "  ".join(cells).rstrip() + "\n"
    return text
