"""Units as files of records write them, and their factors to SI."""

from __future__ import annotations

import re

from alphacut.base.number_text import STANDARD_GRAVITY

METRES = {
    "nm": 1e-9, "um": 1e-6, "µm": 1e-6, "μm": 1e-6, "mm": 1e-3, "cm": 1e-2, "dm": 0.1, "m": 1.0,
    "km": 1e3, "in": 0.0254, "inch": 0.0254, "inches": 0.0254, "ft": 0.3048, "foot": 0.3048,
    "feet": 0.3048,
}  # fmt: skip
SECONDS = {
    "ns": 1e-9, "us": 1e-6, "µs": 1e-6, "μs": 1e-6, "ms": 1e-3, "msec": 1e-3, "s": 1.0, "sec": 1.0,
    "secs": 1.0, "second": 1.0, "seconds": 1.0, "min": 60.0, "minutes": 60.0, "h": 3600.0,
}  # fmt: skip
NEWTONS = {
    "N": 1.0, "kN": 1e3, "MN": 1e6, "mN": 1e-3, "kgf": STANDARD_GRAVITY, "lbf": 4.4482216152605,
    "kip": 4448.2216152605,
}  # fmt: skip
GRAVITY_UNIT = re.compile(
    r"(10\s*\*?|milli|m|%|‰)?\s*g(?:'s|s)?\s*(/\s*10|\*\s*10)?", re.IGNORECASE
)
GRAVITY_PREFIXES = {"": 1.0, "10": 10.0, "milli": 1e-3, "m": 1e-3, "%": 1e-2, "‰": 1e-3}
GALS = {"gal": 1e-2, "gals": 1e-2, "mgal": 1e-5}
_SECOND = r"s(?:ec)?"
PER_SECOND_SQUARED = re.compile(
    rf"([a-zµμ]+?)\s*(?:/\s*{_SECOND}\s*/\s*{_SECOND}"
    rf"|(?:/\s*{_SECOND}|[\s*·]\s*s)\s*(?:\^|\*\*)?\s*[-−]?[2²])",
    re.IGNORECASE,
)
"""A length over a second squared, as cm/s^2, CM/SEC**2, cm/s/s or cm s-2."""
PER_SECOND = re.compile(rf"([a-zµμ]+?)\s*(?:/\s*{_SECOND}|[\s*·]\s*s\s*(?:\^|\*\*)?\s*[-−]1)", re.I)
OTHER_UNITS = {
    "a number of counts, which the sensor's sensitivity turns into an acceleration": re.compile(
        r"counts?|cnts?|digits?|bits?|lsb", re.I
    ),
    "a voltage, which the sensor's sensitivity turns into an acceleration": re.compile(
        r"[kmµμ]?v|volts?", re.I
    ),
    "a pressure": re.compile(r"[kmgh]?pa|m?bar|psi|ksi", re.I),
    "an angle": re.compile(r"m?rad|deg|degrees?|°", re.I),
}
"""Units of other quantities that instruments record, by what the quantity is called."""


def seconds_of(unit: str) -> float:
    """Return the value of a unit of time in s, whatever its capitals; 0 of other units."""
    return SECONDS.get(unit, SECONDS.get(unit.lower(), 0.0))


def acceleration_factor(unit: str) -> float | None:
    """Factor to m/s² of a unit of acceleration as files of records write it; None if unknown."""
    text = unit.strip().strip("()[]").strip().rstrip(".")
    if match := GRAVITY_UNIT.fullmatch(text):
        prefix = (match[1] or "").rstrip(" *").lower()
        tenfold = {"": 1.0, "/": 0.1, "*": 10.0}[(match[2] or "")[:1]]
        return STANDARD_GRAVITY * GRAVITY_PREFIXES[prefix] * tenfold
    if match := PER_SECOND_SQUARED.fullmatch(text):
        return METRES.get(match[1].lower())
    return GALS.get(text.lower())


def other_quantity(unit: str) -> str:
    """Name of the quantity, not an acceleration, that a unit is of; empty if it is not known."""
    text = unit.strip().strip("()[]").strip().rstrip(".")
    if text.lower() in METRES:
        return "a displacement"
    if (match := PER_SECOND.fullmatch(text)) and match[1].lower() in METRES:
        return "a velocity"
    if text in NEWTONS:
        return "a force"
    return next((name for name, pattern in OTHER_UNITS.items() if pattern.fullmatch(text)), "")
