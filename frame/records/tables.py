"""Records and forces in tables: times and values, with units in a head or without a head.

Without a head the case says the unit, and of numbers without times the step as well: one a line, or
several a line, which follow one another. Of several components a channel chooses the column.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from pathlib import Path

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import RefusedError, require
from alphacut.frame.records.recording import Recording
from alphacut.frame.records.stated_peak import peaks_in_text
from alphacut.frame.records.text_file import (
    ACCELERATION_UNITS,
    MAX_STEP,
    TextFile,
    choose_channel,
    read_bytes,
    recording_in_si,
    require_step,
)
from alphacut.frame.records.units import NEWTONS, SECONDS, acceleration_factor, other_quantity
from alphacut.stochastic.particles.csv_columns import NUMBER

TIME = r"\W*(?:time|t)\b\W*([a-zµ]*)\W*[,;\s]\W*"
UNIT = r"[^\w%‰]*(.*?)[\s\])\"]*"  # %g is a unit, and another than g
HEAD = re.compile(TIME + rf"(?:ground\s+)?(?:acceleration|accel|acc|ag|a)\b{UNIT}", re.IGNORECASE)
FORCE_HEAD = re.compile(TIME + rf"(?:force|load|f)\b{UNIT}", re.IGNORECASE)
"""A head of two columns: units of the times and of the values, each empty where it has none."""
ALLOWED = "time [s],acceleration [m/s^2], [g] or [gal]"
ALLOWED_FORCE = "time [s],force [kN], or time [s],force of a course without a unit"
TAKE = "take the record of the acceleration, or mend the head"
DECIMAL_COMMAS_BETWEEN_COMMAS = (
    "these seem to be decimal commas: write decimal points, or semicolons between the columns"
)
OTHER_WORDS = {
    "a displacement": r"disp(?:l\w*)?|deflection|drift|position",
    "a velocity": r"vel(?:oc\w*)?|speed",
    "a force": r"forces?|loads?|thrust|(?:base )?shear",
    "a strain": r"strains?",
    "a stress": r"stress(?:es)?|pressure",
    "an angle": r"rotation|angle|tilt",
    "a number of counts": r"counts?",
    "a voltage": r"voltage|volts?",
}
OTHER_COLUMN = {
    name: re.compile(rf"(?:\b|_)(?:{words})(?:\b|_)", re.IGNORECASE)
    for name, words in OTHER_WORDS.items()
}
"""Words in the head of a column whose quantity is no acceleration, by what it is called."""
ACCELERATION_WORD = re.compile(r"(?:\b|_)(?:acc(?:el\w*)?|ag)(?:\b|_)", re.IGNORECASE)
BRACKETED = re.compile(r"[\[(]\s*([^\])]+?)\s*[\])]")
_DECIMAL = r'"?[-+]?(?:\d+(?:,\d+)?|,\d+)(?:[eE][-+]?\d+)?"?'
DECIMAL_COMMAS = re.compile(
    rf'\s*{_DECIMAL}(?P<more>\s*[;\t]\s*{_DECIMAL}|\s+{_DECIMAL}|(?<="),(?="){_DECIMAL})*[;\s]*'
)
"""A row whose cells have decimal commas; semicolons, tabs, blanks or quotes part the cells."""
BEGINS_WITH_NUMBER = re.compile(r'[\s"]*[-+−]?[.,]?\d')
CURES_OF_ROWS = {
    r"\d:\d\d": "write seconds in place of clock times, or leave times out and say records.step",
    r"\d{4}-\d\d-\d\d|\d/\d+/\d": "write seconds in place of dates, or say records.step",
    r"\d\.\d{3},\d|\d,\d{3}\.\d": "write numbers without separators of thousands",
    r"(?i)nan|null|n/?a\b|inf|-{2}|#": "values are missing: fill the gap, or cut the record there",
    r",\s*,|;\s*;|,\s*$|;\s*$": "cells are empty: fill the gap, or cut the record there",
    r"^\s*[,;]": "cells are empty: fill the gap, or cut the record there",
    r"[A-Za-z]{2}": "text stands among the numbers: cut it off",
    r"\d,\d": "write decimal points if these are decimal commas",
}
"""Cure of a row that is not of numbers, by a pattern in its text; the first that fits."""
COUNTED = re.compile(r"\W*(?:samples?|points?|index|number|no|nr|count|n|i)\b", re.IGNORECASE)
"""A head whose first column counts samples."""
UNEVEN = 0.05
"""Fraction of a step by which a time may miss its place, as times that are rounded do."""
ROUNDED = 1 + 1e-6
"""Last digits by which times that lost digits may miss their place; with binary round-off."""


@dataclass(frozen=True)
class _Table:
    """A table of numbers: its last line of head, empty without one, and cells of each row by line.

    Lines are counted from 0; `start` is the first that is neither empty nor a comment. `above` are
    all lines above the numbers, comments among them, and `column_heads` those of them that tell
    what the columns are: the last one, and those that begin with a time.
    """

    head: str
    start: int
    rows: dict[int, list[str]]
    column_heads: tuple[str, ...]
    above: tuple[str, ...]

    @classmethod
    def of(cls, file: TextFile) -> _Table:
        """The table in a file; lines above the first that begins with a number are its head."""
        lines = {k: x for k, x in enumerate(file.lines) if x.strip() and not x.startswith("#")}
        starts = (k for k, x in lines.items() if BEGINS_WITH_NUMBER.match(x))
        first = next(starts, len(file.lines))
        head = [x for k, x in lines.items() if k < first][-1:]
        texts = {k: x for k, x in lines.items() if k >= first}
        if _have_decimal_commas([*texts.values()]):
            rows = {k: re.findall(r'[^;\s"]+', x) for k, x in texts.items()}
            rows = {
                k: [x.replace(",", ".") for x in cells if x != ","] for k, cells in rows.items()
            }
        else:
            rows = {k: re.findall(r'[^,;\s"]+', x) for k, x in texts.items()}
        above = tuple(x.lstrip("# \t") for x in file.lines[:first] if x.strip("# \t"))
        begin_with_time = [x for x in above[:-1] if re.match(TIME, x, re.IGNORECASE)]
        heads = (*begin_with_time, *above[-1:])
        return cls("".join(head), min(lines, default=0), rows, heads, above)

    def other_quantity(self) -> str:
        """The quantity, not an acceleration, that a head of the columns names; empty if none."""
        for head in self.column_heads:
            if ACCELERATION_WORD.search(head):
                continue
            named = (name for name, pattern in OTHER_COLUMN.items() if pattern.search(head))
            if name := next(named, ""):
                return name
        for head in self.column_heads:
            for unit in BRACKETED.findall(head):
                if name := other_quantity(unit):
                    return f"{name} by its unit {unit}"
        return ""

    def numbers(self, file: TextFile, columns: int) -> Array:
        """The numbers, shape (rows, columns); refuses a row of others."""
        for line, cells in self.rows.items():
            if len(cells) != columns or not _are_numbers(cells):
                raise _row_refusal(file, line, columns)
        return np.array([[float(x) for x in cells] for cells in self.rows.values()])

    def series(self, file: TextFile) -> Array:
        """All numbers, row by row, shape (n,); the last row alone may have fewer than the others.

        Refuses columns that are smoother than the rows: those of several components, not of one
        series whose numbers follow one another.
        """
        first, *_ = self.rows.values()
        *full, last = self.rows
        whole = replace(self, rows={line: self.rows[line] for line in full})
        numbers = whole.numbers(file, len(first))
        if len(self.rows[last]) > len(first) or not _are_numbers(self.rows[last]):
            raise _row_refusal(file, last, len(first))
        is_one_column = len(first) == 1 or len(full) == 1
        along_rows = np.abs(np.diff(numbers.ravel())).sum() / max(numbers.size - 1, 1)
        along_columns = np.abs(np.diff(numbers, axis=0)).sum() / max(numbers[1:].size, 1)
        if along_columns < along_rows and not is_one_column:
            value = f"{len(first)} columns, each smoother than the rows"
            allowed = "one series, whose numbers follow one another"
            cure = f"choose one of several components: {file.name}#1, #2 …; else one number a line"
            raise file.refusal(self.start, value, allowed, cure)
        return np.append(numbers.ravel(), [float(x) for x in self.rows[last]])

    def resolution(self) -> float:
        """The coarsest last digit of the times in the first column, in their unit: of 1.023 0.001.

        Formats have a number of decimals, or of digits; final zeros may be left out, so that the
        cells with most of them tell.
        """
        times = [Decimal(cells[0]) for cells in self.rows.values()]
        finest = min(int(time.as_tuple().exponent) for time in times)
        digits = max(len(time.as_tuple().digits) for time in times)
        return float(10.0 ** max(finest, max(times).adjusted() + 1 - digits))


def _are_numbers(cells: Sequence[str]) -> bool:
    return all(NUMBER.fullmatch(x) and np.isfinite(float(x)) for x in cells)


def _row_refusal(file: TextFile, line: int, columns: int) -> RefusedError:
    """Error about a row that is not of so many numbers, with the cure that its text tells."""
    text = file.lines[line].strip()
    cures = (cure for pattern, cure in CURES_OF_ROWS.items() if re.search(pattern, text))
    return file.refusal(
        line, text, f"rows of {columns} numbers such as 1.25 or 1e-3", next(cures, "")
    )


def _have_decimal_commas(rows: Sequence[str]) -> bool:
    """True if the commas of all rows are decimal commas.

    A row such as 0,03097 may be two numbers as well. It is one if the numbers before the commas do
    not rise, as times or counts of samples would.
    """
    matches = [DECIMAL_COMMAS.fullmatch(row) for row in rows]
    if not all(matches) or not any("," in row for row in rows):
        return False
    if any(match and match["more"] for match in matches):
        return True
    before = np.array([float(row.strip(' ";').partition(",")[0] or 0) for row in rows])
    return bool((np.diff(before) <= 0).any())


def is_table(file: TextFile, *, is_described: bool = False) -> bool:
    """True if a head begins with times, or the last row has one or two numbers.

    More numbers a row are a table if there is no head, or the case describes them (`is_described`).
    """
    table = _Table.of(file)
    last = list(table.rows.values())[-1:]
    is_row = any(all(map(NUMBER.fullmatch, x)) for x in last)
    is_plain = is_described or not table.head or any(len(x) < 3 for x in last)
    return bool(re.match(TIME, table.head, re.IGNORECASE)) or (is_row and is_plain)


def read_table(
    file: TextFile, step: float | None = None, unit: str = "", channel: str = ""
) -> Recording:
    """Recording of a table with even steps: times and accelerations, or accelerations alone.

    The case's unit, and of numbers without times its step in s, stand in where no head states them;
    times without a unit are in s. The channel is a column: its number, where the times are column
    1, or its name in the head.
    """
    table = _Table.of(file)
    allowed = "a header with units, and rows of numbers below it"
    require(len(table.rows) > 1, file.name, f"{len(table.rows)} rows", allowed)
    columns = len(next(iter(table.rows.values())))
    in_head = len(re.split("[,;\t]", table.head))
    has_commas = all("," in file.lines[line] for line in table.rows)
    if has_commas and 1 < in_head < columns <= 2 * in_head and re.match(TIME, table.head, re.I):
        value = f"{columns} numbers in a row below {in_head} heads"
        first_row = next(iter(table.rows))
        cure = DECIMAL_COMMAS_BETWEEN_COMMAS
        raise file.refusal(first_row, value, "a number in a row for each head", cure)
    if channel or columns > 2:
        return _read_column(file, table, step, unit, channel=channel)
    if quantity := table.other_quantity():
        shown = " ".join(table.column_heads)
        raise file.refusal(table.start, shown, ALLOWED, f"its column is {quantity}: {TAKE}")
    match = HEAD.fullmatch(table.head) if columns == 2 else None
    time_unit, head_unit = match.groups() if match else ("", "")
    unit, to_s = head_unit or unit, SECONDS.get(time_unit or "s", 0.0)
    is_complete = to_s > 0 and acceleration_factor(unit) is not None
    if not is_complete or (columns == 1 and step is None):
        value = table.head[:80] or f"{columns} columns without a head"
        allowed = f"a unit of {ACCELERATION_UNITS}, and a step" if columns == 1 else ALLOWED
        cure = 'records.unit = "g"' + (', records.step = "0.005 s"' if columns == 1 else "")
        cure = f"or say {cure}"
        if (
            head_unit and acceleration_factor(head_unit) is None
        ):  # the case's unit does not stand in
            cure = f"{head_unit} is no unit of accelerations: mend the head"
        if re.search(r"[,;\s]\W*(?:time|t)\b", table.head, re.IGNORECASE):
            cure = "times stand in the first column"
        elif COUNTED.match(table.head):
            cure = 'leave the count of samples out, and say records.step = "0.005 s"'
        if to_s == 0:
            cure = f"{time_unit} is no unit of times: {', '.join(SECONDS)}"
        raise file.refusal(table.start, value, allowed, cure)
    stated = [*peaks_in_text(table.above, unit)]
    location = file.location(table.start)
    if columns == 1 or (step and not table.head and not _has_times(table)):
        samples, name = table.series(file), "one column" if columns == 1 else "bare numbers"
        return recording_in_si(location, name, unit, step or 0.0, samples, stated=stated)
    numbers = table.numbers(file, columns)
    step, remarks = _step_and_remarks(file, table, to_s=to_s, stated_step=step)
    if match and not time_unit:
        remarks.append("its times have no unit, taken as s")
    if table.head and not match:
        what = f"its head, {table.head[:40]}, is not understood"
        remarks.append(f"{what}: the case's unit is taken")
    name = "CSV" if match else "two columns"
    return recording_in_si(
        location, name, unit, step, numbers[:, 1], "", (*remarks,), stated=stated
    )


def _has_times(table: _Table) -> bool:
    """True if the head begins with times, or the numbers of the first column rise."""
    if re.match(TIME, table.head, re.IGNORECASE):
        return True
    first = [cells[0] for cells in table.rows.values()]
    return _are_numbers(first) and bool((np.diff(np.array(first, float)) >= 0).all())


def _read_column(
    file: TextFile, table: _Table, step: float | None, unit: str, *, channel: str
) -> Recording:
    """Recording of one of several columns, or of several numbers a line that follow one another."""
    columns = len(next(iter(table.rows.values())))
    location, has_times = file.location(table.start), _has_times(table)
    if not channel and not has_times and step and unit:
        return recording_in_si(location, "bare numbers", unit, step, table.series(file))
    heads = _column_heads(table.head, columns)
    bare = [BRACKETED.sub("", head).strip(' "').lower() for head in heads]
    components = range(1 if has_times else 0, columns)
    names = [tuple(filter(None, (str(k + 1), bare[k]))) for k in components]
    if not channel and not has_times:
        cure = (
            f"choose one of several components, {file.name}#1; one series, several numbers a line,"
        )
        cure += ' has records.step = "0.005 s" and records.unit = "g"'
        raise file.refusal(table.start, f"{columns} columns without times", ALLOWED, cure)
    column = components[choose_channel(f"{location}: {file.name}#COLUMN", channel, names)]
    in_head = BRACKETED.search(heads[column])
    unit, name = in_head[1] if in_head else unit, " ".join(names[column - components[0]])
    for quantity, pattern in OTHER_COLUMN.items():
        if pattern.search(bare[column]) and not ACCELERATION_WORD.search(bare[column]):
            raise file.refusal(
                table.start, heads[column], ALLOWED, f"its column is {quantity}: {TAKE}"
            )
    if not unit or (not has_times and step is None):
        cure = 'say records.unit = "g"' + ("" if has_times else ', records.step = "0.005 s"')
        raise file.refusal(table.start, table.head[:80] or "columns alone", ALLOWED, cure)
    numbers = table.numbers(file, columns)
    if not has_times:
        return recording_in_si(location, "columns", unit, step or 0.0, numbers[:, column], name)
    time_unit = BRACKETED.search(heads[0])
    to_s = SECONDS.get(time_unit[1], 0.0) if time_unit else 1.0
    if to_s == 0:
        raise file.refusal(table.start, heads[0], f"times in {', '.join(SECONDS)}")
    step, remarks = _step_and_remarks(file, table, to_s=to_s, stated_step=step)
    if time_unit is None:
        remarks.append("its times have no unit, taken as s")
    return recording_in_si(location, "columns", unit, step, numbers[:, column], name, (*remarks,))


def _column_heads(head: str, columns: int) -> list[str]:
    """The part of a head above each column, with its unit; empty texts if they do not fit."""
    for cells in (
        re.split("[,;\t]", head),
        re.findall(r"[^\s\[(]+(?:\s*[\[(][^\])]*[\])])?", head),
    ):
        if len(cells) == columns:
            return [cell.strip() for cell in cells]
    return [""] * columns


def _step_and_remarks(
    file: TextFile, table: _Table, *, to_s: float, stated_step: float | None
) -> tuple[float, list[str]]:
    """Return the step in s of a record's times, and remarks; arguments as of `_even_step`."""
    step, first, remarks = _even_step(file, table, to_s=to_s, stated_step=stated_step)
    is_count = step == 1 and first in (0, 1)
    if is_count and stated_step is not None:
        return stated_step, ["its times count the samples: the stated step is taken"]
    cure = "times in ms have the head time [ms]" if step >= MAX_STEP else ""
    if is_count:
        cure = 'times that count the samples do not tell their step: say records.step = "0.005 s"'
    elif to_s != 1:
        cure = "the head states another unit of times than s: if they are in s, write time [s]"
    require_step(file.location(table.start), step, cure)
    if abs(first) > UNEVEN * step:
        remarks.append(f"its times begin at {first:g} s, taken as 0")
    return step, remarks


