"""Records of K-NET and KiK-net: a head of 17 lines, then counts, eight to a line.

One count is the scale factor ``7845(gal)/8223790``. Counts keep the sensor's offset, so that such a
record wants ``baseline = "mean"``.
"""

from __future__ import annotations

import re

from alphacut.records.recording import Recording
from alphacut.records.text_file import TextFile

SCALE = re.compile(r"\s*([0-9.]+)\s*\(gal\)\s*/\s*([0-9.]+)\s*", re.IGNORECASE)
FREQUENCY = re.compile(r"\s*([0-9.]+)\s*Hz\s*", re.IGNORECASE)
DURATION = re.compile(r"\s*([0-9.]+)\s*")
NAMES = {"Sampling Freq(Hz)": FREQUENCY, "Duration Time(s)": DURATION, "Scale Factor": SCALE}
LABEL = 18
"""Columns of a label in the head."""


def is_knet(file: TextFile) -> bool:
    """True if the first line is that of a K-NET file."""
    return file.lines[0].startswith("Origin Time")


def read_knet(file: TextFile) -> Recording:
    """Recording of a K-NET or KiK-net file.

    Raises:
        RefusedError: A line of the head is missing, or the counts are not those it states.
    """
    end = next((k for k, line in enumerate(file.lines) if line.startswith("Memo")), None)
    if end is None:
        raise file.refusal(len(file.lines) - 1, "without a line Memo.", "the head of a K-NET file")
    (frequency, _), (duration, line), (scale, _) = (_field(file, name, end) for name in NAMES)
    rate = float(frequency[1])  # samples in a second
    gal_per_count = float(scale[1]) / float(scale[2])
    counts = file.numbers(end + 1, len(file.lines))
    file.require_count(counts, round(float(duration[1]) * rate), line)
    return Recording("K-NET", "gal", 1 / rate, counts * gal_per_count * 0.01)


def _field(file: TextFile, name: str, end: int) -> tuple[re.Match[str], int]:
    """Match of the value of a name in the head, which has `end` lines, and its line from 0."""
    for row, line in enumerate(file.lines[:end]):
        if line.startswith(name):
            match = NAMES[name].fullmatch(line[min(LABEL, len(line)) :])
            if match and all(float(number) > 0 for number in match.groups()):
                return match, row
            raise file.refusal(row, line.strip(), f"{name}, as in files of K-NET")
    raise file.refusal(end, f"without {name}", "the head of a K-NET file")
