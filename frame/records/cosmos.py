"""Records of CESMD: volumes 1 and 2 of COSMOS and of CSMIP, with one or several channels.

COSMOS: entry 34 of the real header is the step of the raw series in s (older files: in ms), entry
62 that of the processed series in ms. The step is the first of them that agrees with the duration
in the line above the samples. CSMIP: a line announces each series, as ``1200 points of accel data
equally spaced at .010 sec, in cm/sec2. (8f10.6)``; in volume 1 without such a line the numbers
stand behind 13 lines of text, 7 of integers and 7 of reals.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from functools import partial
from math import ceil

import numpy as np

from alphacut.base.arrays import Array
from alphacut.frame.records.recording import Recording
from alphacut.frame.records.stated_peak import StatedPeak, peaks_in_text
from alphacut.frame.records.text_file import TextFile, choose_channel, recording_in_si
from alphacut.frame.records.units import acceleration_factor

FORTRAN = r"\(\s*(\d*)\s*[A-Za-z](\d+)(?:\.\d+\w*)?\s*\)"
"""Numbers in a line and characters of one, as in (8f10.6)."""
DATA = re.compile(
    r"\s*(\d+)\s+acc\w*\s+(?:pts|points),?\s+approx\s+(\d+)\s+secs?,\s*units\s*=\s*([^,(]+?)\s*"
    rf"(?:\(\s*\d+\s*\))?\s*,?\s*Format\s*=\s*{FORTRAN}.*",
    re.IGNORECASE,
)
REALS = re.compile(
    rf"\s*(\d+)\s+Real-header values follow on\s+(\d+)\s+lines\s*,?\s*Format\s*=\s*{FORTRAN}.*",
    re.IGNORECASE,
)
CHANNEL = re.compile(r".*\bSta\s+Chan\s*(\w+)\s*:\s*(.*?)\s*(?:\(|Location|$).*", re.IGNORECASE)
CODE = re.compile(r"\s*End[- ]of[- ]data for\s+(?:Chan\s*)?(\w*)\b.*", re.IGNORECASE)
RAW_STEP, PROCESSED_STEP, PEAK = 34, 62, 64  # entries of the real header
NULL = -999.0  # of an entry that is not known
ROUNDED = 1.5
"""Seconds by which the stated duration may be off; files have it rounded or cut to seconds."""
CSMIP = re.compile(r"\s*(UN)?CORRECTED ACCELEROGRAM\b.*", re.IGNORECASE)
SERIES = re.compile(
    r"\s*(\d+)\s+(?:raw\s+)?points\s+of\s+(?:raw\s+)?acc\w*\s+data\s+equally\s+spaced\s+at\s+"
    r"([0-9]*\.?[0-9]+)\s*sec\w*\W*"
    rf"(?:in\s+(?:units\s+of\s+)?([^\s(]+)|\(?units?:?\s*([^)\s]+)\)?)?\s*(?:{FORTRAN})?.*",
    re.IGNORECASE,
)
CSMIP_CHANNEL = re.compile(r".*\bChan(?:nel)?\s*(\w+)\s*:\s*(.*?)\s*(?:\(|from|$).*", re.IGNORECASE)
V1_TEXT, V1_INTEGERS, V1_REALS = 13, 7, 7  # lines
V1_COUNTS, V1_DURATION = (33, 28), 3  # entries of the integer header and of the real one
V1_UNIT = re.compile(
    r"\bUNITS?\b.*?(?<![\w/*])(g/10|g\*10|10\*?g|cm/s(?:ec)?/s(?:ec)?|g)(?![\w/*])", re.IGNORECASE
)
"""The unit of accelerations in the line that states units; other lines name units of a sensor."""


Channel = tuple[tuple[str, ...], int, Callable[[], Recording]]
"""A channel of a file: the names that it has, the line that announces it, and its reader."""


def is_cosmos(file: TextFile) -> bool:
    """True if the first line is CSMIP's, or a line announces samples as COSMOS has it."""
    return bool(CSMIP.match(file.lines[0])) or any(map(DATA.match, file.lines))


def read_cosmos(file: TextFile, channel: str = "") -> Recording:
    """Recording of one channel of a file of COSMOS or CSMIP.

    A channel is named by its number, orientation or code, as "1", "90 deg" or "HNE"; of several
    one must be named.
    """
    channels = [*_cosmos_channels(file)] or [*_csmip_channels(file)]
    names = [aliases for aliases, _, _ in channels]
    _, _, read = channels[choose_channel(file.location(channels[0][1]), channel, names)]
    return read()


def _samples(file: TextFile, line: int, count: int, per_line: int, width: int) -> Array:
    samples = file.numbers(line + 1, line + 1 + ceil(count / max(per_line, 1)), width=width)
    file.require_count(samples, count, line)
    return samples


def _cosmos_channels(file: TextFile) -> Iterator[Channel]:
    """Channels of acceleration, without those of velocity and displacement, in the file's order."""
    reals, names = -1, list[str]()  # line of the real header and names read last
    for row, line in enumerate(file.lines):
        if REALS.match(line):
            reals = row
        elif match := CHANNEL.match(line):
            names = [match[1].lower(), match[2].strip().lower()]
        elif DATA.match(line):
            ends = (CODE.match(x) for x in file.lines[row:] if "acc" in x.lower())
            code = next((match[1].lower() for match in ends if match), "")
            unique = tuple(dict.fromkeys(name for name in (*names, code) if name))
            yield unique, row, partial(_read_cosmos, file, row, reals, unique)


