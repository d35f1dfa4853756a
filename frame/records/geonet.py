"""Records of GeoNet (New Zealand): corrected files V2A, three components one after another.

A component has 16 lines of text, 4 lines of integers and 6 of reals, ten to a line of 8 columns
each, then accelerations in mm/s², velocities and displacements in the same columns. Integers 34,
35 and 36 count them; real 24 is their duration and real 26 their step in s, real 36 the peak of
the accelerations and real 37 its time.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from math import ceil
from typing import ClassVar

from alphacut.frame.records.recording import Recording
from alphacut.frame.records.stated_peak import StatedPeak
from alphacut.frame.records.stated_timing import (
    StatedTiming,
    require_timing,
    timing_in_text,
)
from alphacut.frame.records.text_file import TextFile, choose_channel, recording_in_si

# The first line of a component; the group is "UN" or None.
MARK = re.compile(r"\s*(UN)?CORRECTED ACCELEROGRAM\b.*\bGNS\b", re.IGNORECASE)


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
    # The format GeoNet V2A fixes these four: lines of text, numbers in a line, characters of a
    # number, and the lines of the head, for messages.
    text_lines: ClassVar[int] = 16
    per_line: ClassVar[int] = 10
    width: ClassVar[int] = 8
    layout: ClassVar[str] = "16 lines of text, 4 of integers and 6 of reals, as in GeoNet's V2A"

    @classmethod
    def of(cls, file: TextFile, start: int) -> _Component:
        """Return the component that begins in a line of a file, counted from 0.

        A component has 16 lines of text, 4 lines of integers and 6 of reals, all in columns of 8
        characters, and then its accelerations, velocities and displacements, 10 in a line, each
        from a new line on. Integers 34, 35 and 36, counted from 1, count these three.

        Returns:
            The component: `start`, `samples` and `end`, the indices of its first line, of the line
            of its first acceleration, and of the line behind its last displacement; `count`, the
            number of its accelerations; and `name`, the orientation in small letters behind the
            word Component in its text, or empty.

        Raises:
            RefusedError: The integers do not count two accelerations or more, or are no numbers.
        """
        first = start + cls.text_lines
        integers = file.head_numbers(first, 4, width=cls.width, layout=cls.layout)
        counts = [int(number) for number in integers[33:36]]
        if len(counts) < 3 or counts[0] < 2 or min(counts) < 0:
            allowed = "40 integers, of which 34 to 36 count samples"
            raise file.refusal(first, f"counts of {counts}", allowed, "load the file anew")
        text = " ".join(file.lines[start:first])
        name = ""
        if match := re.search(r"Component\s+(\S+)", text):
            name = match[1].lower()
        samples = first + 10  # behind 4 lines of integers and 6 of reals
        end = samples + sum(ceil(count / cls.per_line) for count in counts)
        return cls(start, samples, end, counts[0], name)


def read_geonet(file: TextFile, channel: str = "") -> Recording:
    """Return the recording of one component of a corrected file of GeoNet, format V2A.

    Such a file states its accelerations in mm/s², so no unit is needed.

    Args:
        file: The file, whose first line is the title of GeoNet's accelerograms; the caller has
            checked this with `is_geonet`.
        channel: Number or orientation of the component, as "1" or "S90E", in any capitals. It may
            be empty only if the file has one component.

    Returns:
        The recording, with samples in m/s². Its peak is compared with the one in the head.

    Raises:
        RefusedError: The file is not corrected; there is no such component; the lines of a head do
            not tell count and step, or contradict each other; samples are missing or are no
            numbers; the step is not from 4e-5 s to below 0.5 s; or the samples have another peak
            than the head.
    """
    match = MARK.match(file.lines[0])  # its group is UN in "UNCORRECTED ACCELEROGRAM"
    if match is not None and match[1]:
        cure = "take the corrected file of the same record, .V2A"
        raise file.refusal(0, file.lines[0].strip(), "a corrected accelerogram", cure)
    components = list(_components(file))
    # A component can be named by its place in the file, from 1 on, since some have no orientation.
    names = []
    for number, component in enumerate(components, 1):
        names.append(tuple(filter(None, (str(number), component.name))))
    chosen = choose_channel(file.location(0), channel, names)
    component = components[chosen]
    first = component.samples - 6
    reals = file.head_numbers(first, 6, width=component.width, layout=component.layout)
    if len(reals) != 60:
        allowed = "60 reals, of which 26 is the step"
        raise file.refusal(first, f"{len(reals)} reals", allowed, "load the file anew")
    samples = file.fixed_columns(
        component.samples,
        count=component.count,
        per_line=component.per_line,
        width=component.width,
        head=component.start + component.text_lines,
        numbers_may_follow=True,  # velocities
    )
    # The places are counted from 0, the numbers of the format's description from 1.
    step = float(reals[25])
    timing = list(timing_in_text(file, component.start, component.samples - 10))
    timing.append(StatedTiming(component.samples - 4, "duration", float(reals[23])))
    require_timing(file, component.samples - 7, timing, count=component.count, step=step)
    return recording_in_si(
        file.location(component.samples - 6),
        "GeoNet V2A",
        "mm/s/s",
        step,
        samples,
        " ".join(names[chosen]),
        # The peak in mm/s².
        stated=[StatedPeak(1e-3 * abs(float(reals[35])))],
    )


def _components(file: TextFile) -> Iterator[_Component]:
    """Yield the components of a file in their order."""
    start = 0
    while start < len(file.lines) and MARK.match(file.lines[start]):
        component = _Component.of(file, start)
        yield component
        start = component.end
