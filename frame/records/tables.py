"""Records and forces in tables: times and values, with units in a head or without a head.

What the head and other lines do not state, the user says: the unit, and of numbers without times
the step. Of several components a channel chooses the column.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from functools import lru_cache
from math import isclose, isfinite
from pathlib import Path

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.csv_columns import NUMBER, REMARK, ColumnHead
from alphacut.base.errors import RefusedError, cure_of, require
from alphacut.base.stated import Stated, settled
from alphacut.base.units import ACCELERATION, FORCE, factor_of, unit_of
from alphacut.frame.records.recording import Recording
from alphacut.frame.records.stated import TextStatements, named_quantity, require_count
from alphacut.frame.records.stated_peak import peaks_in_text
from alphacut.frame.records.text_file import (
    MAX_STEP,
    TextFile,
    choose_channel,
    read_bytes,
    recording_in_si,
    require_step,
    words_of,
)

# The allowed value in messages on the head of a table.
EXPECTED_HEAD = "time [s],acceleration [m/s^2], [g] or [gal]"
# Fraction of a step by which a time may miss its place, as times that are rounded do. It is tuned:
# published records with three decimals and steps of 0.005 s or 0.01 s stay below it, and a missing
# or repeated sample misses its place by a whole step.
MAX_UNEVENNESS = 0.05
# Numbers that touch: the second begins with its sign.
_TOUCHING = r"[-+]?(?:\d+\.\d*|\.\d+)(?:[eEdD][-+]\d\d)?(?:[-+](?:\d*\.\d*)(?:[eEdD][-+]\d\d)?)+"
_COMMENT = r"\s*(?:[#%!]|//)"


@dataclass(frozen=True)
class _Column:
    """Head of a column: its name in small letters and its unit, empty where it states none."""

    name: str = ""
    unit: str = ""

    @classmethod
    def of(cls, cell: str) -> _Column:
        """Return name and unit of a column from its cell in the head of a table."""
        head = ColumnHead.of(cell, ACCELERATION, FORCE, "s")
        return cls(head.name.lower(), head.unit)

    @property
    def is_time(self) -> bool:
        """Whether the head has times: by their name, or by their unit of time beside no period."""
        if re.match(r"\W*(?:time|t)(?![a-z])(?!.*histor)", self.name):
            return True
        return factor_of(self.unit, "s") > 0 and not self.is_abscissa_of_spectrum

    @property
    def is_abscissa_of_spectrum(self) -> bool:
        """Whether the head has periods or frequencies."""
        return re.match(r"\W*(?:freq|period|f\b)", self.name) is not None

    @property
    def is_count(self) -> bool:
        """Whether the head counts samples."""
        pattern = r"\W*(?:samples?|points?|index|number|no|nr|count|n|i)\W*"
        return re.fullmatch(pattern, self.name) is not None and not self.unit


@dataclass(frozen=True)
class _Table:
    """A table of numbers and the text around it.

    Args:
        file: The file; its lines are counted from 0.
        texts: Lines that are no rows: all above the first row, and comments below.
        heads: Those of them that name the columns and their units; none if no line does.
        columns: Name and unit of each column, both empty without such lines.
        rows: Cells of each row, by its line.
    """

    file: TextFile
    texts: tuple[int, ...]
    heads: tuple[int, ...]
    columns: list[_Column]
    rows: dict[int, list[str]]

    @classmethod
    def of(cls, file: TextFile) -> _Table:
        """Return the table of numbers in a file; without a row that begins with a number, none.

        The first line that begins with a number and is no comment is the first row, and all below
        are rows as well, but comments. Cells are not checked.
        """
        lines = [k for k, text in enumerate(file.lines) if text.strip()]
        plain = [k for k in lines if not re.match(_COMMENT, file.lines[k])]
        is_row = re.compile(r'[\s"]*[-+]?[.,]?\d').match
        first = next((k for k in plain if is_row(file.lines[k])), len(file.lines))
        rows = {k: file.lines[k] for k in plain if k >= first}
        behind = [k for k, text in rows.items() if REMARK.search(text)]
        rows |= {k: REMARK.sub("", rows[k]) for k in behind}
        texts = (*(k for k in lines if k not in rows), *behind)
        divide = _divider(list(rows.values()))
        cells = {k: divide(text) for k, text in rows.items()}
        # Where a line gives the format of numbers that touch, their columns are fixed.
        above_rows = "\n".join(file.lines[k] for k in texts)
        layout = re.search(r"\b\d*[EFG](\d+)\.\d+\b", above_rows, re.IGNORECASE)
        if layout and any(re.fullmatch(_TOUCHING, x) for row in cells.values() for x in row):
            cells = {k: words_of(text, int(layout[1])) for k, text in rows.items()}
        n_columns = len(cells[first]) if cells else 0
        above = [k for k in plain if k < first][-2:]
        is_plain = bool(above)
        above = above or [k for k in lines if k < first][-1:]
        named = [re.sub(f"^{_COMMENT}", "", file.lines[k]) for k in above]
        columns, n_heads = _columns_of(named, n_columns)
        # A comment names the columns if it begins with the time.
        if not columns or not (is_plain or columns[0].is_time):
            columns, n_heads = [_Column()] * n_columns, 0
        heads = tuple(above[len(above) - n_heads :])
        return cls(file, texts, heads, columns, cells)

    @property
    def titles(self) -> list[int]:
        """Those of `texts` that are no comments."""
        return [k for k in self.texts if not re.match(_COMMENT, self.file.lines[k])]

    @property
    def start(self) -> int:
        """The line that messages on the head name: the first that is no comment."""
        return min([*self.titles, *list(self.rows)[:1]], default=0)

    @property
    def width(self) -> int:
        """Numbers in the first row; 0 without rows."""
        return len(self.columns)

    @property
    def has_times(self) -> bool:
        """Whether the first column has times, or counts samples.

        Its head says so; without a head it does if its numbers never fall from row to row.
        """
        if self.heads:
            return self.columns[0].is_time or self.columns[0].is_count
        # Accelerations swing about zero, so that a column of them falls somewhere.
        first = [cells[0] for cells in self.rows.values()]
        return _are_numbers(first) and bool((np.diff(np.array(first, float)) >= 0).all())

    def refusal(self, cure: str) -> RefusedError:
        """Return the error that the head of the table is not understood; `cure` says what to do."""
        value = " ".join(self.file.lines[k] for k in self.heads)[:80]
        value = value or f"{self.width} columns without a head"
        return self.file.refusal(self.start, value, EXPECTED_HEAD, cure)

    def numbers(self, rows: Sequence[int], width: int = 0) -> Array:
        """Return the numbers of rows, by their lines, shape (rows, width).

        Raises:
            RefusedError: A cell is no finite number, or a row has another count of cells than
                `width`, or than the first row of the table where it is 0.
        """
        for line in rows:
            if len(self.rows[line]) != (width or self.width) or not _are_numbers(self.rows[line]):
                raise _wrong_row(self, line, expected=width)
        return np.array([[float(cell) for cell in self.rows[line]] for line in rows])

    def series(self) -> Array:
        """Return the numbers of all rows, one after another, shape (numbers,).

        The last row alone may have fewer numbers than the others.

        Raises:
            RefusedError: A cell is no finite number; a row has another count of cells than the
                first; or the columns seem to be several components, since numbers change less from
                row to row within a column than along the rows, on average.
        """
        *full, last = self.rows
        width = len(self.rows[(full or [last])[0]])
        numbers = self.numbers(full, width)
        rest = self.numbers([last], min(len(self.rows[last]), width))
        series = np.append(numbers.ravel(), rest)
        if width > 1 and len(full) > 1:
            # Neighbours in time differ little. In one series these are neighbours in a row, and
            # numbers one below another are as many samples apart as there are columns.
            change_along_rows = np.abs(np.diff(numbers.ravel())).mean()
            if np.abs(np.diff(numbers, axis=0)).mean() < change_along_rows:
                value = f"{width} columns, each smoother than the rows"
                name = self.file.name
                cure = f"choose one of several components: {name}#1, #2 …; else one number a line"
                allowed = "one series, whose numbers follow one another"
                raise self.file.refusal(self.start, value, allowed, cure)
        return series


def _divider(rows: Sequence[str]) -> Callable[[str], list[str]]:
    """Return the function that divides a row into its cells, decimal commas written as points.

    Cells stand between semicolons, tabs, quotes, commas or blanks, whichever of them comes first in
    this order. A comma beside one of the others is a decimal comma. A comma alone parts two whole
    numbers, unless one of the first is written as no whole number is, as -0 or 01.
    """
    text = "\n".join(rows)
    number = r'"?[-+]?(?:\d+(?:,\d+)?|,\d+)(?:[eE][-+]?\d+)?"?'
    is_parted = re.search(rf'[;\t]|","|^\s*{number}[ ]+{number}[ ]*$', text, re.MULTILINE)
    is_alone = re.search(r"^\s*(?:-0|[-+]?0\d),\d", text, re.MULTILINE) is not None
    is_alone = is_alone and all(row.count(",") == 1 for row in rows)
    if "," not in text or (not is_parted and not is_alone) or re.search(r"\d\.\d", text):
        marks = r'[^;\s"]+' if re.search(r"[;\t]", text) else r'[^,;\s"]+'
        return lambda row: re.findall(marks, row)

    def with_points(row: str) -> list[str]:
        cells = [cell.replace(",", ".") for cell in re.findall(r'[^;\s"]+', row)]
        return [cell for cell in cells if cell != "."]

    return with_points


def _cells_of_head(text: str, count: int) -> list[str]:
    """Return the cells of a line of heads, empty unless it can be divided into so many.

    It is divided at commas as a CSV file, then at commas, semicolons and tabs, then at blanks.
    """
    words = re.findall(r"[^\s\[(]+(?:\s*[\[(][^\])]*[\])])?", text)
    for cells in (next(csv.reader([text])), re.split("[,;\t]", text), words):
        are_names = not any(NUMBER.fullmatch(x.strip()) or re.search("=|:$", x) for x in cells)
        if count > 1 and len(cells) == count and are_names:
            return cells
    return []


def _columns_of(lines: Sequence[str], count: int) -> tuple[list[_Column], int]:
    """Return name and unit of each column from the last lines above the numbers, at most two.

    Loggers write the names of columns in one line and their units, with or without brackets, in the
    next: "time,acc" and "s,g". There are no columns where the last line is a title of two words, or
    has another number of cells than there are columns and does not begin with times.

    Returns:
        The columns, and how many of the lines name them.
    """
    last = lines[-1].rstrip(" ,;\t") if lines else ""
    cells = _cells_of_head(last, count)
    if not cells:
        # One that begins with times has a cell for each column, or the rows are wrong.
        cells = re.split("[,;\t]", last)
        first = _Column.of(cells[0])
        if len(cells) == 1 or not first.is_time or re.search(r"\d", first.name):
            return [], 0
    units = [cell.strip(' "[]()') for cell in cells]
    if all(map(unit_of, units)):
        names = _cells_of_head(lines[0], len(cells)) if len(lines) > 1 else []
        pairs = zip(names or [""] * len(cells), units, strict=True)
        return [_Column(name.strip(' "').lower(), unit) for name, unit in pairs], len(lines)
    columns = [_Column.of(cell) for cell in cells]
    is_parted = count > 2 or re.search("[,;\t]", lines[-1]) is not None
    is_known = is_parted or columns[0].is_time or any(x.unit for x in columns)
    return (columns, 1) if is_known else ([], 0)


def _are_numbers(cells: Sequence[str]) -> bool:
    """Return whether all cells are finite numbers in plain digits, as 1.25 or 1e-3."""
    return all(NUMBER.fullmatch(cell) and isfinite(float(cell)) for cell in cells)


def _wrong_row(table: _Table, line: int, expected: int = 0) -> RefusedError:
    """Return, without raising it, the error about a row of a table that is not all numbers.

    Args:
        table: The table.
        line: Index of the line of the row, counted from 0.
        expected: Numbers that it should have; 0 for those of the first row.
    """
    cures = {
        rf"(?:^|[\s,;]){_TOUCHING}": (
            "numbers touch: part them, or write their format above, as (5E14.7)"
        ),
        r"\d\.\d{3},\d|\d,\d{3}\.\d": "write numbers without separators of thousands",
        r"\d,\d": "if these are decimal commas, write points, or semicolons between columns",
    }
    cure = "write the number that belongs there, or mark a comment by #"
    text = table.file.lines[line].strip()
    allowed = f"rows of {expected or table.width} numbers such as 1.25 or 1e-3"
    return table.file.refusal(line, text, allowed, cure_of(text, cures, cure))


@lru_cache(maxsize=1)  # whether a file is a table is asked before it is read as one
def _table_of(file: TextFile) -> _Table:
    """Return the table of numbers in a file, which nobody changes."""
    return _Table.of(file)


def is_table(file: TextFile) -> bool:
    """Return whether a file has rows that begin with numbers, as a table of CSV."""
    return bool(_table_of(file).rows)


def read_table(
    file: TextFile,
    step: float | None = None,
    unit: str = "",
    channel: str = "",
    override: Collection[str] = (),
) -> Recording:
    """Return the recording in a table: times and accelerations, or accelerations alone.

    The times are the first column if its head has a name or a unit of times, or without a head if
    its numbers never fall. Accelerations without times are a column, or, if step and unit are known
    and neither names nor `channel` tell columns, all numbers row by row.

    Args:
        file: The file.
        step: Step in s that the user says, for numbers without times; beside times it counts where
            these do not tell the step.
        unit: Unit of acceleration that the user says. Times without a unit are in s.
        channel: Column of the accelerations: its number, counted from 1 with the times, or its name
            in the head; empty where there is only one.
        override: "unit" or "step", where the user says that the file states a wrong one.

    Returns:
        The recording, with samples in m/s².

    Raises:
        RefusedError: There are fewer than two rows; a row or the head is not understood; step or
            unit is stated by neither the file nor the user, or by both otherwise; the times are
            uneven; the step is not from 4e-5 s to below 0.5 s; the column is not one of
            accelerations; or the samples have another peak than a line above them states.
    """
    table = _table_of(file)
    allowed = "a header with units, and rows of numbers below it"
    require(len(table.rows) > 1, file.name, f"{len(table.rows)} rows", allowed)
    # A row "600 0.0100 656" above as many numbers or rows as it says is a head of count and step.
    first, *others = table.rows
    head = list(table.rows[first])
    if head == [str(len(others) - 1)]:  # count and step in lines of their own
        head += table.rows[others.pop(0)]
    n_behind = sum(len(table.rows[k]) for k in others)
    has_step = len(head) > 1 and _are_numbers(head) and 0 < float(head[1]) < MAX_STEP
    is_head = head[0].isdecimal() and len(others) > 1 and (has_step or head == [str(len(others))])
    said_count = int(head[0]) if is_head else 0
    nearest = min(n_behind, len(others), key=lambda n: abs(n - said_count))
    # A count that is wrong by two is refused below.
    is_head = is_head and (
        said_count == nearest or 10 <= said_count <= nearest + 2 <= said_count + 4
    )
    if is_head:
        columns = [_Column()] * len(table.rows[others[0]])
        table = replace(table, heads=(), columns=columns, rows={k: table.rows[k] for k in others})
    found = TextStatements.of(file, [k for k in table.texts if k not in table.heads])
    said_step = Stated(step, f"{step:g} s") if step is not None else None
    place = file.location(table.start)
    if is_head:
        line = f"line {file.line_number(first)}"
        found.steps += [Stated(float(x), f"{x} s", line) for x in head[1:2]]
        found.counts.append(Stated(said_count, f"{said_count} samples", line))
        # As many rows as it says may have several columns.
        is_head = nearest == n_behind
    if table.heads:
        table.numbers(list(table.rows)[:1])  # names a row of another count of cells
    # Of two columns the first has times, unless both are components.
    are_components = (
        factor_of(table.columns[0].unit, ACCELERATION) and not table.columns[-1].is_time
    )
    is_pair = table.width == 2 and step is None and not are_components
    has_times = not is_head and (table.has_times or is_pair)
    known_step = None
    # A number may be that of the samples as well.
    count = n_behind if is_head else len(table.rows)
    unsure = [x for x in found.lone_steps if not isclose(x.value, 1 / count)]
    unsure = found.unsure_steps or unsure
    if not has_times:
        known_step = settled(
            place, "step", found.steps, said_step, override=override, unsure=unsure
        )
    is_known = bool(known_step) and bool(unit or found.units or found.peak_units)
    is_series = table.width == 1 or is_head or (not table.heads and not has_times and is_known)
    index = 0
    name = ""
    if not is_series or channel:
        index = _choose_column(table, channel, has_times=has_times)
        if table.width > 2 or channel:
            name = f"{index + 1} {table.columns[index].name}".strip()
    column = table.columns[index]
    own_unit = _unit_of(table, column, found, unit=unit, override=override)
    if own_unit is None or (known_step is None and not has_times):
        key = "unit" if own_unit is None else "step"
        reason = f"no line states the {key} in words that are known here"
        if key == "step" and unsure:
            reason = f"{unsure[0].place}, {unsure[0].text}, may be of it"
        raise table.refusal(f"say records.{key}: {reason}")
    remarks = [own_unit.remark]
    if is_series and not channel:
        samples = table.series()
    else:
        samples = table.numbers(list(table.rows))[:, index]
    if has_times:
        known_step, further = _step_of_times(table, found, said=said_step, override=override)
        remarks += further
    assert known_step is not None
    remarks.append(known_step.remark)
    require_count(place, found.counts, len(samples))
    if said_step is not None and not found.steps and "step" not in override:
        _require_durations(place, found.durations, len(samples), said_step)
    lines = [file.lines[k] for k in table.texts]
    return recording_in_si(
        place,
        "numbers" if is_series else "CSV",
        own_unit.text,
        known_step.value,
        samples,
        name,
        tuple(filter(None, remarks)),
        stated=() if "unit" in override else peaks_in_text(lines, own_unit.text),
    )


def _require_durations(place: str, durations: Sequence[Stated], count: int, step: Stated) -> None:
    """Refuse a step that the user says where a head states another duration of so many samples."""
    for one in durations:
        steps = one.value / step.value
        is_alike = abs(steps - count) <= 1 + 0.05 * count
        cure = 'give the step of the file, or say override = ["step"]'
        what = f"said to have {count} samples of step {step}"
        require(is_alike, place, what, f"a duration of {one}", cure)


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
    if not channel and not has_times and not table.heads:
        name = table.file.name
        cure = f"choose one of several components, {name}#1; one series, several numbers a line,"
        cure += " takes records.step and records.unit"
        value = f"{table.width} columns without times"
        raise table.file.refusal(table.start, value, EXPECTED_HEAD, cure)
    first = int(has_times)
    named = enumerate(table.columns[first:], first + 1)
    names = [tuple(filter(None, (str(number), column.name))) for number, column in named]
    place = f"{table.file.location(table.start)}: {table.file.name}#COLUMN"
    return first + choose_channel(place, channel, names)


def _unit_of(
    table: _Table, column: _Column, found: TextStatements, *, unit: str, override: Collection[str]
) -> Stated | None:
    """Return the unit of a column of accelerations, as a factor to m/s²; None if nobody states it.

    The unit in the head of the column goes before those in other lines, and these before those of
    peaks; all of one kind must agree, with what the user says too.

    Args:
        table: The table.
        column: Name and unit of the column, both empty without a head.
        found: What the other lines state.
        unit: What the user says; may be empty.
        override: "unit", where the user says that the file states a wrong one.

    Raises:
        RefusedError: The column, or the file where no unit of accelerations is stated, is of
            another quantity; a unit is not known, or two disagree; or a factor stands beside it.
    """
    file = table.file
    factor = factor_of(column.unit, ACCELERATION)
    own = []
    if factor:
        place = f"line {file.line_number(table.heads[-1])}"
        own.append(Stated(factor, column.unit, place))
    of_heads = TextStatements.of(file, table.heads)
    if not own:
        found.units += of_heads.units
        found.unsure_units += of_heads.unsure_units
    named = named_quantity(column.name)
    parsed = unit_of(column.unit)
    by_unit = parsed.other_quantity if parsed else ""
    if by_unit:
        by_unit += f" by its unit {column.unit}"
    elsewhere = ""
    line = table.start
    if not own and not found.units and not re.search(r"(?:\b|_)acc", column.name):
        elsewhere, line = (found.quantities or [("", line)])[0]
    is_spectrum = any(
        x.is_abscissa_of_spectrum or re.match("p?sa\b", x.name) for x in table.columns
    )
    is_spectrum |= any(name == "a spectrum" for name, _ in found.quantities)
    what = "a spectrum" if is_spectrum else named or by_unit or elsewhere
    if column.is_time or what:
        what = what or "one of times, which stand in the first"
        cure = f"its column is {what}: take the record of the acceleration, or mend the head"
        raise file.refusal(line, table.file.lines[line], EXPECTED_HEAD, cure)
    if "unit" in override and unit:
        own = own[:1]
    elif column.unit and not factor_of(column.unit, ACCELERATION) and not found.units:
        raise table.refusal(f"{column.unit[:40]} is no unit of accelerations: mend the head")
    elif factors := [*found.factors, *of_heads.factors]:
        text = file.lines[factors[0]].strip()
        cure = "multiply the numbers by it, and mend the line"
        raise file.refusal(factors[0], text, "a unit without a factor", cure)
    said = Stated(factor_of(unit, ACCELERATION), unit) if unit else None
    stated = [*own, *found.units] or found.peak_units
    place = file.location(table.start)
    unsure = found.unsure_units
    return settled(place, "unit", stated, said, override=override, unsure=unsure)


def _step_of_times(
    table: _Table, found: TextStatements, *, said: Stated | None, override: Collection[str]
) -> tuple[Stated, list[str]]:
    """Return the step of the times in the first column, in s, and clauses on what is unusual.

    A step that the user or another line states is taken where the times do not tell it: if they
    count the samples, are all equal, or are rounded too coarsely. Else it must agree.

    Args:
        table: The table of two rows or more.
        found: What lines of text state.
        said: Step that the user says.
        override: "step", where the user says that the file states a wrong one.

    Raises:
        RefusedError: The times are uneven or have another step than is stated, their unit is not
            known, or their step is not from 4e-5 s to below 0.5 s.
    """
    place = table.file.location(table.start)
    time = table.columns[0]
    factor = factor_of(time.unit, "s")
    remarks = []
    if time.unit and not factor:
        raise table.refusal(f"{time.unit} is no unit of times, as s, ms or min")
    if not factor:
        unit = settled(place, "unit of times", found.time_units)
        factor = unit.value if unit else 1.0
        if table.heads and not unit:
            remarks.append("its times have no unit, taken as s")
    other = settled(place, "step", found.steps, said, override=override, tolerance=0.05)
    steps = _even_steps(table, factor, other.value if other else None)
    remarks += filter(None, [steps.remark])
    cure = "mend the head of the times; if they count the samples, say records.step"
    require_step(place, steps.step, cure)
    if abs(steps.first) > MAX_UNEVENNESS * steps.step:
        remarks.append(f"its times begin at {steps.first:g} s, taken as 0")
    of_times = Stated(steps.step, f"{steps.step:.6g} s", "by its times")
    if steps.is_stated and other is not None:
        return other, remarks
    settled(place, "step", [of_times, *found.steps], override=override, tolerance=0.05)
    return settled(place, "step", [of_times], said, override=override) or of_times, remarks


@dataclass(frozen=True)
class _EvenSteps:
    """Step and first time of even times in s, a clause on it, and whether it is the stated one."""

    step: float
    first: float
    remark: str = ""
    is_stated: bool = False


def _even_steps(table: _Table, factor: float, stated_step: float | None = None) -> _EvenSteps:
    """Return the even steps of the times in the first column of a table of two rows or more.

    Args:
        table: The table. Its times are numbers.
        factor: Their unit in s.
        stated_step: Step that user or file state, in s. It is taken where the times do not tell it:
            if they count the samples from 0 or 1 on, or were rounded so coarsely that even steps
            look uneven. Then it must agree with the duration to the last digit of the times.

    Raises:
        RefusedError: The times do not rise in even steps, and `stated_step` is missing or does not
            agree with them.
    """
    file = table.file
    lines = list(table.rows)
    time = factor * table.numbers(lines)[:, 0]
    first = float(time[0])
    duration = float(time[-1]) - first
    n_steps = len(time) - 1
    even: Array = np.asarray(np.linspace(first, time[-1], len(time)), float)
    # The step is the mean, and times are compared with even ones. Differences of neighbours would
    # not do: those of times such as 1.7e9 s, from 1970 on, have lost the digits of the step.
    step = duration / n_steps
    last_digit = factor * _resolution([cells[0] for cells in table.rows.values()])
    deviations = np.abs(time - even)
    unevenness = float(deviations.max())
    if stated_step and step == factor >= MAX_STEP and first in (0, factor):
        remark = "its times count the samples: the stated step is taken"
        return _EvenSteps(stated_step, 0.0, remark, is_stated=True)
    if step > 0 and unevenness <= MAX_UNEVENNESS * step:
        # Beyond rounding to their last digit, and 1 % of a step (tuned), as programs leave by
        # adding up steps, the times are those of a clock that jitters.
        remark = ""
        if unevenness > max(last_digit, 0.01 * step):
            remark = f"its times are uneven by up to {unevenness:.2g} s, taken as even"
        return _EvenSteps(step, first, remark)
    # A rounded time lies within half of the last digit from its place, and so do both ends of the
    # line of even times. The factor leaves room for binary round-off.
    digit = last_digit * (1 + 1e-6)
    are_rounded = unevenness <= digit
    if are_rounded and stated_step and abs(stated_step * n_steps - duration) <= digit:
        remark = f"its times are rounded to {last_digit:g} s: the stated step is taken"
        return _EvenSteps(stated_step, first, remark, is_stated=True)
    usual = float(np.median(np.diff(time)))
    odd = np.abs(np.diff(time) - usual) > 2 * MAX_UNEVENNESS * abs(usual)
    wrong = 1 + int(odd.argmax())
    cure = "times must rise evenly: mend, sort or resample the rows"
    if wrong == 1:
        cure += "; mark a head of count and step by #"
    if are_rounded:
        cure = "digits of the times were lost: write them in full, or say records.step"
    value = f"time {time[wrong]:g} s after {time[wrong - 1]:g} s"
    raise file.refusal(lines[wrong], value, "even steps", cure)


def _resolution(cells: Sequence[str]) -> float:
    """Return the unit of the last digit of times, such as 0.001 for 1.023, in their unit."""
    # Programs write times with a fixed number of decimals, or with a fixed number of digits. As
    # zeros at the end may be missing, the cell with most of them tells this number. Of both units
    # the coarser one is taken, and with a fixed number of digits that of the largest time.
    times = [Decimal(cell) for cell in cells]
    finest = min(int(time.as_tuple().exponent) for time in times)
    digits = max(len(time.as_tuple().digits) for time in times)
    # `adjusted` is the exponent of the first digit of a decimal number.
    return float(10.0 ** max(finest, max(times).adjusted() + 1 - digits))


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
    first_row = next(iter(table.rows), 0)
    columns = table.columns if table.heads and len(table.rows) > 1 else []
    is_headed = len(columns) == 2 and columns[0].is_time and factor_of(columns[0].unit, "s") > 0
    is_headed = is_headed and re.match(r"\W*(?:force|load|f)\b", columns[1].name) is not None
    is_headed = is_headed and (not columns[1].unit or factor_of(columns[1].unit, FORCE) > 0)
    if not is_headed:
        if table.heads:
            table.numbers(list(table.rows)[:1])  # names a row of another count of cells
        allowed = "time [s],force [kN], or time [s],force of a course without a unit"
        cure = "units of forces are N, kN, MN, kgf, lbf or kip; masses are no forces"
        value = " ".join(file.lines[k] for k in table.texts)[:80] or "without a head"
        raise file.refusal(table.start, value, allowed, cure)
    time, force = columns
    steps = _even_steps(table, factor_of(time.unit, "s"))
    if abs(steps.first) > MAX_UNEVENNESS * steps.step:
        cure = f'write times from 0 s on, and in the case "{file.name}, from {steps.first:g} s"'
        raise file.refusal(first_row, f"time {steps.first:g} s", "even steps from 0 s", cure)
    forces = table.numbers(list(table.rows))[:, 1]
    if not forces.any():
        raise file.refusal(table.start, "zeros throughout", "a force that moves something")
    return ForceHistory(
        steps.step,
        np.asarray((factor_of(force.unit, FORCE) or 1.0) * forces),
        has_unit=bool(force.unit),
    )
