"""Every result as a table of texts: for the console, the page and CSV files."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from alphacut.fuzzy.result import Nature, rounded
from alphacut.io.columns import text_table
from alphacut.io.files import Document, write_text
from alphacut.io.manifest import ResultsFolder
from alphacut.io.netcdf import dataset_of
from alphacut.io.quantity import MINUS, end_texts, engineering
from alphacut.questions.all import QUESTIONS
from alphacut.questions.question import Row
from alphacut.report.results import (
    MEANING,
    Table,
    answers,
    drivers,
    material,
    natures,
    peak_gap,
    peak_table,
    unit_of,
    without_empty_columns,
)

if TYPE_CHECKING:
    import xarray

DIGITS = 6


def run_text(summary: Document) -> str:
    """The results of a run for the console: tables, then sentences, answers and main drivers."""
    learned = summary.get("update", {})
    shown = [table for table in (material(summary), peak_table(summary)) if table[1]]
    if "inputs" in learned:
        shown.append(update(learned))
    lines = [*natures(summary)]
    if "refuted" in learned:
        lines.append(learned["refuted"])
    lines += [f"{row[0]}: {row[1]} ({row[2]})" for row in answers(summary)]
    lines += drivers(summary)
    heading = f"{MEANING}\n" if shown else ""
    texts = [text_table(*table) for table in shown]
    return heading + "".join(texts) + "".join(f"{line}\n" for line in lines)


def write_tables(summary: Document, results: ResultsFolder, folder: Path) -> list[Path]:
    """Writes the results of a run as CSV files.

    Args:
        summary: Of the run.
        results: Its results.
        folder: Where the files go; made if it does not exist.

    Returns:
        The files.
    """
    tables_by_name = {name: table for name, table in tables(summary).items() if table[1]}
    for question in QUESTIONS:
        if question.key in summary:
            head, rows = question.number_rows(summary[question.key])
            tables_by_name[question.key] = head, [tuple(map(_csv_cell, row)) for row in rows]
    for name, study in summary.get("envelopes", {}).items():
        data = dataset_of(results.content(f"envelope_{name}.nc"))
        for output in study["min"]:
            unit = unit_of(study, output)
            tables_by_name[f"envelope_{name}-{output}"] = over_time(data, output, unit)
    if "records" in summary:
        tables_by_name["spectra"] = spectra(summary["records"]["spectra"])
    return write_csv(tables_by_name, folder)


def write_csv(tables_by_name: Mapping[str, Table], folder: Path) -> list[Path]:
    """Writes each table as a CSV file, with the minus of ASCII; returns the files."""
    for name, (head, rows) in tables_by_name.items():
        text = io.StringIO()
        csv.writer(text, lineterminator="\n").writerows([head, *rows])
        content = text.getvalue().replace(MINUS, "-")
        write_text(folder / f"{name}.csv", content, follow_links=False)
    return [folder / f"{name}.csv" for name in tables_by_name]


def tables(summary: Document) -> dict[str, Table]:
    """Tables of the results in a summary, by name: of stages as in `MAKERS`, then of questions.

    A stage that is absent or was refuted by its measurements has none.
    """
    stage_tables = {
        name: make(summary[key])
        for name, (key, make) in MAKERS.items()
        if summary.get(key) and "refuted" not in summary[key]
    }
    answers = {x.key: (x.head, x.rows(summary[x.key])) for x in QUESTIONS if x.key in summary}
    return stage_tables | answers


def cut_texts(values: Document, level: int, nature: Nature) -> Row:
    """Both ends of a cut, rounded as their nature allows."""
    return end_texts(float(values["lower"][level]), float(values["upper"][level]), nature, DIGITS)


def radius_map(part: Document) -> Table:
    """Table of the parameters a1 … a4 of the radius map: least, modal and greatest value."""
    rows: list[Row] = []
    for name in ("a1", "a2", "a3", "a4"):
        corners = part[name] if isinstance(part[name], list) else [part[name]]  # three, or one
        least, modal, greatest = corners[0], corners[len(corners) // 2], corners[-1]
        rows.append((name, *map(_number_text, (least, modal, greatest))))
    return ("parameter of the radius map", "least", "modal", "greatest"), rows


def _csv_cell(value: str | float | None) -> str:
    if isinstance(value, str):
        return value
    return "" if value is None else repr(float(value))  # exact: a bound stays one


def _number_text(value: float) -> str:
    return f"{value:.{DIGITS}g}"


def modulus(part: Document) -> Table:
    """Table of the α-cuts of E and of ν, with the error of E, of a round cell or of an image."""
    cuts, nature = part.get("cuts", part), Nature(part["nature"])
    poisson, error = part.get("nu_cuts"), sum(part.get("error", {}).values())
    rows: list[Row] = [
        (
            f"{alpha:g}",
            *cut_texts(cuts["E_GPa"], level, nature),
            *(cut_texts(poisson, level, nature) if poisson else ("", "")),
            f"{error * cuts['E_GPa']['upper'][level]:.2g}" if error else "",
            str(nature),
        )
        for level, alpha in enumerate(cuts["alpha"])
    ]
    head = ("α", "E from [GPa]", "E to [GPa]", "ν from", "ν to", "± E [GPa]", "nature")
    return without_empty_columns(head, rows)


def update(part: Document) -> Table:
    """Table of the inputs before and after measured modes were used, then of predicted modes."""
    rows: list[Row] = []
    for name, identified in part["inputs"].items():
        posterior, unit = (identified["lower"][0], identified["upper"][0]), part["units"][name]
        texts = (_outer_text(ends, unit) for ends in (part["prior"][name], posterior))
        rows.append((name, *texts, f"{part['narrowed'][name]:.0%} of the width"))
    for mode in part["held_out"]:
        verdict, measured = "inside" if mode["inside"] else "outside", f"{mode['measured']:.4g} Hz"
        predicted = _outer_text(mode["predicted"], "Hz")
        rows.append((f"mode {mode['mode']}", measured, predicted, verdict))
    return ("input or mode", "before, measured", "learned, predicted", ""), rows


def _outer_text(ends: Sequence[float], unit: str) -> str:
    sides = zip(ends, ("lower", "upper"), strict=True)
    return " … ".join(engineering(rounded(x, y, Nature.GUARANTEED), unit) for x, y in sides)


def peaks(studies: Document) -> Table:
    """Table of the peaks of all studies, a row for each output and level, in SI."""
    rows: list[Row] = []
    for name, study in studies.items():
        for output, peak in study["peak"].items():
            nature = Nature(peak["nature"])
            for level, alpha in enumerate(study["alpha"]):
                values = end_texts(peak["lower"][level], peak["upper"][level], nature, DIGITS)
                reached = rounded(peak["reached"][level], "upper", Nature.ATTAINED, DIGITS)
                error = f"{peak['error'][level]:.2g}"
                first = (name, output, unit_of(study, output), f"{alpha:g}")
                last = _number_text(reached), f"{peak_gap(peak, level):.2g}"
                rows.append((*first, *values, error, str(nature), *last))
    head = ("study", "output", "unit", "α", "least peak", "greatest peak", "error", "nature")
    return (*head, "peak reached", "gap, share"), rows


def records(part: Document) -> Table:
    """Table of each record's measures and peaks on the lowest level, then of statistics, in SI."""
    rows: list[Row] = []
    for name, record in part["records"].items():
        measures = tuple(_number_text(record["measures"][x]) for x in ("PGA", "Sa(T1)"))
        for output, peak in record["peak"].items():
            ends: Row = (_number_text(peak["upper"][0]), _number_text(peak["reached"][0]))
            rows.append((name, *measures, output, unit_of(part, output), *ends, peak["nature"]))
    for output, statistics in part["statistics"].items():
        for statistic in statistics["proved"]:  # mean, median …
            ends = tuple(_number_text(statistics[x][statistic][0]) for x in ("proved", "reached"))
            rows.append((f"{statistic} of all", "", "", output, unit_of(part, output), *ends, ""))
    head = ("record", "PGA [m/s^2]", "Sa(T1) [m/s^2]", "output", "unit")
    return (*head, "greatest peak", "peak reached", "nature"), rows


