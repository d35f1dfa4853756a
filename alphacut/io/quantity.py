"""Quantities with units as people write them, such as "80 GPa" or "20 t ± 5 %", turned into SI.

One number is a crisp value, two an interval, three a triangular fuzzy number (lower, nominal,
upper) and four a trapezoidal one; a spread such as "± 5 %" is an interval. Numbers are converted as
decimals, so that 250 cm and 2.5 m become the same float.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from functools import cache
from typing import TYPE_CHECKING

from alphacut.base.errors import cure_of
from alphacut.base.number_text import MINUS, STANDARD_GRAVITY
from alphacut.fuzzy import Crisp, FuzzyNumber, Interval, Trapezoidal, Triangular
from alphacut.io.quantity_cures import CONFUSED_PREFIXES, FORM_CURES, NUMBER_CURES, unit_cure

if TYPE_CHECKING:
    import pint


@dataclass(frozen=True)
class Dimension:
    """A physical dimension.

    Args:
        name: Name of the dimension in messages.
        example: A value with its unit, as a user writes it.
        powers: Common units and their powers of ten in the SI unit. They are read without Pint,
            whose import takes 0.35 s.
        usual: Smallest and largest magnitude, in the SI unit, that structures and their materials
            usually have. Other values are allowed, but suggest that a unit is wrong.
    """

    name: str
    example: str
    powers: Mapping[str, int]
    usual: tuple[float, float] = (0.0, float("inf"))


QUANTITIES = {
    "": Dimension("number without a unit", "0.3", {}),
    "Pa": Dimension(
        "stress or modulus",
        "80 GPa",
        {"Pa": 0, "kPa": 3, "MPa": 6, "GPa": 9, "N/mm^2": 6},
        usual=(1e3, 1e13),
    ),
    "m": Dimension("length", "2.5 m", {"m": 0, "cm": -2, "mm": -3, "µm": -6}, usual=(1e-9, 1e4)),
    "m^4": Dimension(
        "second moment of area",
        "1e-6 m^4",
        {"m^4": 0, "cm^4": -8, "mm^4": -12},
        usual=(1e-13, 1e3),
    ),
    "kg": Dimension("mass", "20 t", {"kg": 0, "t": 3}, usual=(1e-3, 1e9)),
    "s": Dimension("time", "30 s", {"s": 0, "ms": -3}, usual=(1e-7, 1e5)),
    "m/s": Dimension("velocity", "-0.5 m/s", {"m/s": 0, "mm/s": -3}, usual=(1e-7, 1e3)),
    "m/s^2": Dimension("acceleration", "9.81 m/s^2", {"m/s^2": 0}, usual=(1e-7, 1e4)),
    "N*s/m": Dimension(
        "damping coefficient", "50 N s/m", {"N s/m": 0, "kN s/m": 3}, usual=(1e-5, 1e12)
    ),
    "N*m*s": Dimension(
        "rotational damping coefficient", "0.1 N m s", {"N m s": 0}, usual=(1e-7, 1e13)
    ),
    "N/m": Dimension("stiffness", "30 kN/m", {"N/m": 0, "kN/m": 3, "MN/m": 6}, usual=(1.0, 1e13)),
    "N": Dimension("force", "0.02 N", {"N": 0, "kN": 3, "MN": 6}, usual=(1e-4, 1e10)),
    "N*s": Dimension("impulse", "0.3 kN s", {}, usual=(1e-5, 1e10)),
    "N*m": Dimension("moment", "12 kN m", {"N m": 0, "kN m": 3}, usual=(1e-5, 1e11)),
    "J": Dimension("energy", "20 kJ", {}),
    "1/s": Dimension("rate", "0.05 1/s", {"1/s": 0, "Hz": 0}),
    "Hz": Dimension("frequency", "1.5 Hz", {"Hz": 0, "1/s": 0}, usual=(1e-4, 1e5)),
    "rad": Dimension("angle", "1.5 rad", {"rad": 0}),
    "rad/s": Dimension("angular velocity", "0.1 rad/s", {"rad/s": 0}),
}
"""Dimensions of quantities by their SI units."""
GRAVITY = Decimal(str(STANDARD_GRAVITY))
UNITS_HERE = {
    "": {"": Decimal(1), "%": Decimal("0.01")},
    "m/s^2": {
        "g": GRAVITY,
        "mg": GRAVITY / 1000,
        "%g": GRAVITY / 100,
        "gal": Decimal("0.01"),
        "Gal": Decimal("0.01"),
    },
}
"""Units that Pint takes for something else: g is no gram here, and Gal no gallon."""
REFUSED = r"[%‰]|\b(per ?cent|per ?mille|pp[mb]|pixel|px|point|dot|pt|tons?)\b"
"""Units of print and fractions, which Pint takes for numbers or lengths, and tons of many kinds."""
MIN_MAGNITUDE = 1e-36
MAX_MAGNITUDE = 1e18
"""Magnitudes in SI beyond which a quantity other than 0 is a mistake."""
NUMBER = r"[-+\u2212]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?"
SHAPES: tuple[Callable[..., FuzzyNumber], ...] = (Crisp, Interval, Triangular, Trapezoidal)
"""Kinds of fuzzy numbers by the count of their values, less one."""


@cache
def registry() -> pint.UnitRegistry:
    """Return Pint's registry of units, which computes with decimals."""
    import pint

    return pint.UnitRegistry(non_int_type=Decimal)


