"""Records of the COSMOS format, volume 2: one or several channels of corrected acceleration.

Entry 34 of the real header is the step. Files have it in seconds or, older ones, in milliseconds:
it is the one that agrees with the duration in the line above the samples.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from math import ceil

from alphacut.records.recording import Recording
from alphacut.records.text_file import ACCELERATION_UNITS, TextFile, acceleration_factor

DATA = re.compile(
    r"\s*(\d+)\s+acc\w*\s+(?:pts|points),?\s+approx\s+(\d+)\s+secs?,\s*units\s*=\s*([^,(]+?)\s*"
    r"(?:\(\s*\d+\s*\))?\s*,\s*Format\s*=\s*\(\s*\d*[A-Za-z](\d+)(?:\.\d+\w*)?\s*\).*",
    re.IGNORECASE,
)
REALS = re.compile(
    r"\s*(\d+)\s+Real-header values follow on\s+(\d+)\s+lines,?\s*"
    r"Format\s*=\s*\(\s*\d*[A-Za-z](\d+).*",
    re.IGNORECASE,
)
CHANNEL = re.compile(r".*\bSta\s+Chan\s*(\w+)\s*:\s*(.*?)\s*(?:\(|Location|$).*", re.IGNORECASE)
CODE = re.compile(r"\s*End[- ]of[- ]data for\s+(?:Chan\s*)?(\S*).*", re.IGNORECASE)
STEP_ENTRY = 34
ROUNDED = 1.5
"""Seconds by which the stated duration may be off; files have it rounded or cut to seconds."""


@dataclass(frozen=True)
class _Channel:
    """Where a channel's samples and its real header begin, and the names that it has."""

    data: int
    reals: int
    names: tuple[str, ...]


def is_cosmos(file: TextFile) -> bool:
    """True if a line announces samples of acceleration as the format has it."""
    return any(DATA.fullmatch(line) for line in file.lines)


def read_cosmos(file: TextFile, channel: str = "") -> Recording:
    """Recording of one channel of a COSMOS file.

    Args:
        file: The file.
        channel: Number, orientation or code of the channel, as "1", "90 deg" or "HNE"; may be left
            out where the file has one channel.

    Raises:
        RefusedError: There is no such channel or there are several, or its step, unit or samples
            are not those of the format.
    """
    channels = _acceleration_channels(file)
    chosen = [entry for entry in channels if not channel or channel.lower() in entry.names]
    if len(chosen) != 1:
        names = "; ".join(" or ".join(entry.names) for entry in channels)
        line = channels[0].data if channels else 0
        raise file.refusal(line, f"channel {channel or 'not named'}", f"one of: {names}")
    return _read_channel(file, chosen[0])


def _read_channel(file: TextFile, channel: _Channel) -> Recording:
    """Recording of a channel, from the line that announces its samples and the lines below it."""
    match = DATA.fullmatch(file.lines[channel.data])
    assert match is not None
    count, duration, unit, width = int(match[1]), float(match[2]), match[3], int(match[4])
    factor = acceleration_factor(unit)
    if factor is None:
        raise file.refusal(channel.data, f"in units of {unit}", ACCELERATION_UNITS)
    step = _step(file, channel, count, duration)
    first = channel.data + 1
    per_line = max(1, len(file.lines[first].rstrip()) // width)
    samples = file.numbers(first, first + ceil(count / per_line), width=width)
    file.require_count(samples, count, channel.data)
    return Recording("COSMOS V2", unit, step, samples * factor)


def _step(file: TextFile, channel: _Channel, count: int, duration: float) -> float:
    """Step in s, from entry 34 of the real header in s or ms: whichever fits the duration in s."""
    match = REALS.fullmatch(file.lines[channel.reals]) if channel.reals >= 0 else None
    allowed = "a real header whose entry 34 is the step, and agrees with the duration"
    if match is None:
        raise file.refusal(channel.data, "without a real header", allowed)
    first = channel.reals + 1
    reals = file.numbers(first, first + int(match[2]), width=int(match[3]))
    entry = reals[STEP_ENTRY - 1] if len(reals) >= STEP_ENTRY else 0.0
    for step in (float(entry), float(entry) / 1000):
        if step > 0 and abs(count * step - duration) <= ROUNDED + 0.01 * duration:
            return step
    value = f"a step of {entry:g} for {count} samples in {duration:g} s"
    raise file.refusal(channel.reals, value, allowed)


def _acceleration_channels(file: TextFile) -> list[_Channel]:
    """Channels of acceleration, without those of velocity and displacement, in the file's order."""
    channels: list[_Channel] = []
    reals, names = -1, list[str]()  # line of the real header and names read last
    for row, line in enumerate(file.lines):
        if REALS.fullmatch(line):
            reals = row
        elif match := CHANNEL.fullmatch(line):
            names = [match[1].lower(), match[2].strip().lower()]
        elif DATA.fullmatch(line):
            channels.append(_Channel(row, reals, tuple(filter(None, names))))
        elif (match := CODE.fullmatch(line)) and channels and "acc" in line.lower():  # at its end
            last = channels[-1]
            code = (match[1].lower(),) if match[1].lower() not in last.names else ()
            channels[-1] = _Channel(last.data, last.reals, (*last.names, *code))
    return channels