def _read_cosmos(file: TextFile, line: int, reals: int, names: tuple[str, ...]) -> Recording:
    """Recording of the samples below a line, whose real header is announced by another."""
    match = DATA.fullmatch(file.lines[line])
    assert match is not None
    count, unit, width = int(match[1]), match[3].rstrip("."), int(match[5])
    header = _real_header(file, reals)
    step = _cosmos_step(file, reals, header, count=count, duration=float(match[2]))
    below = file.lines[line + 1].rstrip() if line + 1 < len(file.lines) else ""
    samples = _samples(file, line, count, len(below) // max(width, 1), width)
    stated, to_si = [], acceleration_factor(unit)
    if header[PEAK - 1] != NULL and to_si is not None:
        stated.append(StatedPeak(to_si * abs(float(header[PEAK - 1]))))
    return recording_in_si(
        file.location(line), "COSMOS V2", unit, step, samples, " ".join(names), stated=stated
    )


HEADER_WORDS = f"a real header whose entry {PROCESSED_STEP} or {RAW_STEP} agrees with the duration"


def _real_header(file: TextFile, line: int) -> Array:
    """Entries of the real header that a line announces, followed by zeros; refuses none."""
    match = REALS.fullmatch(file.lines[line]) if line >= 0 else None
    if match is None:
        raise file.refusal(max(line, 0), "without a real header", HEADER_WORDS)
    values = file.numbers(line + 1, line + 1 + int(match[2]), width=int(match[4]))
    return np.append(values, np.zeros(PEAK))


def _cosmos_step(
    file: TextFile, reals: int, header: Array, *, count: int, duration: float
) -> float:
    """Step in s from the real header: the first entry that fits the duration in s."""
    processed, raw = float(header[PROCESSED_STEP - 1]), float(header[RAW_STEP - 1])
    for step in (processed / 1000, raw, raw / 1000):
        if step > 0 and abs(count * step - duration) <= ROUNDED + 0.01 * duration:
            return step
    value = f"a step of {raw:g} for {count} samples in {duration:g} s"
    raise file.refusal(reals, value, HEADER_WORDS)


def _csmip_channels(file: TextFile) -> Iterator[Channel]:
    """Channels of a file of CSMIP, each of which begins with the line that tells the format."""
    titles = {k: match for k, line in enumerate(file.lines) if (match := CSMIP.match(line))}
    # volume 2 repeats the title of volume 1 in its second line
    starts = [k for k, match in titles.items() if match[1] == titles[0][1] or match[1] is None]
    for start, end in zip(starts, [*starts[1:], len(file.lines)], strict=True):
        block = file.lines[start:end]
        named = (CSMIP_CHANNEL.fullmatch(line) for line in block[:V1_TEXT])
        match = next(filter(None, named), None)
        names = tuple(x.lower() for x in match.groups() if x) if match else ()
        yield names, start, partial(_read_csmip, file, start, end, names)


def _read_csmip(file: TextFile, start: int, end: int, names: tuple[str, ...]) -> Recording:
    """Recording of the series that a line of a channel announces, else by its headers."""
    matches = ((line, SERIES.match(file.lines[line])) for line in range(start, end))
    line, match = next((x for x in matches if x[1]), (start, None))
    if match is None:
        return _read_unannounced(file, start, end, names)
    unit, step = (match[3] or match[4] or "").rstrip(".,"), float(match[2])
    samples = _samples(file, line, int(match[1]), int(match[5] or 8), int(match[6] or 10))
    stated = peaks_in_text(file.lines[start:line], unit)
    return recording_in_si(
        file.location(line), "CSMIP", unit, step, samples, " ".join(names), stated=stated
    )


def _read_unannounced(file: TextFile, start: int, end: int, names: tuple[str, ...]) -> Recording:
    """Recording of volume 1 in its old form, with counts and duration in the headers."""
    first = start + V1_TEXT + V1_INTEGERS
    line = first + V1_REALS  # of the first sample, or of a text above it
    integers = file.numbers(start + V1_TEXT, first, width=5)
    reals = file.numbers(first, line, width=10)
    units = (V1_UNIT.search(text) for text in file.lines[start : start + V1_TEXT])
    unit = next((match[1] for match in units if match), "")
    if len(integers) < V1_COUNTS[0] or len(reals) < V1_DURATION or line >= end:
        allowed = "the headers of CSMIP's volume 1, or a line such as 1200 points of accel data …"
        raise file.refusal(start, "without a series", allowed)
    count = next((int(integers[k - 1]) for k in V1_COUNTS if integers[k - 1] > 0), 0)
    duration = float(reals[V1_DURATION - 1])
    if count < 2 or not duration > 0:
        allowed = "a count and a duration above 0"
        raise file.refusal(first, f"{count} samples in {duration:g} s", allowed)
    if re.search("[A-Za-z]", file.lines[line]):
        samples, step = _samples(file, line, count, 8, 9), duration / (count - 1)
    else:
        pairs = _samples(file, line - 1, 2 * count, 10, 7)
        samples, steps = pairs[1::2], np.diff(pairs[::2])
        step = float(steps.mean())
        if np.ptp(steps) > 0.1 * step or not step > 0:
            raise file.refusal(line, "uneven times", "even steps", "resample to even steps")
    stated = peaks_in_text(file.lines[start : start + V1_TEXT], unit)
    return recording_in_si(
        file.location(line), "CSMIP V1", unit, step, samples, " ".join(names), stated=stated
    )
