"""Records and forces in tables: times and values, with units in a head or without a head.

Without a head the case says the unit, and of a single column the step as well.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import require
from alphacut.frame.records.recording import Recording
from alphacut.frame.records.stated_peak import peaks_in_text
from alphacut.frame.records.text_file import (
    ACCELERATION_UNITS,
    TextFile,
    read_bytes,
    recording_in_si,
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
UNEVEN = 0.05
"""Fraction of a step by which a time may miss its place, as times that are rounded do."""


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
        """The table in a file; lines that begin with a letter are its head."""
        lines = {k: x for k, x in enumerate(file.lines) if x.strip() and not x.startswith("#")}
        starts = (k for k, x in lines.items() if not x.lstrip(' "')[:1].isalpha())
        first = next(starts, len(file.lines))
        head = [x for k, x in lines.items() if k < first][-1:]
        rows = {k: re.findall(r'[^,;\s"]+', x) for k, x in lines.items() if k >= first}
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
                    return name
        return ""

    def numbers(self, file: TextFile, columns: int) -> Array:
        """The numbers, shape (rows, columns); refuses a row of others."""
        allowed = f"rows of {columns} numbers such as 1.25 or 1e-3"
        for line, cells in self.rows.items():
            are_numbers = all(NUMBER.fullmatch(x) and np.isfinite(float(x)) for x in cells)
            if len(cells) != columns or not are_numbers:
                raise file.refusal(line, file.lines[line].strip(), allowed)
        return np.array([[float(x) for x in cells] for cells in self.rows.values()])


def is_table(file: TextFile) -> bool:
    """True if a head begins with times, or the last row has one or two numbers."""
    table = _Table.of(file)
    last = list(table.rows.values())[-1:]
    is_row = any(len(x) in (1, 2) and all(map(NUMBER.fullmatch, x)) for x in last)
    return bool(re.match(TIME, table.head, re.IGNORECASE)) or is_row


def read_table(file: TextFile, step: float | None = None, unit: str = "") -> Recording:
    """Recording of a table with even steps: times and accelerations, or accelerations alone.

    The case's unit, and of one column its step in s, stand in where no head states them; times
    without a unit are in s.
    """
    table = _Table.of(file)
    allowed = "a header with units, and rows of numbers below it"
    require(len(table.rows) > 1, file.name, f"{len(table.rows)} rows", allowed)
    columns = len(next(iter(table.rows.values())))
    if columns < 3 and (quantity := table.other_quantity()):
        shown = " ".join(table.column_heads)
        raise file.refusal(table.start, shown, ALLOWED, f"its column is {quantity}")
    match = HEAD.fullmatch(table.head) if columns == 2 else None
    time_unit, head_unit = match.groups() if match else ("", "")
    unit, to_s = head_unit or unit, SECONDS.get(time_unit or "s", 0.0)
    is_complete = to_s > 0 and acceleration_factor(unit) is not None
    if columns > 2 or not is_complete or (columns == 1 and step is None):
        value = table.head[:80] or f"{columns} columns without a head"
        allowed = f"a unit of {ACCELERATION_UNITS}, and a step" if columns == 1 else ALLOWED
        cure = 'records.unit = "g"' + (', records.step = "0.005 s"' if columns == 1 else "")
        cure = f"or say {cure}"
        if (
            head_unit and acceleration_factor(head_unit) is None
        ):  # the case's unit does not stand in
            cure = f"{head_unit} is no unit of accelerations: mend the head"
        if columns > 2:
            cure = "keep times and one component"
        raise file.refusal(table.start, value, allowed, cure)
    numbers, location = table.numbers(file, columns), file.location(table.start)
    stated = [*peaks_in_text(table.above, unit)]
    if columns == 1:
        return recording_in_si(
            location, "one column", unit, step or 0.0, numbers[:, 0], stated=stated
        )
    step, remarks = _even_step(file, to_s * numbers[:, 0], [*table.rows])
    remarks += ("its times have no unit, taken as s",) * bool(match and not time_unit)
    if table.head and not match:
        remarks += (f"its head, {table.head[:40]}, is not understood: the case's unit is taken",)
    name = "CSV" if match else "two columns"
    return recording_in_si(location, name, unit, step, numbers[:, 1], "", remarks, stated=stated)


def _even_step(
    file: TextFile, time: Array, lines: Sequence[int], *, from_zero: bool = False
) -> tuple[float, tuple[str, ...]]:
    """Return the step in s of times that must rise evenly, and a remark if they begin after 0.

    `lines` are their lines in the file; `from_zero` refuses times that begin elsewhere.
    """
    first = 0.0 if from_zero else time[0]
    even = np.linspace(first, time[-1], len(time))
    step = float(even[1] - even[0]) if len(time) > 1 else 0.0
    deviation = np.abs(time - even)
    if not (step > 0 and deviation.max() <= UNEVEN * step):
        steps = np.diff(time, prepend=first)  # the first is 0
        usual = np.median(steps[steps > 0]) if (steps > 0).any() else 0.0
        is_odd = np.abs(steps - usual) > 2 * UNEVEN * usual
        is_odd[0] = abs(steps[0]) > UNEVEN * usual
        wrong = int(is_odd.argmax() if is_odd.any() else deviation.argmax())
        value = f"time {time[wrong]:g} s" + (f" after {time[wrong - 1]:g} s" if wrong else "")
        allowed = "even steps from 0 s" if from_zero else "even steps"
        raise file.refusal(lines[wrong], value, allowed, "resample to even steps")
    is_shifted = abs(first) > UNEVEN * step
    return step, (f"its times begin at {first:g} s, taken as 0",) if is_shifted else ()


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
    step, _ = _even_step(file, to_s * numbers[:, 0], [*table.rows], from_zero=True)
    samples = np.asarray(to_si * numbers[:, 1])
    if not samples.any():
        raise file.refusal(table.start, "zeros throughout", "a force that moves something")
    return step, samples, bool(match[2])
