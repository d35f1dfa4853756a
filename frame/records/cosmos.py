"""Records of CESMD: volumes 1 and 2 of COSMOS and of CSMIP, with one or several channels.

COSMOS: entry 34 of the real header is the step of the raw series in s (older files: in ms), entry
62 that of the processed series in ms. The step is the first of them that agrees with the duration
in the line above the samples. CSMIP: a line announces each series, as ``1200 points of accel data
equally spaced at .010 sec, in cm/sec2. (8f10.6)``; in volume 1 without such a line the numbers
stand behind 13 lines of text, 7 of integers and 7 of reals.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

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
"""Line of COSMOS above samples: their count, duration in s, unit, and format."""
REALS = re.compile(
    rf"\s*(\d+)\s+Real-header values follow on\s+(\d+)\s+lines\s*,?\s*Format\s*=\s*{FORTRAN}.*",
    re.IGNORECASE,
)
"""Line of COSMOS above the real header: its count of numbers and lines, and their format."""
TITLE = re.compile(r"\s*(UN)?CORRECTED ACCELEROGRAM\b.*", re.IGNORECASE)
"""First line of a channel of CSMIP."""


@dataclass(frozen=True)
class _Channel:
    """A channel of acceleration in a file.

    Args:
        names: Its names in small letters: number, orientation and code.
        line: The line that announces it, counted from 0.
        reals: Line above its real header, of COSMOS; -1 without one.
        end: Line behind its last line, of CSMIP.
    """

    names: tuple[str, ...]
    line: int
    reals: int = -1
    end: int = 0


def is_cosmos(file: TextFile) -> bool:
    """Return whether the first line is CSMIP's, or a line announces samples as COSMOS has it."""
    return bool(TITLE.match(file.lines[0])) or any(DATA.match(line) for line in file.lines)


def read_cosmos(file: TextFile, channel: str = "", unit: str = "") -> Recording:
    """Return the recording of one channel of a file of COSMOS or CSMIP.

    Args:
        file: The file.
        channel: Number, orientation or code of the channel, as "1", "90 deg" or "HNE"; of several
            one must be named.
        unit: Unit that the case states, for a file that states none.

    Raises:
        RefusedError: There is no such channel, its head is not understood, or it does not agree
            with the samples.
    """
    channels = [*_cosmos_channels(file)]
    read = _read_cosmos
    if not channels:
        channels = [*_csmip_channels(file)]
        read = _read_csmip
    names = [found.names for found in channels]
    chosen = choose_channel(file.location(channels[0].line), channel, names)
    return read(file, channels[chosen], unit)


def _cosmos_channels(file: TextFile) -> Iterator[_Channel]:
    """Yield channels of acceleration, not of velocity and displacement, in the file's order."""
    reals = -1
    names: list[str] = []
    channel = r".*\bSta\s+Chan\s*(\w+)\s*:\s*(.*?)\s*(?:\(|Location|$).*"
    code_line = r"\s*End[- ]of[- ]data for\s+(?:Chan\s*)?(\w*)\b.*"
    for row, line in enumerate(file.lines):
        if REALS.match(line):
            reals = row
        elif match := re.match(channel, line, re.I):
            names = [match[1].lower(), match[2].strip().lower()]
        elif DATA.match(line):
            below = [text for text in file.lines[row:] if "acc" in text.lower()]
            codes = [match[1].lower() for x in below if (match := re.match(code_line, x, re.I))]
            unique = dict.fromkeys(name for name in (*names, *codes[:1]) if name)
            yield _Channel(tuple(unique), row, reals=reals)


def _read_cosmos(file: TextFile, channel: _Channel, unit: str) -> Recording:
    """Return the recording of a channel of COSMOS; `unit` is not needed, for each states its own.

    Raises:
        RefusedError: The real header is missing or its steps do not agree with the duration, or
            samples are missing.
    """
    match = DATA.fullmatch(file.lines[channel.line])
    assert match is not None
    count = int(match[1])
    duration = float(match[2])
    width = int(match[5])
    unit = match[3].rstrip(".")
    header = _real_header(file, channel.reals)
    first = channel.line + 1
    line_of_samples = file.lines[first].rstrip() if first < len(file.lines) else ""
    per_line = len(line_of_samples) // max(width, 1)
    samples = file.fixed_columns(
        first, count=count, per_line=per_line, width=width, head=channel.line
    )
    stated = []
    peak = float(header[63])
    to_si = acceleration_factor(unit)
    if peak != -999 and to_si is not None:  # -999 stands for an entry that is not known
        stated.append(StatedPeak(to_si * abs(peak)))
    step = _cosmos_step(file, channel.reals, header, count=count, duration=duration)
    return recording_in_si(
        file.location(channel.line),
        "COSMOS V2",
        unit,
        step,
        samples,
        " ".join(channel.names),
        stated=stated,
    )


HEADER_WORDS = "a real header whose entry 62 or 34 agrees with the duration"


def _real_header(file: TextFile, line: int) -> Array:
    """Return the entries of the real header below a line, followed by 64 zeros.

    Raises:
        RefusedError: The line announces no real header, or the header has other words.
    """
    match = REALS.fullmatch(file.lines[line]) if line >= 0 else None
    if match is None:
        allowed = HEADER_WORDS
        cure = "load the file anew"
        raise file.refusal(max(line, 0), "without a real header", allowed, cure)
    values = file.numbers(line + 1, line + 1 + int(match[2]), width=int(match[4]))
    return np.append(values, np.zeros(64))


