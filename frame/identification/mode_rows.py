"""Measured natural modes from a CSV file."""

from __future__ import annotations

import math
import re
from collections import defaultdict
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.csv_columns import REMARK, ColumnHead, fields, number, text_of
from alphacut.base.errors import RefusedError, require
from alphacut.base.stated import Stated, settled
from alphacut.base.units import (
    FREQUENCY,
    TRANSFORMED,
    Mention,
    factor_of,
    has_unknown_words,
    mentions,
    unit_of,
    without_units,
)
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


# Words of numbers that are no frequencies in a unit, but periods, angular ones or quotients.
_OTHER_NUMBERS = (
    r"(?i)\b(?:omega\w*|angular|circular|puls\w+|eigenvalues?|lambda|2\s*[x×*·]?\s*pi"
    r"|ratios?|relative|reduced|per\s?cent|db|decibels?|half)\b|p[eé]r[ií]od(?!og|ic)|dauer\b|\b1\s*/\s*f|ω|2\s*[x×*·]?\s*π|^T\b|\bf\w?\s*/\s*f"
    rf"|{FACTOR}|{TRANSFORMED}|\bper\s+minute|\b(?:kreis|winkel)\w*frequen"
)
_DEVIATION = r"std|deviation|scatter|error|uncertaint|standardabweich|scarto|[ée]cart|desvia"
_RELATIVE = (
    rf"(?i)(?:{_DEVIATION})\w*\b.*(?:%|\bper\s?cent|\brelati[vf]|\bratio)"
    r"|\bvaria(?:tions?\s?(?:s?k|co)|n[cz])|co\w+\s+(?:of|de|di)\s+varia|(?<!-)\bco?v\b(?!-)"
    r"|half-?\s?width|[ck]onfiden|[2-9]\s*(?:sigma|σ|std)"
)


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
    # Units may stand in a row of their own below the names.
    cells_of_units = [""] * len(header)
    if rows and all(cell.strip(" -–[]()") == "" or unit_of(cell) for cell in rows[0].cells):
        cells_of_units = [cell.strip(" -–") for cell in rows.pop(0).cells]
    for column, cell in enumerate(header):
        title = ColumnHead.of(cell, FREQUENCY)
        name = title.name
        if re.fullmatch(r"(?i)(?:nat(?:ural|\.) |eigen|modal )?freq(?:uency|\.)?|f_?n?", name):
            name = "frequency"
        elif re.fullmatch(r"(?i)mode(?:[_ ]?(?:no|nr|number))?\.?|no\.?|nr\.?", name):
            name = "mode"
        columns[name] = column
        units[name] = title.unit or "".join(cells_of_units[column : column + 1])
    place = f"{path.name}, header"
    shown = ",".join(header)[:80]
    lines = enumerate(text_of(path).splitlines(), 1)
    remarks = ((k, REMARK.search(x)) for k, x in lines if k != head_row)
    comments = {f"line {k}": x[0].strip() for k, x in remarks if x}
    has_deviations = bool({"frequency_std", "shape_std"} & columns.keys())
    if not override:
        heads = (*header, *comments.values())
        # Beside two units a comment on that of the deviations is not read; that of their column is.
        are_mixed = len(set(re.findall(r"\b\w?Hz\b", " ".join(heads)))) > 1
        for text in heads:
            is_mixed = are_mixed and text[:1] == "#"
            _require_frequencies(place, text, has_deviations=has_deviations, is_mixed=is_mixed)
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
    of_head = "" if override else units["frequency"]
    stated = [Stated(_hertz_of(place, of_head), of_head, place)] if of_head else []
    found = unit_of_frequencies(path.name, stated, comments, unit, override=override)
    cure = "write the unit into the header, frequency [Hz], or say frequency_unit"
    if found is None:
        raise RefusedError(place, f"{shown}, without a unit", "frequencies with a unit", cure)
    hertz = {"frequency": found.value, "frequency_std": found.value}
    of_deviations = units.get("frequency_std", "")
    if of_deviations not in ("", units["frequency"]):  # each column in its own unit
        hertz["frequency_std"] = _hertz_of(place, of_deviations)

    # Frequencies and deviations are positive; amplitudes have either sign.
    positive = [columns[x] for x in ("frequency", "frequency_std", "shape_std") if x in columns]
    modes: dict[int, list[list[float]]] = defaultdict(list)
    for row, cells in rows:
        values = [np.nan] * len(header)
        for column in range(len(header)):
            if cells[column : column + 1] != [""]:
                values[column] = number(path, row, cells, column)
        for name in hertz.keys() & columns.keys():
            values[columns[name]] *= hertz[name]
        mode = values[columns["mode"]]
        fits = mode >= 1 and mode % 1 == 0 and all(values[column] > 0 for column in positive)
        allowed = "a mode from 1, frequency and deviations above 0"
        cure = "write decimal points" if len(cells) > len(header) else ""
        require(fits, f"{path.name}, row {row}", ",".join(cells)[:80], allowed, cure)
        modes[int(mode)].append(values)
    return tuple(
        _measurements_of_mode(path, mode, np.array(modes[mode]), columns) for mode in sorted(modes)
    )


