"""Units in texts: one vocabulary and one grammar for all that files state of their numbers.

A unit is a product of atoms, each a symbol or a name with a prefix and a power, joined by "/",
"per", "*", "·", "-", "." or a blank: "cm/s^2", "CM/SEC**2", "N s/m", "metres per second squared".
Its dimension is written with the bases m, kg, s, rad, V and with what is counted: "m s-2" of an
acceleration, "cycle s-1" of a frequency, "m pixel-1" of the side of a pixel.
"""

from __future__ import annotations

import math
import re
import unicodedata
from collections import Counter, defaultdict
from collections.abc import Iterator
from functools import lru_cache
from typing import NamedTuple

_PREFIXES = {
    "p": 1e-12, "pico~": 1e-12, "n": 1e-9, "nano~": 1e-9, "u": 1e-6, "μ": 1e-6,
    "micro~": 1e-6, "mikro~": 1e-6,
    "m": 1e-3, "milli~": 1e-3, "c": 1e-2, "centi~": 1e-2, "d": 0.1, "da": 10.0,
    "h": 1e2, "k": 1e3, "kilo~": 1e3, "M": 1e6, "mega~": 1e6, "deca~": 10.0, "G": 1e9,
    "giga~": 1e9, "": 1.0,
}  # fmt: skip
# In each line the value in SI, the dimension (its factors joined by "·"), and the names, with the
# prefixes that they take in brackets; * stands for the names of prefixes. Blanks within a name, and
# behind those, are written as "~", and may be missing. Lines below replace equal names above.
_VOCABULARY = """
1 m m(p,n,u,μ,m,c,d,k) metre(*) metres(*) meter(*) meters(*) metri métre mètre mètres metro metros
.0254 m in inch inches
.3048 m ft foot feet
1e-10 m Å angstrom angstroms ångström
1e-6 m micron microns
1 m м 米
.01 m см 厘米
.001 m мм 毫米
1e-6 m мкм 微米
2.54e-5 m thou mil mils
1 s s(n,u,μ,m) second(*) seconds(*) sec(m) secs seg sek segundo segundos seconde secondes
1 s Sekunde Sekunden с сек 秒
.001 s мс 毫秒
1 cycle·s-1 Гц 赫兹
60 s min minute minutes Minuten
3600 s h hour hours hr Stunden
.001 kg g(k,M) gram(k) grams(*) gramme(*) grammes(*) kilo kilos
1e3 kg t tonne tonnes Tonne Tonnen metric~ton metric~tons metric~tonne metric~tonnes
907.18474 kg ton tons tonelada toneladas
.45359237 kg lb lbs lbm pound pounds
14.593902937206 kg slug slugs
1 kg·m·s-2 Н 牛 牛顿
1e3 kg·m·s-2 кН 千牛
1e6 kg·m·s-2 МН 兆牛
1 kg кг 千克
1e3 kg т 吨
1 kg·m·s-2 N(m,da,k,M,G) newton(*) newtons(*)
9.80665 kg·m·s-2 kgf kp
9806.65 kg·m·s-2 tf tonf ton~force tons~force tonne~force tonnes~force
4.4482216152605 kg·m·s-2 lbf
4448.2216152605 kg·m·s-2 kip kips
1e-5 kg·m·s-2 dyn dyne dynes
1 kg·m2·s-2 Nm(k,M)
1 kg·m·s-1 Ns(k,M)
1 kg·m-1·s-2 Pa(h,k,M,G) pascal(*) pascals(*)
1e5 kg·m-1·s-2 bar(m)
6894.757293168 kg·m-1·s-2 psi
6894757.293168 kg·m-1·s-2 ksi
9.80665 m·s-2 g(n,u,μ,m) g's gs g_n gn gravity standard~gravity
.00980665 m·s-2 milli~g ‰~g
9.80665e-6 m·s-2 micro~g
.0980665 m·s-2 %~g %~of~g %~of~gravity percent~g percent~of~g
.0980665 m·s-2 per~cent~g percent~gravity percent~of~gravity
.0980665 m·s-2 per~cent~of~gravity per~cent~of~g pct~g
9.80665 m·s-2 fraction~of~gravity fractions~of~gravity units~of~gravity unit~gravity gravity~units
9.80665 m·s-2 fractions~of~g fractions~of~g_n
.980665 m·s-2 g~/~10
98.0665 m·s-2 10~g 10~*~g g~*~10
.01 m·s-2 gal(m) gals(m)
1 m·s-2 mps2 mps^2 mpss
.01 m·s-2 cmps2 cmps^2 cmpss
.001 m·s-2 mmps2 mmps^2 mmpss
1 m·s-1 mps
.01 m·s-1 kine kines cmps
1 cycle·s-1 Hz(m,k,M) hertz(*) cps c.p.s
1 cycle cyc cycle cycles Schwingung Schwingungen oscillation oscillations vibration vibrations
1 cycle turn turns rev revolution revolutions
.016666666666666666 cycle·s-1 rpm cpm
1 sample·s-1 sps
1 sample sample samples point points pts spl value values reading readings
1 rad rad(m) radian(*) radians(*)
.017453292519943295 rad deg degree degrees °
1 count count counts cnts digit digits bit bits lsb
1 V V(μ,m,k) volt(*) volts(*)
1 pixel pixel pixels px pix
1 voxel voxel voxels vox
39.37007874015748 m-1·pixel dpi ppi
.01 . % percent per~cent pct
"""
_SIGNS = str.maketrans("−∕⁄⋅", "-//·")
# Signs of Chinese, Japanese and Korean, which stand beside a unit without a blank, and letters of
# other scripts. A set without its complement takes Python's `re` four times as long to compile.
_WIDE = r"[^\x00-\u303f\U00010000-\U0010ffff]"
_LETTER = rf"(?!{_WIDE})[^\W\d_]"
# Units that are words or other symbols as well: they count where brackets, a number or a word such
# as "unit" stand beside them.
_WEAK = {*"msghtnv%мстн", "in", "us", "min", "bar", "kilo", "count", "digit", "bit", "degree"}
_WEAK |= {"turn", "gs", "ns", "gravity"}
NUMBER = r"(?:\d+\.?\d*(?:[eEdD][-+]?\d+)?|\.\d+(?:[eEdD][-+]?\d+)?)"
_DECIMAL = rf"(?:1\s*/\s*\d{{2,5}}|\d+,\d+|{NUMBER})(?![\d.])"
_MARK = r"\s*(?:[x×*;,/\s]|\bby\b)\s*"
_THREE = rf"{NUMBER}{_MARK}{NUMBER}{_MARK}{NUMBER}"
_BEFORE = re.compile(
    rf"(?<![\w.,/^+-])[-+±]?({_THREE}|{_DECIMAL})[\])]?[\s_]*-?[\[(]?\s*$"
    rf"|[\"']value[\"']\s*:\s*({NUMBER})\s*,\s*[\"']units?[\"']\s*:\s*[\"']$"
)
_BEHIND = re.compile(
    rf"\s*[\])\"'}}]*(?:\s*(?:[:=,]+|\.{{2,}}|\bis\b)\s*|\s+)[\[(\"'/]*({_THREE}|{_DECIMAL})(?![\w/:-])(?!\.\d)"
)
_LABEL = r"\b(?:acc\w*|ag?|times?|t|d[_\s]?t|f|freq\w*|disp\w*|vel\w*|[duvx]|interval|step|y\w*"
_LABEL += r"|mass\w*|stiff\w*|damp\w*|forces?|lengths?)"
_ANNOUNCED = re.compile(
    rf"(?i)(?:[\[(]\s*|(?<=[a-z\d\]])_|{_LABEL}\s*[/_]\s*\(?"
    r"|(?:\bunits?|_units?|einheit\w*|unidad\w*|unit[éèàa]\w*|単位は?|单位|\bin|\b(?:fraction|multiple)s?\s+of)"
    r"(?:\W|\b(?:of|are|is|in|de|en|acc\w*)\b)*)$"
)
_NAMED_NUMBERS = re.compile(r"(?i)\b(?:acc\w*|ordinates?|amplitudes?|values?|data)\W+$")


