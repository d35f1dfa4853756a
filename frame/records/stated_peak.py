"""Peak accelerations that heads of records state and their times, compared with the samples."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import require
from alphacut.base.number_text import STANDARD_GRAVITY
from alphacut.base.units import ACCELERATION, factor_of


@dataclass(frozen=True)
class StatedPeak:
    """Magnitude of a peak acceleration that a head states, and the rounding of its digits, m/s².

    `time` is that of the peak after the first sample, in s; 0 if the head does not state it.
    """

    magnitude: float
    rounding: float = 0.0
    time: float = 0.0


def peaks_in_text(lines: Iterable[str], unit: str) -> Iterator[StatedPeak]:
    """Yield the peak accelerations that lines of a head state, as "MAX = 0.030 G".

    The unit may stand before the number as well, as in "Max. Acc. (gal) 632.2", and a time behind
    it, as in "-388.166 cm/sec/sec at 35.020 sec". Peaks in units of another quantity, as of
    velocities, and zeros are left out. So are those of the uncorrected record, as "Uncor Max =
    -.402 g", where a line states another one.

    Args:
        lines: Lines of the head.
        unit: Unit of peaks that are stated without one. If it is empty or unknown, these are left
            out.

    Yields:
        The magnitude of each peak in m/s², in the order of the text; half a unit of its last digit
        in m/s², by which it may be rounded; and its time in s, 0 if none is stated.
    """
    name = r"(?:PGA|(?:peak|pk|max(?:imum)?)\b\.?(?:\s*(?:ground\s+)?acc\w*\.?)?(?:\s*value)?)"
    unit_before = r"(?:[(\[](?P<before>[^)\]]+)[)\]]\s*[=:]?|[=:])"
    number = r"(?P<number>[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)"
    unit_behind = r"[(\[]?(?P<behind>[^\s,;)\]]*)"
    time = r"(?:[\s,;)\]]*\bat\s+(?P<time>\d+\.?\d*|\.\d+)\s*s(?:ec)?\b)?"
    pattern = rf"\b{name}\s*{unit_before}\s*{number}\s*{unit_behind}{time}"
    uncorrected = list[StatedPeak]()
    is_stated = False
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
            peak = StatedPeak(to_si * magnitude, to_si * rounding, float(match["time"] or 0))
            if re.search(r"\buncor", line[: match.start()], re.IGNORECASE):
                uncorrected.append(peak)
            else:
                is_stated = True
                yield peak
    if not is_stated:
        yield from uncorrected


def remarks_on_peak(
    location: str, samples: Array, stated: Iterable[StatedPeak], unit: str, *, step: float
) -> tuple[str, ...]:
    """Return a clause if the samples have another peak, or at another time, than the head states.

    The result is empty if they agree, or if there are no samples or no stated peaks.

    A peak may be that of the samples or of the samples without their mean: networks state the peak
    of a record before or after they remove the offset of its sensor. Differences up to 5 %, beside
    the rounding of the stated number, are not remarked, since networks filter and interpolate.

    Args:
        location: File and line, for the message.
        samples: Accelerations in m/s², shape (n,).
        stated: Peaks in the head; a head may state those of the raw and of the corrected series.
        unit: Unit in which the samples were read, for the message.
        step: Time between samples, in s.

    Raises:
        RefusedError: The nearest stated peak is more than twice as large or small as that of the
            samples, so that the unit or the samples are wrong.
    """
    peaks = [peak for peak in stated if 0 < peak.magnitude < np.inf]
    if not peaks or len(samples) == 0:
        return ()
    with_mean = float(np.abs(samples).max())
    without_mean = float(np.abs(samples - samples.mean()).max())
    agreeing = []
    differences = []  # logarithms of the ratios
    for peak in peaks:
        for magnitude in (with_mean, without_mean):
            if abs(magnitude - peak.magnitude) <= peak.rounding + 0.05 * peak.magnitude:
                agreeing.append(peak)
            # The floor keeps the logarithm of a record of zeros finite; it is refused below.
            differences.append(abs(np.log(max(magnitude, 1e-300) / peak.magnitude)))
    if agreeing:
        return _remarks_on_time(samples, [peak.time for peak in agreeing if peak.time], step)
    in_g = f"{with_mean / STANDARD_GRAVITY:.3g} g"
    stated_in_g = f"{peaks[-1].magnitude / STANDARD_GRAVITY:.3g} g"
    what = f"a peak of {in_g}, where its head states {stated_in_g}"
    cure = f"look at the unit, {unit}, and mend the head"
    allowed = "samples whose peak is that of the head"
    # Units are mistaken by factors of 9.8 (g) and 100 (gal), and filters change a peak by less than
    # a factor of 2 (tuned): beyond it the record is refused, and not only remarked.
    require(min(differences) <= np.log(2), location, what, allowed, cure)
    return (f"its peak is {in_g}, and its head states {stated_in_g}: check the unit {unit}",)


def _remarks_on_time(samples: Array, times: Sequence[float], step: float) -> tuple[str, ...]:
    """Return a clause if the samples come near their peak at none of the times the head states.

    Args:
        samples: Accelerations, shape (n,), with n ≥ 1.
        times: Times of the peak after the first sample that the head states, in s, above 0. Without
            any the result is empty.
        step: Time between samples, in s.
    """
    sample_times = step * np.arange(len(samples))
    # The peak may be that of the samples without their mean.
    series = (np.abs(samples), np.abs(samples - samples.mean()))
    for time in times:
        # A wrong step moves the peak by a factor, while filters move it by few samples: 5 % of the
        # time, two steps and 0.05 s (tuned) are more than the latter. As a record may have two
        # peaks of nearly the same height, it is enough that it comes near its peak there.
        is_near = np.abs(sample_times - time) <= 0.05 * time + 2 * step + 0.05
        if any((values[is_near] >= 0.95 * values.max()).any() for values in series):
            return ()
    if not times:
        return ()
    peak_time = sample_times[series[0].argmax()]
    return (
        f"its peak lies at {peak_time:g} s, and its head states {times[-1]:g} s: check the step",
    )
