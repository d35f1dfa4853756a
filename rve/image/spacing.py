"""Distances of pixels and voxels that a file states, beside those of the case."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

from alphacut.base.errors import require


def require_spacing(name: str, stated: Sequence[float], sides: Sequence[float]) -> None:
    """Refuse voxels of a file whose sides have other ratios than those of the case.

    Only the ratios of the sides that the file states are compared, so that one alone is allowed.

    Args:
        name: Name of the file, for messages.
        stated: Distances of voxels along x, y, z that the file states, in any unit; NaN where it
            states none.
        sides: Sides of a voxel of the case along z, y, x, in any unit, positive.

    Raises:
        RefusedError: A stated distance is not above 0 and finite, or the ratios differ by more than
            1 %.
        ValueError: The numbers of distances and sides differ.
    """
    # The case's sides are those of the array's axes (z, y, x), a file states x, y, z.
    expected = list(reversed(sides))
    pairs = zip(stated, expected, strict=True)
    known = [(length, side) for length, side in pairs if not math.isnan(length)]
    shown = " × ".join(f"{length:g}" for length in stated)
    are_lengths = all(0 < length < math.inf for length, _ in known)
    require(are_lengths, name, f"voxels of {shown}", "spacings greater than 0, or none")
    ratios = [length / side for length, side in known] or [1.0]
    is_alike = max(ratios) <= 1.01 * min(ratios)  # heads round to two or three digits
    allowed = " : ".join(f"{side:g}" for side in expected)
    cure = "give cell.voxel = [x, y, z] as they are"
    require(is_alike, name, f"voxels of {shown} along x, y, z", allowed, cure)


def ome_spacing(head: str) -> tuple[float, float, float]:
    """Return the distances of voxels along x, y, z in a head of OME-XML.

    Args:
        head: Text of the head, of which the attributes PhysicalSizeX, …Unit and so on are used.

    Returns:
        Distances in µm if all units that are stated are known; a side without a unit counts as µm.
        If one unit is not known, the three plain numbers. NaN for a distance that is missing or no
        number.
    """
    micrometres = {
        "pm": 1e-6, "nm": 1e-3, "µm": 1.0, "um": 1.0, "μm": 1.0, "mm": 1e3, "cm": 1e4, "m": 1e6,
        "Å": 1e-4, "&#181;m": 1.0, "&#xB5;m": 1.0,
    }  # fmt: skip
    lengths = []
    factors = []
    for axis in "XYZ":
        size = re.search(rf'\bPhysicalSize{axis}\s*=\s*"([^"]*)"', head)
        unit = re.search(rf'\bPhysicalSize{axis}Unit\s*=\s*"([^"]*)"', head)
        lengths.append(_length(size))
        factors.append(1.0 if unit is None else micrometres.get(unit[1], math.nan))
    # Ratios need no unit, if all lengths have the same unknown one.
    if any(math.isnan(factor) for factor in factors):
        factors = [1.0] * 3
    x, y, z = (length * factor for length, factor in zip(lengths, factors, strict=True))
    return x, y, z


def _length(match: re.Match[str] | None) -> float:
    """Return the number in the first group of a match, nan where there is none."""
    try:
        return math.nan if match is None else float(match[1])
    except ValueError:
        return math.nan