def _cosmos_step(file: TextFile, line: int, header: Array, *, count: int, duration: float) -> float:
    """Return the step in s from the real header: the first entry that fits the duration in s.

    Raises:
        RefusedError: None does.
    """
    processed = float(header[61])
    raw = float(header[33])
    for step in (processed / 1000, raw, raw / 1000):
        # The stated duration is rounded or cut to seconds.
        if step > 0 and abs(count * step - duration) <= 1.5 + 0.01 * duration:
            return step
    value = f"a step of {raw:g} for {count} samples in {duration:g} s"
    raise file.refusal(line, value, HEADER_WORDS, "load the file anew, or mend entry 62")


def _csmip_channels(file: TextFile) -> Iterator[_Channel]:
    """Yield the channels of a file of CSMIP, each of which begins with a title."""
    titles = {k: match for k, line in enumerate(file.lines) if (match := TITLE.match(line))}
    # Volume 2 repeats the title of volume 1 in its second line.
    starts = [k for k, match in titles.items() if match[1] == titles[0][1] or match[1] is None]
    pattern = r".*\bChan(?:nel)?\s*(\w+)\s*:\s*(.*?)\s*(?:\(|from|$).*"
    for start, end in zip(starts, [*starts[1:], len(file.lines)], strict=True):
        names: tuple[str, ...] = ()
        for line in file.lines[start : min(start + 13, end)]:
            if match := re.fullmatch(pattern, line, re.I):
                names = tuple(name.lower() for name in match.groups() if name)
                break
        yield _Channel(names, start, end=end)


def _read_csmip(file: TextFile, channel: _Channel, unit: str) -> Recording:
    """Return the recording of a channel of CSMIP, by the line that announces its series.

    A channel without such a line is read by its headers. `unit` is for one that states none.
    """
    series = re.compile(
        r"\s*(\d+)\s+(?:raw\s+)?points\s+of\s+(?:raw\s+)?acc\w*\s+data\s+equally\s+spaced\s+at\s+"
        r"([0-9]*\.?[0-9]+)\s*sec\w*\W*"
        rf"(?:in\s+(?:units\s+of\s+)?([^\s(]+)|\(?units?:?\s*([^)\s]+)\)?)?\s*(?:{FORTRAN})?.*",
        re.IGNORECASE,
    )
    for line in range(channel.line, channel.end):
        if match := series.match(file.lines[line]):
            own_unit = (match[3] or match[4] or unit).rstrip(".,")
            samples = file.fixed_columns(
                line + 1,
                count=int(match[1]),
                per_line=int(match[5] or 8),
                width=int(match[6] or 10),
                head=line,
            )
            return recording_in_si(
                file.location(line),
                "CSMIP",
                own_unit,
                float(match[2]),
                samples,
                " ".join(channel.names),
                stated=peaks_in_text(file.lines[channel.line : line], own_unit),
            )
    return _read_unannounced(file, channel, unit)


def _read_unannounced(file: TextFile, channel: _Channel, unit: str) -> Recording:
    """Return the recording of volume 1 in its old form, with counts and duration in the headers.

    Below the headers stand times and samples in pairs, or a line of text and then samples alone.

    Raises:
        RefusedError: The headers are missing or do not tell the series, or the times are uneven.
    """
    integers_line = channel.line + 13
    reals_line = integers_line + 7
    line = reals_line + 7  # of the first sample, or of a text above it
    integers = file.numbers(integers_line, reals_line, width=5)
    reals = file.numbers(reals_line, line, width=10)
    if len(integers) < 33 or len(reals) < 3 or line >= channel.end:
        allowed = "the headers of CSMIP's volume 1, or a line such as 1200 points of accel data …"
        raise file.refusal(channel.line, "without a series", allowed, "load the file anew")
    # Entry 33 counts the samples, or entry 28 in older files; the entries are counted from 1.
    count = int(integers[32]) if integers[32] > 0 else int(integers[27])
    duration = float(reals[2])
    if count < 2 or not duration > 0:
        value = f"{count} samples in {duration:g} s"
        raise file.refusal(reals_line, value, "a count and a duration above 0", "load it anew")
    head = file.lines[channel.line : integers_line]
    # Only a line that states units counts: other lines name units of the sensor.
    stated_unit = r"(?<![\w/*])(g/10|g\*10|10\*?g|cm/s(?:ec)?/s(?:ec)?|g)(?![\w/*])"
    for text in head:
        if match := re.search(rf"\bUNITS?\b.*?{stated_unit}", text, re.I):
            unit = match[1]
            break
    if re.search("[A-Za-z]", file.lines[line]):
        samples = file.fixed_columns(line + 1, count=count, per_line=8, width=9, head=line)
        step = duration / (count - 1)
    else:
        pairs = file.fixed_columns(line, count=2 * count, per_line=10, width=7, head=line - 1)
        samples = pairs[1::2]
        steps = np.diff(pairs[::2])
        step = float(steps.mean())
        if np.ptp(steps) > 0.1 * step or not step > 0:
            raise file.refusal(line, "uneven times", "even steps", "resample to even steps")
    return recording_in_si(
        file.location(line),
        "CSMIP V1",
        unit,
        step,
        samples,
        " ".join(channel.names),
        stated=peaks_in_text(head, unit),
    )
