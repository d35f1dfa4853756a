"""What lines of text state of a record, wherever they stand: units, steps, counts, quantities."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from math import isclose

from alphacut.base.errors import RefusedError
from alphacut.base.stated import Stated
from alphacut.frame.records.text_file import TextFile
from alphacut.frame.records.units import (
    GALS,
    PER_SECOND_SQUARED,
    acceleration_factor,
    other_quantity,
    seconds_of,
)

_NUMBER = r"(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eEdD][-+]?\d+)?)"
# Words in place of symbols, as "centimeters per second squared".
_SPELLED = {
    r"centi-?met(?:er|re)s?": "cm",
    r"milli-?met(?:er|re)s?": "mm",
    r"\bmet(?:er|re)s?": "m",
    r"\s*\bper\s+(?:square\s+sec(?:ond)?|sec(?:ond)?s?[\s-]*(?:squared|per[\s-]*sec(?:ond)?))": (
        "/s^2"
    ),
    r"\s+per\s+": "/",
    r"\b(?:standard|fractions?\s+of|units\s+of)\s+gravity": "(g)",
}
# A unit of acceleration that cannot be something else; not part of a quotient such as V/(m/s^2).
_UNIT = (
    rf"(?<![a-z0-9/])(?<!/\()(?:{PER_SECOND_SQUARED}|{'|'.join(GALS)}|milli-?g|mg|%\s?g"
    r"|g\s?/\s?10|10\s?\*\s?g)(?![a-z0-9]|\s*/)"
)
# The letter g is the unit in brackets, behind "units" or "in", or at the end of such a line.
_G = (
    r"[\[(]\s*(g'?s?)\s*[\])]|\bunits?\b[^a-z]*(?:(?:of|are|is|in)\b)?\W*(g'?s?)\b(?!\s*/|\w)"
    r"|\bin\s+\W?(g'?s?)\b(?!\s*/)|\b(?:acc\w*|ordinates?|amplitudes?|values?|data)\W+(g'?s?)\W*$"
)
_OTHER_UNIT = r"\bunits?\b\s*(?:(?:of|are|is|in)\b)?[\s:=]*[\[(]?([^\s,;\])]+)"
_FACTOR = (
    r"(?:[x×*·]\s*|\b)10\s*(?:\^|\*\*|[-−⁻])\s*\(?[-−⁻]?\s*[\d¹²³⁴⁵⁶⁷⁸⁹]|\b1\.?0*e[-+]?\d"
    r"|[x×]\s*1000*\b"
)
_INTERVAL = (
    r"(?:\b(?:sampl\w*|time|data|digiti[sz]\w*)[\s_-]*(?:interval|step|period|spacing|increment)s?"
    r"|\b(?:time|sampl)\w*|\b(?:interval|step|increment)s?|(?<![a-z])d(?:elta)?[\s_-]*t|Δt|\bdelta)"
)
_RATE = (
    r"(?:\b(?:sampl\w*|digiti[sz]\w*|acquisition|data)[\s_-]*(?:rate|freq\w*)|(?<![a-z])fs\b"
    r"|\bsamples?/s(?:ec(?:ond)?)?|\bsps|\bsampled)"
)
_BEHIND = r"[\s_]*(?:[\[(](?P<before>[^\])]*)[\])])?[\s:=@\"]*(?:(?:is|of|at)\s+)?"


@dataclass
class TextStatements:
    """What some lines of a file state.

    Args:
        units: Units of acceleration, as factors to m/s²; those of peaks alone stand last.
        steps: Times between samples, in s.
        counts: Numbers of samples.
        quantities: Lines that name another quantity than an acceleration, by its name.
        factors: Lines with a power of ten beside a unit.
        time_units: Units of times, as factors to s.
    """

    units: list[Stated] = field(default_factory=list)
    peak_units: list[Stated] = field(default_factory=list)
    steps: list[Stated] = field(default_factory=list)
    counts: list[Stated] = field(default_factory=list)
    quantities: list[tuple[str, int]] = field(default_factory=list)
    factors: list[int] = field(default_factory=list)
    time_units: list[Stated] = field(default_factory=list)

    @classmethod
    def of(cls, file: TextFile, lines: Iterable[int]) -> TextStatements:
        """Return what the lines with these indices state."""
        found = cls()
        for row in lines:
            text = file.lines[row]
            for pattern, symbol in _SPELLED.items():
                text = re.sub(pattern, symbol, text, flags=re.IGNORECASE)
            place = f"line {file.line_number(row)}"
            found._add_units(text, row, place)
            found.steps += _steps(text, place)
            pattern = (
                r"\b(?:npts?|ndata|n_?samples|(?:n(?:umber|o|um|r)?\.?\s*(?:of)?\s*)?"
                r"(?:data|points|samples|values|pts))\s*[:=]\s*(\d+)\b(?!\.)"
            )
            for match in re.finditer(pattern, text, re.IGNORECASE):
                found.counts.append(Stated(float(match[1]), f"{match[1]} samples", place))
        return found

    def _add_units(self, text: str, row: int, place: str) -> None:
        """Add the units, the factors and the other quantities that a line names."""
        is_of_sensor = re.search(
            r"sensitiv|full.?scale|\brange|clip|trigger|thresh|noise|resolution|\bgain|gravity"
            r"|\bg\s*=\s*9|1\s*g\s*=",
            text,
            re.IGNORECASE,
        )
        if is_of_sensor and not re.search(r"\bunits?\b", text, re.IGNORECASE):
            return
        is_peak = re.search(r"\b(?:peak|pg[avd]|pk|max\w*|min\w*)\b", text, re.IGNORECASE)
        units = [match[0] for match in re.finditer(_UNIT, text, re.IGNORECASE)]
        for match in re.finditer(_G, text, re.IGNORECASE):
            units += filter(None, match.groups())
        into = self.peak_units if is_peak else self.units
        for unit in units:
            into.append(Stated(acceleration_factor(unit) or 0.0, unit, place))
        if units and not is_peak and re.search(_FACTOR, text, re.IGNORECASE):
            self.factors.append(row)
        of_times = r"\b(?:time|abscissa)s?\b[^,;]*?(?:\bin\b|[\[(:=])\s*([a-zµμ]+)"
        found = re.search(of_times, text, re.IGNORECASE)
        if found and seconds_of(found[1]):
            self.time_units.append(Stated(seconds_of(found[1]), found[1], place))
        other = re.search(_OTHER_UNIT, text, re.IGNORECASE)
        if not units and other and (name := other_quantity(other[1].strip('"'))):
            is_of_times = re.search(r"\btime|altitude|height|elevation|depth|angle", text, re.I)
            if not is_of_times:
                self.quantities.append((f"{name} by its unit {other[1]}", row))
        if not is_peak and (name := named_quantity(text)):
            self.quantities.append((name, row))


def named_quantity(text: str) -> str:
    """Return the quantity that a line names, as "a velocity"; empty of an acceleration or none."""
    if re.search(r"(?:\b|_)(?:a|acc(?:el(?:s|eration\w*)?)?|ag)(?:\b|_)", text, re.IGNORECASE):
        return ""
    words_of_quantities = {
        "a displacement": r"disp(?:l\w*)?|displacements?|deflection|drift",
        "a velocity": r"vel(?:oc\w*)?|speed",
        "a spectrum": r"(?:response|fourier|amplitude|pseudo\W*\w*)\s+spectr\w+|p?sa",
        "a force": r"forces?|loads?|thrust|(?:base )?shear",
        "a strain": r"strains?",
        "a stress": r"stress(?:es)?|pressure",
        "an angle": r"rotation|angle|tilt",
        "a number of counts": r"counts?",
        "a voltage": r"voltage|volts?",
    }
    for name, words in words_of_quantities.items():
        if re.search(rf"(?:\b|_)(?:{words})(?:\b|_)", text, re.IGNORECASE):
            return name
    return ""


def _steps(text: str, place: str) -> Iterator[Stated]:
    """Yield the steps that a line states: intervals in a unit of time, and rates."""
    interval = rf"{_INTERVAL}{_BEHIND}{_NUMBER}\s*[\[(]?(?P<unit>[a-zµμ]*)"
    backwards = (
        rf"(?<![\w.]){_NUMBER}\s*(?P<unit>[a-zµμ]+)[\s-]*(?:sampl\w*|time)?[\s-]*(?:interval|step)s?\b"
        rf"|\b(?:every|spaced\s+at|intervals?\s+of)\s+(?P<number2>\d*\.?\d+)\s*(?P<unit2>[a-zµμ]+)"
    )
    for match in re.finditer(interval, text, re.IGNORECASE):
        unit = (match["before"] or match["unit"] or "").strip()
        is_bare = match["before"] is None and not match["unit"]
        # A word without a unit is "dt" or has the word interval or step: "time 12" is a time.
        is_step = re.match(r"\W*(?:time|sampl\w*)\W", match[0], re.IGNORECASE) is None or re.search(
            r"interval|step|period|spacing|increment", match[0], re.IGNORECASE
        )
        factor = 1.0 if is_bare else seconds_of(unit)
        if factor and is_step:
            yield _step(match["number"], factor, f"{match['number']} {unit or 's'}", place)
    for match in re.finditer(backwards, text, re.IGNORECASE):
        number = match["number"] or match["number2"]
        unit = match["unit"] or match["unit2"]
        if seconds_of(unit):
            yield _step(number, seconds_of(unit), f"{number} {unit}", place)
    rate = (
        rf"{_RATE}{_BEHIND}{_NUMBER}\s*(?P<unit>kHz)?|(?P<number2>\d+\.?\d*)\s*(?:sps|samples?/s)"
    )
    for match in re.finditer(rate, text, re.IGNORECASE):
        number = match["number"] or match["number2"]
        is_kilo = "khz" in (match["unit"] or match["before"] or "").lower()
        hertz = float(number) * (1000 if is_kilo else 1)
        if hertz > 0:
            yield Stated(1 / hertz, f"{1 / hertz:.6g} s, of {hertz:g} Hz", place)


def _step(number: str, factor: float, text: str, place: str) -> Stated:
    """Return a step in s from the text of its number and its unit."""
    return Stated(factor * float(re.sub("[dD]", "e", number)), text, place)


def require_count(name: str, counts: Iterable[Stated], count: int) -> None:
    """Raise RefusedError if a statement counts other samples than there are."""
    for stated in counts:
        if not isclose(stated.value, count):
            cure = "load the file anew, or mend the number in the head"
            raise RefusedError(name, f"of {count} samples", f"{stated}", cure)