ACCELERATION = "m s-2"
FORCE = "kg m s-2"
FREQUENCY = "cycle s-1"
# Quantities by the dimensions of their units, as a clause names them.
_QUANTITIES = {
    "m": "a displacement",
    "m s-1": "a velocity",
    "m s-3": "a jerk",
    "rad s-2": "an angular acceleration",
    FORCE: "a force",
    "count": "a number of counts, which the sensor's sensitivity turns into an acceleration",
    "V": "a voltage, which the sensor's sensitivity turns into an acceleration",
    "kg m-1 s-2": "a pressure",
    "rad": "an angle",
}


# A number in words before a unit, as "thousandths of an inch".
_PARTS = (
    r"(?i)(?:(?:tenth|mil[eé]sima|d[eé]cima|cent[eé]sima|tausend|zehntel|hundert|hundred|thousand"
    r"|mil+i|billion|kilo|mega|mi[ck]ro|nano|mio|mill|mrd|tsd|migliai|milh|duizend|miljoen|тыс|млн"
    r"|миллион)\w*\.?\s+|miles\s+|[百千万]+\s*)(?:of\s+(?:an?\s+)?|d[ei]\s+)?$"
)
TRANSFORMED = (
    r"\b(?:normali[sz]ed|normali[sz]ation|non-?dimensional\w*|dimensionless|scaled\s+by|divided|squared?|roots?"
    r"|log(?:10|arithm\w*)?|invers\w+|inverted|doubled|halved|twice|reciprocal\w*|tenths?|hundredths?|thousandths?"
    r"|hundreds|thousands|mil+ions|units\s+of\s+(?:the|its)|m[uo]ltipli[cezé]\w*|multiply|mio|mrd|tsd"
    r"|tausend\w*|millionen|milliers|migliaia|milioni|millones|miles\s+de|milhares|тыс|млн)\b"
)
"""Words of numbers that are no longer in the unit beside them, in small letters."""


