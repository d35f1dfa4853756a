"""Measured natural modes from a CSV file."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.csv_columns import fields, number, text_of
from alphacut.base.errors import RefusedError, require
from alphacut.base.stated import Stated, settled
from alphacut.frame.records.stated import FACTOR


@dataclass(frozen=True, eq=False)
class ModeRows:
    """All measurements of one mode.

    Args:
        mode: Number of the mode, from 1.
        frequencies: Frequencies, in Hz, shape (measurements,).
        amplitudes: Amplitudes by floor, from 1, shape (measurements,) each; empty if no shape was
            measured.
        frequency_deviation: Standard deviation of a frequency over the mean frequency; None if the
            file states none.
        shape_deviation: Standard deviation of an amplitude over the largest amplitude of the mode;
            None if the file states none.
    """

    mode: int
    frequencies: Array
    amplitudes: dict[int, Array]
    frequency_deviation: float | None = None
    shape_deviation: float | None = None


# Hz in a unit of frequency, in small letters; 0 of angular frequencies and periods.
HERTZ = {
    "hz": 1.0, "khz": 1e3, "hertz": 1.0, "cps": 1.0, "cycles/s": 1.0, "cycles/sec": 1.0,
    "cycle/s": 1.0, "cycles per second": 1.0, "rad/s": 0.0, "rad/sec": 0.0, "rpm": 0.0,
    "1/min": 0.0, "radians per second": 0.0, "radians/second": 0.0, "rad s-1": 0.0, "rad*hz": 0.0,
    "cpm": 0.0, "1/s": 0.0, "s^-1": 0.0, "kilohertz": 1e3, "millihertz": 1e-3,
    "c.p.s.": 1.0, "oscillations per second": 1.0, "mhz": 1e-3,
}  # fmt: skip


def mode_rows(path: Path, unit: str = "", override: Collection[str] = ()) -> tuple[ModeRows, ...]:
    """Read the measurements of each mode, by rising number, from a CSV file.

    The header is ``mode,frequency [Hz],q1,q2`` with the floors that were measured, in any order of
    the columns. Each row is one measurement of a mode, and a mode may have several. Standard
    deviations may stand in the columns ``frequency_std [Hz]`` and ``shape_std``. An empty cell
    means that the amplitude was not measured. The unit of the frequencies may stand in a comment.

    Args:
        path: The file.
        unit: Unit of the frequencies that the user says; empty where the file states it.
        override: "frequency_unit", where the file states a wrong one.

    Returns:
        For each mode its number; its frequencies in Hz, one for each row; its amplitudes by floor,
        an array with one for each row, no floors if fewer than two were measured; and the standard
        deviations that the file states, or None. The deviation of the frequency is relative to
        its mean, that of the amplitudes to the largest mean amplitude.

    Raises:
        RefusedError: The file is missing, its header or a row is wrong; it states no unit of the
            frequencies, or angular frequencies or periods; a mode has an amplitude in some rows and
            not in others; or all amplitudes of a mode are zero.
    """
    (head_row, header), *rows = fields(path)
    columns: dict[str, int] = {}
    units: dict[str, str] = {}
    for column, cell in enumerate(header):
        pattern = r"\s*([\w .]*?)(?:[\s,_]*[\[(]\s*([^\])]*?)\s*[\])]|[_ ](k?hz))?\s*"
        title = re.fullmatch(pattern, cell, re.IGNORECASE)
        name = title[1] if title else cell
        if re.fullmatch(r"(?i)(?:natural |eigen|modal )?freq(?:uency|\.)?|f_?n?", name):
            name = "frequency"
        elif re.fullmatch(r"(?i)mode(?:[_ ]?(?:no|nr|number))?\.?|no\.?|nr\.?", name):
            name = "mode"
        columns[name] = column
        units[name] = (title[2] or title[3] or "") if title else ""
    place = f"{path.name}, header"
    shown = ",".join(header)[:80]
    comments = [x for x in text_of(path).splitlines() if x.startswith("#")]
    if not override:
        words = (
            r"(?i)\b(?:periods?|omega\w*|angular|circular|pulsation|eigenvalues?|lambda|2\s*pi)\b"
        )
        words += rf"|ω|2\s*π|^T\b|{FACTOR}|\bscaled\s+by\b|\bper\s+minute|/\s*min\b"
        # Angular frequencies and ratios, and words glued before a frequency, as "Kreisfrequenz".
        words += r"|\bpulsations\b|2\s*[x×*·]\s*(?:pi\b|π)"
        words += r"|\b(?:rad|deg)\w*\W*(?:per\s+)?s(?:ec\w*)?\b"
        words += r"|\b(?:ratios?|divided|log(?:10|arithm\w*)?)\b|\bf\w?\s*/\s*f"
        words += r"|\b(?!(?:eigen|natural|modal|resonan\w{0,2})freq)[a-zäöü]+frequen[cz]"
        words += r"|\bsquared|hz(?:\^|²)|\bin\s+[\d.]+\s*k?hz"
        words += r"|(?:frequenc\w+|values)\s+(?:are\s+)?normali"
        if {"frequency_std", "shape_std"} & columns.keys():
            words += r"|(?:std|deviation|scatter|error|uncertaint)\w*\b"
            words += r".*(?:%|\bper\s?cent|\brelative)"
        other = next((x for x in [*header, *comments] if re.search(words, x.strip())), "")
        cure = "write frequencies in Hz, ω/(2π) or 1/T, and deviations in Hz, without a factor"
        require(not other, place, other[:80], "frequencies, not angular ones or periods", cure)
    allowed = (
        "mode,frequency [Hz],q1,q2 … with the floors that were measured, in one unit; frequency_std"
        " [Hz] and shape_std may stand before q1"
    )
    is_known = {"mode", "frequency"} <= columns.keys() and len(columns) == len(header)
    is_known = is_known and all(
        re.fullmatch(r"mode|shape_std|q[1-9]\d*|frequency(_std)?", name) for name in columns
    )
    is_known = is_known and len({x for name, x in units.items() if name[0] == "q"}) < 2
    require(is_known, place, shown, allowed)
    stated: list[Stated] = []
    if not override:
        of_head = [x for name, x in units.items() if name[:1] == "f" and x]
        stated = [Stated(_hertz_of(place, x), x, place) for x in of_head]
        stated += _units_in_comments(path, head_row)
    said = Stated(_hertz_of("frequency_unit", unit), unit) if unit else None
    found = settled(path.name, "frequency_unit", stated, said)
    cure = "write the unit into the header, frequency [Hz], or say frequency_unit"
    if found is None:
        raise RefusedError(place, f"{shown}, without a unit", "frequencies with a unit", cure)

    # Frequencies and deviations are positive; amplitudes have either sign.
    positive = [columns[x] for x in ("frequency", "frequency_std", "shape_std") if x in columns]
    modes: dict[int, list[list[float]]] = defaultdict(list)
    for row, cells in rows:
        values = [np.nan] * len(header)
        for column in range(len(header)):
            if cells[column : column + 1] != [""]:
                values[column] = number(path, row, cells, column)
        for name in {"frequency", "frequency_std"} & columns.keys():
            values[columns[name]] *= found.value
        mode = values[columns["mode"]]
        fits = mode >= 1 and mode % 1 == 0 and all(values[column] > 0 for column in positive)
        allowed = "a mode from 1, frequency and deviations above 0"
        cure = "write decimal points" if len(cells) > len(header) else ""
        require(fits, f"{path.name}, row {row}", ",".join(cells)[:80], allowed, cure)
        modes[int(mode)].append(values)
    return tuple(
        _measurements_of_mode(path, mode, np.array(modes[mode]), columns) for mode in sorted(modes)
    )


def _hertz_of(place: str, unit: str) -> float:
    """Return Hz in a unit of frequency, 0 of angular frequencies; refuse others."""
    hertz = None if "MH" in unit else HERTZ.get(unit.strip().lower())  # 1 MHz is not 1 mHz
    if not hertz:
        cure = "divide by 2π, or by 60" if hertz == 0 else ""
        raise RefusedError(place, f"in {unit}", "frequencies in Hz, kHz or cycles/s", cure)
    return hertz


def _units_in_comments(path: Path, head_row: int) -> Iterator[Stated]:
    """Yield units of frequency in the comments of a file; angular ones and periods are refused."""
    pattern = "|".join(re.escape(unit) for unit in sorted(HERTZ, key=len, reverse=True))
    for row, line in enumerate(text_of(path).splitlines(), 1):
        if line.startswith("#") and row != head_row:
            # Behind a number it is no unit of others, as in "sampled at 200 Hz".
            found = re.search(rf"(?<![\w/.])(?<!\d )(?:{pattern})(?!\w)", line, re.IGNORECASE)
            place = f"{path.name}, line {row}"
            is_sampling = re.search(r"(?i)sampl|filter|band|resolution|\bdf\b", line)
            if found and (not is_sampling or re.search(r"(?i)\bunit", line)):
                yield Stated(_hertz_of(place, found[0]), found[0], f"line {row}")


def _measurements_of_mode(
    path: Path, mode: int, values: Array, columns: dict[str, int]
) -> ModeRows:
    """Return the measurements of one mode from its rows of the file.

    Standard deviations that the rows state become one number for the frequency, relative to its
    mean, and one for all amplitudes, relative to the largest mean amplitude. A shape needs the
    amplitudes of two floors; that of a single floor is left out.

    Args:
        path: The file, for messages.
        mode: Number of the mode.
        values: Numbers of the rows, shape (measurements, columns); NaN where a cell is empty.
        columns: Index of each column by its title without a unit: "mode", "frequency", perhaps
            "frequency_std" and "shape_std", and "q1" and so on for the amplitude of a floor.

    Raises:
        RefusedError: An amplitude is missing in some rows and not in others, or all are zero.
    """
    shape = {}
    for name, column in columns.items():
        amplitudes = values[:, column]
        is_missing = np.isnan(amplitudes)
        if name.startswith("q") and not is_missing.all():
            allowed = "an amplitude of a floor in every row of a mode, or in none"
            key = f"{path.name}, mode {mode}"
            require(not is_missing.any(), key, "an amplitude in some rows", allowed)
            shape[int(name[1:])] = amplitudes
    if len(shape) < 2:
        shape = {}  # the amplitude of one floor alone says nothing
    is_moved = not shape or any(map(np.any, shape.values()))
    allowed = "a shape that moves a floor"
    require(is_moved, f"{path.name}, mode {mode}", "0 at every floor", allowed)

    frequencies = values[:, columns["frequency"]]
    # Independent deviations of several measurements are averaged by their squares.
    deviations = {}  # root mean squares
    for name in ("frequency_std", "shape_std"):
        if name in columns:
            deviations[name] = float(np.sqrt((values[:, columns[name]] ** 2).mean()))
    frequency_deviation = shape_deviation = None
    if "frequency_std" in deviations:
        frequency_deviation = deviations["frequency_std"] / float(frequencies.mean())
    if "shape_std" in deviations and shape:
        largest = max(abs(amplitudes).mean() for amplitudes in shape.values())
        shape_deviation = deviations["shape_std"] / float(largest)
    return ModeRows(mode, frequencies, shape, frequency_deviation, shape_deviation)
