"""Quantities with units as people write them, such as "80 GPa" or "20 t ± 5 %", turned into SI.

One number is a crisp value, two an interval, three a triangular fuzzy number (lower, nominal,
upper) and four a trapezoidal one; a spread such as "± 5 %" is an interval. Numbers are converted as
decimals, so that 250 cm and 2.5 m become the same float.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from decimal import Decimal
from functools import cache, partial
from typing import TYPE_CHECKING

from alphacut.base.number_text import MINUS
from alphacut.fuzzy import Crisp, FuzzyNumber, Interval, Trapezoidal, Triangular
from alphacut.io.quantity_cures import UNITS, form_cure, number_cure, unit_cure

if TYPE_CHECKING:
    import pint


@dataclass(frozen=True)
class Dimension:
    """A physical dimension, as units.toml has it.

    Args:
        name: Name of the dimension in messages.
        example: A value with its unit, as a user writes it.
        powers: Common units and their powers of ten in the SI unit. They are read without Pint,
            whose import takes 0.35 s.
        usual: Smallest and largest magnitude, in the SI unit, that structures and their materials
            usually have. Other values are allowed, but suggest that a unit is wrong.
        factors: Further units and their values in the SI unit, which Pint takes for something else.
    """

    name: str
    example: str
    powers: Mapping[str, int] = field(default_factory=dict)
    usual: tuple[float, float] = (0.0, float("inf"))
    factors: Mapping[str, str] = field(default_factory=dict)


QUANTITIES = {si: Dimension(**facts) for si, facts in UNITS["dimensions"].items()}
"""Dimensions of quantities by their SI units."""
MIN_MAGNITUDE = 1e-36
MAX_MAGNITUDE = 1e18
"""Magnitudes in SI beyond which a quantity other than 0 is a mistake."""
NUMBER = r"[-+\u2212]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?"
"""A decimal number with an exponent or without; \\u2212 is the minus of typography."""


@cache
def registry() -> pint.UnitRegistry:
    """Return Pint's registry of units, which computes with decimals."""
    import pint

    return pint.UnitRegistry(non_int_type=Decimal)


@cache
def factor(unit: str, si: str) -> Decimal:
    """Return the value of one `unit` in the SI unit `si`, such as 1000 for "kN" in "N".

    The units in `QUANTITIES` are tried first, since they need no import; then Pint is asked.

    Args:
        unit: The unit as it was written, without blanks at its ends. Only a pure number may have
            none.
        si: SI unit of the dimension, a key of `QUANTITIES`, such as "N"; empty for a pure number.

    Raises:
        ValueError: The unit is missing, unknown, easily confused with another one (as mN with MN),
            or of another dimension. The message tells which unit to write.
    """
    dimension = QUANTITIES[si]
    if unit in dimension.factors:
        return Decimal(dimension.factors[unit])
    if unit in dimension.powers:
        return Decimal(10) ** dimension.powers[unit]
    if not unit:
        raise ValueError(f"the unit is missing, such as {dimension.example}")
    for word in re.findall(r"[A-Za-z]+", unit):
        if meaning := UNITS["confused"].get(word):
            raise ValueError(f'the unit "{unit}" contains {word}: {meaning}')
    try:
        return _factor_by_pint(unit, si)
    except Exception:  # Pint's parser raises whatever Python's parser raises
        raise ValueError(_wrong_unit(unit, si)) from None


def _factor_by_pint(unit: str, si: str) -> Decimal:
    """Return the value of one unit in the SI unit `si` by Pint, such as 4448.2… for "kip" in "N".

    Args:
        unit: The unit as it was written. Powers need no sign, as in "cm4".
        si: SI unit of the dimension; for a pure number, which is empty, there is no unit.

    Raises:
        Exception: The unit is unknown, of another dimension, or means something else to Pint than
            to people. Pint's parser raises whatever Python's parser raises.
    """
    # Units of print and fractions, which Pint takes for numbers or lengths, and tons of many kinds
    refused = r"[%‰]|\b(per ?cent|per ?mille|pp[mb]|pixel|px|point|dot|pt|tons?)\b"
    # Pint passes over other characters, as in "t,,,,", and over a point that ends a unit.
    is_unit = re.fullmatch(r"(?:[\w\s*/^()°µμ·⁻-]|(?<=\d)\.(?=\d))*", unit)
    if not si or is_unit is None or re.search(refused, unit):
        raise ValueError("Pint has another meaning of this unit")
    # People write cm4 and m3; Pint's powers need ^.
    spelt = re.sub(r"([A-Za-z])([234])(?!\w)", r"\1^\2", unit)
    one_unit = registry().Quantity(Decimal(1), registry().parse_units(spelt))
    return Decimal(one_unit.to(_pint_target(one_unit, si)).magnitude)