def _even_step(
    file: TextFile,
    table: _Table,
    *,
    to_s: float,
    stated_step: float | None = None,
    or_step: str = ', or say records.step = "{:.9g} s"',
) -> tuple[float, float, list[str]]:
    """Return the step of a table's times, the first time, and what is unusual about them.

    The times stand in the first column and must rise in even steps. A step that the case states is
    taken if the times do not tell it: all are equal, they count the samples, or they are rounded so
    coarsely that even steps look uneven. In the last case it must agree with them.

    Args:
        file: The file, for messages.
        table: Its table, of two rows or more.
        to_s: Unit of the times, in s.
        stated_step: Step that the case states, in s.
        or_step: What a cure says of the key that states the step; empty where there is none.

    Returns:
        The step and the first time, in s, and clauses for remarks.

    Raises:
        RefusedError: The times tell no even step, or one that records do not have.
    """
    lines = [*table.rows]
    time = to_s * np.array([float(cells[0]) for cells in table.rows.values()])
    first, last, n_steps = float(time[0]), float(time[-1]), len(time) - 1
    even: Array = np.asarray(np.linspace(first, last, len(time)), float)
    step = float(even[1] - even[0])
    if (time == first).all():
        if stated_step is None:
            cure = f"write times of even steps{or_step.format(0.005)}"
            raise file.refusal(lines[0], f"time {first:g} s, as all times", "times that rise", cure)
        return stated_step, 0.0, ["its times are all equal: the stated step is taken"]
    if not (step > 0 and np.abs(time - even).max() <= UNEVEN * step):
        last_digit = to_s * table.resolution()
        if not _are_rounded(time, even, last_digit):
            raise _uneven(file, lines, time)
        duration = last - first
        difference = abs((stated_step or 0.0) * n_steps - duration)
        if stated_step is None or difference > ROUNDED * last_digit:
            likely = _likely_step(n_steps, duration, last_digit)
            cure = f"digits were lost: write times of steps of {likely:.9g} s in full"
            cure += or_step.format(likely)
            value = f"times to {last_digit:g} s in steps of about {step:.4g} s"
            raise file.refusal(lines[0], value, "even steps", cure)
        return stated_step, first, [f"its times are rounded to {last_digit:g} s: the stated step"]
    return step, first, []


