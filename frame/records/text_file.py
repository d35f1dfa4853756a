"""Text files with records: their lines with places for messages, and what all formats share."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from math import ceil, isfinite, nan
from pathlib import Path
from typing import NamedTuple, Self

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import RefusedError, printable, require
from alphacut.base.memory import require_text
from alphacut.base.units import ACCELERATION, decoded, unit_of
from alphacut.frame.records.recording import Recording
from alphacut.frame.records.stated_peak import StatedPeak, remarks_on_peak

# A number as C, Python or FORTRAN writes it; D stands for E.
NUMBER = re.compile(r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eEdD][-+]?[0-9]+)?")
ACCELERATION_UNITS = "g, gal, cm/s^2 or m/s^2"
# Smallest step of a record, and the one that all are below, in s. Instruments take 10 to 20,000
# samples in a second; another step is a mistake in its unit, or a count of samples.
MIN_STEP = 4e-5
MAX_STEP = 0.5


@dataclass(frozen=True)
class TextFile:
    """The lines of a text file from the first one on that is not empty, without their ends.

    Args:
        name: Its name, for messages.
        lines: The lines.
        skipped: Number of empty lines before them, which messages count as well.
    """

    name: str
    lines: tuple[str, ...]
    skipped: int = 0

    @classmethod
    def from_bytes(cls, name: str, content: bytes) -> Self:
        """Return the lines of a text file in UTF-8 or Latin-1.

        Args:
            name: Name of the file, for messages.
            content: The bytes of the file. Lines may end as on any system (CR LF, LF or CR). Where
                a spreadsheet has set a whole line in quotes, these are left out.

        Returns:
            The file with its lines; there is always one at least, which may be empty.

        Raises:
            RefusedError: The content has zero bytes, as binary files do, with a hint for workbooks,
                archives and UTF-16; or a line has more than 10,000 characters.
        """
        # A text has no zero bytes, but in UTF-16; archives and workbooks have.
        cure = "export its record as text in UTF-8; unpack an archive, save a sheet as CSV"
        require(b"\0" not in content, name, "no text", "a text file with a record", cure)
        lines = decoded(content).replace("\r\n", "\n").replace("\r", "\n").split("\n")
        first = next((k for k, line in enumerate(lines) if line.strip()), 0)
        # A spreadsheet may put separators of empty cells behind the quotes.
        lines = lines[first:]
        if b'"' in content:
            lines = [re.sub(r'^"([^"]*)"[,;\s]*$', r"\1", line) for line in lines]
        file = cls(name, tuple(lines), skipped=first)
        # Searches in a line take the square of its length; formats have about 80 letters a line.
        length = max(map(len, file.lines))
        if length > 10_000:
            longest = list(map(len, file.lines)).index(length)
            raise file.refusal(longest, f"{length:,} letters long", "lines of up to 10,000 letters")
        return file

    def line_number(self, line: int) -> int:
        """Return the number of a line in the file, from 1 on; `line` is its index in `lines`."""
        return line + 1 + self.skipped

    def location(self, line: int) -> str:
        """Return the name of a line, counted from 0, for messages."""
        return f"{self.name}, line {self.line_number(line)}"

    def refusal(self, line: int, value: object, allowed: str, cure: str = "") -> RefusedError:
        """Return the error about a line, counted from 0."""
        return RefusedError(self.location(line), str(value)[:80], allowed, cure)

    def numbers(self, first: int, last: int, *, width: int = 0, count: int = 0) -> Array:
        """Return all numbers in some lines, one after another, shape (numbers,).

        Args:
            first: Index of the first line, counted from 0.
            last: Index of the line behind the last one; lines behind the end of the file are passed
                over.
            width: Characters of a number in files of fixed columns, where empty columns are passed
                over; 0 where blanks separate the numbers.
            count: Number of values that are expected. Once so many have been read, the next line
                with a word that is no number ends the reading. If it is 0, no such line is allowed.

        Raises:
            RefusedError: A word is no finite number.
        """
        text = "\n".join(self.lines[first:last])
        if not width and not re.search(r"[^-+.0-9eE\s]", text):
            with suppress(ValueError):  # of words such as 1-2, which are named below
                found = np.array(text.split(), float)
                if np.isfinite(found).all():
                    return found
        # The loop goes over words, since a message names the line and the word that is wrong.
        values: list[float] = []
        for row in range(first, min(last, len(self.lines))):
            words = words_of(self.lines[row], width)
            if 0 < count <= len(values) and not all(NUMBER.fullmatch(word) for word in words):
                break
            for word in words:
                if not word:  # an empty column
                    continue
                is_number = NUMBER.fullmatch(word) is not None
                value = float(word.replace("D", "e").replace("d", "e")) if is_number else nan
                if not isfinite(value):
                    allowed = "finite numbers such as -.1394908E-02"
                    raise self.refusal(row, repr(word), allowed)
                values.append(value)
        return np.array(values)

    def head_numbers(self, first: int, n_lines: int, *, width: int, layout: str) -> Array:
        """Return the numbers in a block of lines of a head, shape (numbers,).

        A block of reals has a decimal point in its first line, one of integers has none: so a line
        that is missing above is noticed.

        Args:
            first: Index of the first line of the block, counted from 0.
            n_lines: Number of its lines.
            width: Characters of a number; empty columns are passed over.
            layout: What lines the head has, for the message, as "11 lines of text, 6 of integers
                and 10 of reals".

        Raises:
            RefusedError: A line of the block has other words than numbers, or reals stand among
                integers.
        """
        block = range(first, min(first + n_lines, len(self.lines)))
        are_reals = first in block and "." in self.lines[first]
        for row in block:
            words = filter(None, words_of(self.lines[row], width))
            are_numbers = all(NUMBER.fullmatch(word) for word in words)
            if not are_numbers or ("." in self.lines[row] and not are_reals):
                cure = "a line of the head is missing or damaged, or one is too many: load it anew"
                what = f"'{self.lines[row].strip()[:30]}'"
                raise self.refusal(row, what, f"a head of {layout}", cure)
        return self.numbers(first, first + n_lines, width=width)

    def fixed_columns(
        self,
        first: int,
        *,
        count: int,
        per_line: int,
        width: int,
        head: int,
        numbers_may_follow: bool = False,
    ) -> Array:
        """Return samples that stand in fixed columns, shape (count,).

        Args:
            first: Index of the line of the first sample, counted from 0.
            count: Number of samples that the head states.
            per_line: Samples in a line; 0 counts as 1.
            width: Characters of a sample, above 0.
            head: Index of the line that states the count, for the message.
            numbers_may_follow: Whether lines of other numbers, as velocities, may follow at once.

        Raises:
            RefusedError: A sample is no finite number, or there are more or fewer than `count` up
                to a line with text, or to the last line that `count` samples fill where other
                numbers may follow.
        """
        last = first + ceil(count / max(per_line, 1))
        # A damaged number has few letters, as in "nan" or "1.5E-O1". Four of them are text, such as
        # a line that announces the next series.
        for row, line in enumerate(self.lines[first:last], first):
            if re.search("[A-Za-z]{4}", line):
                last = row
                break
        # Further lines of numbers are samples that the head does not count.
        for row in range(last, len(self.lines)):
            words = [word for word in words_of(self.lines[row], width) if word]
            if numbers_may_follow or not words or not all(map(NUMBER.fullmatch, words)):
                break
            last = row + 1
        samples = self.numbers(first, last, width=width)
        self.require_count(samples, count, head)
        return samples

    def require_count(self, samples: Array, count: int, line: int) -> None:
        """Raise RefusedError unless there are `count` samples, as the line `line` states."""
        if len(samples) != count:
            what = f"{count} samples, and {len(samples)} follow"
            cure = "load the file anew, or mend the number in the head"
            raise self.refusal(line, what, "as many samples as the head states", cure)


class RecordFormat(NamedTuple):
    """A format of records with one channel a file.

    Attributes:
        name: Its name, for messages.
        mark: How a line of such a file begins.
        max_lines: In how many of its first lines the mark is looked for.
        read: Function of the file, and of the unit that the user states or "", to the recording.
    """

    name: str
    mark: re.Pattern[str]
    max_lines: int
    read: Callable[[TextFile, str], Recording]

    def has_marked(self, file: TextFile) -> bool:
        """Return whether a file is of this format by its mark."""
        return any(self.mark.match(line) for line in file.lines[: self.max_lines])


def words_of(line: str, width: int) -> list[str]:
    """Return the words of a line: those in columns of `width` characters, or between blanks if 0.

    Words of columns that are empty are empty.
    """
    text = line.rstrip()
    if not width:
        return text.split()
    return [text[start : start + width].strip() for start in range(0, len(text), width)]


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
    """Return the recording of samples in a unit of accelerations.

    Args:
        location: File and line, for messages.
        file_format: Name of the format.
        unit: Unit of the samples; empty where neither the file nor the user states one.
        step: Time between samples, in s.
        samples: The samples, shape (n,).
        channel: Name of the channel in the file.
        remarks: Clauses on what is unusual in the file.
        stated: Peaks in the file's head. If each of them differs from the peak of the samples by
            more than 5 %, the recording bears a remark; if each differs by more than a factor of 2,
            it is refused.

    Returns:
        The recording, with samples in m/s².

    Raises:
        RefusedError: The unit is missing or not one of accelerations, the step is not from 4e-5 s
            to below 0.5 s, or all stated peaks differ by more than a factor of 2.
    """
    parsed = unit_of(unit)
    if parsed is None or parsed.dimension != ACCELERATION:
        value = f"in units of {unit}" if unit else "without a unit"
        quantity = parsed.other_quantity if parsed else ""
        cure = "where the file has no unit, say records.unit"
        if quantity:
            cure = f"{unit} is the unit of {quantity}: take the record of the acceleration"
        elif unit:
            cure = "mend the unit in the head"
        raise RefusedError(location, value, f"accelerations in {ACCELERATION_UNITS}", cure)
    require_step(location, step)
    in_si = parsed.factor * samples
    remarks += remarks_on_peak(location, in_si, stated, unit)
    return Recording(file_format, unit, step, in_si, channel, remarks)


def require_step(location: str, step: float, cure: str = "mend the step in the head") -> None:
    """Refuse a step, in s, that no record of an earthquake has; `cure` is for the message."""
    allowed = f"steps from {MIN_STEP:g} s to below {MAX_STEP:g} s"
    require(MIN_STEP <= step < MAX_STEP, location, f"a step of {step:g} s", allowed, cure)


def require_stated_step(key: str, step: float) -> None:
    """Refuse a step, in s, that the user states and no record of an earthquake has."""
    cure = "state it in s"
    if step >= MAX_STEP:
        cure = f"of {step:g} samples in a second it is {1 / step:.9g} s, and {step:g} ms are"
        cure += f" {step / 1000:g} s"
    require_step(key, step, cure)


def choose_channel(location: str, channel: str, names: Sequence[tuple[str, ...]]) -> int:
    """Return the index of the channel that has a name, or of the only one if none is asked for.

    Args:
        location: File and line, for the message.
        channel: The name, in any capitals; empty if none is asked for. A name that several channels
            have is numbered in their order, as "90 deg#1" and "90 deg#2".
        names: Names of each channel, in small letters.

    Raises:
        RefusedError: No channel has the name, or none is asked for and there are several.
    """
    counts = Counter(name for aliases in names for name in aliases)
    seen = Counter[str]()
    unique_names = []  # of each channel, none of which another one has
    for aliases in names:
        seen.update(aliases)
        numbers = {name: f"#{seen[name]}" for name in aliases if counts[name] > 1}
        unique_names.append([name + numbers.get(name, "") for name in aliases])
    wanted = channel.lower()
    chosen = [k for k, unique in enumerate(unique_names) if not wanted or wanted in unique]
    allowed = "; ".join(dict.fromkeys(" or ".join(unique) for unique in unique_names))
    value = f"channel {channel or 'not named'}"
    require(len(chosen) == 1, location, value, f"one of: {allowed or 'accelerations'}")
    return chosen[0]


def read_bytes(path: Path) -> bytes:
    """Return the content of a file that should be a text with a record.

    Raises:
        RefusedError: The file is missing, is a folder or no regular file, cannot be read, or is too
            large for the memory.
    """
    try:
        require_text(path)
        return path.read_bytes()
    except OSError as error:
        reason = str(error.strerror or "unreadable").lower().removeprefix("is ")
        raise RefusedError(printable(path, 80), reason, "a file with a record") from None
