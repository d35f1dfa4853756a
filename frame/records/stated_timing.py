"""Counts, steps and durations in a head beside those by which the samples are read."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from typing import NamedTuple

from alphacut.base.stated import Stated, settled
from alphacut.frame.records.text_file import TextFile, require_step


class StatedTiming(NamedTuple):
    """What a line of a head, counted from 0, states of the samples.

    Attributes:
        line: The line.
        kind: "count", "step" in s, or "duration" in s, which may be one step more.
        value: The number; 0 states nothing.
    """

    line: int
    kind: str
    value: float


def timing_in_text(file: TextFile, first: int, last: int) -> Iterator[StatedTiming]:
    """Yield counts and steps of a corrected series that some lines of text state.

    Such lines are "Number of points 8192", "10100 points of instrument- and baseline-corrected
    accel", "At equally-spaced intervals of 0.010 sec" and "data at 0.020 sec intervals".

    Args:
        file: The file.
        first: Index of the first line, counted from 0.
        last: Index of the line behind the last one.
    """
    number = r"(\d+\.?\d*|\.\d+)\s*s(?:ec)?\b"
    patterns = {
        "count": r"\bnumber of points\s*[:=]?\s*(\d+)|^\s*(\d+) points of .*\bcorrected\b",
        "step": rf"\bintervals of\s*{number}|\bat\s*{number}\s*intervals\b",
    }
    for line in range(first, last):
        for kind, pattern in patterns.items():
            if match := re.search(pattern, file.lines[line], re.IGNORECASE):
                yield StatedTiming(line, kind, float(match[1] or match[2]))


def require_timing(
    file: TextFile, line: int, stated: Iterable[StatedTiming], *, count: int, step: float
) -> None:
    """Raise RefusedError if a head states another count, step or duration than samples have.

    A step that no record has is refused first.

    Args:
        file: The file, for the message.
        line: Index of the line by which the samples are read, counted from 0.
        stated: What other lines state.
        count: Number of samples.
        step: Time between samples, in s.
    """
    place = file.location(line)
    require_step(place, step)
    values = {"count": count, "step": step, "duration": count * step}
    own_line = f"line {file.line_number(line)}"
    for other in stated:
        if not other.value:
            continue
        # Heads round steps to milliseconds or less, as 1/204.8 s to .005, and durations may be
        # those of one step more or less. A mistaken step is wrong by a quarter at least (tuned).
        tolerances = {"count": 1e-9, "step": 0.05, "duration": 0.05 + 2 * step / other.value}
        line_of_other = f"line {file.line_number(other.line)}"
        found = [Stated(values[other.kind], f"{values[other.kind]:g}", own_line)]
        found.append(Stated(other.value, f"{other.value:g}", line_of_other))
        settled(place, other.kind, found, tolerance=tolerances[other.kind])
