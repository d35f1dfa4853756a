"""Universal files: their data sets, and time histories (data sets 58, text or binary).

The columns of the heads are those of I-DEAS, Universal File Format.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from io import BytesIO
from itertools import takewhile
from math import isclose

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import RefusedError, require
from alphacut.base.units import decoded, factor_of
from alphacut.frame.records.recording import Recording
from alphacut.frame.records.stated import named_quantity
from alphacut.frame.records.text_file import NUMBER, choose_channel, recording_in_si

# Codes of the type of values: complex single and complex double.
COMPLEX = (5, 6)
# Names of the codes 1 … 6 of a direction: translations, and rotations about the axes.
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
    and forces contradict it, and others say nothing. Data sets 58 in text and in bytes are read.

    Args:
        name: Name of the file, for messages.
        content: The file.
        channel: NODE.DIRECTION of the response, as "7.x", in any capitals; empty where there is
            one. Of several data sets of one response it is "7.x#1", "7.x#2" …, or the first line of
            their heads.
        unit: Unit of a data set that states none, in a file without a system of units (164).

    Returns:
        The recording, with samples in m/s². Its channel is NODE.DIRECTION.

    Raises:
        RefusedError: There is no such data set; it is no time history of an acceleration in even
            steps with as many samples as it states; its unit is missing or not one of
            accelerations; or the step is not from 4e-5 s to below 0.5 s.
        ValueError: A code of its head is no whole number.
    """
    allowed = "a universal file with time histories, data sets 58"
    try:
        found = list(data_sets(content, 58))
        responses = [_response(data_set) for data_set in found]
        require(bool(found), name, "without a data set 58", allowed, "export time histories, 58")
        chosen = _choose_data_set(name, channel, found, responses)
        history = _parse_history(found[chosen])
    except RefusedError:
        raise
    except (ValueError, IndexError) as error:
        cure = "write or copy the file anew"
        raise RefusedError(name, str(error)[:80], allowed, cure) from None
    key = f"{name}, response {responses[chosen]}"
    _require_acceleration(key, found[chosen])
    n_samples = len(history.samples)
    is_full = n_samples == history.count > 1 and bool(np.isfinite(history.samples).all())
    what = f"{history.count} points, and {n_samples} are there"
    allowed = "two or more finite samples, as many as stated"
    require(is_full, key, what, allowed, "write or copy the file anew")
    step = history.step
    if history.times is not None:
        step = _even_step(key, history.times)
    # Line 8 of the head is of the abscissa, and has its name in columns 27 to 46 and its unit in 48
    # to 67. The unit may be the last word of the name; times without a known one are in s.
    words = re.findall(r"[^\W\d_]+", found[chosen].head[7][26:67])
    step *= next(filter(None, (factor_of(word, "s") for word in reversed(words))), 1.0)
    # Line 9 of the head is of the ordinate and has its unit in columns 48 to 67.
    own_unit = found[chosen].head[8][47:67].strip()
    if own_unit.upper() in ("", "NONE"):
        own_unit = _unit_of_system(content) or unit
    return recording_in_si(key, "UFF 58", own_unit, step, history.samples, responses[chosen])


def _unit_of_system(content: bytes) -> str:
    """Return the unit of accelerations in the system of units that a data set 164 states, or "".

    Its second line begins with the number of units of length in a metre.
    """
    for system in data_sets(content, 164):
        per_metre = floats(system.head[1])[0]
        for length in ("m", "cm", "mm", "in", "ft"):
            if isclose(per_metre * factor_of(length, "m"), 1, rel_tol=1e-3):
                return f"{length}/s^2"
        raise ValueError(f"in a system of {per_metre:g} units of length in a metre")
    return ""


def _response(data_set: DataSet) -> str:
    """Return NODE.DIRECTION of the response of a data set 58, as "7.x", or "7.9" for the code 9."""
    columns = data_set.head[5]
    direction = abs(int(columns[51:55]))
    names = dict(enumerate(DIRECTIONS, start=1))
    return f"{int(columns[41:51])}.{names.get(direction, direction)}"


