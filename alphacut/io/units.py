"""Units at the border: what the user writes becomes SI, exactly, by way of decimals."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from decimal import Decimal
from functools import cache
from statistics import median
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pint

QUANTITIES = {  # SI unit: (name of the quantity, a value as a user would write it)
    "": ("number without a unit", "0.3"),
    "Pa": ("stress or modulus", "80 GPa"),
    "m": ("length", "2.5 m"),
    "m^2": ("area", "0.01 m^2"),
    "m^4": ("second moment of area", "1e-6 m^4"),
    "kg": ("mass", "20 t"),
    "kg/m": ("mass per length", "12 t/m"),
    "kg/m^3": ("density", "2500 kg/m^3"),
    "s": ("time", "30 s"),
    "m/s": ("velocity", "-0.5 m/s"),
    "m/s^2": ("acceleration", "9.81 m/s^2"),
    "N*s/m": ("damping coefficient", "50 N s/m"),
    "N*m*s": ("rotational damping coefficient", "0.1 N m s"),
    "N/m": ("stiffness", "30 kN/m"),
    "N": ("force", "0.02 N"),
    "1/s": ("rate", "0.05 1/s"),
    "rad": ("angle", "1.5 rad"),
    "rad/s": ("angular velocity", "0.1 rad/s"),
}

STANDARD_GRAVITY = Decimal("9.80665")
"""In m/s², by the third General Conference on Weights and Measures, 1901."""

SIZES = {"Pa": (1e-6, 1e18), "m^2": (1e-24, 1e15), "m^4": (1e-36, 1e12)}
"""Least and greatest magnitude of a quantity other than 0, in SI; what lies beyond is a slip."""
ORDINARY = (1e-15, 1e15)
"""The same of all other quantities with a unit."""
COUNTED = (0.0, 1e18)
"""The same of numbers without a unit."""

# Units that the page on the case format lists; Pint's others of the same dimension are taken too.
ACCEPTED = {
    "Pa": ("Pa", "kPa", "MPa", "GPa", "N/mm^2", "N/m^2", "kN/cm^2", "psi", "ksi"),
    "m": ("m", "mm", "cm", "um", "km", "inch", "ft"),
    "m^2": ("m^2", "cm^2", "mm^2"),
    "m^4": ("m^4", "cm^4", "mm^4"),
    "kg": ("kg", "t", "g"),
    "kg/m": ("kg/m", "t/m"),
    "kg/m^3": ("kg/m^3", "t/m^3", "g/cm^3"),
    "s": ("s", "ms", "min"),
    "m/s": ("m/s", "mm/s", "cm/s", "km/h"),
    "m/s^2": ("m/s^2", "cm/s^2", "mm/s^2", "g"),
    "N*s/m": ("N s/m", "kN s/m", "kg/s"),
    "N*m*s": ("N m s", "kN m s"),
    "N/m": ("N/m", "kN/m", "N/mm"),
    "N": ("N", "kN", "MN"),
    "1/s": ("1/s", "Hz"),
    "rad": ("rad", "mrad", "deg"),
    "rad/s": ("rad/s", "deg/s"),
}


def size_problem(value: float, si: str) -> str:
    """Why a quantity is smaller or larger than anything that is built; empty if it is not."""
    least, greatest = SIZES.get(si, ORDINARY if si else COUNTED)
    if value == 0 or least <= abs(value) <= greatest:
        return ""
    unit = f" {si}" if si else ""
    return (
        f"{value:.3g}{unit} is too {'large' if abs(value) > greatest else 'small'}: magnitudes go"
        f" from {least:g} to {greatest:g}{unit}, or are 0; check the unit"
    )


# Sizes of everyday units in SI, so that a case of these starts without Pint's registry.
EVERYDAY = {
    "Pa": {"Pa": "1", "kPa": "1e3", "MPa": "1e6", "GPa": "1e9"},
    "m": {"m": "1", "mm": "1e-3", "cm": "1e-2"},
    "m^2": {"m^2": "1"},
    "m^4": {"m^4": "1"},
    "kg": {"kg": "1", "t": "1e3"},
    "s": {"s": "1", "ms": "1e-3"},
    "m/s": {"m/s": "1"},
    "m/s^2": {"m/s^2": "1"},
    "N*s/m": {"N s/m": "1", "kN s/m": "1e3"},
    "N/m": {"N/m": "1", "kN/m": "1e3"},
    "N": {"N": "1", "kN": "1e3"},
    "1/s": {"1/s": "1", "Hz": "1"},
    "rad": {"rad": "1"},
    "rad/s": {"rad/s": "1"},
}


PRINTED = r"pixel|px\b|\b(pel|dot|pt)s?\b|pica|point|didot|cicero|\b[pb]p\b"
"""Units of print and screens, which Pint takes for 1/96 inch, 1/72 inch and the like."""

SHARES = r"[%‰]|\bper ?cent\b|\bper ?mille\b|\bpp[mb]\b"
"""Shares, by which Pint takes 5 % MPa for 0.05 MPa."""

# units that are others than were meant
MEANT = {("m/s^2", "G"): "g", ("s", "m"): "min", ("kg", "T"): "t", ("Pa", "g"): "GPa"}


@cache
def registry() -> pint.UnitRegistry:
    """The one unit registry; decimals, so that 250 cm and 2.5 m become the same float."""
    import pint

    return pint.UnitRegistry(non_int_type=Decimal)


@cache
def factor(unit: str, si: str) -> Decimal:
    """Size of one `unit` in `si`.

    Raises:
        ValueError: The unit is unknown, or measures something else.
    """
    if not si:
        if unit in ("", "1"):
            return Decimal(1)
        if unit == "%":
            return Decimal("0.01")
        raise ValueError(f'the unit "{unit}" is wrong')
    if not unit:
        raise ValueError("the unit is missing")
    if share := re.search(SHARES, unit):
        raise ValueError(f'"{unit}": {share[0]} is a share, no part of a unit; write "20 t ± 5 %"')
    if (si, unit) == ("m/s^2", "g"):  # standard gravity, no gram
        return STANDARD_GRAVITY
    if (si, unit.lower()) == ("m/s^2", "gal"):  # cm/s², no gallon
        return Decimal("0.01")
    if unit in EVERYDAY.get(si, {}):
        return Decimal(EVERYDAY[si][unit])
    if si == "rad" and not re.search("rad|deg|turn|rev|arc", unit):  # pint: % is an angle
        raise ValueError(f'the unit "{unit}" is wrong')
    if re.search(PRINTED, unit, re.IGNORECASE):
        raise ValueError(f'"{unit}" is no length; give the length of one pixel, such as "0.5 µm"')
    import pint

    if re.search(r"\btons?\b", unit):
        raise ValueError(f'the unit "{unit}" means several things; write t for 1000 kg, or lb')
    # pint's tokeniser raises whatever Python's does on text that is not a unit at all
    try:
        one = registry().Quantity(
            Decimal(1), registry().parse_units(re.sub(r"([A-Za-z])([234])(?!\w)", r"\1^\2", unit))
        )
        return Decimal(one.to(si).magnitude)
    except (pint.UndefinedUnitError, pint.DimensionalityError):
        close = next(
            (name for name in ACCEPTED.get(si, ()) if name.lower() == unit.lower()),
            MEANT.get((si, unit), ""),
        )
        hint = f"; did you mean {close}?" if close else weight(unit, si)
        raise ValueError(f'the unit "{unit}" is wrong{hint}') from None
    except Exception:
        raise ValueError(f'the unit "{unit}" cannot be read') from None


def weight(unit: str, si: str) -> str:
    """Hint where a mass is given as a force, or a force as a mass."""
    other = {"kg": "N", "N": "kg"}.get(si)
    try:
        size = None if other is None else float(factor(unit, other))
    except ValueError:
        return ""
    if size is None:
        return ""
    g = float(STANDARD_GRAVITY)
    if si == "kg":
        return f": it is a force; what weighs 1 {unit} has a mass of {size / g:.4g} kg"
    return f": it is a mass, which weighs {size * g:.4g} N"


PREFIXES = {9: "G", 6: "M", 3: "k", 0: "", -3: "m", -6: "µ", -9: "n"}
MINUS = "\u2212"
PREFIXED = ("m", "m/s", "m/s^2", "N", "N/m", "Pa", "s", "rad", "W", "J")


def engineering(value: float, si: str, *, digits: int = 4, beside: float = 0.0) -> str:
    """Value in `si` for people, ``−3.590 MN``, with the prefix of `beside` if larger.

    A unit that takes no prefix stands as it is.
    """
    if si not in PREFIXED or not math.isfinite(value) or not (value or beside):
        short = f"{value:.{digits}g}"
        told = f"{float(short):.0f}" if 1e4 <= abs(value) < 1e7 else short
        return f"{told} {si}".strip().replace("-", MINUS)
    largest = float(f"{max(abs(value), abs(beside)):.{digits}g}")
    if not 1e-12 <= largest < 1e15:
        return f"{value:.{digits}g} {si}".replace("-", MINUS)
    exponent = min(9, max(-9, 3 * math.floor(math.log10(largest) / 3)))
    scaled = float(f"{value:.{digits}g}") / 10.0**exponent
    places = max(0, digits - 1 - math.floor(math.log10(abs(scaled)))) if scaled else 0
    number = f"{scaled:.{places}f}" if places < digits + 3 else f"{scaled:.{digits}g}"
    return f"{number} {PREFIXES[exponent]}{si}".replace("-", MINUS)


def span(values: Iterable[float], unit: str) -> str:
    """Least and greatest of values in SI, and the median of more than two, in words."""
    told = sorted(map(float, values))
    ends = [engineering(x, unit) for x in (told[0], median(told), told[-1])]
    return f"from {ends[0]} to {ends[2]}" + f", median {ends[1]}" * (len(told) > 2)


def fixed(value: float, places: int) -> str:
    """A number with so many decimals, or with six digits where these would leave two or fewer."""
    return f"{value:.{places}f}" if not 0 < abs(value) < 10.0 ** (2 - places) else f"{value:.6g}"


def largest_by_unit(values: Iterable[tuple[float, str]]) -> dict[str, float]:
    """Largest magnitude among values of the same unit, for `engineering`."""
    found: dict[str, float] = {}
    for value, si in values:
        found[si] = max(found.get(si, 0.0), abs(value))
    return found


def axis_prefix(largest: float, si: str) -> tuple[float, str]:
    """Factor and unit for an axis whose values reach `largest`."""
    if si not in PREFIXED or not math.isfinite(largest) or largest <= 0 or 0.1 <= largest < 1000:
        return 1.0, si
    exponent = min(9, max(-9, 3 * math.floor(math.log10(largest) / 3)))
    return 10.0**-exponent, f"{PREFIXES[exponent]}{si}"


def shown(value: float, unit: str, si: str) -> float:
    """A value in `si`, in `unit`, for people."""
    return float(Decimal(repr(float(value))) / factor(unit, si))