class Unit(NamedTuple):
    """A unit: its value in SI, its dimension, and the names of its atoms with their powers."""

    factor: float
    dimension: str
    atoms: tuple[tuple[str, int], ...]

    @property
    def other_quantity(self) -> str:
        """The quantity that is no acceleration, as "a velocity"; empty where none is known."""
        return _QUANTITIES.get(self.dimension, "")


class Mention(NamedTuple):
    """A unit in a text.

    Args:
        unit: The unit.
        text: How it is written.
        numbers: Numbers beside it, one or three, in the unit as it is written; NaN of one that can
            be read in two ways, as 12,700.
        before: The text between the unit before, or the beginning, and this one with its numbers.
        behind: The text up to the end, or to the first comma, semicolon or bracket before another
            unit.
        is_sure: Whether it is a unit beyond doubt, and no word or other symbol.
        start: Index of its first letter, that of its numbers among them.
        end: Index behind its last letter.
    """

    unit: Unit
    text: str
    numbers: tuple[float, ...]
    before: str
    behind: str
    is_sure: bool
    start: int
    end: int

    @property
    def dimension(self) -> str:
        """The dimension of its unit."""
        return self.unit.dimension

    @property
    def values(self) -> tuple[float, ...]:
        """The numbers in SI."""
        return tuple(number * self.unit.factor for number in self.numbers)

    @property
    def is_multiple(self) -> bool:
        """Whether a factor that is not 1 stands beside the unit, as in "0.1 g" or "g/2"."""
        is_divided = re.match(r"[\s\])]*[/*×·]\s*\d", self.behind) is not None
        return is_divided or self.numbers not in ((), (1.0,))

    @property
    def shown(self) -> str:
        """Number and unit."""
        return " ".join([" × ".join(f"{x:g}" for x in self.numbers), self.text]).strip()


class Word(NamedTuple):
    """A name of the vocabulary: its value in SI and its dimension."""

    factor: float
    dimension: str


