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
from alphacut.base.units import ACCELERATION, factor_of
from alphacut.frame.records.recording import Recording
from alphacut.frame.records.stated_peak import StatedPeak, peaks_in_text
from alphacut.frame.records.stated_timing import require_timing, timing_in_text
from alphacut.frame.records.text_file import TextFile, choose_channel, recording_in_si

# A FORTRAN format such as (8f10.6). Its groups are the numbers in a line (8; empty for one) and the
# characters of each (10). The decimals do not matter, since samples are written with their points.
FORTRAN = r"\(\s*(\d*)\s*[A-Za-z](\d+)(?:\.\d+\w*)?\s*\)"
# The line of COSMOS above the samples. Its groups are 1 the count of samples, 2 the duration in s,
# 3 the unit, 4 the numbers in a line, and 5 the characters of a number. Only accelerations match:
# the same file repeats the channel as velocity and as displacement.
DATA = re.compile(
    r"\s*(\d+)\s+acc\w*\s+(?:pts|points),?\s+approx\s+(\d+)\s+secs?,\s*units\s*=\s*([^,(]+?)\s*"
    rf"(?:\(\s*\d+\s*\))?\s*,?\s*Format\s*=\s*{FORTRAN}.*",
    re.IGNORECASE,
)
# The line of COSMOS above the real header. Its groups are 1 the count of numbers, 2 the count of
# lines, 3 the numbers in a line, and 4 the characters of a number.
REALS = re.compile(
    rf"\s*(\d+)\s+Real-header values follow on\s+(\d+)\s+lines\s*,?\s*Format\s*=\s*{FORTRAN}.*",
    re.IGNORECASE,
)
# The first line of a channel of CSMIP; the group is "UN" or None.
TITLE = re.compile(r"\s*(UN)?CORRECTED ACCELEROGRAM\b.*", re.IGNORECASE)


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
    return bool(TITLE.match(file.lines[0])) or any(map(DATA.match, file.lines))


def read_cosmos(file: TextFile, channel: str = "", unit: str = "") -> Recording:
    """Return the recording of one channel of a file of COSMOS or CSMIP.

    A file is one of COSMOS if any of its lines announces samples as COSMOS does ("4000 acceleration
    pts, approx 20 secs, units=cm/sec2, Format=(8f10.6)"). Otherwise it must be one of CSMIP, whose
    first line is the title "CORRECTED ACCELEROGRAM" or "UNCORRECTED ACCELEROGRAM"; the caller has
    checked this with `is_cosmos`.

    Args:
        file: The file.
        channel: Number, orientation or code of the channel, as "1", "90 deg" or "HNE", in any
            capitals. It may be empty if the file has one channel of acceleration.
        unit: Unit of acceleration that the user states, as "g". It counts only for a file of CSMIP
            that states none.

    Returns:
        The recording, with samples in m/s².

    Raises:
        RefusedError: There is no such channel, or the channel is not named and there are several;
            the head of the channel is not understood, or it does not agree with the samples; no
            unit of acceleration is stated; or the step is not from 4e-5 s to below 0.5 s.
    """
    channels = list(_cosmos_channels(file))
    read = _read_cosmos
    if not channels:
        channels = list(_csmip_channels(file))
        read = _read_csmip
    names = [found.names for found in channels]
    chosen = choose_channel(file.location(channels[0].line), channel, names)
    return read(file, channels[chosen], unit)


def _cosmos_channels(file: TextFile) -> Iterator[_Channel]:
    """Yield the channels of acceleration of a file of COSMOS, in its order.

    The series of velocities and displacements of the same channels are passed over. A file without
    a line that announces accelerations yields nothing.

    Yields:
        For each series the channel. Its `names` are, in small letters, the number ("1") and the
        orientation ("90 deg") in the last line "Sta Chan 1: 90 deg" above it, and the code ("hne")
        in the first line "End-of-data for Chan HNE acceleration" below it, as far as the file
        states them. Its `line` is the index, from 0, of the line that announces the samples. Its
        `reals` is that of the last line above which announces a real header, or -1.
    """
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
            # A dictionary keeps the order, in which a message lists the names, and leaves repeated
            # ones out.
            unique = dict.fromkeys(name for name in names + codes[:1] if name)
            yield _Channel(tuple(unique), row, reals=reals)