def _wrong_unit(unit: str, si: str) -> str:
    """Return a clause that says what is wrong with a unit, and what to write in its place.

    If the unit is a common one of another dimension, this dimension is named. Then the unit follows
    that was probably meant, or the units that are allowed.

    Args:
        unit: The unit as it was written, which is none of the dimension.
        si: SI unit of the dimension, a key of `QUANTITIES`; empty for a pure number.
    """
    dimension = QUANTITIES[si]
    what = f'the unit "{unit}" is wrong'
    if si:
        what = f'the unit "{unit}" is no unit of {dimension.name}'
    actual = next((x.name for x in QUANTITIES.values() if unit in x.powers), "")
    if actual:
        what = f'the unit "{unit}" is a unit of {actual}, and no unit of {dimension.name}'
    fits = partial(_is_unit_of, si=si)
    if cure := unit_cure(unit, si, fits=fits, known=dimension.powers):
        return f"{what}; {cure}"
    if not si:
        return f"{what}; write a number alone, or one with %"
    units = ", ".join([*dimension.powers, *dimension.factors]) or f"as in {dimension.example}"
    return f"{what}; units are {units}"


def _is_unit_of(spelling: str, si: str) -> bool:
    """Return whether a spelling is a unit of the dimension of the SI unit `si`.

    It is one if it stands in the table `QUANTITIES`, or if Pint knows it. An empty spelling is no
    unit, also of a pure number.
    """
    dimension = QUANTITIES[si]
    if spelling in dimension.factors or spelling in dimension.powers:
        return bool(spelling)
    try:
        return _factor_by_pint(spelling, si) > 0
    except Exception:  # whatever Pint's parser raises
        return False


def _pint_target(one_unit: pint.Quantity, si: str) -> str:
    """Return the unit to which Pint must convert a unit so that the result is in the SI unit `si`.

    It is `si`, but turn/s for a frequency whose unit contains an angle, such as rad/s or rpm.
    Pint's radian is the number 1, so that it would take 1 rad/s for 1 Hz. It would also take 1 Hz
    for 1 rad/s, which is refused here.

    Args:
        one_unit: One of the unit that was written, as Pint has read it. Whether it is of the
            dimension of `si` at all is only looked at for frequencies.
        si: SI unit of the quantity.

    Raises:
        ValueError: A frequency is neither 1/s nor an angle over time, or an angular velocity is in
            hertz.
    """
    if si == "rad/s" and any("hertz" in name for name, _ in one_unit.unit_items()):
        raise ValueError("hertz count turns, not radians")
    if si != "Hz":
        return si
    powers = dict(one_unit.to_root_units().unit_items())
    if powers == {"second": -1}:
        return "Hz"
    if powers == {"radian": 1, "second": -1}:
        return "turn/s"
    raise ValueError("neither turns nor angles per time")


def _parse_decimal(text: str, si: str) -> Decimal:
    """Return the value of one number with its unit, such as "80 GPa", in the SI unit `si`.

    It is exact unless the factor of the unit is irrational, as for degrees.

    Args:
        text: A decimal number and a unit; a pure number needs none. Blanks around them do not
            matter, and the minus of typography is a minus.
        si: SI unit of the quantity, a key of `QUANTITIES`; empty for a pure number.

    Raises:
        ValueError: The text is no number with a unit of this dimension, or its magnitude is far out
            of range (beyond about 10^±100). The message says what to write.
    """
    text = text.strip()
    match = re.fullmatch(rf"({NUMBER})\s*(.*)", text)
    # "1,5 GPa" begins with the number 1 and the unit ",5 GPa".
    if match is None or match[2].startswith((",", "_")):
        what = f'"{text}" does not begin with a number such as 1.5'
        cure = number_cure(text)
        raise ValueError(f"{what}; {cure}" if cure else what)
    digits = match[1]
    unit = match[2].strip()
    # A unit that begins with another character is the rest of a number, as "x 10^3 N" of a power.
    if re.match(r"[^A-Za-z°%‰µμ(/[]", unit) and (cure := number_cure(text)):
        raise ValueError(f'"{text}" is no number with a unit; {cure}')

    # Powers of ten of thousands of digits would take minutes: numbers far beyond the largest
    # magnitude are refused before they are multiplied by their unit.
    _, _, exponent = digits.lower().partition("e")
    number = Decimal("Infinity")
    if len(exponent) < 6:
        number = Decimal(digits.replace(MINUS, "-"))
    if (number != 0 and abs(number.adjusted()) > 100) or not number.is_finite():
        raise ValueError(_out_of_range())
    try:
        return number * factor(unit, si)
    except ValueError as error:
        cure = number_cure(text)
        raise ValueError(f"{cure}; {error}" if cure else str(error)) from None


