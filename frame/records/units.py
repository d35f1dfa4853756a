"""Units as files of records write them, and their factors to SI."""

from __future__ import annotations

import re

from alphacut.base.number_text import STANDARD_GRAVITY
from alphacut.base.stated import METRES

# Seconds in a unit of time.
SECONDS = {
    "ns": 1e-9, "us": 1e-6, "µs": 1e-6, "μs": 1e-6, "ms": 1e-3, "msec": 1e-3, "s": 1.0, "sec": 1.0,
    "secs": 1.0, "second": 1.0, "seconds": 1.0, "min": 60.0, "minutes": 60.0, "h": 3600.0,
    "milliseconds": 1e-3, "microseconds": 1e-6, "millisecond": 1e-3, "microsecond": 1e-6,
}  # fmt: skip
# Newtons in a unit of force. Capitals count, since mN and MN differ by 1e9.
NEWTONS = {
    "N": 1.0, "kN": 1e3, "MN": 1e6, "kgf": STANDARD_GRAVITY, "lbf": 4.4482216152605,
    "kip": 4448.2216152605,
}  # fmt: skip
# A length over a second squared: "cm/s^2", "CM/SEC**2", "cm/s/s", "cm/(s^2)", "cm s-2" or "cm.s-2".
_SECOND = r"s(?:ec(?:onds?)?)?"
_SQUARE = r"(?:\^|\*\*)?\s*[-−]?\{?[2²]\}?"
PER_SECOND_SQUARED = (
    rf"(?P<length>{'|'.join(sorted(METRES, key=len, reverse=True))})\s*(?:/\s*{_SECOND}\s*/\s*"
    rf"{_SECOND}|_?p?s\^?2|(?:/\s*\(?\s*{_SECOND}|[\s*·.]\s*s)\s*{_SQUARE}\)?)"
)
GALS = {"gal": 1e-2, "gals": 1e-2, "mgal": 1e-5, "mgals": 1e-5}


def seconds_of(unit: str) -> float:
    """Return the value of a unit of time in s, whatever its capitals; 0 of other units."""
    return SECONDS.get(unit, SECONDS.get(unit.lower(), 0.0))


def acceleration_factor(unit: str) -> float | None:
    """Return the factor to m/s² of a unit of acceleration as files of records write it.

    Multiples of g are "mg", "%g", "g/10" and "10*g"; a length over a second squared may be
    "cm/s^2", "CM/SEC**2", "cm/s/s" or "cm s-2". Capitals and brackets around the unit do not
    matter. Other units, and an empty one, give None.
    """
    text = _without_brackets(unit)
    multiple = r"(10\s*\*?|milli-?|m|%|‰)?\s*g(?:'s|s)?\s*(/\s*10|\*\s*10)?"
    if match := re.fullmatch(multiple, text, re.IGNORECASE):
        prefixes = {"": 1.0, "10": 10.0, "milli": 1e-3, "m": 1e-3, "%": 1e-2, "‰": 1e-3}
        prefix = (match[1] or "").rstrip(" *-").lower()
        tenfold = {"": 1.0, "/": 0.1, "*": 10.0}[(match[2] or "")[:1]]
        return STANDARD_GRAVITY * prefixes[prefix] * tenfold
    if match := re.fullmatch(PER_SECOND_SQUARED, text, re.IGNORECASE):
        return METRES.get(match["length"].lower())
    return GALS.get(text.lower())


def other_quantity(unit: str) -> str:
    """Return the quantity that a unit is of, if it is none of acceleration, as "a velocity".

    Forces are told by "N", "kN" … with their capitals; displacements, velocities, counts, voltages,
    pressures and angles by their units in any capitals. Brackets around the unit do not matter. The
    result is empty for other units, such as those of acceleration.
    """
    text = _without_brackets(unit)
    if text in NEWTONS:
        return "a force"
    length = "|".join(METRES)
    patterns = {
        "a displacement": length,
        "a velocity": rf"(?:{length})\s*(?:/\s*s(?:ec)?|[\s*·]\s*s\s*(?:\^|\*\*)?\s*[-−]1)|kines?",
        "a number of counts, which the sensor's sensitivity turns into an acceleration": (
            r"counts?|cnts?|digits?|bits?|lsb"
        ),
        "a voltage, which the sensor's sensitivity turns into an acceleration": r"[kmµμ]?v|volts?",
        "a pressure": r"[kmgh]?pa|m?bar|psi|ksi",
        "an angle": r"m?rad|deg|degrees?|°",
    }
    for name, pattern in patterns.items():
        if re.fullmatch(pattern, text, re.IGNORECASE):
            return name
    return ""


def _without_brackets(unit: str) -> str:
    """Return a unit without brackets and blanks around it, and without points at its end."""
    return unit.strip().strip("()[]").strip().rstrip(".")