def _are_rounded(time: Array, even: Array, last_digit: float) -> bool:
    """True if times in s, shape (n,), are even ones that were rounded or cut to a last digit.

    Then two steps or more differ from the usual one. A single odd step is a time
    that stands twice, or a gap.
    """
    steps = np.diff(time)
    usual = np.median(steps)
    is_odd = np.abs(steps - usual) > 2 * UNEVEN * usual
    # a rounded time lies within half its last digit, and so does the line through both ends
    is_near = np.abs(time - even).max() <= ROUNDED * last_digit
    rises = time[-1] > time[0] and bool((steps >= 0).all())
    return rises and bool(is_near) and int(is_odd.sum()) > 1


def _likely_step(n_steps: int, duration: float, last_digit: float) -> float:
    """Step in s of a usual sampling rate that fits the duration to its last digit, else the mean.

    Rates are multiples of 100, 128, 50, 64, 25 or 10 samples in a second, in this order.
    """
    least = n_steps / (duration + last_digit)
    most = n_steps / max(duration - last_digit, duration / 2)
    for multiple in (100, 128, 50, 64, 25, 10):
        rate = multiple * round(n_steps / duration / multiple)
        if rate and least <= rate <= most:
            return 1 / rate
    return duration / n_steps


def _uneven(file: TextFile, lines: Sequence[int], time: Array) -> RefusedError:
    """Return the error about times whose steps differ: the first odd one, and its cure.

    Args:
        file: The file.
        lines: Line of each time, counted from 0.
        time: The times, in s, shape (n,).
    """
    steps = np.diff(time)
    rising = steps[steps > 0]
    usual = float(np.median(rising)) if rising.size else 0.0
    is_odd = np.abs(steps - usual) > 2 * UNEVEN * usual
    distances = np.abs(time - np.linspace(time[0], time[-1], len(time)))
    wrong = 1 + int(is_odd.argmax()) if is_odd.any() else int(distances.argmax())
    if (steps < 0).any():
        wrong = 1 + int((steps < 0).argmax())
    value = f"time {time[wrong]:g} s after {time[wrong - 1]:g} s"
    cure = "resample to even steps"
    in_order = np.diff(np.sort(time))
    if time[wrong] < time[wrong - 1]:
        pair = f"line {lines[wrong - 1] + 1} and line {lines[wrong] + 1}"
        cure = f"times must rise, and fall between {pair}: sort the rows"
        if (steps < 0).all():
            cure = "times must rise, and these fall: turn the order of the rows round"
        elif (in_order < UNEVEN * usual).any():
            cure = f"times must rise, and fall between {pair}: of two records in one file keep one"
    elif time[wrong] == time[wrong - 1]:
        cure = "a time stands twice: leave one out, or resample to even steps"
    elif steps[wrong - 1] > 1.5 * usual and is_odd.sum() == 1:
        cure = "samples are missing there: fill the gap, or resample to even steps"
    return file.refusal(lines[wrong], value, "even steps", cure)


