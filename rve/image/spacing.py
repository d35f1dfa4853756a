"""Distances of pixels and voxels that a file states, beside those of the case."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

from alphacut.base.errors import require
from alphacut.base.stated import LENGTHS, Stated, settled
from alphacut.base.units import (
    NUMBER,
    Mention,
    decoded,
    factor_of,
    folded,
    has_unknown_words,
    mentions,
    without_units,
)

VOLUME = 3
# Words of sides of voxels, of sides along z, of pixels, which lie in a slice, of whole volumes, and
# of lengths that are none of these.
_SIDES = (
    r"(?i)vox|pix|px|edge|sampling|scale|spac|resol|thick|isotrop|every|step|pitch|kante|schicht"
)
_ALONG_Z = r"(?i)slice|layer|section|slab|voxel\W*depth|schicht|tranche|(?<![a-z])z(?![a-z])"
_PIXEL = r"(?i)pix|px"
_EXTENT = r"(?i)field\s+of\s+view|\bfov|extent"
_OTHERS = (
    r"(?i)diamet|wavelength|source|detector|distance|sample(?!d)|specimen|fib(?:re|er)|grain|particle"
    r"|pore|radius|filter|aperture|focal|origin|offset|position|corner|cent(?:re|er)"
    r"|crop|wall|core\b|spot|stage"
)
_AXIS = r"(?i)(?:(?:^|[\W_])[dvΔδ]?|\bd)([xyz]{1,3})[\"']?\s*[:=]*\s*$"
# A number of one axis, or of a pixel, without a unit.
_BARE_SIDE = (
    rf"(?i)\b(?:d?([xyz])|(?:pixel|voxel)[\s_]?(?:size|spacing))[\"']?\s*[:=]\s*({NUMBER})"
    r"(?![ \t]*[a-zμ.\d])"
)


class StatedSpacing(NamedTuple):
    """What a file states of its voxels.

    Args:
        distances: Of voxels along x, y, z, or fewer; NaN where it states none.
        units: Units of them, empty where it states none.
        texts: Lines that may state sides as well, as "voxel size 2.5 um".
    """

    distances: Sequence[float]
    units: Sequence[str]
    texts: Sequence[str] = ()


def require_spacing(
    name: str,
    found: StatedSpacing,
    sides: Sequence[float],
    *,
    counts: Sequence[int] = (),
    override: Collection[str] = (),
) -> None:
    """Refuse voxels of a file whose sides are not those of the case.

    Sides with a unit are compared as they are; of sides without one the ratios.

    Args:
        name: Name of the file, for messages.
        found: What the file states.
        sides: Sides of a voxel of the case along z, y, x, or of a pixel along y, x, in m, positive.
        counts: Numbers of voxels along x, y, z, which divide extents in `texts`.
        override: "voxel", where the user says that the file is wrong.

    Raises:
        RefusedError: A stated distance is not above 0 and finite; a unit is unknown beside a known
            one; or sides or ratios differ by more than 1 %.
    """
    if "voxel" in override:
        return
    # The case's sides are those of the array's axes (z, y, x), a file states x, y, z.
    expected = list(reversed(sides))
    stated = found.distances[: len(sides)]
    units = [unit.strip() for unit in found.units]
    known = [k for k, length in enumerate(stated) if not math.isnan(length)]
    shown = " × ".join(f"{stated[k]:g} {units[k]}".strip() for k in known)
    shown = f"voxels of {shown} along {', '.join('xyz'[k] for k in known)}"
    are_lengths = all(0 < stated[k] < math.inf for k in known)
    require(are_lengths, name, shown, "spacings greater than 0, or none")
    # Without a known unit the ratios of the sides count: of all axes in the unit of the first one.
    factors = [factor_of(unit, "m") or math.nan for unit in units]
    has_units = not all(math.isnan(factors[k]) for k in known)
    if not has_units:
        is_one = len({units[k] for k in known}) < 2
        require(is_one, name, shown, f"units {LENGTHS}")
        scales = [expected[k] / stated[k] for k in known] or [1.0]
        factors = [scales[0]] * len(stated)
    what = f"said to have voxels of {' × '.join(f'{side:g} m' for side in expected)}"
    are_alike = all(math.isclose(stated[k] * factors[k], expected[k], rel_tol=0.01) for k in known)
    require(are_alike, name, what, shown, 'give the voxel as it is, or say override = ["voxel"]')
    values = dict(enumerate(expected))
    if len(expected) == VOLUME:
        values[VOLUME] = math.prod(expected)
    lengths = [one for text in found.texts for one in _lengths_in(folded(text), counts)]
    has_depth = any(one.axes == (2,) for one in lengths)
    for one in lengths:
        # Beside the distance of slices the side of a voxel is that within a slice.
        axes = one.axes[:2] if has_depth and len(one.axes) == 3 else one.axes
        if len(axes) == 3 and len({stated[k] for k in known}) > 1:
            axes = (min(known, key=stated.__getitem__),)  # the side to which the ratios belong
        for axis in values.keys() & set(axes):
            place = "m^3" if axis == VOLUME else f"m along {'xyz'[axis]}"
            said = Stated(values[axis], f"of {values[axis]:g} {place}")
            settled(name, "voxel", [one.stated], said, tolerance=0.03 if axis == VOLUME else 0.01)
    if has_units or not lengths or any(one.axes for one in lengths):
        return
    # Lengths of which no word says what they are must be those of the case, or of the volume.
    extents = [side * count for side, count in zip(expected, counts, strict=False)]
    own = [one.stated.value for one in lengths]
    is_like = all(_is_among(x, (*expected, *extents)) for x in own)
    is_like &= all(_is_among(x, own) for x in expected) or any(_is_among(x, own) for x in extents)
    shown = " and ".join(str(one.stated) for one in lengths)
    cure = 'say override = ["voxel"] if that is something else'
    require(is_like, name, what, f"a length of {shown}", cure)


def _is_among(length: float, others: Iterable[float]) -> bool:
    """Return whether a length is one of some others, to 1 %."""
    return any(math.isclose(length, other, rel_tol=0.01) for other in others)


class _Length(NamedTuple):
    """A length that a text states, and the axes, 0, 1, 2 of x, y, z, of which it is the side.

    Without axes it may be something else. The axis `VOLUME` stands for the volume of a voxel.
    """

    axes: tuple[int, ...]
    stated: Stated


def _lengths_in(text: str, counts: Sequence[int]) -> Iterator[_Length]:
    """Yield the lengths in a line of text that are, or may be, sides of voxels.

    Args:
        text: The line.
        counts: Numbers of voxels along x, y, z, which divide extents; none if unknown.
    """
    found = mentions(text)
    unit = unit_in_texts([text])
    if unit and not re.search(_OTHERS, text):
        for match in re.finditer(_BARE_SIDE, without_units(text, found)):
            side = Stated(factor_of(unit, "m") * float(match[2]), match[0])
            yield _Length(("xyz".index(match[1].lower()),) if match[1] else (0, 1), side)
    groups: list[list[Mention]] = []
    for one in found:
        # Numbers with a unit each, as "2um;2um;5um", are those of one axis after another.
        if groups and len(one.numbers) == 1 and re.fullmatch(r"[\s,;x×*()]+", one.before):
            groups[-1].append(one)
        elif one.numbers:
            groups.append([one])
    if not groups and has_unknown_words(text) and re.search(r"\d", text):
        yield _Length((), Stated(math.nan, text.strip()[:60]))
    for group in groups:
        first = group[0]
        if first.dimension in ("m-1 pixel", "m-1 voxel", "m pixel-1", "m voxel-1"):
            length = (first.values[0] or math.nan) ** (-1 if "m-1" in first.dimension else 1)
            axes = (0, 1, 2) if "voxel" in first.dimension else (0, 1)
            yield _Length(axes, Stated(length, first.shown))
        elif first.dimension == "m3" and len(first.numbers) == 1 and "vox" in first.before.lower():
            yield _Length((VOLUME,), Stated(first.values[0], first.shown))
        elif first.dimension == "m" or (first.dimension == "m3" and len(first.numbers) == 3):
            scale = first.unit.factor ** (1 if first.dimension == "m" else 1 / 3)
            lengths = [scale * number for one in group for number in one.numbers]
            # Of the bar of a scale, as "50 um = 10 px".
            pixels = re.search(rf"({NUMBER})\s*pi?x\w*\s*=\s*$", text[: first.start])
            pixels = pixels or re.match(rf"\s*=\s*({NUMBER})\s*pi?x", text[group[-1].end :])
            if pixels and len(lengths) == 1:
                length = lengths[0] / (float(pixels[1]) or math.nan)
                yield _Length((0, 1), Stated(length, f"{first.shown} of {pixels[1]} pixels"))
                continue
            yield from _sides_of(first.before, group[-1].behind, lengths, counts, first.shown)


def _sides_of(
    before: str, behind: str, lengths: Sequence[float], counts: Sequence[int], shown: str
) -> Iterator[_Length]:
    """Yield what one or several lengths beside each other are, by the words around them."""
    around = f"{before[-60:]} | {re.split('[,;]', behind)[0][:25]}"
    is_side = re.search(_SIDES, around) is not None
    axes: tuple[int, ...] = ()
    if re.search(_EXTENT, around):
        # A single extent is that of the width.
        for axis, (length, count) in enumerate(zip(lengths, counts, strict=False)):
            yield _Length((axis,), Stated(length / count, f"{shown} of {count} voxels"))
        return
    if re.search(_OTHERS, around) and not is_side:
        return
    # Beside a magnification, the pixels of a camera are larger.
    is_of_camera = re.search("(?i)detector|camera|sensor|magnif|binn", around) is not None
    is_side = is_side and not is_of_camera
    if len(lengths) == 3 and is_side:
        for axis, length in enumerate(lengths):
            yield _Length((axis,), Stated(length, shown))
        return
    if len(lengths) == 1 and not is_of_camera:
        if match := re.search(_AXIS, before):
            axes = tuple("xyz".index(letter) for letter in dict.fromkeys(match[1].lower()))
        elif re.search(_ALONG_Z, around):
            axes = (2,)
        elif re.search(_PIXEL, before):
            axes = (0, 1)
        elif is_side:
            axes = (0, 1, 2)
    for length in lengths:
        yield _Length(axes, Stated(length, shown))


def unit_in_texts(texts: Iterable[str]) -> str:
    """Return the unit of all lengths that lines state, as "lengths in um"; empty if none does."""
    announced = re.compile(r"(?i)\bin\W*$|unit|[\[(]$|^\W*(?:comment)?\W*$")
    for text in texts:
        for one in mentions(text):
            if one.dimension == "m" and not one.numbers and announced.search(one.before):
                return one.text
    return ""


def spacing_of_resolution(x: float, y: float) -> StatedSpacing:
    """Return what resolutions, in pixels per inch along x and y, state of the pixels.

    Programs write those of printers, 72 to 2400 in whole numbers, whatever the pixels are: of these
    the ratio alone counts, if it is not 1. Round numbers in a metre are written on purpose.
    """
    inches = [1 / number if 0 < number < math.inf else math.nan for number in (x, y)]
    if x > 2:
        half_thousands = x / 12.7  # in a metre
        is_round = abs(half_thousands - round(half_thousands)) < 1e-3
        if x > 2400 or is_round or abs(x - round(x)) > 0.02:
            return StatedSpacing(inches, ["in", "in"])
    return StatedSpacing(inches if abs(x - y) > 0.01 * y else [], ["", ""])


def spacing_of_tags(tags: Mapping[int, object]) -> StatedSpacing:
    """Return what a page of TIFF states in its tags: of OME, ImageJ, microscopes or TIFF itself.

    TIFF itself has no distance along z.

    Args:
        tags: Values of the tags by their numbers.
    """
    words = {code: _plain(text) for code, text in tags.items() if isinstance(text, str)}
    description = words.pop(270, "")
    words.pop(269, "")  # of a file, whose name states nothing
    texts = list(words.values())
    # Lists of settings of Zeiss and FEI, whose lengths without a unit are in m.
    settings = folded("\n".join(str(tags.get(code, "")) for code in (34118, 34680, 34682)))
    size = rf"(?i)pixel ?(?:size|(width)|height)[^\w.\n]+({NUMBER})[ ',]*([a-zμ]*)"
    for match in re.finditer(size, settings):
        unit = match[3] if factor_of(match[3], "m") else "m"
        axis = "x = " if match[1] else ""
        texts.append(f"pixel size {axis}{match[2]} {unit}")
    if "<OME" in description:
        return _ome_spacing(description)._replace(texts=texts)
    x, y = (_reciprocal(tags.get(code)) for code in (282, 283))
    head = dict(re.findall(r"(?m)^(\w+)=(.*?)\s*$", description))
    if "ImageJ" in head:
        # ImageJ writes the units of y and z where they differ from that of x.
        keys = ("unit", "yunit", "zunit")
        units = [head.get(key, head.get("unit", "")).replace("\\u00B5", "µ") for key in keys]
        if units[0].lower() in ("", "pixel", "pixels", "null"):
            units = [""] * 3
            # Without a unit of length ImageJ's spacing is in pixels.
            if math.isnan(x) or x == y == 1:
                x = y = 1.0
        return StatedSpacing([x, y, _number(head.get("spacing", ""))], units, texts)
    texts.append(description)
    unit = str(tags.get(296, 2))
    if unit == "3":  # centimetres, which are written on purpose; inches are often a printer's
        return StatedSpacing([x, y], ["cm", "cm"], texts)
    found = spacing_of_resolution(1 / x, 1 / y) if unit == "2" else StatedSpacing([x, y], ["", ""])
    return found._replace(texts=texts)


def _plain(text: str) -> str:
    """Return a text of a tag, which Pillow takes as Latin-1 and programs write in UTF-8, too."""
    try:
        return decoded(text.encode("latin-1"))
    except UnicodeEncodeError:
        return folded(text)


def _ome_spacing(head: str) -> StatedSpacing:
    """Return the distances of voxels along x, y, z in a head of OME-XML, and their units.

    Args:
        head: Text of the head, of which the attributes PhysicalSizeX, …Unit and so on are used.

    Returns:
        NaN for a distance that is missing or no number. If one unit is stated, those that are not
        are µm, as OME says; else all are empty.
    """
    attributes = dict(re.findall(r'\bPhysicalSize(\w+)\s*=\s*"([^"]*)"', head))
    default = "µm" if any(len(key) > 1 for key in attributes) else ""
    units = [attributes.get(f"{axis}Unit", default) for axis in "XYZ"]
    units = [re.sub("&#(?:181|xB5);", "µ", unit) for unit in units]
    return StatedSpacing([_number(attributes.get(axis, "")) for axis in "XYZ"], units)


def _number(text: str) -> float:
    """Return the number that a text is, nan where it is none."""
    try:
        return float(text)
    except ValueError:
        return math.nan


def _reciprocal(value: object) -> float:
    """Return 1 over the value of a tag, a number or a fraction; nan without one above 0."""
    numbers = [*map(float, re.findall(NUMBER, str(value))), 1.0]
    return numbers[1] / numbers[0] if len(numbers) > 1 and numbers[0] > 0 else math.nan
