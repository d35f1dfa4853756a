"""Text of a downloaded file: its lines, numbers by place, and refusals that name the line."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Self

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import RefusedError, printable, require
from alphacut.base.memory import require_text
from alphacut.frame.records.recording import Recording
from alphacut.frame.records.stated_peak import StatedPeak, remarks_on_peak
from alphacut.frame.records.units import acceleration_factor, other_quantity

NUMBER = re.compile(r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eEdD][-+]?[0-9]+)?")
"""A number as C, Python or FORTRAN writes it; D stands for E."""
LONGEST_LINE = 10_000
"""Letters of a line; formats have about 80, and searches of a line take their square."""
ACCELERATION_UNITS = "g, gal, cm/s^2 or m/s^2"
MIN_STEP, MAX_STEP = 4e-5, 0.5
"""Steps of records in s that are believed: instruments sample 10 to 20,000 times a second."""


@dataclass(frozen=True)
class TextFile:
    """The lines of a text file, without their ends; its name is for messages."""

    name: str
    lines: tuple[str, ...]

    @classmethod
    def from_bytes(cls, name: str, content: bytes) -> Self:
        """The lines of a content in UTF-8 or Latin-1; RefusedError of what no text has."""
        require(b"\0" not in content, name, "no text", "a text file with a record")
        file = cls(name, tuple(re.split(r"\r\n|\r|\n", decoded(content))))
        length, longest = max((len(line), number) for number, line in enumerate(file.lines))
        if length > LONGEST_LINE:
            allowed = f"lines of up to {LONGEST_LINE:,} letters"
            raise file.refusal(longest, f"{length:,} letters long", allowed)
        return file

    def location(self, line: int) -> str:
        """Name of a line, counted from 0, for messages."""
        return f"{self.name}, line {line + 1}"

    def refusal(self, line: int, value: object, allowed: str, cure: str = "") -> RefusedError:
        """Error about a line, counted from 0."""
        return RefusedError(self.location(line), str(value)[:80], allowed, cure)

    def numbers(self, first: int, last: int, *, width: int = 0, count: int = 0) -> Array:
        """All numbers from line `first` up to, but not with, line `last`, counted from 0.

        In files of fixed columns a number has `width` characters, else spaces part numbers. Behind
        `count` numbers a line of text ends the reading. What else is no finite number is refused.
        """
        values: list[float] = []
        for row in range(first, min(last, len(self.lines))):
            line = self.lines[row].rstrip()
            columns = range(0, len(line), width) if width else ()
            words = [line[start : start + width].strip() for start in columns] or line.split()
            if 0 < count <= len(values) and not all(map(NUMBER.fullmatch, words)):
                break
            for word in filter(None, words):
                value = float(re.sub("[dD]", "e", word)) if NUMBER.fullmatch(word) else np.nan
                if not isfinite(value):
                    raise self.refusal(row, repr(word), "finite numbers such as -.1394908E-02")
                values.append(value)
        return np.array(values)

    def require_count(self, samples: Array, count: int, line: int) -> None:
        """Refuses another number of samples than the head states."""
        if len(samples) != count:
            what = f"{count} samples, and {len(samples)} follow"
            raise self.refusal(line, what, "as many samples as the head states", "load it anew")


def recording_in_si(
    location: str,
    file_format: str,
    unit: str,
    step: float,
    samples: Array,
    channel: str = "",
    remarks: tuple[str, ...] = (),
    *,
    stated: Iterable[StatedPeak] = (),
) -> Recording:
    """Recording of samples in a unit, their step in s; refuses other units and steps at a place.

    `stated` are the peaks in the file's head: if the samples have another one, the recording
    bears a remark, or is refused, as `remarks_on_peak` says.
    """
    to_si = acceleration_factor(unit)
    if to_si is None:
        value = f"in units of {unit}" if unit else "without a unit"
        quantity = other_quantity(unit)
        cure = 'where the file has no unit, say records.unit = "g"'
        if quantity:
            cure = f"{unit} is the unit of {quantity}: take the record of the acceleration"
        elif unit:
            cure = "mend the unit in the head"
        raise RefusedError(location, value, f"accelerations in {ACCELERATION_UNITS}", cure)
    require_step(location, step)
    in_si = to_si * samples
    remarks += remarks_on_peak(location, in_si, stated, unit)
    return Recording(file_format, unit, step, in_si, channel, remarks)


def require_step(location: str, step: float, cure: str = "") -> None:
    """Refuse a step, in s, that no record of an earthquake has; `cure` is for the message."""
    allowed = f"steps from {MIN_STEP:g} s to below {MAX_STEP:g} s"
    is_usual = MIN_STEP <= step < MAX_STEP
    require(
        is_usual, location, f"a step of {step:g} s", allowed, cure or "mend the step in the head"
    )


def choose_channel(location: str, channel: str, names: Sequence[tuple[str, ...]]) -> int:
    """Index of the channel that has a name; of the only one where none is asked for.

    A name that several channels have is numbered in their order, as "90 deg#1" and "90 deg#2".
    """
    counts = Counter(name for aliases in names for name in aliases)
    numbers = Counter[str]()
    numbered: list[list[str]] = []  # names of each channel, none of which another one has
    for aliases in names:
        numbers.update(aliases)
        is_own = {name: counts[name] == 1 for name in aliases}
        numbered.append([x if is_own[x] else f"{x}#{numbers[x]}" for x in aliases])
    chosen = [k for k, own in enumerate(numbered) if not channel or channel.lower() in own]
    allowed = "; ".join(dict.fromkeys(" or ".join(own) for own in numbered)) or "accelerations"
    value = f"channel {channel or 'not named'}"
    require(len(chosen) == 1, location, value, f"one of: {allowed}")
    return chosen[0]


def decoded(content: bytes) -> str:
    """The text of a content in UTF-8, else in Latin-1."""
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("latin-1")


def read_bytes(path: Path) -> bytes:
    """The content of a file; refuses one that cannot be read."""
    try:
        require_text(path)
        return path.read_bytes()
    except OSError as error:
        reason = str(error.strerror or "unreadable").lower().removeprefix("is ")
        raise RefusedError(printable(path, 80), reason, "a file with a record") from None
