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
    r"\bper\s?cent\s+(?:of\s+)?(?:gravity|g)\b": "%g",
    r"\b(?:standard|fractions?\s+of|units?\s*[:=]?(?:\s*of)?)\s+gravity": "(g)",
    # The acceleration of gravity, as "g = 9.81 m/s2".
    r"(?:\bg\s*=\s*)?\b(?:9\.8\d*\s*\(?m|98[01]\.?\d*\s*\(?(?:cm|gal)|386\.\d*\s*in"
    r"|32\.\d*\s*ft)\S*": "",
    r"(?<=\bacc)(\w*\.?)\s*/\s*\(?": r"\1 (",
    # Systems of units, and the symbol of standard gravity.
    r"\bcgs\b": "(cm/s^2)",
    r"\bSI\s+units?\b|\bunits?\W+SI\b": "(m/s^2)",
    r"\bg_n\b(?!\s*=)": "(g)",
    r"\blengths?\W+(?:units?\W+|in\W+)?([cm]?m|in|ft)\b(?=.*\btimes?\W.*\bs(?:ec)?\b)": r"\1/s^2",
}
_SPELLED_WORDS = re.compile("|".join(_SPELLED), re.IGNORECASE)
# A unit of acceleration that cannot be something else; not part of a quotient such as V/(m/s^2).
_UNIT = (
    rf"(?<![a-z0-9/])(?<!/\()(?:{PER_SECOND_SQUARED}|{'|'.join(GALS)}|milli-?g|mg|%\s?g"
    r"|g\s?/\s?10|10\s?\*\s?g)(?![a-z0-9]|\s*/)"
)
# The letter g is the unit in brackets, behind "units" or "in", or at the end of such a line.
_G = (
    r"[\[(]\s*(g'?s?)\s*[\])]|\bunits?\b[^a-z]*(?:(?:of|are|is|in)\b)?\W*(g'?s?)\b(?!\s*/|\w)"
    r"|\bin\s+[(\"']?(g'?s?)\b(?!\s*/)|\b(g)\s+units?\b|\b(?:acc\w*|ordinates?|amplitudes?|values?|data)\W+(g'?s?)\W*$"
)
_OTHER_UNIT = r"\bunits?\b\s*(?:(?:of|are|is|in)\b)?[\s:=]*[\[(]?([^\s,;\])]+)"
FACTOR = (
    r"(?:[x×*·]\s*|\b)10\s*(?:\^|\*\*|⁻|[²³⁴⁵⁶])|[x×*·]\s*10\s*[-−]\s*\d|\b1\.?0*e[-+]?\d"
    r"|[x×]\s*(?:1000*\b|0?\.\d)"
    r"|\b(?:scal\w*[\s_]*factor|scal\w*(?=\s*[:=])|multipl\w*|divided|conversion)[\s:=]*(?:by\s+)?"
    r"(?!1(?:\.0*)?\b)[\d.]|[2²]\s*/\s*\d|\b(?:of|in|is)\s+\d*\.?\d+\s*g\b"
)
_INTERVAL = (
    r"(?:\b(?:sampl\w*|time|data|digiti[sz]\w*)[\s_-]*(?:interval|step|period|spacing|increment)s?"
    r"|\b(?:time|sampl)\w*|\b(?:interval|step|increment)s?|(?<![a-z])d(?:elta)?[\s_-]*t|Δt|\bdelta)"
)
_RATE = (
    r"(?:\b(?:sampl\w*|digiti[sz]\w*|acquisition|data)[\s_-]*(?:rate|freq\w*)|(?<![a-z])fs\b"
    r"|\bsamples?/s(?:ec(?:ond)?)?|\bsps"
    r"|^\W*rate(?=\s*[:=])|(?:\bsampl\w*|\brate|\bdigiti[sz]\w*|@)"
    r"(?=(?:(?!filt|pass|corner|cut|band)[^\d\n]){0,20}[\d.]+\s*k?hz))"
)
_BEHIND = (
    r"[\s_]*(?:between\s+\w+\s*)?(?:[\[(](?P<before>[^\])]*)[\])]|/\s*(?P<slash>[mµu]?s)\b)?"
    r"(?:[\s:=@\"',]|\.{2,})*"
    r"(?:(?:is|was|of|at|with|by)\s+)?"
)


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
            if _SPELLED_WORDS.search(text):  # few lines have any, and one search is quicker
                for pattern, symbol in _SPELLED.items():
                    text = re.sub(pattern, symbol, text, flags=re.IGNORECASE)
            # As "1/100 sec".
            text = re.sub(r"\b1/(\d{2,5})(?=\s*s)", lambda x: f"{1 / int(x[1]):.9g}", text)
            place = f"line {file.line_number(row)}"
            for clause in text.split(";"):
                found._add_units(clause, row, place)
            found.steps += _steps(text, place)
            pattern = (
                r"\b(?:npts?|ndata|n_?samples|points|samples|n(?:umber|o|um|r)?\.?\s*(?:of)?\s*"
                r"(?:data|points|samples|values|pts))\s*[:=]\s*(\d+)\b(?![./:-])"
            )
            for match in re.finditer(pattern, text, re.IGNORECASE):
                found.counts.append(Stated(float(match[1]), f"{match[1]} samples", place))
        return found

    def _add_units(self, text: str, row: int, place: str) -> None:
        """Add the units, the factors and the other quantities that a line names."""
        is_of_sensor = re.search(
            r"sensitiv|full.?scale|\brange|clip|trigger|thresh|noise|resolution|\bgain|1\s*g\s*=",
            text,
            re.IGNORECASE,
        )
        if is_of_sensor and not re.search(r"\bunits?\b", text, re.IGNORECASE):
            if re.search(r"\bcounts\b", text, re.IGNORECASE):
                self.quantities.append(("a number of counts", row))
            return
        is_peak = re.search(r"\b(?:peak|pg[avd]|pk|max\w*|min\w*)\b", text, re.IGNORECASE)
        found_units = list(re.finditer(_UNIT, text, re.IGNORECASE))
        units = [match[0] for match in found_units]
        is_multiple = any(re.search(r"\d\s*$", text[: match.start()]) for match in found_units)
        for match in re.finditer(_G, text, re.IGNORECASE):
            units += filter(None, match.groups())
        into = self.peak_units if is_peak else self.units
        for unit in units:
            into.append(Stated(acceleration_factor(unit) or 0.0, unit, place))
        if not is_peak and (is_multiple or re.search(FACTOR, text, re.IGNORECASE)):
            self.factors.append(row)
        of_times = r"\b(?:time|abscissa)s?\b[\s,:=(\[]*(?:in\s+)?([a-zµμ]+)"
        for found in re.finditer(of_times, text, re.IGNORECASE):
            if seconds_of(found[1]):
                self.time_units.append(Stated(seconds_of(found[1]), found[1], place))
        # A unit of another quantity, behind the word "unit", or in brackets if it is no length or
        # angle, which are those of the site.
        others = re.findall(_OTHER_UNIT, text, re.IGNORECASE)
        is_of_site = r"(?i)altitude|height|elevation|depth|coordinate|vs_?30|\bwave|peak|pg[vd]"
        others += [x for x in re.findall(r"[\[(]([^\])]*)[\])]", text) if not seconds_of(x)]
        for unit in others:
            name = other_quantity(unit.strip('"'))
            is_length = "displacement" in name or "angle" in name
            is_named = re.search(r"\bunits?\b", text, re.IGNORECASE) is not None
            if name and (is_named or not is_length) and not re.search(is_of_site, text):
                self.quantities.append((f"{name} by its unit {unit}", row))
        # Loads, angles and drifts of an instrument or a site are no quantity of the numbers.
        name = named_quantity(text)
        is_quantity = name.endswith(
            ("displacement", "velocity", "spectrum", "counts", "voltage", "jerk", "acceleration")
        )
        if is_quantity and not is_peak and not re.search(is_of_site, text):
            self.quantities.append((name, row))