def spectra(part: Document) -> Table:
    """Table of response spectra: pseudo-acceleration of each record, and their mean, by period."""
    names = [name for name in part if name != "period_s"]
    columns = [part[name] for name in names]
    rows: list[Row] = []
    for k, period in enumerate(part["period_s"]):
        values = [column[k] for column in columns]
        numbers = (period, *values, sum(values) / len(values))
        rows.append(tuple(map(_number_text, numbers)))
    return ("period [s]", *(f"{name} [m/s^2]" for name in (*names, "mean"))), rows


def shares(part: Document) -> Table:
    """Table of each input's share in the width of each result at the lowest level, sorted."""
    rows: list[Row] = [
        (quantity, name, f"{share:.3f}")
        for quantity, values in part.items()
        for name, share in sorted(values.items(), key=lambda pair: -pair[1])
    ]
    return ("width of", "input", "share"), rows


MAKERS = {
    "radius_map": ("microstructure", radius_map),
    "modulus": ("modulus", modulus),
    "image": ("image", modulus),
    "update": ("update", update),
    "peaks": ("envelopes", peaks),
    "records": ("records", records),
    "shares": ("shares", shares),
}
"""Part of the summary of each table, and the function that makes it."""


def over_time(data: xarray.Dataset, output: str, unit: str) -> Table:
    """Table of the bounds of one output over time, with three columns for each level."""
    series = data.sel(output=output)
    nature = Nature(data.attrs["nature"])
    titles = {"lower": f"{nature} lower", "upper": f"{nature} upper"}
    titles["error"] = "gap to attained" if nature is Nature.GUARANTEED else "error"
    columns = {"time [s]": [_number_text(time) for time in series["time"].values]}
    for level in series["alpha"].values:
        at_level = series.sel(alpha=level)
        for kind, title in titles.items():
            if kind in at_level:
                values = (rounded(float(x), kind, nature, DIGITS) for x in at_level[kind].values)
                columns[f"{title} at alpha {level:g} [{unit}]"] = [*map(_number_text, values)]
    return tuple(columns), [*zip(*columns.values(), strict=True)]
