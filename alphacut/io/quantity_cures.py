"""What to write in place of a quantity that is not understood, as "1,5 GPa" or "30 KN/m"."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator

NUMBER_CURES = {
    r"^[-+]?\d{1,3}(?:[,'’_\s]\d{3})+(?!\d)": "write thousands without a separator, as 25000",
    r"\d,\d": "write a decimal point, as 1.5; several values stand in brackets, as [1, 2]",
    r"^[-+]?[\d.]*\s*[x×*·⋅]?\s*10\s*(?:\^|\*\*|[⁻⁰-⁹])": "write a power of ten as 3e6",
    r"^\d+:\d": "write a time in one unit, as 90 s",
    r"^\d+\s*/\s*\d": "write a fraction as a decimal number",
    r"\d\s*\D{0,9}\+\s*/?\s*[-−]|(?i:plus)": 'write a spread as "5 m ± 1 m" or "5 m ± 10 %"',
    r"^\[[^\]]*[;\s][^,\]]*\]|^\(": 'write several values as "[5, 6] m", with commas',
    r"^\[[^\]]*$": "close the bracket",
    r"\d\s*(?:[-–—;…]|\.\.+|to|bis)\s*\d": 'write a range as "[5, 6] m"',
    r"^[<>≤≥~≈]|(?i:^(?:about|ca|max|min))": 'write a value, or a range as "[5, 6] m"',
    r"(?i:^[-+]?(?:nan|inf))": "write a finite number",
    r"^[A-Za-z%]+\s*[-+.\d]": "write the number first, as 80 GPa",
    r"^0[xX]": "write a decimal number",
}
"""Cure by a pattern in the text of a quantity; the first that fits holds."""
UNIT_CURES = {
    r"(?i)\b(?:us |short |long |metric )?tons?\b|to": "write t (1000 kg), short_ton or long_ton",
    r"(?i)per ?cent|pct\.?|perc\.?|prozent": "write %",
    r"(?i)‰|per ?mille": "write 0.1 % in place of 1 ‰",
    r"[\"”″]": "write in for inches",
    r"['’′]": "write ft for feet",
}
"""Cure by a pattern in a unit that is not understood."""
SPELLINGS = {
    "cps": "Hz",
    "hertz": "Hz",
    "sek": "s",
    "gr": "g",
    "knm": "kN m",
    "kns": "kN s",
    "mnm": "MN m",
    "mns": "MN s",
    "nm": "N m",
    "ns": "N s",
    "nms": "N m s",
    "rev": "turn",
    "u": "turn",
    "psf": "lbf/ft^2",
    "pcf": "lbf/ft^3",
    "kgs": "kg",
    "lbs": "lb",
    "mn": "MN",
    "mpa": "MPa",
    "kg": "kg",
}
"""Pint's spelling of units by their small letters, where small letters alone do not give it."""
USUAL = (
    *("Pa", "kPa", "MPa", "GPa", "N", "kN", "MN", "GN", "m", "mm", "cm", "km", "s", "ms", "min"),
    *("h", "kg", "t", "Hz", "kHz", "g", "gal", "rad", "deg", "rpm", "ft", "in", "lb", "lbf", "kip"),
    *("ksi", "psi", "J", "kJ", "MJ", "W", "kgf", "turn"),
)
"""Units as Pint spells them; a unit with other capitals is told these."""


def number_cure(text: str) -> str:
    """Return what to write in place of a quantity without a plain number; empty if unknown."""
    cures = (cure for pattern, cure in NUMBER_CURES.items() if re.search(pattern, text))
    return next(cures, "")


def unit_cure(unit: str, si: str, fits: Callable[[str], bool]) -> str:
    """Return what to write in place of a unit that is none of a dimension; empty if unknown.

    Args:
        unit: The unit as it was written.
        si: SI unit of the dimension.
        fits: Whether a unit is one of the dimension.
    """
    for pattern, cure in UNIT_CURES.items():
        if re.fullmatch(pattern, unit.strip()):
            return cure
    if spelt := next(filter(fits, _spellings(unit)), ""):
        return f"did you mean {spelt}?"
    if si == "kg" and re.fullmatch(r"[kMG]?N|kip|lbf", unit):
        return "a weight over 9.80665 m/s^2 is a mass"
    return ""


def _spellings(unit: str) -> Iterator[str]:
    """Yield other spellings of a unit: usual capitals, without brackets, forces for masses."""
    by_small_letters = {name.lower(): name for name in USUAL} | SPELLINGS
    bare = re.sub(r"[\[\](){}]", "", unit).strip()
    yield bare

    def usual(match: re.Match[str]) -> str:
        return by_small_letters.get(match[0].lower(), match[0])

    spelt = re.sub(r"[A-Za-z]+", usual, bare)
    yield spelt
    yield re.sub(r"(?<=[A-Za-z])\s*[-.·]\s*(?=[A-Za-z])", " ", spelt)
    yield re.sub(r"\b(kg|lb)\b", r"\1f", spelt)
