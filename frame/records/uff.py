"""Universal files: their data sets, and time histories (data sets 58, text or binary).

The columns of the heads are those of I-DEAS, Universal File Format.
"""

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
from alphacut.frame.records.text_file import NUMBER, choose_channel, decoded, recording_in_si

COMPLEX = (5, 6)
"""Codes of complex values, single and double."""
DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")


def floats(line: str) -> list[float]:
    """Return the numbers of a line, as FORTRAN or C write them.

    FORTRAN leaves the letter out before an exponent of three digits: 8.82898-001 is .882898.
    """
    with_letter = re.sub(r"(\d*\.\d+|\d+\.)([-+]\d{3})(?![\d.])", r"\1e\2", line)
    return [float(number.upper().replace("D", "E")) for number in NUMBER.findall(with_letter)]


def is_universal(content: bytes) -> bool:
    """Return whether the first line is the mark between data sets of universal files."""
    return content.lstrip()[:20].split(b"\n")[0].strip() == b"-1"


def read_uff_record(name: str, content: bytes, channel: str = "", unit: str = "") -> Recording:
    """Return the recording of acceleration in a data set 58 of a universal file.

    The stated unit says whether it is an acceleration; types of data of displacements, velocities
    and forces contradict it, and others say nothing.

    Args:
        name: Name of the file, for messages.
        content: The file.
        channel: NODE.DIRECTION of the response, as "7.x"; empty where there is one. Of several data
            sets of one response it is "7.x#1", "7.x#2" …, or the first line of their heads.
        unit: Unit of a data set that states none.

    Raises:
        RefusedError: There is no such data set, or it is no time history of an acceleration in even
            steps with as many samples as it states.
    """
    allowed = "a universal file with time histories, data sets 58"
    try:
        histories = [_parse_history(data_set) for data_set in data_sets(content, 58)]
    except (ValueError, IndexError) as error:
        cure = "write or copy the file anew"
        raise RefusedError(name, str(error)[:80], allowed, cure) from None
    require(bool(histories), name, "without a data set 58", allowed, "export time histories, 58")
    counts = Counter(history.name for history in histories)
    names = []
    for history in histories:
        is_repeated = counts[history.name] > 1
        names.append((history.name, history.title) if is_repeated else (history.name,))
    history = histories[choose_channel(name, channel, names)]

    key = f"{name}, response {history.name}"
    # A function of the general type 0 over times (17) is a time history (1) as well.
    is_history = history.function == 1 or (history.function == 0 and history.axis == 17)
    what = f"of function type {history.function}"
    cure = "export the time history: spectra and transfer functions have no samples over time"
    require(is_history, key, what, "a time history (1) of an acceleration", cure)
    quantities = {8: "a displacement", 9: "a force", 11: "a velocity", 13: "a force"}
    if history.quantity in quantities:
        what = f"of type {history.quantity}, {quantities[history.quantity]}"
        cure = "choose the channel of an accelerometer, type 12"
        raise RefusedError(key, what, "the response of an accelerometer", cure)
    n_samples = len(history.samples)
    is_full = n_samples == history.count > 1 and bool(np.isfinite(history.samples).all())
    what = f"{history.count} points, and {n_samples} are there"
    allowed = "two or more finite samples, as many as stated"
    require(is_full, key, what, allowed, "write or copy the file anew")
    step = history.step if history.times is None else _even_step(key, history.times)
    own_unit = history.unit or unit
    return recording_in_si(key, "UFF 58", own_unit, step, history.samples, history.name)


@dataclass(frozen=True)
class DataSet:
    """A data set of a universal file.

    Args:
        head: Lines of its head: 11 of a data set 58, 8 of a data set 55.
        lines: Lines of its values; none where these are bytes.
        content: The values of a data set 58 in bytes; None of one in text.
        byte_order: Order of these bytes as NumPy names it, < or >.
    """

    head: list[str]
    lines: list[str]
    content: bytes | None = None
    byte_order: str = "<"


def data_sets(content: bytes, number: int) -> Iterator[DataSet]:
    """Yield the data sets of a number, 55 or 58, in the order of a universal file.

    Raises:
        ValueError: A data set of the number ends inside its head.
    """
    head_lines = {55: 8, 58: 11}[number]
    file = BytesIO(content)
    while line := file.readline():
        if line.strip() != b"-1":
            continue
        first = file.readline()
        if first[:7].strip() == b"58b" and number == 58:
            byte_order, _, _, size = (int(word) for word in first[7:].split()[:4])
            head = [decoded(file.readline()).rstrip("\r\n") for _ in range(head_lines)]
            start = file.tell()
            # Some writers put an end of line between the head and the bytes.
            for extra in range(3):
                if content[file.tell() + extra + size :].lstrip()[:2] == b"-1":
                    start = file.tell() + extra
                    break
            file.seek(start + max(size, 0))
            values = content[start : file.tell()]
            yield DataSet(head, [], values, byte_order=">" if byte_order == 2 else "<")
        inside = takewhile(lambda text: text.strip() != b"-1", iter(file.readline, b""))
        lines = [decoded(text).rstrip("\r\n") for text in inside]
        if first.strip() == str(number).encode():
            if len(lines) < head_lines:
                # An ID line "-1" looks like the end of the data set.
                is_id_line = file.readline().strip() not in (b"-1", b"")
                reason = "an ID line is −1: write NONE there" if is_id_line else "it is cut off"
                raise ValueError(f"data set {number} with {len(lines)} lines of a head; {reason}")
            yield DataSet(lines[:head_lines], lines[head_lines:])