def _choose_data_set(
    name: str, channel: str, found: Sequence[DataSet], responses: Sequence[str]
) -> int:
    """Return the index of the data set 58 that a channel names.

    Args:
        name: Name of the file, for the message.
        channel: NODE.DIRECTION of the response, as "7.x", in any capitals. If several data sets
            have this response it is "7.x#1", "7.x#2" …, in their order, or the first line of the
            head of the data set. It may be empty if there is one data set.
        found: The data sets.
        responses: NODE.DIRECTION of each, as "7.x".

    Raises:
        RefusedError: No data set or several have the name, or none is named and there are several.
    """
    counts = Counter(responses)
    names: list[tuple[str, ...]] = []
    for data_set, response in zip(found, responses, strict=True):
        aliases = [response]
        if counts[response] > 1:
            aliases.append(" ".join(data_set.head[0].split()).lower())
        names.append(tuple(aliases))
    return choose_channel(name, channel, names)


def _require_acceleration(key: str, data_set: DataSet) -> None:
    """Check that a data set 58 is a time history, and that it is none of another quantity.

    A data set that states no quantity, or one other than displacement, velocity and force, passes:
    the unit tells then.

    Args:
        key: What the data set is of, for messages.
        data_set: The data set, with the 11 lines of its head.

    Raises:
        RefusedError: It is no time history, or its response is by code or name a displacement, a
            velocity or a force.
        ValueError: A code of the head is no whole number.
    """
    # Columns of the format: the function in line 6, the quantities of abscissa and ordinate at the
    # beginning of lines 8 and 9, as code numbers; 12 is an acceleration.
    function = int(data_set.head[5][:5])
    axis = int(data_set.head[7][:10])
    # A function of the general type 0 over times (17) is a time history (1) as well.
    is_history = function == 1 or (function == 0 and axis == 17)
    cure = "export the time history: spectra and transfer functions have no samples over time"
    allowed = "a time history (1) of an acceleration"
    require(is_history, key, f"of function type {function}", allowed, cure)
    quantity = int(data_set.head[8][:10].strip() or 0)
    others = {8: "a displacement", 9: "a force", 11: "a velocity", 13: "a force"}
    what = f"of type {quantity}, {others.get(quantity)}"
    cure = "choose the channel of an accelerometer, type 12"
    require(quantity not in others, key, what, "the response of an accelerometer", cure)
    # Columns 27 to 46 of line 9 have the name of the ordinate.
    label = data_set.head[8][26:47].strip()
    named = named_quantity(label)
    require(not named, key, f"of {label}, {named}", "the response of an accelerometer", cure)


@dataclass(frozen=True)
class DataSet:
    """A data set of a universal file.

    Args:
        head: Lines of its head: 11 of a data set 58, 8 of a data set 55, 13 of a data set 2414.
        lines: Lines of its values; none where these are bytes.
        content: The values of a data set 58 in bytes; None of one in text.
        byte_order: Order of these bytes as NumPy names it, < or >.
    """

    head: list[str]
    lines: list[str]
    content: bytes | None = None
    byte_order: str = "<"


def data_sets(content: bytes, number: int) -> Iterator[DataSet]:
    """Yield the data sets of one number, in the order of a universal file.

    A data set stands between two lines "-1". Its first line is its number; "58b" marks a data set
    58 whose values are bytes. Data sets of other numbers are passed over.

    Args:
        content: The file.
        number: 55 or 2414 (modes and other data at nodes), 58 (functions, as time histories), or
            164 (units).

    Yields:
        The data set: `head`, the 8 (55), 11 (58), 2 (164) or 13 (2414) lines of its head, and
        `lines`, its values. A binary one has no lines; the bytes of its values are `content`, which
        is None otherwise, and their `byte_order` is ">" or "<". If the file is cut off, values are
        missing.

    Raises:
        ValueError: A data set of the number ends inside its head, or the line of a binary one does
            not count its bytes.
        KeyError: `number` is another one.
    """
    head_lines = {55: 8, 58: 11, 164: 2, 2414: 13}[number]
    file = BytesIO(content)
    while line := file.readline():
        if line.strip() != b"-1":
            continue
        first = file.readline()
        if first[:7].strip() == b"58b" and number == 58:
            # Numbers behind 58b: order of the bytes (1 or 2), their floating-point format, the
            # count of lines of the head, and the count of bytes.
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
            orders = {1: "<", 2: ">"}
            yield DataSet(head, [], values, byte_order=orders.get(byte_order, "<"))
        # The lines up to the next "-1". Those of other numbers and of binary values are dropped.
        inside = takewhile(lambda text: text.strip() != b"-1", iter(file.readline, b""))
        lines = [decoded(text).rstrip("\r\n") for text in inside]
        if first.strip() == str(number).encode():
            if len(lines) < head_lines:
                reason = "cut off, or with an ID line -1"
                raise ValueError(f"data set {number} of {len(lines)} lines of a head, {reason}")
            yield DataSet(lines[:head_lines], lines[head_lines:])


