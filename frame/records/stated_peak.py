"""Peak accelerations that heads of records state, compared with the samples."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import require
from alphacut.base.number_text import STANDARD_GRAVITY
from alphacut.base.units import ACCELERATION, factor_of


@dataclass(frozen=True)
class StatedPeak:
    """Magnitude of a peak acceleration that a head states, and the rounding of its digits, m/s²."""

    magnitude: float
    rounding: float = 0.0


def peaks_in_text(lines: Iterable[str], unit: str) -> Iterator[StatedPeak]:
    """Yield the peak accelerations that lines of a head state, as "MAX = 0.030 G".

    The unit may stand before the number as well, as in "Max. Acc. (gal) 632.2". Peaks in units of
    another quantity, as of velocities, and zeros are left out. So are those of the uncorrected
    record, as "Uncor Max = -.402 g", where a line states another one.

    Args:
        lines: Lines of the head.
        unit: Unit of peaks that are stated without one. If it is empty or unknown, these are left
            out.

    Yields:
        The magnitude of each peak in m/s², in the order of the text, and half a unit of its last
        digit in m/s², by which it may be rounded.
    """
    name = r"(?:PGA|(?:peak|pk|max(?:imum)?)\b\.?(?:\s*(?:ground\s+)?acc\w*\.?)?(?:\s*value)?)"
    unit_before = r"(?:[(\[](?P<before>[^)\]]+)[)\]]\s*[=:]?|[=:])"
    number = r"(?P<number>[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)"
    unit_behind = r"[(\[]?(?P<behind>[^\s,;)\]]*)"
    pattern = rf"\b{name}\s*{unit_before}\s*{number}\s*{unit_behind}"
    found: dict[bool, list[StatedPeak]] = {False: [], True: []}  # True of uncorrected ones
    for line in lines:
        for match in re.finditer(pattern, line, re.IGNORECASE):
            own_unit = match["before"] or match["behind"]
            is_without = own_unit.lower() in ("", "at")
            to_si = factor_of(unit if is_without else own_unit, ACCELERATION)
            magnitude = abs(float(match["number"]))
            if to_si * magnitude == 0:
                continue
            # The number is rounded to half a unit of its last decimal: 0.030 to 0.0005, 1.2e2 to 5.
            mantissa, _, exponent = match["number"].lower().partition("e")
            decimals = len(mantissa.partition(".")[2])
            rounding = 0.5 * 10.0 ** (int(exponent or 0) - decimals)
            peak = StatedPeak(to_si * magnitude, to_si * rounding)
            found["uncor" in line[: match.start()].lower()].append(peak)
    yield from found[False] or found[True]


def remarks_on_peak(
    location: str, samples: Array, stated: Iterable[StatedPeak], unit: str
) -> tuple[str, ...]:
    """Return a clause if the samples have another peak than the head states.

    The result is empty if they agree, or if there are no samples or no stated peaks.

    A peak may be that of the samples or of the samples without their mean: networks state the peak
    of a record before or after they remove the offset of its sensor. Differences up to 5 %, beside
    the rounding of the stated number, are not remarked, since networks filter and interpolate.

    Args:
        location: File and line, for the message.
        samples: Accelerations in m/s², shape (n,).
        stated: Peaks in the head; a head may state those of the raw and of the corrected series.
        unit: Unit in which the samples were read, for the message.

    Raises:
        RefusedError: The nearest stated peak is more than twice as large or small as that of the
            samples, so that the unit or the samples are wrong.
    """
    peaks = [peak for peak in stated if 0 < peak.magnitude < np.inf]
    if not peaks or len(samples) == 0:
        return ()
    with_mean = float(np.abs(samples).max())
    without_mean = float(np.abs(samples - samples.mean()).max())
    magnitudes = (with_mean, without_mean)
    for peak in peaks:
        if any(
            abs(x - peak.magnitude) <= peak.rounding + 0.05 * peak.magnitude for x in magnitudes
        ):
            return ()
    ratios = np.outer(magnitudes, [1 / peak.magnitude for peak in peaks])
    nearest = np.maximum(ratios, 1 / np.maximum(ratios, 1e-300)).min()
    in_g = f"{with_mean / STANDARD_GRAVITY:.3g} g"
    stated_in_g = f"{peaks[-1].magnitude / STANDARD_GRAVITY:.3g} g"
    what = f"a peak of {in_g}, where its head states {stated_in_g}"
    cure = f"look at the unit, {unit}, and mend the head"
    allowed = "samples whose peak is that of the head"
    # Units are mistaken by factors of 9.8 (g) and 100 (gal), and filters change a peak by less than
    # a factor of 2 (tuned): beyond it the record is refused, and not only remarked.
    require(bool(nearest <= 2), location, what, allowed, cure)
    return (f"its peak is {in_g}, and its head states {stated_in_g}: check the unit {unit}",)
