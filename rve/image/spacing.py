"""Distances of pixels and voxels that a file states, beside those of the case."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterable, Iterator, Sequence

from alphacut.base.errors import require
from alphacut.base.stated import LENGTHS, METRES, Stated, settled

_UNITS = "|".join(sorted(METRES, key=len, reverse=True))
_NUMBER = r"(\d+\.?\d*(?:e[-+]?\d+)?|\.\d+)"
# Sides of voxels, as "voxel size 2 x 2 x 5 um", "pixel: 2 um" or "slice thickness = 5 um".
_SIDES = (
    r"(slice|layer|section|\bz)?s?[\s_-]*(vox|pix|px|edge|sampling|scale|spac|resol|thick|isotrop|every|step)"
    rf"(?:(?!slice|layer|section|\bz\b)[^\d\n]){{0,40}}{_NUMBER}"
    rf"(?:\s*(?:[x×,;*]|\s)\s*{_NUMBER}\s*[x×,;*\s]\s*{_NUMBER})?\s*[\[(]?({_UNITS})(?![a-z])"
)
# The side along one axis, as "dx=2um" or "x: 2 um", and the extent of the whole volume.
_AXIS = (
    r"(?:(?:^d?|\bd)([xyz])[\"']?[\s:=]+|\b([xyz])[\"']?\s*[:=]\s*)"
    rf"{_NUMBER}\s*({_UNITS})?(?![a-z])"
)
_EXTENT = (
    rf"(?:field\s+of\s+view|\bfov|\bextents?)[^\d\n]{{0,20}}{_NUMBER}"
    rf"(?:[\sx×,;*]+{_NUMBER}[\sx×,;*]+{_NUMBER})?\s*({_UNITS})(?![a-z])"
)
_REWRITTEN = {
    # One unit behind each number, as "2um;2um;5um".
    rf"{_NUMBER}\s*({_UNITS})([\s,;x×*]+){_NUMBER}\s*\2([\s,;x×*]+){_NUMBER}\s*\2(?![a-z])": (
        r"\1 \4 \6 \2"
    ),
    # "2 um/pixel", and the unit before the numbers: "spacing (um): 2 2 5", "voxel_um: [2, 2, 5]".
    rf"({_NUMBER}\s*(?:{_UNITS}))\s*(?:/|per)\s*(vox|pix)\w*": r"\3: \1",
    rf"[\[(_]({_UNITS})[\])\"']*\s*[:=]*\s*[\[(]*({_NUMBER}(?:[\s,;x×*]+{_NUMBER}){{0,2}})": (
        r" \2 \1"
    ),
    r"vox(?:el)?[\s_]*depth": "slice spacing",
}


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
    units = [unit.strip().lower() for unit in units] or [""] * len(stated)
    shown = " × ".join(f"{x:g} {u}".strip() for x, u in zip(stated, units, strict=True))
    known = [k for k, length in enumerate(stated) if not math.isnan(length)]
    are_lengths = all(0 < stated[k] < math.inf for k in known)
    require(are_lengths, name, f"voxels of {shown}", "spacings greater than 0, or none")
    # Without a known unit the ratios of the sides count: of all axes in the unit of the first one.
    factors = [METRES.get(unit, math.nan) for unit in units]
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
    for text in texts:
        for pattern, written in _REWRITTEN.items():
            text = re.sub(pattern, written, text, flags=re.IGNORECASE)
        for axis, own in _sides_in(text, counts):
            if axis < len(expected):
                said = Stated(expected[axis], f"of {expected[axis]:g} m along {'xyz'[axis]}")
                settled(name, "voxel", [own], said, tolerance=0.01)


def _sides_in(text: str, counts: Sequence[int]) -> Iterator[tuple[int, Stated]]:
    """Yield the sides of voxels in a line of text, each with its axis: 0, 1, 2 of x, y, z.

    Args:
        text: The line, in which `_REWRITTEN` is rewritten.
        counts: Numbers of voxels along x, y, z, which divide extents; none if unknown.
    """
    # Voxels in a length, as "500 px/mm" or "12700 dpi".
    per_length = rf"{_NUMBER}\s*(?:(vox|pix|px)\w*\s*(?:/|per)\s*({_UNITS})(?![a-z])|[dp]pi\b)"
    for match in re.finditer(per_length, text, re.IGNORECASE):
        side = METRES[(match[3] or "inch").lower()] / (float(match[1]) or math.nan)
        n_axes = 3 if match[2] == "vox" else 2  # a pixel lies in a slice
        yield from ((axis, Stated(side, match[0])) for axis in range(n_axes))
    for match in re.finditer(_SIDES, text, re.IGNORECASE):
        axis_word, what, first, second, third, unit = match.groups()
        # Slices lie along z, and a pixel lies in a slice.
        is_of_pixel = axis_word is None and what.lower() in ("pix", "px") and third is None
        for axis, length in enumerate((first, second or first, third or first)):
            if not (axis_word and axis < 2) and not (is_of_pixel and axis == 2):
                yield axis, Stated(METRES[unit.lower()] * float(length), match[0])
    if not re.search("(?i)origin|offset|position|corner|centre|center", text):
        for match in re.finditer(_AXIS, text, re.IGNORECASE):
            unit = match[4] or unit_in_texts([text])
            if unit:
                axis = "xyz".index((match[1] or match[2]).lower())
                yield axis, Stated(METRES[unit.lower()] * float(match[3]), match[0])
    for match in re.finditer(_EXTENT, text, re.IGNORECASE):
        lengths = (match[1], match[2] or match[1], match[3] or match[1])
        # A single extent is that of the width.
        for axis, count in enumerate(counts if match[3] else counts[:1]):
            length = METRES[match[4].lower()] * float(lengths[axis]) / count
            yield axis, Stated(length, match[0])


def unit_in_texts(texts: Iterable[str]) -> str:
    """Return the unit of all lengths that lines state, as "lengths in um"; empty if none does."""
    for text in texts:
        pattern = rf"(?:\bin|units?[\s\"']*[:=]*(?:\s*(?:are|is|of))?)\s*[\[(\"]?({_UNITS})\b"
        if match := re.search(pattern, text, re.IGNORECASE):
            return match[1]
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