@cache
def factor(unit: str, si: str) -> Decimal:
    """Return the value of one `unit` in the SI unit `si`, such as 1000 for "kN" in "N".

    Raises:
        ValueError: The unit is missing, unknown, easily confused with another one, or of another
            dimension. The message tells which unit to write.
    """
    common = UNITS_HERE.get(si, {})
    if unit in common:
        return common[unit]
    dimension = QUANTITIES[si]
    if unit in dimension.powers:
        return Decimal(10) ** dimension.powers[unit]
    if not unit:
        raise ValueError(f"the unit is missing, such as {dimension.example}")
    for word in re.findall(r"[A-Za-z]+", unit):
        if word in CONFUSED_PREFIXES:
            raise ValueError(f'the unit "{unit}" contains {word}: {CONFUSED_PREFIXES[word]}')
    try:
        return _factor_by_pint(unit, si)
    except Exception:  # Pint's parser raises whatever Python's parser raises
        raise ValueError(_wrong_unit(unit, si)) from None


def _factor_by_pint(unit: str, si: str) -> Decimal:
    """Return the value of one unit in the SI unit `si` by Pint, or raise any exception."""
    if not si or re.search(REFUSED, unit):
        raise ValueError("Pint has another meaning of this unit")
    spelt = re.sub(r"([A-Za-z])([234])(?!\w)", r"\1^\2", unit)
    one_unit = registry().Quantity(Decimal(1), registry().parse_units(spelt))
    return Decimal(one_unit.to(_pint_target(one_unit, si)).magnitude)


def _wrong_unit(unit: str, si: str) -> str:
    """Return what is wrong with a unit that is none of the SI unit `si`, and what to write."""
    dimension = QUANTITIES[si]

    def fits(spelling: str) -> bool:
        """Return whether this module or Pint knows a unit of the dimension by this spelling."""
        if spelling in UNITS_HERE.get(si, {}) or spelling in dimension.powers:
            return bool(spelling)
        try:
            return _factor_by_pint(spelling, si) > 0
        except Exception:  # whatever Pint's parser raises
            return False

    what = f'the unit "{unit}" is {f"no unit of {dimension.name}" if si else "wrong"}'
    own = next((x.name for x in QUANTITIES.values() if unit in x.powers), "")
    if own:
        what = f'the unit "{unit}" is a unit of {own}, and no unit of {dimension.name}'
    if cure := unit_cure(unit, si, fits=fits, known=dimension.powers):
        return f"{what}; {cure}"
    units = ", ".join([*dimension.powers, *UNITS_HERE.get(si, {})]) or f"as in {dimension.example}"
    if not si:
        return f"{what}; write a number alone, or one with %"
    return f"{what}; units are {units}"