def _out_of_range() -> str:
    """Return the message about a magnitude that no quantity has."""
    return f"magnitudes go from {MIN_MAGNITUDE:g} to {MAX_MAGNITUDE:g} in SI, or are 0"


def _parse_spread(match: re.Match[str], si: str) -> tuple[Decimal, Decimal]:
    """Return both ends of an interval such as "20 t ± 5 %" or "20 t ± 1 t" in the SI unit `si`.

    Args:
        match: Four groups: the midpoint, its unit, the half-width, and the unit of the half-width,
            where % means a fraction of the midpoint. A unit may be empty.
        si: SI unit of the quantity, empty for a pure number.

    Returns:
        Midpoint less half-width, and midpoint plus half-width; the first one is the larger if the
        half-width is negative.

    Raises:
        ValueError: A number or a unit is wrong. The message says what to write.
    """
    midpoint_text, unit, width_text, width_unit = (group.strip() for group in match.groups())
    midpoint = _parse_decimal(f"{midpoint_text} {unit}", si)
    # In "2 % ± 1 %" the second percentage is a half-width, not a fraction of the midpoint.
    is_fraction = width_unit == "%" and (si != "" or unit != "%")
    if is_fraction:
        half_width = abs(midpoint) * _parse_decimal(width_text, "") / 100
    else:
        half_width = _parse_decimal(f"{width_text} {width_unit}", si)
    return midpoint - half_width, midpoint + half_width


def _parse_decimals(text: str, si: str) -> list[Decimal]:
    """Return the numbers of a list, both ends of a spread, or one number, in the SI unit `si`.

    Args:
        text: "[19, 20, 21] t" or "[19 t, 20 t]", whose numbers are returned in their order;
            "20 t ± 5 %" or "20 t ± 1 t", with ± or +/-, whose ends are returned; or "20 t".
        si: SI unit of the quantity, empty for a pure number.

    Raises:
        ValueError: A number or a unit is wrong or missing, also in an empty list.
    """
    if match := re.fullmatch(r"\[(.*)\]\s*(.*)", text, re.DOTALL):
        items, unit = match.groups()
        return [_parse_decimal(f"{item.strip()} {unit}", si) for item in items.split(",")]
    if match := re.fullmatch(rf"({NUMBER})\s*(.*?)\s*(?:±|\+/-)\s*({NUMBER})\s*(.*)", text):
        return [*_parse_spread(match, si)]
    return [_parse_decimal(text, si)]


def parse_numbers(value: object, si: str) -> tuple[float, ...]:
    """Return all numbers of a quantity in the SI unit `si`.

    Args:
        value: Text with a unit, such as "80 GPa", "[75, 80] GPa" or "20 t ± 5 %"; a bare number or
            a list of numbers where no unit is needed; a list of texts with units. Truth values are
            no numbers.
        si: SI unit of the quantity, a key of `QUANTITIES`, such as "Pa"; empty for a pure number.

    Returns:
        One number, the numbers of a list in their order, or the lower and the upper end of a
        spread. Two texts of one value in different units give the same float.

    Raises:
        ValueError: It is no quantity, its unit is wrong, its text has more than 1000 letters, or a
            magnitude other than 0 is outside 1e-36 … 1e18. The message says what to write.
    """
    if isinstance(value, bool) or not isinstance(value, str | int | float | list):
        raise ValueError("this is no quantity")
    text = str(value).strip()
    if isinstance(value, list):
        text = "[" + ", ".join(map(str, value)) + "]"
    if len(text) > 1000:  # regular expressions of texts take the square of their length
        raise ValueError("this is too long")
    try:
        values = _parse_decimals(text, si)
    except ValueError as error:
        # What is said of a single number or unit helps little if the form is wrong.
        if cure := form_cure(text):
            raise ValueError(f'"{text}" is no quantity as it stands; {cure}') from None
        raise error from None
    # Only now the decimals are rounded, once each.
    floats = tuple(map(float, values))
    magnitudes = set(map(abs, floats)) - {0.0}
    if magnitudes and not MIN_MAGNITUDE <= min(magnitudes) <= max(magnitudes) <= MAX_MAGNITUDE:
        raise ValueError(_out_of_range())
    return floats