@dataclass(frozen=True, eq=False)
class _History:
    """The function in a data set 58.

    Args:
        name: NODE.DIRECTION of the response.
        title: First line of the head, in small letters.
        quantity: Type of data of the ordinate.
        function: Type of the function.
        axis: Type of data of the abscissa.
        unit: Unit of the ordinate; empty where the file states none.
        count: Number of samples that the head states.
        step: Step of even abscissae.
        times: Abscissae that are listed with the samples, shape (n,); None where they are even.
        samples: Real parts of the values, shape (n,).
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


def _parse_history(data_set: DataSet) -> _History:
    """Return the function in a data set 58.

    Raises:
        ValueError, IndexError: A line of the head is no such line.
    """
    head = data_set.head
    direction = abs(int(head[5][51:55]))
    axis_name = DIRECTIONS[direction - 1] if 1 <= direction <= 6 else str(direction)
    value_type = int(head[6][:10])
    count = int(head[6][10:20])
    has_times = int(head[6][20:30]) == 0
    [step] = floats(head[6][43:56])
    times, samples = _samples(data_set, value_type, count, has_times=has_times)
    unit = head[8][47:67].strip()
    return _History(
        name=f"{int(head[5][41:51])}.{axis_name}",
        title=" ".join(head[0].split()).lower(),
        quantity=int(head[8][:10].strip() or 0),
        function=int(head[5][:5]),
        axis=int(head[7][:10]),
        unit="" if unit.upper() == "NONE" else unit,
        count=count,
        step=step,
        times=times,
        samples=samples,
    )


def _samples(
    data_set: DataSet, value_type: int, count: int, *, has_times: bool
) -> tuple[Array | None, Array]:
    """Return the times, None without such, and the real parts of the values of a data set 58.

    Args:
        data_set: The data set.
        value_type: Code of the values: 2 and 4 are single and double reals, 5 and 6 complex.
        count: Number of values that the head states; there may be fewer, and then padding.
        has_times: Whether a time stands before each value.
    """
    numbers_of_value = 2 if value_type in COMPLEX else 1
    if data_set.content is not None:
        real = f"{data_set.byte_order}f{8 if value_type in (4, 6) else 4}"
        fields: list[tuple[str, str, tuple[int, ...]]] = [("value", real, (numbers_of_value,))]
        if has_times:  # a time is single, beside doubles as well
            fields.insert(0, ("time", f"{data_set.byte_order}f4", ()))
        row = np.dtype(fields)
        n_rows = min(count, len(data_set.content) // row.itemsize)
        table = np.frombuffer(data_set.content, row, n_rows)
        times = table["time"].astype(float) if has_times else None
        return times, table["value"][:, 0].astype(float)
    numbers = np.array([number for line in data_set.lines for number in floats(line)])
    width = numbers_of_value + 1 if has_times else numbers_of_value
    n_rows = min(count, len(numbers) // width)
    rows = numbers[: n_rows * width].reshape(-1, width)
    return rows[:, 0] if has_times else None, rows[:, width - numbers_of_value]


def _even_step(key: str, times: Array) -> float:
    """Return the step in s of times that are even but for the six digits that the format has.

    Args:
        key: What the times are of, for messages.
        times: The times in s, shape (n,).

    Raises:
        RefusedError: They are uneven.
    """
    even = np.linspace(times[0], times[-1], len(times))
    step = float(even[1] - even[0])
    magnitudes = np.maximum(np.abs(times), np.finfo(float).tiny)
    last_digits = 10 ** (np.floor(np.log10(magnitudes)) - 5)
    # Besides, a time may miss its place by a thousandth of a step (tuned).
    is_even = step > 0 and bool((np.abs(times - even) <= last_digits + 1e-3 * step).all())
    require(is_even, key, "uneven", "even times", "resample to even steps")
    # A whole number of samples in a second that fits all digits is the step before rounding.
    rate = round(1 / step)
    is_whole = rate > 0 and abs(1 / rate - step) * (len(times) - 1) <= last_digits[-1]
    return 1 / rate if is_whole else step
