"""What to write in place of a quantity that is not understood, as "1,5 GPa" or "30 KN/m"."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Iterable, Iterator
from difflib import get_close_matches
from functools import cache
from pathlib import Path

from alphacut.base.errors import cure_of

UNITS = tomllib.loads(Path(__file__).with_name("units.toml").read_text(encoding="utf-8"))
"""Dimensions with their units, and what people write for units."""


def number_cure(text: str) -> str:
    """Return what to write in place of a number, such as "1,5 GPa", by its pattern; empty if none.

    Whether the text is understood is not looked at: the caller shows the cure only if it is not.
    """
    # The first pattern that is found holds. So that of thousands stands before that of a decimal
    # comma, since "25,000" has both; likewise the one of several values before a decimal comma.
    cures = {
        r"^[-+]?\d{1,3}(?:[,'’_\s]\d{3})+(?!\d)": "write thousands without a separator, as 25000",
        r"^[-+\d.]+\s*,\s+[-+\d.]": (
            "several values of one quantity stand in brackets, as [19, 20, 21] t; those of several"
            " floors or storeys are texts of their own"
        ),
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
    return cure_of(text, cures)


def form_cure(text: str) -> str:
    """Return how to write several values or a spread that has a wrong form; empty if none is found.

    A wrong form has its unit or its brackets in a wrong place, such as "[5, 6 m]" or "5 ± 10 %".
    "[5 m, 6 m]" is right.
    """
    cures = {
        r"^\[[^\]]*(?:±|\+/-)": 'write a spread without brackets, as "5 m ± 1 m" or "5 m ± 10 %"',
        r"^\[[-+\d.eE,\s]*[A-Za-zµμ°%][^,\]]*\]$": (
            'write the unit behind the bracket, as "[5, 6] m"'
        ),
        r"^[-+\d.eE]+\s*(?:±|\+/-)": 'write the unit behind the first number, as "5 m ± 10 %"',
        r"(?:±|\+/-)\s*[\d.]+$": 'write a spread with % or a unit, as "5 m ± 10 %" or "5 m ± 1 m"',
    }
    return cure_of(text, cures)


def unit_cure(unit: str, si: str, *, fits: Callable[[str], bool], known: Iterable[str]) -> str:
    """Return what to write in place of a unit that does not fit a dimension.

    It is a clause such as "did you mean kN?" or "write ft for feet", and empty if no unit is alike.

    Args:
        unit: The unit as it was written.
        si: SI unit of the dimension.
        fits: Function that tells whether a spelling is a unit of the dimension.
        known: Common units of the dimension.
    """
    cures = {
        r"(?i)^(?:(?:us |short |long |metric )?tons?|to)$": (
            "write t (1000 kg), short_ton or long_ton"
        ),
        r"(?i)^(?:per ?cent|pct\.?|perc\.?|prozent)$": "write %",
        r"(?i)^(?:‰|per ?mille)$": "write 0.1 % in place of 1 ‰",
        r"^[\"”″]$": "write in for inches",
        r"^['’′]$": "write ft for feet",
    }
    if si == "N" and re.fullmatch(r"(?i)(?:us |short |long |metric )?t(?:o|ons?|onnes?)?", unit):
        return "write tf, the weight of 1000 kg, or kN"
    if cure := cure_of(unit.strip(), cures):
        return cure
    # A spelling is offered only where it fits the dimension: "KN" is kN for a force, and no hint
    # for a length.
    for spelling in _spellings(unit):
        if spelling != unit and fits(spelling):
            return f"did you mean {spelling}?"
    if si == "kg" and re.fullmatch(r"[kMG]?N|kip|lbf", unit):
        return "a weight over 9.80665 m/s^2 is a mass"
    if similar := get_close_matches(unit, [*known], n=1):
        return f"did you mean {similar[0]}?"
    return ""


def _spellings(unit: str) -> Iterator[str]:
    """Yield other spellings of a unit, the most likely one first.

    In this order they are: the unit without brackets; the usual symbol for each word, as "kN/m" of
    "KN/M"; blanks between the symbols, as "kN m" of "kN-m"; all as one word, as "kN" of
    "kilo newtons"; forces in place of masses, as "kgf" of "kg"; and no powers. A spelling may be
    the unit itself, no unit at all, or come twice.
    """
    bare = re.sub(r"[\[\](){}]", "", unit).strip(" .")
    yield bare
    with_symbols = re.sub(r"[A-Za-zµ]+", lambda match: _usual_symbol(match[0]), bare)
    yield with_symbols
    yield re.sub(r"(?<=[A-Za-z])\s*[-.·]\s*(?=[A-Za-z])", " ", with_symbols)
    yield _usual_symbol(bare.replace(" ", ""))
    # Old tables state forces and stresses in kg and kg/cm².
    yield re.sub(r"\b(kg|lb)\b", r"\1f", with_symbols)
    yield re.sub(r"(?<=[A-Za-z])(?:\^|\*\*)?[23²³]", "", with_symbols)


def _usual_symbol(word: str) -> str:
    """Return the symbol of a unit by its name or its letters, as kN of "KN" or "kilonewtons".

    Capitals do not matter, a plural s is dropped, and a name may have a slip, as "newtno". A word
    that is like no unit is returned as it is.
    """
    small = word.lower()
    symbols = _symbols_by_letters()
    singular = small if small in symbols else small.removesuffix("s")
    if singular in symbols:
        return symbols[singular]
    close = get_close_matches(small, symbols, n=1, cutoff=0.75)
    # Two letters, or words with another first letter, are alike by chance.
    is_close = len(small) > 2 and bool(close) and close[0][0] == small[0]
    return symbols[close[0]] if is_close else word


@cache
def _symbols_by_letters() -> dict[str, str]:
    """Return the usual symbols of units, as Pint spells them, by small letters.

    The keys are the symbols themselves, other spellings and abbreviations, and names with or
    without a prefix, as "kn", "knm" and "kilonewton" for "kN", "kN m" and "kN".
    """
    usual = (
        "Pa kPa MPa GPa N kN MN GN m mm cm km s ms min h kg t Hz kHz g gal rad deg rpm ft in lb lbf"
        " kip ksi psi J kJ MJ W kgf turn"
    )
    symbols = {symbol.lower(): symbol for symbol in usual.split()}
    symbols |= UNITS["spellings"]
    for prefix, prefix_symbol in UNITS["prefixes"].items():
        for name, symbol in UNITS["names"].items():
            symbols[prefix + name] = prefix_symbol + symbol
    return symbols