def named_quantity(text: str) -> str:
    """Return the quantity that a line names, as "a velocity"; empty of an acceleration or none."""
    if other := re.search(r"\b(?:jerk|(?:angular|rotational)\s+acc\w*)", text, re.IGNORECASE):
        return "a jerk" if other[0].lower() == "jerk" else "an angular acceleration"
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
        rf"|\b(?:every\s|spaced\s+at\s|intervals?\s+of\s|time\s*[\[(])\s*(?P<number2>\d*\.?\d+)\s*(?P<unit2>[a-zµμ]+)"
    )
    for match in re.finditer(interval, text, re.IGNORECASE):
        before = match["before"] or match["slash"]
        unit = (before or match["unit"] or "").strip()
        is_bare = before is None and not match["unit"]
        # "time 12 s" is a time, and "sampling 100" has no unit.
        words = r"(?i)interval|step|period|spacing|increment|d(?:elta)?_?\s?t|Δt|delta"
        is_sampling = not is_bare and re.match(r"(?i)sampl", match[0]) is not None
        is_step = is_sampling or re.search(words, match[0]) is not None
        factor = 1.0 if is_bare else seconds_of(unit)
        if factor and is_step:
            yield _step(match["number"], factor, f"{match['number']} {unit or 's'}", place)
    for match in re.finditer(backwards, text, re.IGNORECASE):
        number = match["number"] or match["number2"]
        unit = match["unit"] or match["unit2"]
        if seconds_of(unit):
            yield _step(number, seconds_of(unit), f"{number} {unit}", place)
    rate = rf"{_RATE}{_BEHIND}{_NUMBER}\s*(?P<unit>kHz)?"
    rate += r"|(?P<number2>\d+\.?\d*)\s*"
    rate += r"(?:sps|(?:samples?|points?)/s|(?:hz|(?P<kilo>khz))\s+(?:sampl|digiti))"
    for match in re.finditer(rate, text, re.IGNORECASE):
        number = match["number"] or match["number2"]
        is_kilo = "khz" in (match["unit"] or match["before"] or match["kilo"] or "").lower()
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
