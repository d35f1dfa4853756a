"""Universal files: their data sets, and time histories (data sets 58, text or binary)."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO
from itertools import takewhile

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import RefusedError, require
from alphacut.frame.records.recording import Recording
from alphacut.frame.records.text_file import (
    NUMBER,
    choose_channel,
    decoded,
    recording_in_si,
)

HEAD_LINES = {55: 8, 58: 11}
"""Lines of the head of each data set that is read."""
TIME_HISTORY, TIME = 1, 17
"""Function type of a time history, and type of an axis of times, in data set 58."""
BIG_ENDIAN, DOUBLE, COMPLEX = 2, (4, 6), (5, 6)
"""Codes of byte order and of values."""
OTHER_QUANTITIES = {8: "a displacement", 9: "a force", 11: "a velocity", 13: "a force"}
"""Types of data of the ordinate that are no acceleration, whatever unit the file states."""
DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")
WITHOUT_LETTER = re.compile(r"(\d*\.\d+|\d+\.)([-+]\d{3})(?![\d.])")
"""A number whose exponent has three digits; FORTRAN leaves its letter out."""
EVEN = 1e-3
"""Fraction of a step by which times may be uneven besides the rounding of their digits."""


def floats(line: str) -> list[float]:
    """Return the numbers of a line, as FORTRAN or C write them; 8.82898-001 is .882898."""
    with_letter = WITHOUT_LETTER.sub(r"\1e\2", line)
    return [float(number.upper().replace("D", "E")) for number in NUMBER.findall(with_letter)]


def is_universal(content: bytes) -> bool:
    """True if the first line is the mark with which data sets of universal files begin and end."""
    return content.lstrip()[:20].split(b"\n")[0].strip() == b"-1"


def read_uff_record(name: str, content: bytes, channel: str = "") -> Recording:
    """Reads a recording of acceleration from a data set 58 of a universal file, text or binary.

    The stated unit says whether it is an acceleration; types of data of displacements, velocities
    and forces contradict it, and others say nothing. `channel` is NODE.DIRECTION of the response,
    as "7.x"; it may be left out where there is one. Of several data sets of one response it is
    "7.x#1", "7.x#2" …, or the first line of their heads.
    """
    try:
        parsed = [_parse_series(*rows) for rows in data_sets(content, 58)]
    except (ValueError, IndexError) as error:
        raise RefusedError(name, str(error)[:80], "data sets 58 of a universal file") from None
    require(bool(parsed), name, "without a data set 58", "a universal file with time histories")
    counts = Counter(series.name for series in parsed)
    names = []  # of each data set; those of one response are told apart by their first lines too
    for series in parsed:
        is_repeated = counts[series.name] > 1
        names.append((series.name, series.title.lower()) if is_repeated else (series.name,))
    series = parsed[choose_channel(name, channel, names)]
    key = f"{name}, response {series.name}"
    is_history = series.function == TIME_HISTORY or (series.function == 0 and series.axis == TIME)
    allowed = "a time history (1) of an acceleration"
    require(is_history, key, f"of function type {series.function}", allowed)
    quantity = OTHER_QUANTITIES.get(series.quantity, "")
    value, allowed = f"of type {series.quantity}, {quantity}", "the response of an accelerometer"
    require(not quantity, key, value, allowed)
    is_full = len(series.samples) == series.count > 1 and bool(np.isfinite(series.samples).all())
    value = f"{series.count} points, and {len(series.samples)} are there"
    require(is_full, key, value, "two or more finite samples, as many as stated")
    step = series.step if series.times is None else _even_step(key, series.times)
    return recording_in_si(key, "UFF 58", series.unit, step, series.samples, series.name)


@dataclass(frozen=True, eq=False)
class _Series:
    """A data set 58: NODE.DIRECTION of the response, types of function and axis, and its samples.

    `title` is the first line of the head, `quantity` the type of data of the ordinate; `times` are
    None where the steps are even, (n,) in s otherwise.
    """

    name: str
    title: str
    quantity: int
    function: int
    axis: int
    unit: str
    count: int
    step: float
    times: Array | None
    samples: Array


def data_sets(content: bytes, number: int) -> Iterator[tuple[list[str], bytes | list[str]]]:
    """Yields the head of each data set of a number, and its values: lines, or bytes of a 58b.

    The head of a data set in bytes ends with their byte order, < or >.

    Raises:
        ValueError: A data set of the number ends inside its head.
    """
    file = BytesIO(content)
    while line := file.readline():
        if line.strip() != b"-1":
            continue
        first = file.readline()
        if first[:7].strip() == b"58b" and number == 58:
            byte_order, _, _, size = (int(word) for word in first[7:].split()[:4])
            head = [decoded(file.readline()).rstrip("\r\n") for _ in range(HEAD_LINES[58])]
            # some writers put an end of line between the head and the bytes
            starts = (file.tell() + extra for extra in range(3))
            ends = (x for x in starts if content[x + size :].lstrip()[:2] == b"-1")
            start = next(ends, file.tell())
            file.seek(start + max(size, 0))
            yield [*head, ">" if byte_order == BIG_ENDIAN else "<"], content[start : file.tell()]
        inside = takewhile(lambda x: x.strip() != b"-1", iter(file.readline, b""))
        rows = [decoded(row).rstrip("\r\n") for row in inside]
        if first.strip() == str(number).encode():
            if len(rows) < HEAD_LINES[number]:
                following = file.readline().strip()
                is_id_line = following not in (b"-1", b"")
                reason = "an ID line is −1: write NONE there" if is_id_line else "it is cut off"
                raise ValueError(f"data set {number} with {len(rows)} lines of a head; {reason}")
            yield rows[: HEAD_LINES[number]], rows[HEAD_LINES[number] :]


def _parse_series(head: list[str], values: bytes | list[str]) -> _Series:
    """The series of a data set 58, by the columns of its head (I-DEAS, Universal File Format)."""
    response, direction = int(head[5][41:51]), abs(int(head[5][51:55]))
    axis_name = DIRECTIONS[direction - 1] if 1 <= direction <= 6 else str(direction)
    kind, count, is_even = (int(head[6][start : start + 10]) for start in (0, 10, 20))
    [step] = floats(head[6][43:56])
    parts = 2 if kind in COMPLEX else 1
    columns = parts if is_even else parts + 1
    if isinstance(values, bytes):
        real = f"{head[-1]}f{8 if kind in DOUBLE else 4}"
        time = f"{head[-1]}f4"  # a time is single, beside doubles as well
        row = np.dtype([("time", time)] * (not is_even) + [("value", real, (parts,))])
        table = np.frombuffer(values, row, min(count, len(values) // row.itemsize))
        times = None if is_even else table["time"].astype(float)
        samples = table["value"][:, 0].astype(float)
    else:
        numbers = np.array([number for line in values for number in floats(line)])
        rows = numbers[: count * columns]  # what follows is padding
        rows = rows[: len(rows) // columns * columns].reshape(-1, columns)
        times = None if is_even else rows[:, 0]
        samples = rows[:, columns - parts]
    function, axis, unit = int(head[5][:5]), int(head[7][:10]), head[8][47:67].strip()
    unit = "" if unit.upper() == "NONE" else unit
    name = f"{response}.{axis_name}"
    title, quantity = " ".join(head[0].split()), int(head[8][:10].strip() or 0)
    return _Series(name, title, quantity, function, axis, unit, count, step, times, samples)


def _even_step(key: str, times: Array) -> float:
    """Step in s of times that are even but for the six digits with which the format has them."""
    even = np.linspace(times[0], times[-1], len(times))
    step = float(even[1] - even[0])
    size = np.maximum(np.abs(times), np.finfo(float).tiny)
    rounding = 10 ** (np.floor(np.log10(size)) - 5)
    is_even = step > 0 and bool((np.abs(times - even) <= rounding + EVEN * step).all())
    require(is_even, key, "uneven", "even times")
    rate = round(1 / step)  # of which the digits are often but a rounding
    is_whole = rate > 0 and abs(1 / rate - step) * (len(times) - 1) <= rounding[-1]
    return 1 / rate if is_whole else step
