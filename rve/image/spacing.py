"""Distances of pixels and voxels that a file states, beside those of the case."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

from alphacut.base.errors import RefusedError, require

MAX_RATIO = 1.01
"""Of two ratios of sides that count as equal: heads round to two or three digits."""
OME_UNITS = {
    "pm": 1e-6, "nm": 1e-3, "µm": 1.0, "um": 1.0, "μm": 1.0, "mm": 1e3, "cm": 1e4, "m": 1e6,
    "Å": 1e-4, "&#181;m": 1.0, "&#xB5;m": 1.0,
}  # fmt: skip
"""Micrometres of the units of lengths in OME's heads."""
OME_SIZE = r'\bPhysicalSize{0}\s*=\s*"([^"]*)"'
OME_UNIT = r'\bPhysicalSize{0}Unit\s*=\s*"([^"]*)"'


def require_spacing(name: str, stated: Sequence[float], sides: Sequence[float]) -> None:
    """Refuse voxels whose sides have other ratios than those of the case.

    Args:
        name: Name of the file.
        stated: Distances of voxels along x, y, z that the file states, in any unit; nan where it
            states none.
        sides: Sides of a voxel of the case along (z, y, x), in any unit.

    Raises:
        RefusedError: A stated distance is not above 0, or the ratios differ by more than 1 %.
    """
    known = [not math.isnan(x) for x in stated]
    shown = " × ".join(f"{x:g}" for x in stated)
    are_lengths = all(
        0 < x < math.inf for x, is_known in zip(stated, known, strict=True) if is_known
    )
    require(are_lengths, name, f"voxels of {shown}", "spacings greater than 0, or none")
    given = list(reversed(sides))
    ratios = [x / side for x, side, is_known in zip(stated, given, known, strict=True) if is_known]
    if ratios and max(ratios) > MAX_RATIO * min(ratios):
        allowed = " : ".join(f"{side:g}" for side in given)
        cure = "give cell.voxel = [x, y, z] as they are"
        raise RefusedError(name, f"voxels of {shown} along x, y, z", allowed, cure)


def ome_spacing(head: str) -> tuple[float, float, float]:
    """Return the distances of voxels along x, y, z in a head of OME-XML; nan where it has none.

    They are in µm if all their units are known, else without a unit.
    """
    lengths, factors = [], []
    for axis in "XYZ":
        size = re.search(OME_SIZE.format(axis), head)
        unit = re.search(OME_UNIT.format(axis), head)
        lengths.append(_length(size[1] if size else ""))
        factors.append(OME_UNITS.get(unit[1] if unit else "µm", math.nan))
    if any(math.isnan(factor) for factor in factors):
        factors = [1.0] * 3
    x, y, z = (length * factor for length, factor in zip(lengths, factors, strict=True))
    return x, y, z


def _length(text: str) -> float:
    """The number in a text, nan where it is none."""
    try:
        return float(text)
    except ValueError:
        return math.nan
