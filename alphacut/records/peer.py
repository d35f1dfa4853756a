"""Records of PEER's data base, files of type AT2 in all the heads that were written since 1999.

The head names the unit and, in one of its first lines, the number of samples and their step:
``NPTS= 4000, DT= .0050 SEC``, with a comma at its end or without SEC, ``4000 .0050 NPTS, DT``, or
the step alone. Behind the samples there may be text, such as ``*** End Data ***``.
"""

from __future__ import annotations

import re

from alphacut.records.recording import Recording
from alphacut.records.text_file import ACCELERATION_UNITS, TextFile, acceleration_factor

HEAD_LINES = 12
"""Lines in which a head ends; those of PEER have four."""
REAL = r"([0-9]*\.?[0-9]+(?:[eEdD][-+]?[0-9]+)?)"
NAMED = re.compile(
    rf"(?:NPTS\s*=?\s*([0-9]+)\s*[,;]?\s*)?\bDT\s*=?\s*{REAL}\s*(?:S|SEC|SECONDS?)?\s*[,;.]?\s*",
    re.I,
)
TRAILING = re.compile(rf"([0-9]+)[\s,]+{REAL}[\s,]+NPTS\s*,?\s*DT\s*[,;.]?\s*", re.I)
MARK = re.compile(r"\bNPTS\b|\bPEER\b.*\b(?:DATABASE|RECORD)\b", re.I)
UNIT = re.compile(r"\bunits\s*(?:of|are|is|=|:)?\s*\(?\s*([^\s,;()]+)", re.I)
IN_GRAVITY = re.compile(r"\bacceleration\b.*\bin\s+\(?(g(?:'s|s)?)\b", re.I)
COMPONENT = re.compile(r".*,\s*([\w-]+)\s*(?:\(.*\))?\s*")
ALLOWED = "a head with UNITS OF G and NPTS= 4000, DT= .0050 SEC, and as many numbers below it"


def is_peer(file: TextFile) -> bool:
    """True if one of the first lines has NPTS, the step or PEER's name as files of type AT2 do."""
    return any(_step_line(line) or MARK.search(line) for line in file.lines[:HEAD_LINES])


def read_peer(file: TextFile) -> Recording:
    """Recording of a file of type AT2.

    Raises:
        RefusedError: The head or the unit is missing, or the numbers are not those it states.
    """
    row = next((k for k, line in enumerate(file.lines[:HEAD_LINES]) if _step_line(line)), None)
    if row is None:
        raise file.refusal(min(3, len(file.lines) - 1), "without NPTS and DT", ALLOWED)
    match = _step_line(file.lines[row])
    assert match is not None
    count, step = match[1] and int(match[1]), float(re.sub("[dD]", "e", match[2]))
    if not 0 < step < 10:
        raise file.refusal(row, f"a step of {step:g} s", "a step above 0 and below 10 s")
    line, unit = _unit(file, row)
    factor = acceleration_factor(unit)
    if factor is None or re.search(r"\b(velocity|displacement)\b", file.lines[line], re.I):
        value = f"in units of {unit}" if unit else "without a unit"
        raise file.refusal(line, value, f"accelerations in {ACCELERATION_UNITS}", ALLOWED)
    samples = file.numbers(row + 1, len(file.lines), count=count or 0)
    if count:
        file.require_count(samples, count, row)
    component = COMPONENT.fullmatch(file.lines[1]) if row > 1 else None
    channel = component[1] if component else ""
    return Recording("PEER AT2", unit, step, samples * factor, channel)


def _unit(file: TextFile, last: int) -> tuple[int, str]:
    """Line that states the unit, and the unit; empty where no line up to `last` does."""
    for pattern in (UNIT, IN_GRAVITY):
        for row, line in enumerate(file.lines[: last + 1]):
            if match := pattern.search(line):
                return row, match[1].rstrip(".")
    return last, ""


def _step_line(line: str) -> re.Match[str] | None:
    return TRAILING.search(line) or NAMED.search(line)
