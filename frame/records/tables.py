"""Records and forces in tables: times and values, with units in a head or without a head.

Without a head the user states the unit, and of numbers without times the step as well: one number
a line, or several that follow one another. Of several components a channel chooses the column.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal
from functools import lru_cache
from math import isfinite
from pathlib import Path

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.csv_columns import NUMBER
from alphacut.base.errors import RefusedError, cure_of, require
from alphacut.frame.records.recording import Recording
from alphacut.frame.records.stated_peak import peaks_in_text
from alphacut.frame.records.text_file import (
    MAX_STEP,
    MIN_STEP,
    TextFile,
    choose_channel,
    read_bytes,
    recording_in_si,
    require_step,
)
from alphacut.frame.records.units import (
    NEWTONS,
    SECONDS,
    acceleration_factor,
    other_quantity,
    seconds_of,
)

# The allowed value in messages on the head of a table.
EXPECTED_HEAD = "time [s],acceleration [m/s^2], [g] or [gal]"
# Fraction of a step by which a time may miss its place, as times that are rounded do. It is tuned:
# published records with three decimals and steps of 0.005 s or 0.01 s stay below it, and a missing
# or repeated sample misses its place by a whole step.
MAX_UNEVENNESS = 0.05


@dataclass(frozen=True)
class _Column:
    """Head of a column: its name in small letters and its unit, empty where it states none."""

    name: str = ""
    unit: str = ""

    @classmethod
    def of(cls, cell: str) -> _Column:
        """Return name and unit of a column from its cell in the head of a table.

        A unit stands in brackets, "Accel. [g]" or "acc (g)", and may then be anything; or it is the
        last word, "acc, g" or "acc g", and then must be a unit of acceleration, time or force.
        Blanks and quotes around the cell are left out.

        Returns:
            The column: its `name` in small letters, and its `unit` as it is written; the unit is
            empty if the cell states none.
        """
        text = cell.strip(' "')
        if match := re.fullmatch(r"(.*?)[\s,]*[\[(]\s*([^\])]*?)\s*[\])]?", text):
            return cls(match[1].lower(), match[2])
        match = re.fullmatch(r"(.*?)[\s,]+(\S+)", text)
        # Without brackets the last word is a unit only if it is known: "ground acceleration" has
        # none.
        if match and (acceleration_factor(match[2]) or seconds_of(match[2]) or match[2] in NEWTONS):
            return cls(match[1].lower(), match[2])
        return cls(text.lower())

    @property
    def is_time(self) -> bool:
        """Whether the head names times."""
        return re.match(r"\W*(?:time|t)(?![a-z])", self.name) is not None

    @property
    def is_acceleration(self) -> bool:
        """Whether the head names accelerations."""
        pattern = r"(?:\b|_)(?:a|acc(?:el\w*)?|ag)(?:\b|_)"
        return re.search(pattern, self.name) is not None


@dataclass(frozen=True)
class _Table:
    """A table of numbers below a head.

    Args:
        file: The file; its lines are counted from 0.
        start: First line that is neither empty nor a comment.
        head: Last line above the numbers; empty without one. Of a line of names above a line of
            units it has both, as "time [s],acc [g]".
        above: All lines above the numbers, comments among them without their mark.
        rows: Cells of each row, by its line.
    """

    file: TextFile
    start: int
    head: str
    above: tuple[str, ...]
    rows: dict[int, list[str]]

    @classmethod
    def of(cls, file: TextFile) -> _Table:
        """Return the table of numbers in a file.

        Empty lines and lines that begin with "#" are passed over. The first other line that begins
        with a number is the first row, and all below are rows as well; lines above are heads. Cells
        are separated by commas, semicolons, tabs or blanks, unless the commas of all rows are
        decimal commas: these are then written as points. Cells are not checked; a file without such
        a line gives a table without rows.

        Returns:
            The table: `start`, the index of the first line passed neither as empty nor as a
            comment, 0 without one; `head`, the last line above the rows that is no comment, or
            empty, and if it has units alone, joined with the line of names before, as "time [s],acc
            [g]"; `above`, all lines above the rows, comments among them without their "#"; and
            `rows`, the cells of each row by the index of its line.
        """
        lines = {k: x for k, x in enumerate(file.lines) if x.strip() and not x.startswith("#")}
        first = len(file.lines)
        for line, text in lines.items():
            if re.match(r'[\s"]*[-+−]?[.,]?\d', text):
                first = line
                break
        texts = {line: text for line, text in lines.items() if line >= first}
        has_decimal_commas = _have_decimal_commas(list(texts.values()))
        rows = {}
        for line, text in texts.items():
            # A cell may be a lone comma where quoted numbers stand between commas: "0,01","0,2".
            if has_decimal_commas:
                cells = re.findall(r'[^;\s"]+', text)
                rows[line] = [cell.replace(",", ".") for cell in cells if cell != ","]
            else:
                rows[line] = re.findall(r'[^,;\s"]+', text)
        heads = [text for line, text in lines.items() if line < first]
        head = _with_units(heads) if heads else ""
        above = tuple(x.lstrip("# \t") for x in file.lines[:first] if x.strip("# \t"))
        return cls(file, min(lines, default=0), head, above, rows)

    @property
    def width(self) -> int:
        """Numbers in the first row; 0 without rows."""
        return len(next(iter(self.rows.values()), []))

    @property
    def columns(self) -> list[_Column]:
        """Heads of the columns, as many as numbers in the first row.

        The last line above the numbers is divided at commas as a CSV file, then at commas,
        semicolons and tabs, then at blanks. The first division into the right number of cells
        counts; if none is, the columns have no names and no units.
        """
        words = re.findall(r"[^\s\[(]+(?:\s*[\[(][^\])]*[\])])?", self.head)
        for cells in (next(csv.reader([self.head])), re.split("[,;\t]", self.head), words):
            if self.head and len(cells) == self.width:
                return [_Column.of(cell) for cell in cells]
        return [_Column()] * self.width

    @property
    def column_heads(self) -> list[str]:
        """Lines above the numbers that tell what the columns are.

        They are those that begin with a time, and the last one.
        """
        named = [line for line in self.above[:-1] if _Column.of(line).is_time]
        return named + list(self.above[-1:])

    @property
    def has_times(self) -> bool:
        """Whether the first column has times.

        It does if the last line above the numbers begins with "time" or "t", or if the numbers in
        the column never fall from row to row.
        """
        if _Column.of(self.head).is_time:
            return True
        # Accelerations swing about zero, so that a column of them falls somewhere.
        first = [cells[0] for cells in self.rows.values()]
        return _are_numbers(first) and bool((np.diff(np.array(first, float)) >= 0).all())

    def refusal(self, cure: str) -> RefusedError:
        """Return the error that the head of the table is not understood; `cure` says what to do."""
        value = self.head[:80] or f"{self.width} columns without a head"
        return self.file.refusal(self.start, value, EXPECTED_HEAD, cure)

    def numbers(self, *, rows: Sequence[int] = ()) -> Array:
        """Return the numbers of all rows, or of some, shape (rows, columns).

        Args:
            rows: Indices of the lines of the file whose rows are wanted, in this order, each of
                which must be the line of a row. If it is empty, all rows are meant; a table without
                rows gives shape (0,).

        Raises:
            RefusedError: A cell is no finite number, or a row has another count of cells than the
                first row of the table.
        """
        lines = rows or list(self.rows)
        for line in lines:
            if len(self.rows[line]) != self.width or not _are_numbers(self.rows[line]):
                raise _wrong_row(self, line)
        return np.array([[float(cell) for cell in self.rows[line]] for line in lines])

    def series(self) -> Array:
        """Return the numbers of all rows one after another, shape (numbers,).

        This is for a series that was written in several columns, row by row. The table has at least
        one row. The last row alone may have fewer numbers than the others.

        Raises:
            RefusedError: A cell is no finite number; a row has another count of cells than the
                first; or the columns seem to be several components, since numbers change less from
                row to row within a column than along the rows, on average.
        """
        *full, last = self.rows
        numbers = self.numbers(rows=full)
        last_cells = self.rows[last]
        if len(last_cells) > self.width or not _are_numbers(last_cells):
            raise _wrong_row(self, last)
        if self.width > 1 and len(full) > 1:
            # Neighbours in time differ little. In one series these are neighbours in a row, and
            # numbers one below another are as many samples apart as there are columns.
            change_along_rows = np.abs(np.diff(numbers.ravel())).mean()
            change_along_columns = np.abs(np.diff(numbers, axis=0)).mean()
            if change_along_columns < change_along_rows:
                value = f"{self.width} columns, each smoother than the rows"
                allowed = "one series, whose numbers follow one another"
                name = self.file.name
                cure = f"choose one of several components: {name}#1, #2 …; else one number a line"
                raise self.file.refusal(self.start, value, allowed, cure)
        return np.append(numbers.ravel(), [float(cell) for cell in last_cells])

    def resolution(self) -> float:
        """Return the unit of the last digit of the times, such as 0.001 for 1.023.

        The times are the first column, one at least, all of them numbers. The result is in their
        unit.
        """
        # Programs write times with a fixed number of decimals, or with a fixed number of digits.
        # As zeros at the end may be missing, the cell with most of them tells this number. Of both
        # units the coarser one is taken, and with a fixed number of digits that of the largest
        # time.
        times = [Decimal(cells[0]) for cells in self.rows.values()]
        finest = min(int(time.as_tuple().exponent) for time in times)
        digits = max(len(time.as_tuple().digits) for time in times)
        # `adjusted` is the exponent of the first digit of a decimal number.
        last_of_largest = max(times).adjusted() + 1 - digits
        return float(10.0 ** max(finest, last_of_largest))


def _with_units(heads: Sequence[str]) -> str:
    """Return the last line above the numbers, joined with the one before if it has units alone.

    Loggers write the names of columns in one line and their units, with or without brackets, in the
    next: "time,acc" and "s,g" become "time [s],acc [g]". The last line is returned as it is if
    there is one line alone, if a cell of it is no known unit, or if both lines have different
    numbers of cells.

    Args:
        heads: The lines above the numbers, one or more, of which the last two count. Commas,
            semicolons and tabs separate their cells.
    """
    cells = [re.split("[,;\t]", line) for line in heads[-2:]]
    units = [cell.strip(' "[]()') for cell in cells[-1]]
    names = cells[0]
    known = [acceleration_factor(x) or seconds_of(x) or other_quantity(x) for x in units]
    if len(heads) < 2 or len(names) != len(units) or not all(known):
        return heads[-1]
    return ",".join(f"{name.strip()} [{unit}]" for name, unit in zip(names, units, strict=True))


def _are_numbers(cells: Sequence[str]) -> bool:
    """Return whether all cells are finite numbers in plain digits, as 1.25 or 1e-3."""
    return all(NUMBER.fullmatch(cell) and isfinite(float(cell)) for cell in cells)


def _wrong_row(table: _Table, line: int) -> RefusedError:
    """Return, without raising it, the error about a row of a table that is not all numbers.

    Args:
        table: The table.
        line: Index of the line of the row, counted from 0.

    Returns:
        The error. If the time alone is no number, and the times around it tell it, its hint is that
        time. Otherwise the hint is chosen by the text of the row, such as a clock time, an empty
        cell or a unit; there may be none.
    """
    *_, last_row = table.rows
    text_cure = "text stands among the numbers: write the number that belongs there"
    if line == last_row:
        text_cure = "text stands among the numbers: cut it off"
    # The order counts, since the first pattern that is found gives the hint: those of clock times
    # and dates stand before those of single characters that both contain.
    cures = {
        r"\d:\d\d": "write seconds in place of clock times, or leave times out and say"
        " records.step",
        r"\d{4}-\d\d-\d\d|\d/\d+/\d": "write seconds in place of dates, or say records.step",
        r"\d\.\d{3},\d|\d,\d{3}\.\d": "write numbers without separators of thousands",
        r"(?i)nan|null|n/?a\b|inf|-{2}|#": "values are missing: fill the gap, or cut the record"
        " there",
        r"^\s*[,;]|,\s*,|;\s*;|[,;]\s*$": "cells are empty: fill the gap, or cut the record there",
        r"\d\s*[a-zA-Z%]+\s*(?:[,;\t]|$)": "write numbers alone: units stand in the head, as in"
        " time [s]",
        r"[A-Za-z]{2}": text_cure,
        r"\d,\d": "write decimal points if these are decimal commas",
        r"[-+.eE]$": "the row ends within a number: load the file anew, or delete this row",
    }
    text = table.file.lines[line].strip()
    allowed = "rows of numbers such as 1.25 or 1e-3"
    first_row = next(iter(table.rows.values()))
    if _are_numbers(first_row):
        allowed = f"rows of {table.width} numbers such as 1.25 or 1e-3"
    cure = cure_of(text, cures)
    if likely := _likely_time(table, line):
        cure = f"the time alone is no number: {likely:.9g} fits (spreadsheets make dates of some)"
    return table.file.refusal(line, text, allowed, cure)


def _likely_time(table: _Table, line: int) -> float:
    """Return the time that fits into a row whose time alone is no number, or 0 if none is likely.

    A time is likely if the two rows before this one and the one behind it are numbers, and the
    times on both sides of this row are two steps apart.

    Args:
        table: The table. Its times are in the unit of their column.
        line: Index of the line of the row, counted from 0.
    """
    lines = list(table.rows)
    place = lines.index(line)
    cells = table.rows[line]
    samples = cells[1 - table.width :]
    near = [table.rows[row] for row in lines[max(place - 2, 0) : place + 2] if row != line]
    are_rows = all(len(row) == table.width and _are_numbers(row) for row in near)
    if len(near) < 3 or table.width < 2 or not are_rows or not _are_numbers(samples):
        return 0.0
    if _are_numbers(cells[:1]) and len(cells) == table.width:
        return 0.0
    before_last, before, behind = (float(row[0]) for row in near)
    step = before - before_last
    if step <= 0 or abs(behind - before - 2 * step) > 2 * MAX_UNEVENNESS * step:
        return 0.0
    return before + step


def _have_decimal_commas(rows: Sequence[str]) -> bool:
    """Return whether the commas of all rows of a table are decimal commas.

    Semicolons, tabs, blanks or quotes then separate the cells. A row such as 0,03097 may also be
    two numbers, with the comma between them. The comma is a decimal comma if in some row the number
    before it is not above that of the row before, since times or counts of samples rise.

    Args:
        rows: The texts of all rows. Those with words or dates, which are mistakes, do not count.

    Returns:
        False if there are no rows, no commas, or a row that is no list of numbers with decimal
        commas.
    """
    words = r"[A-Za-z]{2}|\d[-/.]\d+[-/.]\d"
    number = r'"?[-+]?(?:\d+(?:,\d+)?|,\d+)(?:[eE][-+]?\d+)?"?'
    further = rf'\s*[;\t]\s*{number}|\s+{number}|(?<="),(?="){number}'
    pattern = rf"\s*{number}(?P<more>{further})*[;\s]*"
    # Tables have thousands of rows, and in most of them the first one is none of such numbers.
    if not all(re.fullmatch(pattern, row) or re.search(words, row) for row in rows):
        return False
    rows = [row for row in rows if not re.search(words, row)]
    if not any("," in row for row in rows):
        return False
    matches = [re.fullmatch(pattern, row) for row in rows]
    if any(match and match["more"] for match in matches):
        return True
    before_commas = [float(row.strip(' ";').partition(",")[0] or 0) for row in rows]
    return bool((np.diff(before_commas) <= 0).any())


@lru_cache(maxsize=1)  # whether a file is a table is asked before it is read as one
def _table_of(file: TextFile) -> _Table:
    """Return the table of numbers in a file, which nobody changes."""
    return _Table.of(file)


def is_table(file: TextFile, *, is_described: bool = False) -> bool:
    """Return whether a file is a table of numbers, such as one in CSV.

    It is one if the last line above the numbers begins with "time", "t", "date" or "timestamp".
    Otherwise the last row must be numbers, and there must be one or two of them, or no line above
    the numbers, or a description by the user. A file without numbers is none, unless it has such a
    line.

    Args:
        file: The file. Lines that begin with "#" do not count.
        is_described: Whether the user says how to read the numbers: a channel, or step and unit.
    """
    table = _table_of(file)
    if re.match(r"\W*(?:time|t|date|timestamp)\b", table.head, re.IGNORECASE):
        return True
    last_row = list(table.rows.values())[-1:]
    is_row = any(all(NUMBER.fullmatch(cell) for cell in cells) for cells in last_row)
    return is_row and (is_described or not table.head or len(last_row[0]) < 3)


def read_table(
    file: TextFile, step: float | None = None, unit: str = "", channel: str = ""
) -> Recording:
    """Return the recording in a table: times and accelerations, or accelerations alone.

    The times are the first column if the last line above the numbers begins with "time" or "t"; if
    the numbers of the first column never fall; or if there are two columns and no `step`.
    Accelerations without times are a column, or, if `step` and `unit` are given and `channel` is
    not, all numbers row by row.

    Args:
        file: The file.
        step: Step in s that the user states, for numbers without times; beside times it counts only
            where these do not tell the step.
        unit: Unit of acceleration that the user states, for a head without one. Times without a
            unit are in s.
        channel: Column of the accelerations: its number, counted from 1 with the times, or its name
            in the head; empty where there is only one.

    Returns:
        The recording, with samples in m/s².

    Raises:
        RefusedError: There are fewer than two rows; a row or the head is not understood; step or
            unit is stated by neither the file nor the user; the times are uneven; the step is not
            from 4e-5 s to below 0.5 s; the column is not one of accelerations; or the samples have
            another peak than a line above them states.
    """
    table = _table_of(file)
    allowed = "a header with units, and rows of numbers below it"
    require(len(table.rows) > 1, file.name, f"{len(table.rows)} rows", allowed)
    _require_cell_of_each_head(table)
    has_times = table.has_times or (table.width == 2 and step is None)
    is_series = table.width == 1 or (not has_times and bool(step and unit))
    if not is_series or channel:
        return _read_columns(table, step, unit, channel=channel, has_times=has_times)
    _require_acceleration(table, table.column_heads)
    if step is None or not unit:
        raise table.refusal('say records.unit = "g" and records.step = "0.005 s"')
    location = file.location(table.start)
    stated = peaks_in_text(table.above, unit)
    return recording_in_si(location, "numbers", unit, step, table.series(), stated=stated)


def _read_columns(
    table: _Table, step: float | None, unit: str, *, channel: str, has_times: bool
) -> Recording:
    """Return the recording in one column of a table of two rows or more.

    Args:
        table: The table.
        step: Step in s that the user states; None if it states none. Beside times it counts only
            where these do not tell the step.
        unit: Unit that the user states, or empty. The unit in the head of the column goes before
            it, if there are more than two columns or the head begins with times.
        channel: Number of the column, counted from 1 with the times, or its name in the head; empty
            if there is only one beside the times.
        has_times: Whether the first column has the times. Without a unit in their head they are in
            s.

    Returns:
        The recording, with samples in m/s². Its channel is number and name of the column, as "2
        ns"; empty for the second of two columns that was not named.

    Raises:
        RefusedError: A row or the head is not understood; there is no such column, or it is not one
            of accelerations; step or unit is stated by neither the file nor the user; the times are
            uneven; the step is not from 4e-5 s to below 0.5 s; or the samples have another peak
            than a line above them states.
    """
    numbers = None
    if table.head:  # without one, the last row of a series of numbers may be a short one
        numbers = table.numbers()
    index = 1
    heads = table.column_heads
    name = ""
    if channel or table.width > 2:
        index = _choose_column(table, channel, has_times=has_times)
        chosen = table.columns[index]
        heads = [f"{chosen.name} [{chosen.unit}]"]
        name = f"{index + 1} {chosen.name}".strip()
    _require_acceleration(table, heads)

    # Of two columns without a head that begins with times only the case's unit counts.
    # A head of another kind, "acc g" above two columns, may mean either column.
    is_understood = table.width > 2 or table.columns[0].is_time
    if is_understood and table.columns[index].unit:
        unit = table.columns[index].unit
    if cure := _cure_of_head(table, table.columns[index], unit=unit):
        raise table.refusal(cure)
    if numbers is None:
        numbers = table.numbers()
    remarks: list[str] = []
    if has_times:
        step, remarks = _step_and_remarks(table, stated_step=step)
        if is_understood and not table.columns[0].unit:
            remarks.append("its times have no unit, taken as s")
    elif step is None:
        raise table.refusal('say records.step = "0.005 s"')
    if table.head and not is_understood:
        what = f"its head, {table.head[:40]}, is not understood"
        remarks.append(f"{what}: the case's unit is taken")
    return recording_in_si(
        table.file.location(table.start),
        "CSV",
        unit,
        step,
        numbers[:, index],
        name,
        tuple(remarks),
        stated=peaks_in_text(table.above, unit),
    )


def _require_cell_of_each_head(table: _Table) -> None:
    """Raise an error if rows seem to have decimal commas between commas.

    This is so if the head has two cells or more and begins with times, each row has a comma, and
    the first row has more cells than the head, up to twice as many, and no words, such as units. A
    table without rows passes.

    Raises:
        RefusedError: The rows are such rows.
    """
    heads = len(re.split("[,;\t]", table.head))
    # The row 0,01,0,25 below the head time,acc has four cells. Its commas cannot be told apart.
    has_commas = all("," in table.file.lines[line] for line in table.rows)
    if has_commas and 1 < heads < table.width <= 2 * heads and _Column.of(table.head).is_time:
        value = f"{table.width} numbers in a row below {heads} heads"
        first_row = next(iter(table.rows))
        if re.search("[A-DF-Za-df-z]", table.file.lines[first_row]):  # E may be an exponent
            raise _wrong_row(table, first_row)
        cure = "these seem to be decimal commas: write decimal points, or semicolons between the"
        cure += " columns"
        raise table.file.refusal(first_row, value, "a number in a row for each head", cure)


def _choose_column(table: _Table, channel: str, *, has_times: bool) -> int:
    """Return the index, from 0 on, of the column that a channel names.

    Args:
        table: The table.
        channel: Number of the column, counted from 1 on with the column of the times, or its name
            in the head, in any capitals. It may be empty if there are times and one column beside
            them.
        has_times: Whether the first column has the times, and so is not to be chosen.

    Raises:
        RefusedError: No column or several have the name, or the name is missing though there are
            several; or there are no times and no name, so that the numbers may as well be one
            series.
    """
    if not channel and not has_times:
        name = table.file.name
        cure = f"choose one of several components, {name}#1; one series, several numbers a line,"
        cure += ' has records.step = "0.005 s" and records.unit = "g"'
        value = f"{table.width} columns without times"
        raise table.file.refusal(table.start, value, EXPECTED_HEAD, cure)
    first = 1 if has_times else 0
    names = []
    for number, column in enumerate(table.columns[first:], first + 1):
        names.append(tuple(filter(None, (str(number), column.name))))
    place = f"{table.file.location(table.start)}: {table.file.name}#COLUMN"
    return first + choose_channel(place, channel, names)


def _require_acceleration(table: _Table, heads: Sequence[str]) -> None:
    """Raise an error if a head names another quantity than an acceleration.

    It does so by a word such as velocity, force or counts, unless the head also has a word for an
    acceleration, or by a unit in brackets, such as [mm]. A head that names no quantity passes.

    Args:
        table: The table, for the message.
        heads: Texts above the numbers of a column, such as "time [s],vel [cm/s]".

    Raises:
        RefusedError: Such a word or unit is found; the message names the first one.
    """
    words_of_quantities = {
        "a displacement": r"disp(?:l\w*)?|deflection|drift|position",
        "a velocity": r"vel(?:oc\w*)?|speed",
        "a force": r"forces?|loads?|thrust|(?:base )?shear",
        "a strain": r"strains?",
        "a stress": r"stress(?:es)?|pressure",
        "an angle": r"rotation|angle|tilt",
        "a number of counts": r"counts?",
        "a voltage": r"voltage|volts?",
    }
    quantity = ""
    for head in heads:
        for name, words in words_of_quantities.items():
            is_named = re.search(rf"(?:\b|_)(?:{words})(?:\b|_)", head, re.IGNORECASE)
            if is_named and not _Column(head.lower()).is_acceleration:
                quantity = quantity or name
        for unit in re.findall(r"[\[(]\s*([^\])]+?)\s*[\])]", head):
            if name := other_quantity(unit):
                quantity = quantity or f"{name} by its unit {unit}"
    if quantity:
        cure = f"its column is {quantity}: take the record of the acceleration, or mend the head"
        raise table.file.refusal(table.start, " ".join(heads), EXPECTED_HEAD, cure)


def _cure_of_head(table: _Table, column: _Column, *, unit: str) -> str:
    """Return what is to be mended in the head of times and accelerations; empty if it is complete.

    Complete means: times, if the head names them, have a known unit; the column is neither one of
    times nor a spectrum; and the unit of acceleration, from the head or the user, is known. If the
    names in the head are unknown, the unit in it must not be another one than that taken.

    Args:
        table: The table, with one column at least.
        column: Name and unit of the accelerations in the head, both possibly empty.
        unit: Unit of acceleration that is taken, from the head or the user; empty without one.
    """
    first = table.columns[0]
    # Times without a unit are in s, as most files have them.
    if first.is_time and not seconds_of(first.unit or "s"):
        return f"{first.unit} is no unit of times: {', '.join(SECONDS)}"
    if column.is_time:
        return "times stand in the first column"
    if re.match(r"freq|period|sa\b|psa\b", first.name):
        return "this is a spectrum: take the record of the acceleration over time"
    if column.unit and acceleration_factor(column.unit) is None:
        return f"{column.unit} is no unit of accelerations: mend the head"
    own_factor = acceleration_factor(column.unit)
    is_named_otherwise = not first.is_time and bool(seconds_of(first.unit)) and own_factor
    if is_named_otherwise and own_factor != acceleration_factor(unit):
        # The units tell times and accelerations, as below names in another language.
        return f"name the columns: time [{first.unit}], acceleration [{column.unit}]"
    if acceleration_factor(unit) is not None:
        return ""
    if re.match(r"\W*(?:samples?|points?|index|number|no|nr|count|n|i)\b", first.name):
        return 'leave the count of samples out, and say records.step = "0.005 s"'
    return 'write the unit into the head, or say records.unit = "g"'


def _step_and_remarks(table: _Table, *, stated_step: float | None) -> tuple[float, list[str]]:
    """Return the step of a record's times in s, and clauses on what is unusual about them.

    Times that rise by 1 from 0 or 1 on count the samples. They are then no times in s, and
    `stated_step` is returned.

    Args:
        table: The table of two rows or more, whose first column has the times.
        stated_step: Step that the user states, in s, or None. It is returned where the times do not
            tell their step: if they count the samples, are all equal, or are rounded too coarsely.
            Else it is ignored.

    Raises:
        RefusedError: The times are uneven, or their step is not from 4e-5 s to below 0.5 s.
    """
    steps = _even_steps(table, stated_step=stated_step)
    is_count = steps.step == 1 and steps.first in (0, 1)
    if is_count and stated_step is not None:
        return stated_step, ["its times count the samples: the stated step is taken"]
    cure = ""
    if is_count:
        cure = 'times that count the samples do not tell their step: say records.step = "0.005 s"'
    elif table.columns[0].is_time and seconds_of(table.columns[0].unit or "s") != 1:
        cure = "the head states another unit of times than s: if they are in s, write time [s]"
    elif steps.step >= MAX_STEP:
        cure = "times in ms have the head time [ms]"
    elif steps.step < MIN_STEP:
        cure = "times of a spreadsheet are in days: multiply them by 86400"
    require_step(table.file.location(table.start), steps.step, cure)
    remarks = [steps.remark] if steps.remark else []
    if abs(steps.first) > MAX_UNEVENNESS * steps.step:
        remarks.append(f"its times begin at {steps.first:g} s, taken as 0")
    return steps.step, remarks


@dataclass(frozen=True)
class _EvenSteps:
    """Step and first time of even times, in s, and a clause on how the step was found."""

    step: float
    first: float
    remark: str = ""


def _even_steps(
    table: _Table,
    *,
    stated_step: float | None = None,
    or_step: str = ', or say records.step = "{:.9g} s"',
) -> _EvenSteps:
    """Return the even steps of the times in the first column of a table of two rows or more.

    A step that the user states is taken where the times do not tell it: if all are equal, or if
    they were rounded so coarsely that even steps look uneven. In the latter case it must agree with
    the duration to the last digit of the times.

    Args:
        table: The table. Its times are numbers, in the unit in the head of their column, or in s.
        stated_step: Step that the user states, in s; None if it states none.
        or_step: What a hint says of the key that states the step; "{:.9g}" in it is replaced by a
            step. It is empty where there is no such key.

    Returns:
        `step` and `first`, the step and the first time in s, where `first` is 0 if all times are
        equal; and `remark`, a clause on how the step was found, empty if it follows from the times.

    Raises:
        RefusedError: The times do not rise in even steps, and `stated_step` is missing or does not
            agree with them.
    """
    file = table.file
    lines = list(table.rows)
    to_s = 1.0
    if table.columns[0].is_time:
        to_s = seconds_of(table.columns[0].unit or "s")
    time = to_s * np.array([float(cells[0]) for cells in table.rows.values()])
    first = float(time[0])
    duration = float(time[-1]) - first
    n_steps = len(time) - 1
    if (time == first).all():
        if stated_step is not None:
            remark = "its times are all equal: the stated step is taken"
            return _EvenSteps(stated_step, first=0.0, remark=remark)
        cure = f"write times of even steps{or_step.format(0.005)}"
        raise file.refusal(lines[0], f"time {first:g} s, as all times", "times that rise", cure)

    even: Array = np.asarray(np.linspace(first, time[-1], len(time)), float)
    # The step is the mean, and times are compared with even ones. Differences of neighbours would
    # not do: those of times such as 1.7e9 s, from 1970 on, have lost the digits of the step.
    step = duration / n_steps
    last_digit = to_s * table.resolution()
    unevenness = float(np.abs(time - even).max())
    if step > 0 and unevenness <= MAX_UNEVENNESS * step:
        # Beyond rounding to their last digit, and 1 % of a step (tuned), as programs leave by
        # adding up steps, the times are those of a clock that jitters.
        remark = ""
        if unevenness > max(last_digit, 0.01 * step):
            remark = f"its times are uneven by up to {unevenness:.2g} s, taken as even"
        return _EvenSteps(step, first, remark)
    if not _are_rounded(time, even, last_digit):
        raise _uneven(file, lines, time)
    difference = abs((stated_step or 0.0) * n_steps - duration)
    if stated_step is None or difference > last_digit * (1 + 1e-6):  # 1e-6 is binary round-off
        likely = _likely_step(n_steps, duration, last_digit)
        cure = f"digits were lost: write times of steps of {likely:.9g} s in full"
        value = f"times to {last_digit:g} s in steps of about {step:.4g} s"
        raise file.refusal(lines[0], value, "even steps", cure + or_step.format(likely))
    remark = f"its times are rounded to {last_digit:g} s: the stated step is taken"
    return _EvenSteps(stated_step, first, remark)


def _are_rounded(time: Array, even: Array, last_digit: float) -> bool:
    """Return whether times are even ones that were rounded or cut to a last digit.

    This needs three things: no time falls, and the last is above the first; each time lies within
    the last digit of its even place; and two steps or more differ from the median step by 10 % or
    more. A single odd step is not rounding, but a time that stands twice, or a gap.

    Args:
        time: The times in s, shape (n,) with n ≥ 2.
        even: Even times from the first to the last of them, shape (n,).
        last_digit: Unit of the last digit of the times, in s.
    """
    steps = np.diff(time)
    usual = np.median(steps)
    is_odd = np.abs(steps - usual) > 2 * MAX_UNEVENNESS * usual
    # A rounded time lies within half of the last digit from its place, and so do both ends of the
    # line of even times: together at most one last digit. A time that was cut lies below its place
    # by at most one digit, and so does the line. The factor leaves room for binary round-off.
    is_near = np.abs(time - even).max() <= last_digit * (1 + 1e-6)
    rises = time[-1] > time[0] and bool((steps >= 0).all())
    return rises and bool(is_near) and int(is_odd.sum()) > 1


def _likely_step(n_steps: int, duration: float, last_digit: float) -> float:
    """Return the step in s of a usual sampling rate that fits a duration to its last digit.

    Rates are multiples of 100, 128, 50, 64, 25 or 10 samples in a second, tried in this order. If
    none fits, the mean step `duration / n_steps` is returned.

    Args:
        n_steps: Number of steps, above 0.
        duration: Difference of the last and the first time in s, above 0.
        last_digit: Unit of the last digit of the times, in s.
    """
    lowest = n_steps / (duration + last_digit)
    # A duration of a few last digits alone keeps the rate finite.
    highest = n_steps / max(duration - last_digit, duration / 2)
    for multiple in (100, 128, 50, 64, 25, 10):
        rate = multiple * round(n_steps / duration / multiple)
        if rate and lowest <= rate <= highest:
            return 1 / rate
    return duration / n_steps


def _uneven(file: TextFile, lines: Sequence[int], time: Array) -> RefusedError:
    """Return, without raising it, the error about times that do not rise in even steps.

    The error names the first odd time. Its hint depends on the pattern: a single wrong time, rows
    in falling order or out of order, two records in one file, a time that stands twice, or a gap.

    Args:
        file: The file.
        lines: Index of the line of each time, counted from 0.
        time: The times in s, shape (n,) with n ≥ 2; not all are equal.
    """
    steps = np.diff(time)
    rising = steps[steps > 0]
    usual = float(np.median(rising)) if rising.size else 0.0
    odd = np.flatnonzero(np.abs(steps - usual) > 2 * MAX_UNEVENNESS * usual)
    wrong = 1 + int(odd[0]) if odd.size else int(np.abs(time - time[0]).argmax())
    falls = np.flatnonzero(steps < 0)
    # One wrong time makes two odd steps, one after the other, whose sum is right.
    is_one_time = odd.size == 2 and odd[1] == odd[0] + 1
    if is_one_time and abs(steps[odd].sum() - 2 * usual) <= 2 * MAX_UNEVENNESS * usual:
        cure = f"this time alone is wrong: {time[wrong - 1] + usual:.9g} s fits"
    elif falls.size:
        wrong = 1 + int(falls[0])
        pair = (
            f"line {file.line_number(lines[wrong - 1])} and line {file.line_number(lines[wrong])}"
        )
        cure = f"times must rise, and fall between {pair}: sort the rows"
        if falls.size == steps.size:
            cure = "times must rise, and these fall: turn the order of the rows round"
        elif (np.diff(np.sort(time)) < MAX_UNEVENNESS * usual).any():
            cure = f"times must rise, and fall between {pair}: of two records in one file keep one"
    elif time[wrong] == time[wrong - 1]:
        cure = "a time stands twice: leave one out, or resample to even steps"
    elif steps[wrong - 1] > 1.5 * usual and odd.size == 1:
        cure = "samples are missing there: fill the gap, or resample to even steps"
    else:
        cure = "resample to even steps"
    value = f"time {time[wrong]:g} s after {time[wrong - 1]:g} s"
    return file.refusal(lines[wrong], value, "even steps", cure)


@dataclass(frozen=True)
class ForceHistory:
    """A force over time in even steps from t = 0.

    Args:
        step: Time between samples, in s.
        samples: The force in N, or without a unit, shape (n,).
        has_unit: Whether the file states the unit of the force.
    """

    step: float
    samples: Array
    has_unit: bool


def read_force_history(path: Path) -> ForceHistory:
    """Read a force over time from a table with the head "time [s],force [kN]" or alike.

    The times rise in even steps from 0 on.

    Args:
        path: The file. The unit of the times is needed. Without a unit of the force the samples are
            a factor that has no unit.

    Returns:
        `step` in s; `samples` in N, or without a unit, shape (n,); and `has_unit`, whether the head
        states the unit of the force.

    Raises:
        RefusedError: The file cannot be read, its head does not name times and a force in known
            units, there are fewer than two rows, a row is wrong, the times are uneven or begin
            elsewhere, or all forces are 0.
    """
    file = TextFile.from_bytes(path.name, read_bytes(path))
    table = _table_of(file)
    _require_cell_of_each_head(table)
    if cure := _cure_of_force_head(table):
        allowed = "time [s],force [kN], or time [s],force of a course without a unit"
        raise file.refusal(table.start, table.head[:80] or "without a head", allowed, cure)
    numbers = table.numbers()
    steps = _even_steps(table, or_step="")
    if abs(steps.first) > MAX_UNEVENNESS * steps.step:
        first_row = next(iter(table.rows))
        cure = f'write times from 0 s on, and in the case "{file.name}, from {steps.first:g} s"'
        raise file.refusal(first_row, f"time {steps.first:g} s", "even steps from 0 s", cure)
    if not numbers[:, 1].any():
        raise file.refusal(table.start, "zeros throughout", "a force that moves something")
    unit = table.columns[1].unit
    samples = NEWTONS.get(unit, 1.0) * numbers[:, 1]
    return ForceHistory(steps.step, np.asarray(samples), has_unit=bool(unit))


def _cure_of_force_head(table: _Table) -> str:
    """Return what is to be mended in a table of times and forces; empty if it is complete.

    Complete means: two rows or more; two columns, named time and force (or load, or f); a known
    unit of the times; and a known unit of the force, or none.
    """
    if len(table.rows) < 2:
        return "write two rows of numbers or more below the head"
    if table.width != 2:
        return "write two numbers in a row, the time and the force"
    time, force = table.columns
    if force.is_time:
        return "times stand in the first column"
    if not time.is_time or not re.match(r"\W*(?:force|load|f)\b", force.name):
        return "name the first column time and the second one force"
    if not seconds_of(time.unit):
        return f"write the unit of the times: time [s], or one of {', '.join(SECONDS)}"
    if not force.unit or force.unit in NEWTONS:
        return ""
    if force.unit in ("kg", "t"):
        return "this is a unit of mass: write the weight in N, or in kgf"
    by_small_letters = {unit.lower(): unit for unit in NEWTONS}
    if meant := by_small_letters.get(force.unit.lower()):
        return f"did you mean {meant}?"
    return f"units of forces are {', '.join(NEWTONS)}"