@lru_cache(maxsize=1)
def _words() -> dict[str, Word | None]:
    """Return the words of the vocabulary by their names, with "~" for blanks and without blanks.

    Names in small letters are there as well, with None where capitals tell two apart, as mN and MN.
    """
    words: dict[str, Word] = {}
    for line in _VOCABULARY.strip().splitlines():
        value, dimension, *names = line.split()
        for entry in names:
            name, _, listed = entry.rstrip(")").partition("(")
            prefixes = [x for x in _PREFIXES if "~" in x] if listed == "*" else listed.split(",")
            for prefix in ("", *prefixes):
                word = Word(_PREFIXES[prefix] * float(value), dimension.strip("."))
                words[prefix + name] = words[f"{prefix}{name}".replace("~", "")] = word
    meanings = defaultdict(set)
    for name, word in words.items():
        meanings[name.lower()].add(word)
    folded = {name: x.pop() if len(x) == 1 else None for name, x in meanings.items()}
    # Single letters that are names of other things count in the right case alone.
    return folded | dict.fromkeys("nvth") | words


def folded(text: str) -> str:
    """Return a text with signs in their plain form: "cm/s2" of "㎝/s²", and 10^-3 of 10⁻³."""
    if text.isascii():
        return text
    text = re.sub(r"(?<=\d)(?=[⁻⁰¹²³⁴-⁹])", "^", text)
    return unicodedata.normalize("NFKC", text).translate(_SIGNS)


def decoded(content: bytes) -> str:
    """Return the text of a content in UTF-8, its signs in their plain form, else in Latin-1."""
    try:
        return folded(content.decode("utf-8-sig"))
    except UnicodeDecodeError:
        return content.decode("latin-1")


def has_unknown_words(text: str) -> bool:
    """Return whether a text has words of another script, or of an encoding that is not known.

    They may state whatever a number is; what of them is known here is a unit.
    """
    return re.search(r"[^\W\d_\x00-\u024f]{2}|[\u0080-\u024f]{4}", folded(text)) is not None


def word_of(name: str) -> Word | None:
    """Return the meaning of a name of the vocabulary; None if there is none, or two."""
    return _words().get(name) or _words().get(name.lower())


@lru_cache(maxsize=1)
def _joined_atom() -> re.Pattern[str]:
    """Return the pattern of an atom of a unit, behind what joins it to the atom before it."""
    spaced = {name.lower() for name in _words() if "~" in name}
    plain = {name.lower() for name in _words()} - {name.replace("~", "") for name in spaced}
    names = (re.escape(x).replace("\\~", "~").replace("~", r"[-\s_]*") for x in plain)
    name = "|".join(sorted(names, key=len, reverse=True))
    power = (
        r"(?:\s*(?:\^|\*\*)\s*(?:[({]\s*(-?\d)\s*[)}]|(-?\d))|\{?(-?[1-4])\}?(?!\w|\.\d)"
        r"|\s+(squared|cubed)(?![a-z]))?"
    )
    # Names that end with a digit, as mps2, end where the digits do.
    ended = rf"(?-i:(?!{_LETTER})(?!(?<=\d)\d)(?!(?<={_WIDE}){_WIDE}))"
    atom = rf"(?:(square|sq\.?|cubic|cu\.?)\s+)?({name}){ended}{power}"
    # A blank joins a negative power, and what follows a force: "cm s-2" and "kN s/m".
    mark = (
        r"(\s*/\s*\(?|[\s_]*(?<![a-z])(?:per|pro|par|por)[\s_]+|_p?(?=s\^?2)|\s*[*·×]\s*|[-.](?=[a-z])"
        r"|\s+(?=[^\W\d_]+\s*(?:\^|\*\*)?\s*[({]?-\d)|(?-i:(?<=[Nf])\s+(?=[cm]?m\b|s\^?2?\b)))"
    )
    return re.compile(f"{mark}?{atom}", re.IGNORECASE)


class _Parsed(NamedTuple):
    """Atoms with their powers, and the index behind them."""

    atoms: tuple[tuple[str, int], ...]
    end: int