def parse_number(value: object, si: str) -> float:
    """Return a single crisp quantity in the SI unit `si`.

    Args:
        value: Text with a unit, such as "80 GPa"; a bare number where no unit is needed; or a list
            of one of these.
        si: SI unit of the quantity, a key of `QUANTITIES`, such as "Pa"; empty for a pure number.

    Raises:
        ValueError: It is no quantity or several values, its unit is wrong, or a magnitude other
            than 0 is outside 1e-36 … 1e18. The message says what to write.
    """
    values = parse_numbers(value, si)
    if len(values) != 1:
        raise ValueError(f"{len(values)} values stand where one is needed")
    return values[0]


def parse_fuzzy(value: object, si: str) -> FuzzyNumber:
    """Return a quantity as a fuzzy number in the SI unit `si`.

    One value is crisp, two are an interval, three a triangular number (lower end, value of
    membership 1, upper end), four a trapezoidal one. Values may be equal. A spread such as
    "20 t ± 5 %" is an interval.

    Args:
        value: Text with a unit, such as "[75, 80, 85] GPa"; a bare number or a list of numbers
            where no unit is needed; a list of texts with units.
        si: SI unit of the quantity, a key of `QUANTITIES`, such as "Pa"; empty for a pure number.

    Raises:
        ValueError: It is no quantity, its unit is wrong, a magnitude other than 0 is outside
            1e-36 … 1e18, there are more than four values or they fall, or `value` is a list of one
            text. The message says what to write.
    """
    values = parse_numbers(value, si)
    if isinstance(value, list) and len(value) == 1 and isinstance(value[0], str):
        raise ValueError("a list of one text, as if of a matrix; without brackets it is a value")
    # Numbers of one to four values, in this order
    kinds: tuple[Callable[..., FuzzyNumber], ...] = (Crisp, Interval, Triangular, Trapezoidal)
    if len(values) > len(kinds):
        raise ValueError(f"{len(values)} values stand where one to four that rise are needed")
    if list(values) != sorted(values):
        raise ValueError("values must rise: write the smallest first and the largest last")
    return kinds[len(values) - 1](*values)


def parse_fuzzy_in_any_unit(
    value: object, units: Sequence[str] = tuple(QUANTITIES)
) -> tuple[FuzzyNumber, str]:
    """Return a quantity that may be of several dimensions, and the SI unit of its dimension.

    Args:
        value: Text with a unit, such as "80 GPa" or "[1, 2] kN/m"; a bare number or a list of
            numbers, which is a pure number; a list of texts with units.
        units: SI units of the dimensions, keys of `QUANTITIES`; the first that fits is taken.

    Returns:
        The fuzzy number (crisp, interval, triangular or trapezoidal by the count of its values) in
        the SI unit, and this unit.

    Raises:
        ValueError: It is a quantity of none of the dimensions. The message says what is wrong with
            the number, or else which unit was probably meant, or else gives examples.
    """
    reasons = []
    for si in units:
        try:
            return parse_fuzzy(value, si), si
        except ValueError as error:
            reasons.append(str(error))
    # Each dimension gave a reason. They are the same if the number is wrong, else the unit is.
    if len(set(reasons)) == 1:
        raise ValueError(reasons[0])
    # If reasons differ, one that names what was probably meant helps most. The reason of the pure
    # number, whose `si` is empty, says nothing about units.
    for si, reason in zip(units, reasons, strict=True):
        if si and re.search("did you mean|; write", reason):
            raise ValueError(reason)
    examples = [QUANTITIES[si].example for si in units]
    raise ValueError(f"its unit is none of a quantity such as {', '.join(examples[:5])}")