def read_force_history(path: Path) -> tuple[float, Array, bool]:
    """Reads a force over time from a table with even steps from t = 0.

    Returns:
        Step in s; samples, shape (n,), in N or without a unit; whether the head gives a unit.
    """
    file = TextFile.from_bytes(path.name, read_bytes(path))
    table = _Table.of(file)
    match = FORCE_HEAD.fullmatch(table.head)
    to_s = SECONDS.get(match[1], 0.0) if match and match[1] else 0.0
    if match is None or not table.rows or to_s == 0:
        raise file.refusal(table.start, table.head[:80] or "without a head", ALLOWED_FORCE)
    to_si = NEWTONS.get(match[2], 0.0) if match[2] else 1.0
    if to_si == 0:
        cure = f"units are {', '.join(NEWTONS)}"
        raise file.refusal(table.start, table.head[:80], ALLOWED_FORCE, cure)
    numbers = table.numbers(file, 2)
    step, first, _ = _even_step(file, table, to_s=to_s, or_step="")
    if abs(first) > UNEVEN * step:
        [line, *_] = table.rows
        raise file.refusal(line, f"time {first:g} s", "even steps from 0 s")
    samples = np.asarray(to_si * numbers[:, 1])
    if not samples.any():
        raise file.refusal(table.start, "zeros throughout", "a force that moves something")
    return step, samples, bool(match[2])