def _parsed(text: str, start: int) -> _Parsed | None:
    """Return the unit that begins at an index of a text; None where none does."""
    atoms: list[tuple[str, int]] = []
    end = start
    outer = 1  # −1 within a bracket behind "/"
    while one := _joined_atom().match(text, end):
        mark, shape, name, bracketed, power, glued, spelled = one.groups()
        name = re.sub(r"[-\s_]", "", name)
        # Each atom but the first has a mark before it.
        if (mark is None) != (not atoms) or word_of(name) is None:
            break
        is_quotient = re.search("(?i)/|p[aeor]+|_", mark or "") is not None
        if "(" in (mark or ""):
            outer = -outer
            is_quotient = False
        exponent = int(bracketed or power or glued or 1)
        if spelled or shape:
            exponent = 3 if "cu" in f"{spelled}{shape}".lower() else 2
        atoms.append((name, -outer * exponent if is_quotient else outer * exponent))
        end = one.end()
    end += outer == -1 and text[end : end + 1] == ")"
    return _Parsed(tuple(atoms), end) if atoms else None


def unit_of_atoms(atoms: tuple[tuple[str, int], ...]) -> Unit:
    """Return the unit that is a product of atoms."""
    factor = 1.0
    powers = Counter[str]()
    for name, power in atoms:
        word = word_of(name)
        assert word is not None
        factor *= word.factor**power
        for letters, exponent in re.findall(r"([a-zV]+)(-?\d?)", word.dimension):
            powers[letters] += power * int(exponent or 1)
    known = sorted((base, power) for base, power in powers.items() if power)
    dimension = " ".join(base if power == 1 else f"{base}{power}" for base, power in known)
    return Unit(factor, dimension, atoms)


@lru_cache(maxsize=1000)
def unit_of(text: str) -> Unit | None:
    """Return the unit that a whole text is, as "[cm/s^2]" or "10 ms"; None of another text.

    Brackets, blanks and full stops around it do not matter.
    """
    plain = folded(text).strip(" \"'").strip("[]").strip().rstrip(".")
    if plain.startswith("("):
        plain = plain.strip("() ")
    number = re.match(rf"({NUMBER})\s*[*x·]?\s*(?=[^\W\d]|%|°)", plain)
    for start in (0, number.end() if number else 0, 2 if plain.startswith("1/") else 0):
        parsed = _parsed(plain, start)
        if parsed is not None and plain[parsed.end :].strip() in ("", ")"):
            sign = -1 if plain.startswith("1/") and start == 2 else 1
            unit = unit_of_atoms(tuple((name, sign * power) for name, power in parsed.atoms))
            scale = float(number[1]) if number and start == number.end() else 1.0
            return unit._replace(factor=scale * unit.factor)
    return None


def factor_of(text: str, *dimensions: str) -> float:
    """Return the value in SI of a unit of one of some dimensions; 0 of any other text."""
    unit = unit_of(text)
    return unit.factor if unit is not None and unit.dimension in dimensions else 0.0


