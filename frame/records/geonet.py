"""Records of GeoNet (New Zealand): corrected files V2A, three components one after another.

A component has 16 lines of text, 4 lines of integers and 6 of reals, ten to a line of 8 columns
each, then accelerations in mm/s², velocities and displacements in the same columns. Integers 34,
35 and 36 count them; real 26 is their step in s, real 36 the peak of the accelerations.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from math import ceil

from alphacut.base.arrays import Array
from alphacut.frame.records.recording import Recording
from alphacut.frame.records.stated_peak import StatedPeak
from alphacut.frame.records.text_file import TextFile, choose_channel, recording_in_si

MARK = re.compile(r"\s*(UN)?CORRECTED ACCELEROGRAM\b.*\bGNS\b", re.IGNORECASE)
"""First line of a component."""
TEXT_LINES = 16
PER_LINE = 10
WIDTH = 8
"""Numbers in a line, and characters of each."""


def is_geonet(file: TextFile) -> bool:
    """Return whether the first line is that of GeoNet's files of one accelerogram."""
    return MARK.match(file.lines[0]) is not None


@dataclass(frozen=True)
class _Component:
    """A component of a file.

    Args:
        start: Its first line, counted from 0.
        samples: Line of its first acceleration.
        end: Line behind its last displacement.
        count: Number of its accelerations.
        name: Its name in small letters, as "s90e"; empty if it has none.
    """

    start: int
    samples: int
    end: int
    count: int
    name: str

    @classmethod
    def of(cls, file: TextFile, start: int) -> _Component:
        """Return the component that begins in a line.

        Raises:
            RefusedError: Its head does not count the samples.
        """
        first = start + TEXT_LINES
        integers = file.numbers(first, first + 4, width=WIDTH)
        counts = [int(number) for number in integers[33:36]]
        if len(counts) < 3 or counts[0] < 2 or min(counts) < 0:
            allowed = "40 integers, of which 34 to 36 count samples"
            raise file.refusal(first, f"counts of {counts}", allowed, "load the file anew")
        text = " ".join(file.lines[start:first])
        names = [*re.findall(r"Component\s+(\S+)", text), ""]
        samples = first + 10  # behind 4 lines of integers and 6 of reals
        end = samples + sum(ceil(count / PER_LINE) for count in counts)
        return cls(start, samples, end, counts[0], names[0].lower())


def read_geonet(file: TextFile, channel: str = "") -> Recording:
    """Return the recording of one component, named by its number or orientation, as "1" or "S90E".

    Raises:
        RefusedError: The file is not corrected, a head does not tell counts and step, or samples
            are missing.
    """
    match = MARK.match(file.lines[0])
    if match is not None and match[1]:
        cure = "take the corrected file of the same record, .V2A"
        raise file.refusal(0, file.lines[0].strip(), "a corrected accelerogram", cure)
    components = [*_components(file)]
    names = []
    for number, component in enumerate(components, 1):
        names.append(tuple(filter(None, (str(number), component.name))))
    chosen = choose_channel(file.location(0), channel, names)
    component = components[chosen]
    reals = _reals(file, component.samples - 6)
    samples = file.fixed_columns(
        component.samples,
        count=component.count,
        per_line=PER_LINE,
        width=WIDTH,
        head=component.start + TEXT_LINES,
    )
    return recording_in_si(
        file.location(component.samples - 6),
        "GeoNet V2A",
        "mm/s/s",
        float(reals[25]),
        samples,
        " ".join(names[chosen]),
        stated=[StatedPeak(1e-3 * abs(float(reals[35])))],
    )


def _components(file: TextFile) -> Iterator[_Component]:
    """Yield the components of a file in their order."""
    start = 0
    while start < len(file.lines) and MARK.match(file.lines[start]):
        component = _Component.of(file, start)
        yield component
        start = component.end


def _reals(file: TextFile, first: int) -> Array:
    """Return the reals of a head, shape (60,), from their first line on."""
    reals = file.numbers(first, first + 6, width=WIDTH)
    if len(reals) != 60:
        allowed = "60 reals, of which 26 is the step"
        raise file.refusal(first, f"{len(reals)} reals", allowed, "load the file anew")
    return reals