def unit_of_frequencies(
    name: str,
    stated: Sequence[Stated],
    texts: Mapping[str, str],
    unit: str,
    *,
    override: Collection[str],
) -> Stated | None:
    """Return the unit of frequencies on which a file and its user agree, as a factor to Hz.

    Args:
        name: Name of the file, for messages.
        stated: Units that the file states in their place.
        texts: Its comments, by where they stand.
        unit: What the user says; may be empty.
        override: "frequency_unit", where the file states a wrong one.

    Returns:
        None if nobody states it.

    Raises:
        RefusedError: Two disagree, or one is that of an angular frequency or of a period.
    """
    own = list(stated)
    unsure: list[Stated] = []
    for place, text in texts.items():
        if not override:
            found = mentions(text)
            for one in found:
                _add_unit(one, place, name, own, unsure)
            if has_unknown_words(without_units(text, found)):
                unsure.append(Stated(math.nan, text[:60], place))
    said = Stated(_hertz_of("frequency_unit", unit), unit) if unit else None
    return settled(name, "frequency_unit", own, said, override=override, unsure=unsure)


def _require_frequencies(place: str, text: str, *, has_deviations: bool, is_mixed: bool) -> None:
    """Raise RefusedError where a text says that numbers are no frequencies in a unit."""
    rest = without_units(text, mentions(text)).strip(" #")
    # Shapes may be normalised.
    clauses = [x for x in re.split("[,;]", rest) if not re.search("(?i)shape|vector", x)]
    is_other = any(re.search(_OTHER_NUMBERS, clause) for clause in clauses)
    is_other |= re.search(r"(?i)(?:%|\bper\s?cent)\s+of\b", text) is not None
    is_other |= has_deviations and re.search(_RELATIVE, text) is not None
    is_other |= is_mixed and re.search(rf"(?i)(?:{_DEVIATION})[^,;]*Hz", text) is not None
    cure = "write frequencies in Hz, ω/(2π) or 1/T, and deviations in Hz, without a factor"
    allowed = "frequencies, not angular ones or periods"
    require(not is_other, place, text[:80], allowed, cure)


def _hertz_of(place: str, unit: str) -> float:
    """Return Hz in a unit of frequency; refuse others, angular ones among them."""
    hertz = factor_of(unit, FREQUENCY)
    if hertz not in (1.0, 1e3, 1e-3):
        parsed = unit_of(unit)
        cures = {"s": "write 1/T, in Hz, for periods T", "rad s-1": "write ω/(2π), in Hz, for ω"}
        cure = cures.get(parsed.dimension, "write them in Hz") if parsed else ""
        raise RefusedError(place, f"in {unit}", "frequencies in Hz, kHz or cycles/s", cure)
    return hertz


def _add_unit(
    one: Mention, place: str, name: str, stated: list[Stated], unsure: list[Stated]
) -> None:
    """Add a unit in a comment to those of the frequencies, or to those that may be of others.

    Args:
        one: The unit, with the number beside it.
        place: The line.
        name: Name of the file, for messages.
        stated: Units of the frequencies, as factors to Hz.
        unsure: Units of values that may be others.

    Raises:
        RefusedError: It is that of an angular frequency or of a period, or has a factor.
    """
    is_of_others = re.search(r"(?i)sampl|filter|band|resolution|\bdf\b|abtast|sensor", one.before)
    is_named = re.search(r"(?i)\bunit", one.before) is not None
    is_angular = one.dimension in ("rad s-1", "cycle rad s-1", "s-1", "cycle2 s-2", "rad2 s-2")
    is_period = one.dimension == "s" and one.is_sure and not one.numbers
    is_of_all = re.search(r"(?i)\b(?:in|units?(?:\s+of)?)\W*$", one.before) is not None
    is_angular = is_angular and (is_of_all or not one.numbers)
    if (is_angular or is_period) and (is_named or not is_of_others):
        _hertz_of(f"{name}, {place}", one.text)
    if one.dimension != FREQUENCY or (is_of_others and not is_named):
        return
    if is_of_all or not one.numbers:
        text = f"a multiple, {one.shown}{one.behind[:9]}" if one.is_multiple else one.text
        hertz = _hertz_of(f"{name}, {place}", text)
        stated.append(Stated(hertz, one.text, place))
    else:
        unsure.append(Stated(one.unit.factor, one.shown, place))


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
    largest = max((float(abs(x).mean()) for x in shape.values()), default=np.nan)
    deviation = _relative_deviation(values, columns.get("frequency_std"), frequencies.mean())
    of_shape = _relative_deviation(values, columns.get("shape_std") if shape else None, largest)
    return ModeRows(mode, frequencies, shape, deviation, of_shape)


def _relative_deviation(values: Array, column: int | None, scale: float) -> float | None:
    """Return the mean of a column of deviations over a scale; None without a column."""
    if column is None:
        return None
    # Independent deviations of several measurements are averaged by their squares.
    return float(np.sqrt((values[:, column] ** 2).mean()) / scale)
