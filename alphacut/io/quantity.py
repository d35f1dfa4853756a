"""Quantities at the border: "80 GPa", "[75, 80, 85] GPa", "20 t ± 5 %" become SI, and SI text.

One number is crisp, two are an interval, three a triangle (lower, nominal, upper), four a
trapezoid; a spread "± 5 %" is an interval. Units are Pint's, exactly, by way of
decimals.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from decimal import Decimal
from functools import cache
from typing import TYPE_CHECKING, NamedTuple

from alphacut.base.number_text import MINUS, STANDARD_GRAVITY
from alphacut.fuzzy import Crisp, FuzzyNumber, Interval, Trapezoidal, Triangular
from alphacut.io.quantity_cures import number_cure, unit_cure

if TYPE_CHECKING:
    import pint


class Dimension(NamedTuple):
    """A physical dimension: its name, a value as a user writes it, units as powers of ten in SI.

    Pint, whose import takes 0.35 s, is not needed for these units.
    """

    name: str
    example: str
    powers: Mapping[str, int]


QUANTITIES = {
    "": Dimension("number without a unit", "0.3", {}),
    "Pa": Dimension(
        "stress or modulus", "80 GPa", {"Pa": 0, "kPa": 3, "MPa": 6, "GPa": 9, "N/mm^2": 6}
    ),
    "m": Dimension("length", "2.5 m", {"m": 0, "cm": -2, "mm": -3, "µm": -6}),
    "m^4": Dimension("second moment of area", "1e-6 m^4", {"m^4": 0, "cm^4": -8, "mm^4": -12}),
    "kg": Dimension("mass", "20 t", {"kg": 0, "t": 3}),
    "s": Dimension("time", "30 s", {"s": 0, "ms": -3}),
    "m/s": Dimension("velocity", "-0.5 m/s", {"m/s": 0, "mm/s": -3}),
    "m/s^2": Dimension("acceleration", "9.81 m/s^2", {"m/s^2": 0}),
    "N*s/m": Dimension("damping coefficient", "50 N s/m", {"N s/m": 0, "kN s/m": 3}),
    "N*m*s": Dimension("rotational damping coefficient", "0.1 N m s", {"N m s": 0}),
    "N/m": Dimension("stiffness", "30 kN/m", {"N/m": 0, "kN/m": 3, "MN/m": 6}),
    "N": Dimension("force", "0.02 N", {"N": 0, "kN": 3, "MN": 6}),
    "N*s": Dimension("impulse", "0.3 kN s", {}),
    "N*m": Dimension("moment", "12 kN m", {"N m": 0, "kN m": 3}),
    "J": Dimension("energy", "20 kJ", {}),
    "1/s": Dimension("rate", "0.05 1/s", {"1/s": 0, "Hz": 0}),
    "Hz": Dimension("frequency", "1.5 Hz", {"Hz": 0, "1/s": 0}),
    "rad": Dimension("angle", "1.5 rad", {"rad": 0}),
    "rad/s": Dimension("angular velocity", "0.1 rad/s", {"rad/s": 0}),
}
"""Dimensions of quantities by their SI units."""
UNITS_HERE = {
    "": {"": Decimal(1), "%": Decimal("0.01")},
    "m/s^2": {
        "g": Decimal(str(STANDARD_GRAVITY)),
        "mg": Decimal(str(STANDARD_GRAVITY)) / 1000,
        "%g": Decimal(str(STANDARD_GRAVITY)) / 100,
        "gal": Decimal("0.01"),
        "Gal": Decimal("0.01"),
    },
}
"""Units that Pint takes for something else: g is no gram here, and Gal no gallon."""
REFUSED = r"[%‰]|\b(per ?cent|per ?mille|pp[mb]|pixel|px|point|dot|pt|tons?)\b"
"""Units of print and shares, which Pint takes for numbers or lengths, and tons of several kinds."""
LEAST, GREATEST = 1e-36, 1e18
"""Magnitudes in SI beyond which a quantity other than 0 is a slip."""
NUMBER = r"[-+\u2212]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?"
LIST = re.compile(r"\[(.*)\]\s*(.*)", re.DOTALL)
SPREAD = re.compile(rf"({NUMBER})\s*(.*?)\s*(?:±|\+/-)\s*({NUMBER})\s*(.*)")
SINGLE = re.compile(rf"({NUMBER})\s*(.*)")
SHAPES: tuple[Callable[..., FuzzyNumber], ...] = (Crisp, Interval, Triangular, Trapezoidal)
MAX_EXPONENT = 100
"""Power of ten of a number beyond which it is not multiplied by its unit, but refused."""
MAX_CHARACTERS = 1000
"""Characters of a quantity; no longer text is read."""


@cache
def registry() -> pint.UnitRegistry:
    """The one registry of units; decimals, so that 250 cm and 2.5 m become the same float."""
    import pint

    return pint.UnitRegistry(non_int_type=Decimal)


@cache
def factor(unit: str, si: str) -> Decimal:
    """Value of one `unit` in the SI unit `si`, as 1000 of "kN" in "N"; ValueError of others."""
    if unit in UNITS_HERE.get(si, {}):
        return UNITS_HERE[si][unit]
    if unit in QUANTITIES[si].powers:
        return Decimal(10) ** QUANTITIES[si].powers[unit]
    if not unit:
        raise ValueError(f"the unit is missing, such as {QUANTITIES[si].example}")
    if not si or re.search(REFUSED, unit):
        raise ValueError(_with_cure(f'the unit "{unit}" is wrong', unit, si))
    try:
        return _factor_by_pint(unit, si)
    except Exception:  # Pint's parser raises whatever Python's does
        kind = next((x.name for x in QUANTITIES.values() if unit in x.powers), "")
        measured = f"is a unit of {kind}, and" if kind else "is"
        what = f'the unit "{unit}" {measured} no unit of {QUANTITIES[si].name}'
        raise ValueError(_with_cure(what, unit, si)) from None


def _factor_by_pint(unit: str, si: str) -> Decimal:
    """Value of one unit in the SI unit `si` by Pint, whose parser raises whatever Python's does."""
    spelt = re.sub(r"([A-Za-z])([234])(?!\w)", r"\1^\2", unit)
    one_unit = registry().Quantity(Decimal(1), registry().parse_units(spelt))
    return Decimal(one_unit.to(_pint_target(one_unit, si)).magnitude)