def _read_cosmos(file: TextFile, channel: _Channel, unit: str) -> Recording:
    """Return the recording of one channel of a file of COSMOS.

    Args:
        file: The file.
        channel: The channel. Its `line` is the index of the line that announces the samples, with
            their count, duration, unit and format; its `reals` is the index of the line above the
            real header.
        unit: Not used, since each channel states its own unit.

    Returns:
        The recording, with samples in m/s² and the step in s.

    Raises:
        RefusedError: The real header is missing or its steps do not agree with the duration;
            samples are missing or are no numbers; the unit is none of accelerations; or the peak of
            the samples is not the peak that the header states.
    """
    # Groups: 1 the count of samples, 2 the duration in s, 3 the unit, 5 the characters of a number.
    match = DATA.fullmatch(file.lines[channel.line])
    assert match is not None
    count = int(match[1])
    duration = float(match[2])
    width = int(match[5])
    unit = match[3].rstrip(".")
    header = _real_header(file, channel.reals)
    first = channel.line + 1
    # The first line of samples tells how many stand in a line, since the stated format is wrong in
    # some files. A count of 0 is taken as 1 by `fixed_columns`.
    line_of_samples = file.lines[first].rstrip() if first < len(file.lines) else ""
    per_line = len(line_of_samples) // max(width, 1)
    samples = file.fixed_columns(
        first, count=count, per_line=per_line, width=width, head=channel.line
    )
    stated = []
    peak = float(header[63])  # entry 64 of the format's description, which counts from 1
    to_si = factor_of(unit, ACCELERATION)
    if peak != -999 and to_si:  # -999 stands for an entry that is not known
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


# The allowed value in messages on the header; its entries are counted from 1.
HEADER_WORDS = "a real header whose entry 62 or 34 agrees with the duration"


def _real_header(file: TextFile, line: int) -> Array:
    """Return the numbers of the real header of a channel of COSMOS, followed by 65 zeros.

    The zeros stand for entries that a short header does not have, so that each of its first 65
    entries can be taken.

    Args:
        file: The file.
        line: Index of the line above the header, "100 Real-header values follow on 20 lines,
            Format= (5F15.6)"; -1 if the file has none.

    Returns:
        Array of shape (numbers + 65,), in the units of the format.

    Raises:
        RefusedError: `line` is -1 or is no such line, or a word of the header is no finite number.
    """
    # Groups: 2 the count of lines, 4 the characters of a number.
    match = REALS.fullmatch(file.lines[line]) if line >= 0 else None
    if match is None:
        allowed = HEADER_WORDS
        cure = "load the file anew"
        raise file.refusal(max(line, 0), "without a real header", allowed, cure)
    values = file.numbers(line + 1, line + 1 + int(match[2]), width=int(match[4]))
    return np.append(values, np.zeros(65))


def _cosmos_step(file: TextFile, line: int, header: Array, *, count: int, duration: float) -> float:
    """Return the step in s from a real header of COSMOS.

    Candidates are, in this order, entry 62, the step of the processed series in ms; entry 34, the
    step of the raw series in s; and entry 34 in ms, as older files have it. The first that is
    positive and agrees with the duration is returned.

    Args:
        file: The file, for the message.
        line: Index of the line above the header, for the message.
        header: Entries of the header, from the first on; at least 62.
        count: Number of samples.
        duration: Duration of the series in s, as the file rounds it.

    Raises:
        RefusedError: No candidate agrees with the duration.
    """
    # The format's description counts entries from 1.
    processed = float(header[61])
    raw = float(header[33])
    for step in (processed / 1000, raw, raw / 1000):
        # The stated duration is rounded or cut to whole seconds, and may be that of count or of
        # count - 1 steps. The two errors are below 1.5 s; 1 % is for rounded steps (tuned). A step
        # in the wrong unit misses the duration by a factor of 1000.
        if step > 0 and abs(count * step - duration) <= 1.5 + 0.01 * duration:
            return step
    value = f"a step of {raw:g} for {count} samples in {duration:g} s"
    raise file.refusal(line, value, HEADER_WORDS, "load the file anew, or mend entry 62")


def _csmip_channels(file: TextFile) -> Iterator[_Channel]:
    """Yield the channels of a file of CSMIP, in its order.

    A channel begins with a title, "CORRECTED ACCELEROGRAM" or "UNCORRECTED ACCELEROGRAM", and ends
    before the next one. The first line of the file must be a title.

    Yields:
        For each channel its `names`, number and orientation in small letters, as ("1", "90 deg").
        They are read from the first line with "Chan 1: 90 deg" among its first 13 lines, and are
        empty without one. Its `line` and `end` are the indices, from 0, of its first line and of
        the line behind its last one.

    Raises:
        KeyError: There are titles, and the first line is none.
    """
    # The group of a title is "UN" or None.
    titles = {k: match for k, line in enumerate(file.lines) if (match := TITLE.match(line))}
    # Volume 2 (corrected) repeats the title of volume 1 (UNCORRECTED …) in its second line, which
    # begins no channel. So a title with UN counts only in files that begin with one.
    starts = [k for k, match in titles.items() if match[1] == titles[0][1] or match[1] is None]
    pattern = r".*\bChan(?:nel)?\s*(\w+)\s*:\s*(.*?)\s*(?:\(|from|$).*"
    ends = starts[1:]
    ends.append(len(file.lines))
    for start, end in zip(starts, ends, strict=True):
        names: tuple[str, ...] = ()
        for line in file.lines[start : min(start + 13, end)]:
            if match := re.fullmatch(pattern, line, re.I):
                names = tuple(name.lower() for name in match.groups() if name)
                break
        yield _Channel(names, start, end=end)