def _pint_target(one_unit: pint.Quantity, si: str) -> str:
    """Return the unit to which Pint must convert a unit so that the result is in the SI unit `si`.

    Pint's radian is the number 1, so that it takes 1 rad/s for 1 Hz, and 1 Hz for 1 rad/s. A
    frequency counts turns: where its unit contains an angle, it is converted to turns per second.

    Raises:
        ValueError: A frequency has another power of an angle or a unit of data, or an angular
            velocity is in hertz.
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

    Raises:
        ValueError: The text is no number with a unit of this dimension, or is out of range.
    """
    text = text.strip()
    match = re.fullmatch(rf"({NUMBER})\s*(.*)", text)
    cure = cure_of(text, NUMBER_CURES)
    if match is None or match[2].startswith((",", "_")):
        what = f'"{text}" does not begin with a number such as 1.5'
        raise ValueError(f"{what}; {cure}" if cure else what)
    digits = match[1]
    unit = match[2].strip()
    if cure and re.match(r"[^A-Za-z°%‰µμ(/[]", unit):
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
        raise ValueError(f"{cure}; {error}" if cure else str(error)) from None


def _out_of_range() -> str:
    return f"magnitudes go from {MIN_MAGNITUDE:g} to {MAX_MAGNITUDE:g} in SI, or are 0"


def _parse_spread(match: re.Match[str], si: str) -> tuple[Decimal, Decimal]:
    """Return both ends of an interval such as "20 t ± 5 %" or "20 t ± 1 t" in the SI unit `si`.

    Args:
        match: Groups of the midpoint, its unit, the half-width, and the unit of the half-width.
        si: SI unit of the quantity.

    Raises:
        ValueError: A number or a unit is wrong.
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

    Raises:
        ValueError: A number or a unit is wrong.
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
        value: Text with a unit, such as "[75, 80] GPa" or "20 t ± 5 %"; a bare number or a list
            of numbers where no unit is needed.
        si: SI unit of the quantity, a key of `QUANTITIES`.

    Returns:
        One number, the numbers of a list in their order, or both ends of a spread.

    Raises:
        ValueError: It is no quantity, its unit is wrong, or it is too large or small.
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
        if cure := cure_of(text, FORM_CURES):
            raise ValueError(f'"{text}" is no quantity as it stands; {cure}') from None
        raise error from None
    floats = tuple(float(x) for x in values)
    if any(x != 0 and not MIN_MAGNITUDE <= abs(x) <= MAX_MAGNITUDE for x in floats):
        raise ValueError(_out_of_range())
    return floats


def parse_number(value: object, si: str) -> float:
    """Return a single crisp quantity in the SI unit `si`.

    Raises:
        ValueError: As for `parse_numbers`, or there are several values.
    """
    values = parse_numbers(value, si)
    if len(values) != 1:
        raise ValueError(f"{len(values)} values stand where one is needed")
    return values[0]


def parse_fuzzy(value: object, si: str) -> FuzzyNumber:
    """Return a quantity in the SI unit `si` as a fuzzy number, whose kind the count of values says.

    Raises:
        ValueError: As for `parse_numbers`; there are more than four values, or they do not rise.
    """
    values = parse_numbers(value, si)
    if isinstance(value, list) and len(value) == 1 and isinstance(value[0], str):
        raise ValueError("a list of one text, as if of a matrix; without brackets it is a value")
    if len(values) > len(SHAPES):
        raise ValueError(f"{len(values)} values stand where one to four that rise are needed")
    if list(values) != sorted(values):
        raise ValueError("values must rise: write the smallest first and the largest last")
    return SHAPES[len(values) - 1](*values)


def parse_fuzzy_in_any_unit(
    value: object, units: Sequence[str] = tuple(QUANTITIES)
) -> tuple[FuzzyNumber, str]:
    """Return a quantity that may be of several dimensions, and the SI unit of its dimension.

    Args:
        value: As for `parse_numbers`.
        units: SI units of the dimensions, keys of `QUANTITIES`; the first that fits is taken.

    Raises:
        ValueError: It is a quantity of none of the dimensions.
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
    for si, reason in zip(units, reasons, strict=True):
        if si and re.search("did you mean|; write", reason):
            raise ValueError(reason)
    examples = [QUANTITIES[si].example for si in units]
    raise ValueError(f"its unit is none of a quantity such as {', '.join(examples[:5])}")