@dataclass(frozen=True, eq=False)
class _History:
    """The samples in a data set 58.

    Args:
        count: Number of samples that the head states; there may be fewer.
        step: Step of even times, in s.
        samples: Real parts of the values, shape (n,).
        times: Times that stand beside the samples, shape (n,); None where they are even.
    """

    count: int
    step: float
    samples: Array
    times: Array | None = None


def _parse_history(data_set: DataSet) -> _History:
    """Return the samples in a data set 58, and what its head says of them.

    Line 7 of the head has, in columns of 10 characters, the type of the values, their count, and
    whether their abscissas are even (1) or stand beside them (0); columns 44 to 56 have the step.
    Of complex values the real parts are returned.

    Args:
        data_set: The data set, in text or in bytes.

    Returns:
        `count`, the count in the head; `step`, in s; `samples`, shape (n,), where n is smaller than
        `count` if values are missing; and `times` in s, shape (n,), or None if they are even.

    Raises:
        ValueError, IndexError: A line of the head is no such line.
    """
    columns = data_set.head[6]
    value_type = int(columns[:10])
    count = int(columns[10:20])
    has_times = int(columns[20:30]) == 0  # before each value
    [step] = floats(columns[43:56])
    numbers_of_value = 2 if value_type in COMPLEX else 1
    if data_set.content is None:
        numbers = np.array([number for line in data_set.lines for number in floats(line)])
        width = numbers_of_value + int(has_times)
        n_rows = min(count, len(numbers) // width)  # what follows is padding
        rows = numbers[: n_rows * width].reshape(-1, width)
        values = rows[:, width - numbers_of_value]
        return _History(count, step, values, rows[:, 0] if has_times else None)
    order = data_set.byte_order
    # Types of values: 2 and 4 are real, 5 and 6 complex; 2 and 5 are single, 4 and 6 double.
    value = "f8" if value_type in (4, 6) else "f4"
    fields: list[tuple[str, str, tuple[int, ...]]] = [("value", order + value, (numbers_of_value,))]
    if has_times:  # a time is single, beside doubles as well
        fields.insert(0, ("time", f"{order}f4", ()))
    row = np.dtype(fields)
    n_rows = min(count, len(data_set.content) // row.itemsize)
    table = np.frombuffer(data_set.content, row, n_rows)
    times = table["time"].astype(float) if has_times else None
    return _History(count, step, table["value"][:, 0].astype(float), times)


def _even_step(key: str, times: Array) -> float:
    """Return the mean step in s of even times, which the format has rounded to six digits.

    Args:
        key: What the times are of, for messages.
        times: The times in s, shape (n,), with n ≥ 2.

    Raises:
        RefusedError: A time misses its even place by more than a unit of its sixth digit and a
            thousandth of a step, or the times do not rise.
    """
    even = np.linspace(times[0], times[-1], len(times))
    step = float(even[1] - even[0])
    # The first digit of a time t has the unit 10^floor(log10 |t|), and the sixth one 1e-5 of it.
    # The floor of the magnitudes keeps the logarithm of t = 0 finite.
    magnitudes = np.maximum(np.abs(times), np.finfo(float).tiny)
    last_digits = 10 ** (np.floor(np.log10(magnitudes)) - 5)
    # Besides, a time may miss its place by a thousandth of a step (tuned).
    is_even = step > 0 and bool((np.abs(times - even) <= last_digits + 1e-3 * step).all())
    require(is_even, key, "uneven", "even times", "resample to even steps")
    return step