def mentions(text: str) -> list[Mention]:
    """Return the units in a text with the numbers beside them, from left to right."""
    plain = folded(text)
    if not any(map(word_of, re.findall(rf"(?:{_LETTER})+|{_WIDE}+|[%‰°]", plain))):
        return []  # without the pattern of units, which takes 10 ms to make
    spans = list(_spans(plain))
    found: list[Mention] = []
    last_end = 0
    for index, (start, parsed) in enumerate(spans):
        end = parsed.end
        next_start = spans[index + 1][0] if index + 1 < len(spans) else len(plain)
        unit = unit_of_atoms(parsed.atoms)
        is_inverted = re.search(r"(?<![\w.])1\s?/\s?\(?$", plain[last_end:start]) is not None
        if is_inverted:  # as 1/s
            unit = unit_of_atoms(tuple((name, -power) for name, power in parsed.atoms))
        name = plain[start:end]
        number = _BEFORE.search(plain, last_end, start)
        is_announced = _ANNOUNCED.search(plain, last_end, start) is not None
        is_announced = is_announced or re.match(r"\s*\bunits?\b", plain[end:], re.I) is not None
        behind = None
        if number is None and (is_announced or re.search("sample|pixel|voxel", unit.dimension)):
            behind = _BEHIND.match(plain, end, next_start)
            # A number before another unit belongs to that.
            if behind and index + 1 < len(spans) and not plain[behind.end() : next_start].strip():
                behind = None
        if unit.dimension in ("sample", "pixel", "voxel", "cycle"):
            continue  # which are words
        is_single = len(parsed.atoms) == 1 and parsed.atoms[0][1] == 1 and not is_inverted
        is_last = _NAMED_NUMBERS.search(plain, 0, start) and not plain[end:].strip(" .\"'#)")
        is_sure = bool(
            not (is_single and name.lower() in _WEAK) or number or is_announced or is_last
        )
        numbers: tuple[float, ...] = ()
        if which := number or behind:
            numbers = tuple(_numbers(next(filter(None, which.groups()))))
        elif unit.dimension and re.search(r"\d\.?\s*$", plain[last_end:start]):
            numbers = (math.nan,)  # of a range, as "0.1-25 Hz", or a power of ten
        if re.search(_PARTS, plain[:start]):
            numbers = (math.nan,)
        begin = number.start() if number else start
        stop = behind.end() if behind else end
        before, rest = plain[last_end:begin], plain[stop:next_start]
        if index + 1 < len(spans):  # what stands before another unit is its own, but for a clause
            clause = re.match(r"[^,;|)]*(?=[,;|)])|.*?(?=\s(?:in|at|and)\s)", rest)
            rest = clause[0] if clause else ""
        found.append(Mention(unit, name, numbers, before, rest, is_sure, begin, stop))
        last_end = stop
    return found


_NAME = re.compile(
    r"t\s*(?:[/_(\[]\s*\(?\d*\s*(?:[nuμm]?s(?:ec)?\b|min|n\b)|,)|(?<!\d)(?<!\d\s)[a-z]\s*="
    r"|in\s+[a-zμ%°]",
    re.IGNORECASE,
)


def _spans(text: str) -> Iterator[tuple[int, _Parsed]]:
    """Yield where units begin in a text, and their atoms; none stands within another."""
    end = 0
    # A unit begins behind a sign of Chinese, Japanese or Korean, or is such a sign.
    starts = rf"(?:(?<![^\W\d_])|(?<={_WIDE}))(?!{_WIDE})[^\W_]|(?<![^\W\d_])[^\W_]|[%‰°]"
    for match in re.finditer(starts, text):
        start = match.start()
        if start < end or (match[0].isdigit() and not re.match(r"10\s*\*?\s*g\b", text[start:])):
            continue
        # Names of columns and other quantities, as "t (s)", "t/ms", "T_n" and "h = 3 m".
        parsed = None if _NAME.match(text, start) else _parsed(text, start)
        is_word = parsed is not None and text[start : parsed.end].lower() == "in"
        is_word = is_word and re.search(r"[\d\[(]\s*$", text[:start]) is None
        if parsed is not None and not is_word:
            end = parsed.end
            yield start, parsed


def _numbers(text: str) -> Iterator[float]:
    """Yield the numbers of a text: one, a fraction of one, or three with marks between them."""
    if fraction := re.fullmatch(r"1\s*/\s*(\d+)", text):
        yield 1 / (float(fraction[1]) or math.nan)
    elif re.fullmatch(r"\d+,\d+", text):
        # Three digits behind a comma may be decimals or thousands.
        is_clear = text.startswith("0,") or not re.fullmatch(r"\d+,\d{3}", text)
        yield float(text.replace(",", ".")) if is_clear else math.nan
    else:
        yield from (float(re.sub("[dD]", "e", number)) for number in re.findall(NUMBER, text))


def without_units(text: str, found: list[Mention]) -> str:
    """Return a text with blanks in place of its units and the numbers beside them."""
    plain = folded(text)
    for one in found:
        plain = f"{plain[: one.start]}{' ' * (one.end - one.start)}{plain[one.end :]}"
    return plain
