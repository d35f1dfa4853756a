"""Distances of pixels and voxels that a file states, beside those of the case."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterable, Iterator, Sequence
from typing import NamedTuple

from alphacut.base.errors import require
from alphacut.base.stated import LENGTHS, Stated, settled
from alphacut.base.units import NUMBER, Mention, factor_of, mentions, without_units

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
# A number of one axis without a unit.
_BARE_AXIS = rf"(?i)\bd?([xyz])[\"']?\s*[:=]\s*({NUMBER})(?!\s*[a-zµμ])"


def require_spacing(
    name: str,
    stated: Sequence[float],
    sides: Sequence[float],
    units: Sequence[str] = (),
    *,
    texts: Iterable[str] = (),
    counts: Sequence[int] = (),
    override: Collection[str] = (),
) -> None:
    """Refuse voxels of a file whose sides are not those of the case.

    Sides with a unit are compared as they are; of sides without one the ratios.

    Args:
        name: Name of the file, for messages.
        stated: Distances of voxels along x, y, z that the file states; NaN where it states none.
        sides: Sides of a voxel of the case along z, y, x, in m, positive.
        units: Unit of each of the distances; empty where the file states none, and none at all if
            there are no units.
        texts: Other lines of the file, which may state sides as well, as "voxel size 2.5 um".
        counts: Numbers of voxels along x, y, z, which divide extents in `texts`.
        override: "voxel", where the user says that the file is wrong.

    Raises:
        RefusedError: A stated distance is not above 0 and finite; a unit is unknown beside a known
            one; or sides or ratios differ by more than 1 %.
        ValueError: The numbers of distances and sides differ.
    """
    if "voxel" in override:
        return
    # The case's sides are those of the array's axes (z, y, x), a file states x, y, z.
    expected = list(reversed(sides))
    units = [unit.strip() for unit in units] or [""] * len(stated)
    shown = " × ".join(f"{x:g} {u}".strip() for x, u in zip(stated, units, strict=True))
    known = [k for k, length in enumerate(stated) if not math.isnan(length)]
    are_lengths = all(0 < stated[k] < math.inf for k in known)
    require(are_lengths, name, f"voxels of {shown}", "spacings greater than 0, or none")
    # Without a known unit the ratios of the sides count: of all axes in the unit of the first one.
    factors = [factor_of(unit, "m") or math.nan for unit in units]
    if all(math.isnan(factors[k]) for k in known):
        is_one = len({units[k] for k in known}) < 2
        require(is_one, name, f"voxels of {shown}", f"units {LENGTHS}")
        scales = [expected[k] / stated[k] for k in known] or [1.0]
        factors = [scales[0]] * len(stated)
        shown_sides = " : ".join(f"{side:g}" for side in expected)
    else:
        shown_sides = " × ".join(f"{side:g} m" for side in expected)
    are_alike = all(math.isclose(stated[k] * factors[k], expected[k], rel_tol=0.01) for k in known)
    cure = "give the voxel as it is"
    require(are_alike, name, f"voxels of {shown} along x, y, z", shown_sides, cure)
    found = [one for text in texts for one in _lengths_in(text, counts)]
    has_depth = any(one.axes == (2,) for one in found)
    unsure = [one.stated for one in found if not one.axes]
    for one in found:
        # Beside the distance of slices the side of a voxel is that within a slice.
        axes = one.axes[:2] if has_depth and len(one.axes) == 3 else one.axes
        if len(axes) == 3 and len({stated[k] for k in known}) > 1:
            axes = (min(known, key=stated.__getitem__),)  # the side to which the ratios belong
        for axis in axes:
            if axis < len(expected):
                said = Stated(expected[axis], f"of {expected[axis]:g} m along {'xyz'[axis]}")
                settled(name, "voxel", [one.stated], said, tolerance=0.01)
            elif axis == VOLUME == len(expected):
                said = Stated(math.prod(expected), f"of {math.prod(expected):g} m^3")
                settled(name, "voxel", [one.stated], said, tolerance=0.03)
    if not unsure or known or len(unsure) < len(found):
        return
    # Lengths of which no word says what they are must be those of the case, or of the volume.
    extents = [side * count for side, count in zip(expected, counts, strict=False)]
    for own in unsure:
        is_like = any(math.isclose(own.value, x, rel_tol=0.01) for x in (*expected, *extents))
        cure = 'say override = ["voxel"] if that is something else'
        require(is_like, name, f"of a length of {own}", f"voxels of {shown_sides}", cure)
    for axis, side in enumerate(expected):
        said = Stated(side, f"of {side:g} m along {'xyz'[axis]}")
        whole = extents[axis] if extents else math.nan
        if not any(math.isclose(x.value, whole, rel_tol=0.01) for x in unsure):
            settled(name, "voxel", [], said, tolerance=0.01, unsure=unsure)


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
        for match in re.finditer(_BARE_AXIS, without_units(text, found)):
            side = Stated(factor_of(unit, "m") * float(match[2]), match[0])
            yield _Length(("xyz".index(match[1].lower()),), side)
    groups: list[list[Mention]] = []
    for one in found:
        # Numbers with a unit each, as "2um;2um;5um", are those of one axis after another.
        if groups and len(one.numbers) == 1 and re.fullmatch(r"[\s,;x×*()]+", one.before):
            groups[-1].append(one)
        elif one.numbers:
            groups.append([one])
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
    announced = re.compile(r"(?i)\bin\W*$|unit|^\W*(?:comment)?\W*$")
    for text in texts:
        for one in mentions(text):
            if one.dimension == "m" and not one.numbers and announced.search(one.before):
                return one.text
    return ""


def ome_spacing(head: str) -> tuple[list[float], list[str]]:
    """Return the distances of voxels along x, y, z in a head of OME-XML, and their units.

    Args:
        head: Text of the head, of which the attributes PhysicalSizeX, …Unit and so on are used.

    Returns:
        NaN for a distance that is missing or no number. If one unit is stated, those that are not
        are µm, as OME says; else all are empty.
    """
    sizes = [re.search(rf'\bPhysicalSize{axis}\s*=\s*"([^"]*)"', head) for axis in "XYZ"]
    found = [re.search(rf'\bPhysicalSize{axis}Unit\s*=\s*"([^"]*)"', head) for axis in "XYZ"]
    default = "µm" if any(found) else ""
    micro = re.compile("&#(?:181|xB5);")
    units = [micro.sub("µ", unit[1]) if unit else default for unit in found]
    return [_length(size) for size in sizes], units


def _length(match: re.Match[str] | None) -> float:
    """Return the number in the first group of a match, nan where there is none."""
    try:
        return math.nan if match is None else float(match[1])
    except ValueError:
        return math.nan