def _with_cure(what: str, unit: str, si: str) -> str:
    """What is wrong with a unit, followed by what to write in its place."""

    def fits(spelling: str) -> bool:
        """Whether Pint, or this module, has this unit for the dimension."""
        if not spelling or spelling == unit or re.search(REFUSED, spelling):
            return False
        if spelling in UNITS_HERE.get(si, {}) or spelling in QUANTITIES[si].powers:
            return True
        try:
            return bool(si) and bool(_factor_by_pint(spelling, si))
        except Exception:  # whatever Pint's parser raises
            return False

    units = ", ".join(QUANTITIES[si].powers) or "none, or %"
    return f"{what}; {unit_cure(unit, si, fits) or f'units are {units}'}"


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
    """The number in the SI unit `si` that a quantity such as "80 GPa" states, or ValueError."""
    text = text.strip()
    match = SINGLE.fullmatch(text)
    cure = number_cure(text)
    if match is None or match[2].startswith((",", "_")):
        example = "does not begin with a number such as 1.5"
        raise ValueError(f'"{text}" {example}' + (f"; {cure}" if cure else ""))
    if cure and re.match(r"[^A-Za-z°%‰µμ(/[]", match[2]):
        raise ValueError(f'"{text}" is no number with a unit; {cure}')
    _, _, exponent = match[1].lower().partition("e")
    number = Decimal(0)
    is_moderate = len(exponent) < 6
    if is_moderate:
        number = Decimal(match[1].replace(MINUS, "-"))  # a typographic minus is one
        is_moderate = number == 0 or abs(number.adjusted()) <= MAX_EXPONENT
    if not is_moderate:
        raise ValueError(f"magnitudes go from {LEAST:g} to {GREATEST:g} in SI, or are 0")
    try:
        return number * factor(match[2].strip(), si)
    except ValueError as error:
        raise ValueError(f"{cure}; {error}" if cure else str(error)) from None


