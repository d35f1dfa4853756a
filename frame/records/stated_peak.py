"""Peak accelerations that heads of records state, and how the samples agree with them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import require
from alphacut.base.number_text import STANDARD_GRAVITY
from alphacut.frame.records.units import acceleration_factor

STATED = re.compile(
    r"\b(?:PGA|(?:peak|pk|max(?:imum)?)\b\.?(?:\s*(?:ground\s+)?acc\w*\.?)?(?:\s*value)?)\s*"
    r"(?:[(\[]([^)\]]+)[)\]]\s*[=:]?|[=:])\s*"
    r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*[(\[]?([^\s,;)\]]*)",
    re.IGNORECASE,
)
"""A peak in a line of a head, as "MAX = 0.030 G" or "Max. Acc. (gal) 632.2": unit, number, unit."""
TOLERANCE = 0.05
"""Relative difference of both peaks that is not remarked, since networks filter and interpolate."""
MAX_RATIO = 2.0
"""Ratio of both peaks beyond which a file is refused: its unit or its samples are wrong."""


@dataclass(frozen=True)
class StatedPeak:
    """Magnitude of a peak acceleration that a head states, and the rounding of its digits, m/s²."""

    magnitude: float
    rounding: float = 0.0


def peaks_in_text(lines: Iterable[str], unit: str) -> Iterator[StatedPeak]:
    """Yield the peak accelerations that lines of a head state; `unit` is for those without one.

    Peaks in units of another quantity, as of velocities, and zeros are left out.
    """
    for line in lines:
        for match in STATED.finditer(line):
            before, number, behind = match.groups()
            own_unit = before or behind
            is_without = own_unit is None or own_unit.lower() in ("", "at")
            to_si = acceleration_factor(unit if is_without else own_unit)
            if to_si is None or float(number) == 0:
                continue
            digits = number.lower().partition("e")[0].partition(".")[2]
            exponent = int(number.lower().partition("e")[2] or 0)
            half_digit = 0.5 * 10.0 ** (exponent - len(digits))
            yield StatedPeak(to_si * abs(float(number)), to_si * half_digit)


def remarks_on_peak(
    location: str, samples: Array, stated: Iterable[StatedPeak], unit: str
) -> tuple[str, ...]:
    """Return a clause if the peak of the samples is none of those that the head states.

    A peak may be that of the samples or of the samples without their mean: networks state the peak
    of a record before or after they remove the offset of its sensor.

    Args:
        location: File and line, for the message.
        samples: Accelerations in m/s², shape (n,).
        stated: Peaks in the head; a head may state those of the raw and of the corrected series.
        unit: Unit in which the samples were read, for the message.

    Raises:
        RefusedError: The nearest stated peak is more than `MAX_RATIO` times larger or smaller.
    """
    peaks = [peak for peak in stated if 0 < peak.magnitude < np.inf]
    if not peaks or len(samples) == 0:
        return ()
    found = [float(np.abs(samples).max()), float(np.abs(samples - samples.mean()).max())]
    ratios = []
    for peak in peaks:
        for magnitude in found:
            difference = abs(magnitude - peak.magnitude)
            if difference <= peak.rounding + TOLERANCE * peak.magnitude:
                return ()
            ratios.append(max(magnitude, 1e-300) / peak.magnitude)
    ratio = min(ratios, key=lambda ratio: abs(np.log(ratio)))
    in_g = f"{found[0] / STANDARD_GRAVITY:.3g} g"
    stated_in_g = f"{peaks[-1].magnitude / STANDARD_GRAVITY:.3g} g"
    what = f"a peak of {in_g}, where its head states {stated_in_g}"
    cure = f"look at the unit, {unit}, and mend the head"
    is_near = 1 / MAX_RATIO <= ratio <= MAX_RATIO
    require(is_near, location, what, "samples whose peak is that of the head", cure)
    return (f"its peak is {in_g}, and its head states {stated_in_g}: check the unit {unit}",)
