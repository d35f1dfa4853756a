"""Records of ESM and ITACA: a head of lines ``KEY: value``, then one sample a line."""

from __future__ import annotations

import re

from alphacut.records.recording import Recording
from alphacut.records.text_file import ACCELERATION_UNITS, NUMBER, TextFile, acceleration_factor

LINE = re.compile(r"([A-Z][A-Z0-9_/.]*(?: [A-Z0-9_/.]+)*)\s*:\s*(.*)")
INTERVAL, COUNT = "SAMPLING_INTERVAL_S", "NDATA"
KIND = "DATA_TYPE"


def is_esm(file: TextFile) -> bool:
    """True if a line of the head states the sampling interval as files of ESM do."""
    return any(line.startswith(INTERVAL) for line in file.lines[:80])


def read_esm(file: TextFile) -> Recording:
    """Recording of a file of ESM or ITACA.

    Raises:
        RefusedError: A line of the head is missing, the samples are no accelerations, or there are
            not as many as the head states.
    """
    head = _head(file)
    step, count = _positive_number(file, head, INTERVAL), int(_positive_number(file, head, COUNT))
    if not 0 < step < 10:
        raise file.refusal(head[INTERVAL][1], f"a step of {step:g} s", "above 0 and below 10 s")
    unit, line = head.get("UNITS", ("", head[INTERVAL][1]))
    factor = acceleration_factor(unit)
    kind = head.get(KIND, ("ACCELERATION", 0))[0]
    if factor is None or "ACCELERATION" not in kind.upper():
        value = f"{kind} in {unit or 'no unit'}"
        raise file.refusal(line, value, f"accelerations in {ACCELERATION_UNITS}")
    first = 1 + max(row for _, row in head.values())
    samples = file.numbers(first, len(file.lines))
    file.require_count(samples, count, head[COUNT][1])
    return Recording("ESM", unit, step, samples * factor)


def _head(file: TextFile) -> dict[str, tuple[str, int]]:
    """Value and line number, from 0, of each key of the head, which ends at the first number."""
    head: dict[str, tuple[str, int]] = {}
    for row, line in enumerate(file.lines):
        match = LINE.fullmatch(line.strip())
        if match is None:
            if line.strip() and NUMBER.fullmatch(line.strip()):
                break
            continue
        head[match[1]] = match[2].strip(), row
    return head


def _positive_number(file: TextFile, head: dict[str, tuple[str, int]], key: str) -> float:
    text, line = head.get(key, ("", 0))
    if not NUMBER.fullmatch(text) or float(text) <= 0:
        raise file.refusal(line, f"{key}: {text}", "a number above 0", "load the file anew")
    return float(text)