def _parse_spread(match: re.Match[str], si: str) -> tuple[Decimal, Decimal]:
    """Both ends of "20 t ± 5 %" or "20 t ± 1 t", which matched `SPREAD`, in the SI unit `si`."""
    number, unit, spread, spread_unit = (text.strip() for text in match.groups())
    middle = _parse_decimal(f"{number} {unit}", si)
    # "2 % ± 1 %" is 1 % to 3 %: there the spread is no share of the middle
    if spread_unit == "%" and (si or unit != "%"):
        half_width = abs(middle) * _parse_decimal(spread, "") / 100
    else:
        half_width = _parse_decimal(f"{spread} {spread_unit}", si)
    return middle - half_width, middle + half_width


def parse_numbers(value: object, si: str) -> tuple[float, ...]:
    """All numbers of a quantity in the SI unit `si`: one, an array, or the ends of a spread.

    `value` is text with a unit, or a bare number or array where no unit is needed.

    Raises:
        ValueError: It is no quantity, its unit is wrong, or it is too large or small.
    """
    if isinstance(value, list):
        value = "[" + ", ".join(map(str, value)) + "]"
    text = str(value).strip()
    if len(text) > MAX_CHARACTERS:
        raise ValueError("this is too long")
    if isinstance(value, bool) or not isinstance(value, str | int | float):
        raise ValueError("this is no quantity")
    if match := LIST.fullmatch(text):
        items = (item.strip() for item in match[1].split(","))
        unit = f" {match[2]}" if match[2] else ""
        values = tuple(_parse_decimal(f"{item}{unit}", si) for item in items)
    elif match := SPREAD.fullmatch(text):
        values = _parse_spread(match, si)
    else:
        values = (_parse_decimal(text, si),)
    floats = tuple(map(float, values))
    if any(x != 0 and not LEAST <= abs(x) <= GREATEST for x in floats):
        raise ValueError(f"magnitudes go from {LEAST:g} to {GREATEST:g} in SI, or are 0")
    return floats


def parse_number(value: object, si: str) -> float:
    """A single crisp quantity, in `si`; ValueError as of `parse_numbers`, or of several values."""
    values = parse_numbers(value, si)
    if len(values) != 1:
        raise ValueError(f"{len(values)} values stand where one is needed")
    return values[0]


def parse_fuzzy(value: object, si: str) -> FuzzyNumber:
    """A quantity in the SI unit `si` as a fuzzy number: the count of its values says which kind.

    ValueError as of `parse_numbers`, of more than four values, or of values that do not rise.
    """
    values = parse_numbers(value, si)
    if isinstance(value, list) and len(value) == 1 and isinstance(value[0], str):
        raise ValueError("a list of one text, as if of a matrix; without brackets it is a value")
    if len(values) > len(SHAPES) or list(values) != sorted(values):
        raise ValueError(f"{len(values)} values stand where one to four that rise are needed")
    return SHAPES[len(values) - 1](*values)


def parse_fuzzy_in_any_unit(value: object) -> FuzzyNumber:
    """A quantity in the SI unit of `QUANTITIES` that its own unit fits, crisp or fuzzy."""
    reasons = []
    for si in QUANTITIES:
        try:
            return parse_fuzzy(value, si)
        except ValueError as error:
            reasons.append(str(error))
    raise ValueError(reasons[0])