def _read_csmip(file: TextFile, channel: _Channel, unit: str) -> Recording:
    """Return the recording of one channel of a file of CSMIP.

    The samples are read behind the line that announces the series, as "1200 points of accel data
    equally spaced at .010 sec, in cm/sec2. (8f10.6)". Without a format there, a line has 8 samples
    of 10 characters. A channel without such a line is read by the counts in its headers, as
    `_read_unannounced` does.

    Args:
        file: The file.
        channel: The channel; its `line` and `end` are the indices of its first line and of the line
            behind its last.
        unit: Unit of acceleration that the user states, for a channel that states none.

    Returns:
        The recording, with samples in m/s². Peaks that the lines above the samples state are
        compared with them.

    Raises:
        RefusedError: The headers do not tell the series, or state another count or step above it;
            samples are missing or are no numbers; no unit of acceleration is stated; the step is
            not from 4e-5 s to below 0.5 s; or the samples have another peak than the head.
    """
    # Groups: 1 the count of samples, 2 the step in s, 3 or 4 the unit behind "in" or "units", 5 the
    # numbers in a line, 6 the characters of a number. All from the unit on may be missing.
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
            step = float(match[2])
            timing = timing_in_text(file, channel.line, line)
            require_timing(file, line, timing, count=len(samples), step=step)
            return recording_in_si(
                file.location(line),
                "CSMIP",
                own_unit,
                step,
                samples,
                " ".join(channel.names),
                stated=peaks_in_text(file.lines[channel.line : line], own_unit),
            )
    return _read_unannounced(file, channel, unit)


def _read_unannounced(file: TextFile, channel: _Channel, unit: str) -> Recording:
    """Return the recording of a channel of CSMIP's volume 1 in its old form.

    A channel has 13 lines of text, 7 lines of integers in columns of 5 characters, and 7 lines of
    reals in columns of 10 characters. Below stand either times and samples in pairs, 10 numbers of
    7 characters in a line, or a line of text and then the samples alone, 8 numbers of 9 characters
    in a line.

    Args:
        file: The file.
        channel: The channel; its `line` and `end` are the indices of its first line and of the line
            behind its last.
        unit: Unit of acceleration that the user states. It counts if no line of the text states one
            behind the word UNIT or UNITS.

    Returns:
        The recording, with samples in m/s². The step is the mean difference of the times, or else
        the duration over the count of samples less one.

    Raises:
        RefusedError: The headers are missing or do not tell the series; the times are uneven;
            samples are missing or are no numbers; no unit is stated; the step is not from 4e-5 s to
            below 0.5 s; or the samples have another peak than the head.
    """
    integers_line = channel.line + 13
    reals_line = integers_line + 7
    line = reals_line + 7  # of the first sample, or of a text above it
    layout = "13 lines of text, 7 of integers and 7 of reals, as in CSMIP's volume 1"
    integers = file.head_numbers(integers_line, 7, width=5, layout=layout)
    reals = file.head_numbers(reals_line, 7, width=10, layout=layout)
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
    # Only a line with the word UNIT counts: other lines name units of the sensor, whose sensitivity
    # may be in cm/g. The look-arounds keep "g" from being found inside words and in such quotients.
    stated_unit = r"(?<![\w/*])(g/10|g\*10|10\*?g|cm/s(?:ec)?/s(?:ec)?|g)(?![\w/*])"
    for text in head:
        if match := re.search(rf"\bUNITS?\b.*?{stated_unit}", text, re.I):
            unit = match[1]
            break
    if re.search("[A-Za-z]", file.lines[line]):
        samples = file.fixed_columns(
            line + 1, count=count, per_line=8, width=9, head=line, numbers_may_follow=True
        )
        step = duration / (count - 1)
    else:
        pairs = file.fixed_columns(
            line, count=2 * count, per_line=10, width=7, head=line - 1, numbers_may_follow=True
        )
        samples = pairs[1::2]
        steps = np.diff(pairs[::2])
        step = float(steps.mean())
        # The times have few digits: 0.1 of a step is more than their rounding, and less than a
        # missing sample (tuned).
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
