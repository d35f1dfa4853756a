"""Counts, steps and durations in a head beside those by which the samples are read."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from alphacut.base.stated import Stated, settled
from alphacut.frame.records.text_file import TextFile, require_step


@dataclass(frozen=True)
class StatedTiming:
    """What a line of a head, counted from 0, states of the samples; 0 where it does not.

    Args:
        line: The line.
        count: Number of samples.
        step: Time between samples, in s.
        duration: Time from the first to the last sample, or one step more, in s.
    """

    line: int
    count: int = 0
    step: float = 0.0
    duration: float = 0.0


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
    count = r"\bnumber of points\s*[:=]?\s*(\d+)|^\s*(\d+) points of .*\bcorrected\b"
    step = rf"\bintervals of\s*{number}|\bat\s*{number}\s*intervals\b"
    for line in range(first, last):
        if match := re.search(count, file.lines[line], re.IGNORECASE):
            yield StatedTiming(line, count=int(match[1] or match[2]))
        if match := re.search(step, file.lines[line], re.IGNORECASE):
            yield StatedTiming(line, step=float(match[1] or match[2]))


def require_timing(
    file: TextFile, line: int, stated: Iterable[StatedTiming], *, count: int, step: float
) -> None:
    """Raise RefusedError if a head states another count, step or duration than samples have.

    A step that no record has is refused first.

    Args:
        file: The file, for the message.
        line: Index of the line by which the samples are read, counted from 0.
        stated: Count, step in s and duration in s as other lines state them; 0 stands for what a
            line does not state.
        count: Number of samples.
        step: Time between samples, in s.
    """
    place = file.location(line)
    require_step(place, step)
    # Heads round steps to milliseconds or less, as 1/204.8 s to .005, and durations may be those of
    # one step more or less. A mistaken step is wrong by a quarter at least (tuned).
    by_kind = {"count": (float(count), 1e-9), "step": (step, 0.05), "duration": (count * step, 0.0)}
    for other in stated:
        for kind, (value, tolerance) in by_kind.items():
            own = float(getattr(other, kind))
            if kind == "duration":
                tolerance = 0.05 + 2 * step / (own or 1.0)
            if own:
                place_of_other = f"line {file.line_number(other.line)}"
                found = [Stated(value, f"{value:g}", f"line {file.line_number(line)}")]
                found.append(Stated(own, f"{own:g}", place_of_other))
                settled(place, kind, found, tolerance=tolerance)
