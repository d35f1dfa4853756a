"""Numbers as texts: with units and prefixes, as ranges that stay true, in per cent, as tables."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from alphacut.base.nature import Nature, rounded

STANDARD_GRAVITY = 9.80665
"""In m/s², by the third General Conference on Weights and Measures, 1901."""
PREFIXES = {9: "G", 6: "M", 3: "k", 0: "", -3: "m", -6: "µ", -9: "n"}
"""Prefix of a unit by its power of ten, for people who read a power of a thousand as a word."""
MINUS = "\u2212"
"""The minus of typography, as wide as a digit; files for programs have a hyphen instead."""


class Table(NamedTuple):
    """A table of texts: titles of the columns, and rows with a text for each column."""

    head: tuple[str, ...]
    rows: list[tuple[str, ...]]

    @property
    def records(self) -> list[dict[str, str]]:
        """The texts of each row by the titles of their columns."""
        return [dict(zip(self.head, row, strict=True)) for row in self.rows]


class ShownUnit(NamedTuple):
    """A unit in which a quantity is shown.

    Args:
        label: The unit, such as "mm"; empty for a pure number.
        factor: What one SI unit is in this unit, such as 1000.
    """

    label: str
    factor: float

    def text(self, value: float, *, digits: int = 4) -> str:
        """Return a value in SI as a text in this unit, such as ``40.00 mm`` of 0.04.

        The value is multiplied by the field `factor`, 1000 for mm, and followed by `label`. A
        negative one has the minus of typography, and NaN is the text "nan".

        Args:
            value: The value in the SI unit.
            digits: Number of significant digits, zeros at the end among them. All digits before the
                point are shown also where there are more, so that no exponent is needed.
        """
        scaled = value * self.factor + 0.0  # adding 0 removes the sign of −0
        places = max(digits, len(f"{abs(scaled):.0f}"))
        number = f"{scaled:#.{places}g}".rstrip(".")
        return f"{number} {self.label}".strip().replace("-", MINUS)


def engineering(value: float, si: str, *, digits: int = 4) -> str:
    """Return a value in SI as a text with a suitable prefix, such as ``−3.590 MN``.

    A prefix from n to G is taken for m, m/s, m/s^2, N, N*m, N/m, Pa, s, rad, W and J, if the
    magnitude is from 1e-12 to 1e12. Otherwise the unit is kept, and the number has no zeros at its
    end and an exponent where it is large or small, such as ``1.5e+13 Pa`` or ``0 N``. NaN and
    infinities are written as nan and inf, and minus as in typography.

    Args:
        value: The value, in the unit `si`.
        si: Unit, such as "N"; empty for a pure number.
        digits: Number of significant digits, 1 or more.
    """
    rounded_text = f"{value + 0.0:.{digits}g}"  # adding 0 removes the sign of −0
    # The prefix is chosen for the rounded value: 999.96 N are 1.000 kN with four digits.
    rounded_value = float(rounded_text)
    if not _takes_prefix(si) or not 1e-12 <= abs(rounded_value) < 1e12:
        if 1e4 <= abs(value) < 1e7:
            rounded_text = f"{rounded_value:.0f}"  # short enough without an exponent
        return f"{rounded_text} {si}".strip().replace("-", MINUS)
    exponent = _prefix_exponent(abs(rounded_value))
    unit = ShownUnit(f"{PREFIXES[exponent]}{si}", 10.0**-exponent)
    return unit.text(rounded_value, digits=digits)


def _takes_prefix(si: str) -> bool:
    """Return whether an SI unit is shown with a prefix such as k.

    Others are not, such as kg, which has a prefix, and m^4, where km^4 would not be 1000 m^4.
    """
    return si in ("m", "m/s", "m/s^2", "N", "N*m", "N/m", "Pa", "s", "rad", "W", "J")


def _prefix_exponent(magnitude: float) -> int:
    """Return the power of ten of the prefix for a positive number, from −9 to 9."""
    return min(9, max(-9, 3 * math.floor(math.log10(magnitude) / 3)))


def rounded_ends(low: float, high: float, nature: Nature, digits: int = 4) -> tuple[float, float]:
    """Return both ends of a range, rounded in the direction that keeps its guarantee true.

    Ends that agree to nine digits count as one crisp value, and are rounded to the nearest number.
    So are ends that would pass each other when rounded inwards. Infinite ends stay.

    Args:
        low: Lower end.
        high: Upper end, not below the lower one.
        nature: What the ends promise: guaranteed and estimated ones are rounded outwards, attained
            ones, which some inputs reach, inwards.
        digits: Number of significant digits, 1 or more.
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
    """Return by which factor an axis multiplies its values, and the unit that it then shows.

    A prefix from n to G is taken for m, m/s, m/s^2, N, N*m, N/m, Pa, s, rad, W and J. The factor is
    1 and the unit stays for other units, for magnitudes from 0.1 to 1000, and if there is no
    positive finite magnitude.

    Args:
        largest: Largest magnitude of the values in the unit `si`.
        si: SI unit of the values.

    Example:
        >>> axis_prefix(4.2e4, "N")
        (0.001, 'kN')
    """
    is_suitable = math.isfinite(largest) and (0 < largest < 0.1 or largest >= 1000)
    if not _takes_prefix(si) or not is_suitable:
        return 1.0, si
    exponent = _prefix_exponent(largest)
    return 10.0**-exponent, f"{PREFIXES[exponent]}{si}"


def text_table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table as lines of text, each with a line feed at its end.

    Columns are as wide as their longest cell, two blanks apart. The first one is aligned to the
    left, all others to the right.

    Args:
        head: Titles of the columns, one or more; they are the first line.
        rows: Cells of each row.

    Raises:
        ValueError: A row has another number of cells than the head.
    """
    lines = [head, *rows]
    first_width, *widths = (max(map(len, column)) for column in zip(*lines, strict=True))
    text = ""
    for first, *others in lines:
        cells = [first.ljust(first_width), *map(str.rjust, others, widths)]
        text += "  ".join(cells).rstrip() + "\n"
    return text
