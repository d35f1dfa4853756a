"""What lines of text state of a record, wherever they stand: units, steps, counts, quantities."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from math import isclose, nan

from alphacut.base.errors import RefusedError
from alphacut.base.number_text import STANDARD_GRAVITY
from alphacut.base.stated import Stated
from alphacut.base.units import (
    ACCELERATION,
    FREQUENCY,
    TRANSFORMED,
    Mention,
    factor_of,
    has_unknown_words,
    mentions,
    without_units,
)
from alphacut.frame.records.text_file import MAX_STEP, MIN_STEP, TextFile

_RATES = (FREQUENCY, "s-1 sample")
_PEAK = r"(?i)\b(?:peak|pg[avd]|pk|[av]?max\w*|min\w*|extrem\w*)\b"
# Numbers of the instrument.
_SENSOR = (
    r"(?i)sensitiv|full.?scale|\brange|clip|trigger|thresh|noise|resolution|\bgain|\bres\b|offset"
)
_SITE = r"(?i)altitude|height|elevation|depth|coordinate|vs_?30|\bwave|peak|pg[vd]|distance"
FACTOR = (
    r"(?:[x×*·]\s*|\b)10\s*(?:\^|\*\*)|[x×*·]\s*10\s*-\s*\d|\b1\.?0*e[-+]?\d"
    r"|(?:(?<![a-z_])x|[×*·])\s*(?:1000*\b|1\.?0*e|0?\.\d)"
    r"|\b(?:scal\w*[\s_]*factor|scal\w*(?=\s*[:=])|(?:multipl\w*|divide\w*)(?:\s+[a-z]+){0,6}|conversion)[\s:=]*"
    r"(?!1(?:\.0*)?\b)[\d.]|\btimes\s+(?:\d|t\w+)|\b(?:fa[ck]tor|facteur|fattore)\s*(?:of\s+)?[:=]?\s*(?!1\b)\d|(?<=[a-z])\s*/\s*10+\b"
)
# Words of times between samples, in some languages, and words of other times and frequencies.
_SAMPLING = (
    r"(?i)samp|digiti|abtast|[ée]chant|muestre|campion|amostr|step|interval|spac(?:ed|ing)|increment"
    r"|every|schritt|шаг|paso|\bpas\b|passo|\brate|acquisition|(?<![a-z])d(?:elta)?[\s_-]*t(?![a-z])|Δ|\bdelta|@"
    r"|(?<![a-z])[ft]s\b"
)
_OTHER_TIMES = (
    r"(?i)filter|pass\b|corner|cut|band|butter|natur|resonan|predomin|trigger|origin|delay|event|taper"
    r"|smooth|damp|respon|duration|peak|max|pg[avd]|window|sensor|seism|instrument|clock|drift|arriv"
    r"|roll|usable|lowest|highest|low\b|high\b"
)
# Between a word and the number without a unit that it states.
_BEHIND = r"[\s_]*(?:[\s:=@\"',]|\.{2,})*(?:(?:is|was|of|at|with|by)\s+)?"
_NUMBER = r"(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eEdD][-+]?\d+)?)(?![\d.]*\w)"
_BARE_STEP = re.compile(
    r"(?:\b(?:sampl\w*|time|data|digiti[sz]\w*)[\s_-]*(?:interval|step|period|spacing|increment)s?"
    r"|(?:interval|step|increment)s?|(?<![a-z])(?:d(?:elta)?[\s_-]*t|ts)|Δt|\bdelta(?:_?x)?)"
    rf"{_BEHIND}{_NUMBER}",
    re.IGNORECASE,
)
_BARE_RATE = re.compile(
    r"(?:\b(?:sampl\w*|digiti[sz]\w*|acquisition|data)[\s_-]*(?:rate|freq\w*)|(?<![a-z])f_?s(?:amp\w*)?\b"
    rf"|^\W*rate(?=\s*[:=])){_BEHIND}{_NUMBER}",
    re.IGNORECASE,
)
# A number that stands alone, and is part of no word, date, time or list.
_LONE_NUMBER = re.compile(r"(?<![\w.,:/+-])(?:\d+[.,]?\d*|\.\d+)(?![\w:/-]|[.,]\d)")
_COUNT = re.compile(
    r"\b(?:npts?|ndata|n_?samples|points|samples|n(?:umber|o|um|r)?\.?\s*(?:of)?\s*"
    r"(?:data|points|samples|values|pts))\s*[:=]\s*(\d+)\b(?![./:-])",
    re.IGNORECASE,
)
# What stands before a comment in a row of numbers.
_NUMBERS = re.compile(r"^[-+\d.,;\seEdD\"]*\d[.\s\"]*(?=#|//|[;!])")
_SYSTEMS = {r"\bcgs\b": "cm/s^2", r"\bSI\s+units?\b|\bunits?\W+SI\b": "m/s^2"}


@dataclass
class TextStatements:
    """What some lines of a file state.

    Args:
        units: Units of acceleration, as factors to m/s².
        peak_units: Those of peaks.
        unsure_units: Units that may be other words.
        steps: Times between samples, in s.
        unsure_steps: Times, and the reciprocals of frequencies, that may be other ones; and numbers
            of unknown meaning in lines on sampling.
        lone_steps: Other numbers of unknown meaning that are those of usual steps or rates.
        durations: Durations, in s.
        counts: Numbers of samples.
        quantities: Lines that name another quantity than an acceleration, by its name.
        factors: Lines with a power of ten beside a unit.
        time_units: Units of times, as factors to s.
    """

    units: list[Stated] = field(default_factory=list)
    peak_units: list[Stated] = field(default_factory=list)
    unsure_units: list[Stated] = field(default_factory=list)
    steps: list[Stated] = field(default_factory=list)
    unsure_steps: list[Stated] = field(default_factory=list)
    lone_steps: list[Stated] = field(default_factory=list)
    durations: list[Stated] = field(default_factory=list)
    counts: list[Stated] = field(default_factory=list)
    quantities: list[tuple[str, int]] = field(default_factory=list)
    factors: list[int] = field(default_factory=list)
    time_units: list[Stated] = field(default_factory=list)

    @classmethod
    def of(cls, file: TextFile, lines: Iterable[int]) -> TextStatements:
        """Return what the lines with these indices state."""
        found = cls()
        for row in lines:
            text = _NUMBERS.sub("", file.lines[row])
            place = f"line {file.line_number(row)}"
            for clause in text.split(";"):
                found._add_clause(clause, row, place)
            for match in _COUNT.finditer(text):
                found.counts.append(Stated(float(match[1]), f"{match[1]} samples", place))
        return found

    def _add_clause(self, text: str, row: int, place: str) -> None:
        """Add what a line, or a part of it between semicolons, states."""
        all_units = mentions(text)
        plain = without_units(text, [])
        rest = without_units(text, [one for one in all_units if one.is_sure])
        units: list[Mention] = []
        for one in all_units:
            # The acceleration of gravity, as "1 g = 9.81 m/s2", is no unit of the samples.
            is_gravity = one.dimension == ACCELERATION and one.unit.factor != STANDARD_GRAVITY
            is_gravity &= any(isclose(x, STANDARD_GRAVITY, rel_tol=0.005) for x in one.values)
            # What a sensor gives, as "1 V = 1 g", is none either.
            is_gain = one.before.strip() == "=" and units[-1:] and units[-1].dimension == "V"
            if not is_gravity and not is_gain:
                units.append(one)
            elif units and one.before.lstrip().startswith("="):
                units.pop()
        is_peak = re.search(_PEAK, text) is not None
        for one in units:
            if "count-1" in one.dimension:  # of a sensor, as "0.06 mg/LSB"
                self.quantities.append((f"a number of counts of {one.shown}", row))
            elif one.dimension == ACCELERATION:
                self._add_unit(one, row, place, is_peak=is_peak)
            elif one.dimension == "s" and not one.numbers:
                of_times = r"(?i)\b(?:time|abscissa)s?\W*(?:in\s+)?$|\b(?:t|in|units?)\W*$"
                if re.search(of_times, one.before):
                    self.time_units.append(Stated(one.unit.factor, one.text, place))
            elif one.numbers and one.dimension in ("s", "s sample-1", *_RATES):
                self._add_time(one, place, is_peak=is_peak)
            elif not is_peak and not re.search(_SITE, text):
                self._add_other(one, row, text)
        for pattern, unit in _SYSTEMS.items():
            if re.search(pattern, text, re.IGNORECASE):
                self.units.append(Stated(factor_of(unit, ACCELERATION), unit, place))
        lengths = [x for x in all_units if x.dimension == "m" and not x.numbers]
        if lengths and re.search(r"(?i)\blengths?\b.*\btimes?\W+(?:in\W+)?s(?:ec)?\b", text):
            self.units.append(Stated(lengths[0].unit.factor, f"{lengths[0].text}/s^2", place))
        if not is_peak and re.search(
            f"{FACTOR}|{TRANSFORMED}", _BARE_STEP.sub("", rest), re.IGNORECASE
        ):
            self.factors.append(row)
        for bare, is_rate in ((_BARE_STEP, False), (_BARE_RATE, True)):
            for match in bare.finditer(rest):
                if match[0] != plain[slice(*match.span())]:  # a number with a unit stands between
                    continue
                number = float(match["number"].lower().replace("d", "e")) or nan
                shown = f"{match['number']} {'Hz' if is_rate else 's'}"
                self.steps.append(_step(number, shown, place, is_rate=is_rate))
            rest = bare.sub(lambda match: " " * len(match[0]), rest)
        # In words of a language that is not known here, a number may be the step or the rate.
        is_unknown = has_unknown_words(rest)
        # Words in square brackets are a unit, whether it is known or not.
        if is_unknown or re.search(r"\[[^\W\d_][^\[\]]*\]", rest):
            self.unsure_units.append(Stated(nan, text.strip()[:60], place))
        is_sampling = is_unknown or re.search(_SAMPLING, text) is not None
        for match in _LONE_NUMBER.finditer(_COUNT.sub(" ", rest)):
            number = float(match[0].replace(",", ".")) or nan
            stated = Stated(number if number < MAX_STEP else 1 / number, text.strip()[:60], place)
            if is_sampling:
                self.unsure_steps.append(stated)
            # The steps of most rates are decimals of few digits.
            elif 5e-4 <= number <= 0.1 or (20 <= number <= 1000 and 1e8 % number == 0):
                self.lone_steps.append(stated)
        # Loads, angles and drifts of an instrument or a site are no quantity of the numbers.
        name = named_quantity(rest)
        is_quantity = name != "" and (
            not name.endswith(("force", "stress", "angle")) or re.match(r"\W*\w+\W*(?:,|$)", rest)
        )
        if is_quantity and not is_peak and not re.search(_SITE, text):
            self.quantities.append((name, row))

    def _add_unit(self, one: Mention, row: int, place: str, *, is_peak: bool) -> None:
        """Add a unit of acceleration: of samples, of peaks, or one that may be another word."""
        if re.search(_SENSOR, one.before) and not re.search(r"(?i)\bunits?\b", one.before):
            return
        stated = Stated(one.unit.factor, one.text, place)
        if is_peak:
            self.peak_units.append(stated)
        elif one.is_sure:
            self.units.append(stated)
            if one.is_multiple:
                self.factors.append(row)
        else:
            self.unsure_units.append(replace(stated, value=nan) if one.is_multiple else stated)

    def _add_other(self, one: Mention, row: int, text: str) -> None:
        """Add the quantity of a unit that is none of acceleration, where it is of the samples."""
        if "sample" in one.dimension or not one.is_sure or one.numbers:
            return
        name = one.unit.other_quantity
        if one.dimension in ("m2 s-4", "m2 s-3", "m2 s-2"):
            name = "another quantity"
        is_named = re.search(r"(?i)\bunits?\b[^,]*$", one.before) is not None
        # Lengths and angles are those of the site, unless a line calls them units.
        is_bracketed = one.before.rstrip().endswith(("(", "["))
        is_alone = not any(x.dimension == ACCELERATION for x in mentions(text))
        is_of_samples = one.dimension not in ("m", "rad") and (is_bracketed or is_alone)
        if name and (is_named or is_of_samples):
            self.quantities.append((f"{name} by its unit {one.text}", row))

    def _add_time(self, one: Mention, place: str, *, is_peak: bool) -> None:
        """Add a time or a frequency: a step, one that may be a step, or a duration."""
        value = one.values[0]
        around = f"{one.before[-60:]} | {one.behind[:30]}"
        is_rate = one.dimension in _RATES
        stated = _step(value or nan, one.shown, place, is_rate=is_rate)
        is_sampling = re.search(_SAMPLING, around) is not None or "sample" in one.dimension
        # As "acceleration (g) over time (1/100 s)".
        is_sampling |= re.search(r"(?i)\btimes?\s*[\[(]\s*$", one.before) is not None
        if re.search(r"(?i)nyquist", around):
            self.unsure_steps.append(Stated(stated.value / 2, stated.text, place))
        elif re.search(r"(?i)decimat|resampl|interpolat|half|every\s+(?:other|third)", around):
            self.unsure_steps.append(Stated(nan, one.shown, place))
        elif re.search(r"(?i)duration|dauer|dur[ée]e|duraci", one.before):
            self.durations.append(Stated(value, one.shown, place))
        elif is_sampling:
            clause = re.split("[,;]", one.before)[-1]
            if re.search(r"(?i)filter|pass\b|corner|cut.?off|band", clause) is None:
                self.steps.append(stated)
        elif not is_peak and MIN_STEP <= stated.value < MAX_STEP:
            self.unsure_steps += [] if re.search(_OTHER_TIMES, around) else [stated]


def named_quantity(text: str) -> str:
    """Return the quantity that a line names, as "a velocity"; empty of an acceleration or none."""
    if other := re.search(
        r"\b(?:jerk|(?:angular|rotational)\s+acc\w*|(?:winkel|dreh)beschl\w*)", text, re.IGNORECASE
    ):
        return "a jerk" if other[0].lower() == "jerk" else "an angular acceleration"
    spectrum = r"\bspectral\s+acc|\b(?:response|fourier|amplitude|pseudo\W*\w*)\s+spectr\w+"
    is_matched = re.search(r"match|compatib|target|artific|design|fit", text, re.IGNORECASE)
    if re.search(spectrum, text, re.IGNORECASE) and not is_matched:
        return "a spectrum"
    # A lone "a" is a word of many languages.
    of_acceleration = (
        r"acc(?:[eé]l\w*)?|acel\w*|\w*beschleunig\w*|ускорен\w*|ag|a(?=_|\W*$|\s*[\[(=:/])"
    )
    if re.search(rf"(?:\b|_)(?:{of_acceleration})(?:\b|_)|加速度|가속도", text, re.IGNORECASE):
        return ""
    words_of_quantities = {
        "a displacement": r"disp(?:l\w*)?|d[ée]placements?|desplaz\w+|desloca\w+|spostament\w*"
        r"|\w*verschieb\w*|(?:schwing|feder|stell)?wege?|\w*auslenk\w*|verplaatsing\w*|f[oö]rsk\w+ning"
        r"|пере?мещен\w*|смещен\w*|\w*(?:[变変]位|位移|변위)\w*|deflection|drift",
        "a velocity": r"vel(?:oc\w*)?|speed|vitesses?|\w*geschwindigkeit\w*|(?:schwing)?schnelle"
        r"|snelheid|hastighe[dt]|скорост\w*|\w*(?:速度|속도)\w*|pr[eę]dko[sś]\w+|rychlost\w*",
        "a spectrum": r"p?s[av]",
        "a force": r"forces?|loads?|thrust|(?:base )?shear",
        "a strain": r"strains?|\w*dehnung\w*|d[eé]formations?|deformaci[oó]n|deformazion[ei]",
        "a stress": r"stress(?:es)?|pressure",
        "an angle": r"rotation|angle|tilt",
        "a number of counts": r"counts?",
        "a voltage": r"voltage|volts?",
    }
    for name, words in words_of_quantities.items():
        is_named = re.search(rf"(?:\b|_)(?:{words})(?:\b|_)", text, re.IGNORECASE)
        if is_named and not (is_matched and name == "a spectrum"):
            return name
    return ""


def _step(value: float, text: str, place: str, *, is_rate: bool) -> Stated:
    """Return a step, given in s or as samples in a second."""
    if is_rate:
        return Stated(1 / value, f"{1 / value:.6g} s, of {text}", place)
    return Stated(value, text, place)


def require_count(name: str, counts: Iterable[Stated], count: int) -> None:
    """Raise RefusedError if a statement counts other samples than there are."""
    for stated in counts:
        if not isclose(stated.value, count):
            cure = "load the file anew, or mend the number in the head"
            raise RefusedError(name, f"of {count} samples", f"{stated}", cure)
