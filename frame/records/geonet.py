"""Records of GeoNet (New Zealand): corrected files V2A, three components one after another.

A component has 16 lines of text, 4 lines of integers and 6 of reals, ten to a line of 8 columns
each, then accelerations in mm/s², velocities and displacements in the same columns. Integers 34,
35 and 36 count them; real 26 is their step in s, real 36 the peak of the accelerations.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from math import ceil

from alphacut.base.arrays import Array
from alphacut.frame.records.recording import Recording
from alphacut.frame.records.stated_peak import StatedPeak
from alphacut.frame.records.text_file import TextFile, choose_channel, recording_in_si

GEONET = re.compile(r"\s*(UN)?CORRECTED ACCELEROGRAM\b.*\bGNS\b", re.IGNORECASE)
TEXT_LINES, INTEGER_LINES, REAL_LINES = 16, 4, 6
HEAD_LINES = TEXT_LINES + INTEGER_LINES + REAL_LINES
PER_LINE, WIDTH = 10, 8
COUNTS, STEP, PEAK = slice(33, 36), 25, 35
"""Places, from 0: counts of samples in the integers; step and peak in the reals."""
UNIT = "mm/s/s"
COMPONENT = re.compile(r"Component\s+(\S+)")


def is_geonet(file: TextFile) -> bool:
    """True if the first line is that of GeoNet's files of one accelerogram."""
    return GEONET.match(file.lines[0]) is not None


def read_geonet(file: TextFile, channel: str = "") -> Recording:
    """Recording of one component, which is named by its number or orientation, as "1" or "S90E".

    Raises:
        RefusedError: The file is not corrected, a head does not tell counts and step, or samples
            are missing.
    """
    match = GEONET.match(file.lines[0])
    if match is not None and match[1]:
        cure = "take the corrected file of the same record, .V2A"
        raise file.refusal(0, file.lines[0].strip(), "a corrected accelerogram", cure)
    starts = [*_starts(file)]
    names = []
    for number, start in enumerate(starts, 1):
        found = (COMPONENT.match(line) for line in file.lines[start : start + TEXT_LINES])
        component = next((x[1].lower() for x in found if x), "")
        names.append(tuple(filter(None, (str(number), component))))
    chosen = choose_channel(file.location(0), channel, names)
    start = starts[chosen]
    reals = _reals(file, start)
    first, count = start + HEAD_LINES, _counts(file, start)[0]
    samples = file.numbers(first, first + ceil(count / PER_LINE), width=WIDTH)
    file.require_count(samples, count, start + TEXT_LINES)
    return recording_in_si(
        file.location(start + TEXT_LINES + INTEGER_LINES),
        "GeoNet V2A",
        UNIT,
        float(reals[STEP]),
        samples,
        " ".join(names[chosen]),
        stated=[StatedPeak(1e-3 * abs(float(reals[PEAK])))],
    )


def _starts(file: TextFile) -> Iterator[int]:
    """Yield the first line, from 0, of each component."""
    start = 0
    while start < len(file.lines) and GEONET.match(file.lines[start]):
        yield start
        blocks = (ceil(count / PER_LINE) for count in _counts(file, start))
        start += HEAD_LINES + sum(blocks)


def _counts(file: TextFile, start: int) -> list[int]:
    """Return the counts of accelerations, velocities and displacements below a head."""
    first = start + TEXT_LINES
    integers = file.numbers(first, first + INTEGER_LINES, width=WIDTH)
    counts = [int(x) for x in integers[COUNTS]]
    if len(counts) < 3 or counts[0] < 2 or min(counts) < 0:
        allowed = "40 integers, of which 34 to 36 count samples"
        raise file.refusal(first, f"counts of {counts}", allowed)
    return counts


def _reals(file: TextFile, start: int) -> Array:
    """Return the reals of a head, shape (60,)."""
    first = start + TEXT_LINES + INTEGER_LINES
    reals = file.numbers(first, first + REAL_LINES, width=WIDTH)
    if len(reals) != REAL_LINES * PER_LINE:
        raise file.refusal(first, f"{len(reals)} reals", "60 reals, of which 26 is the step")
    return reals
