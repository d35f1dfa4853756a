"""CSV files of a run, for spreadsheets: a row a time or a level, units in the head."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from alphacut.frame.structures.quantities import Output
from alphacut.fuzzy.result import Nature, rounded
from alphacut.io.files import Document, write_text
from alphacut.io.netcdf import read_dataset
from alphacut.questions.table import QUESTIONS
from alphacut.report.results import nature_of, whole
from alphacut.report.safe import cleaned, plain_name

if TYPE_CHECKING:
    import xarray

Table = tuple[Sequence[str], Iterable[Sequence[object]]]


def write_tables(summary: Document, results: Path, folder: Path) -> list[Path]:
    """Writes the results of a run as CSV files with six digits.

    Args:
        summary: Of the run.
        results: Its folder.
        folder: Where the files go; made if it does not exist.

    Returns:
        The files.
    """
    files = []
    for name, (head, rows) in tables(cleaned(summary), results):
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(head)
        writer.writerows([_cell(value) for value in row] for row in rows)
        files.append(folder / f"{name}.csv")
        write_text(files[-1], text.getvalue())
    return files


def _cell(value: object) -> object:
    return f"{value:.6g}" if isinstance(value, float) else value


def tables(summary: Document, results: Path) -> Iterator[tuple[str, Table]]:
    """Name and content of each table."""
    if "modulus" in summary:
        yield "modulus", modulus(summary["modulus"])
    if "image" in summary:
        yield "image", image(summary["image"])
    studies = summary.get("envelopes", {})
    for name, study in studies.items():
        if plain_name(name):
            data = read_dataset(results / f"envelope_{name}.nc", key=str(results))
            for output in filter(plain_name, study["min"]):
                yield f"envelope_{name}-{output}", envelope(data, output)
    if studies:
        yield "peaks", (PEAKS, peaks(studies))
    if shares := summary.get("shares"):
        inputs = dict.fromkeys(name for entry in shares.values() for name in entry)
        rows = [(name, *(shares[of].get(name, "") for of in shares)) for name in inputs]
        yield "shares", (("input", *(f"share of {of} [1]" for of in shares)), rows)
    for question in QUESTIONS:
        if question.key in summary:
            yield question.key, (question.head, question.rows(summary[question.key]))


def modulus(part: Document) -> Table:
    """α-cuts of E and ν, with the error of E."""
    error, nature = sum(part.get("error", {}).values()), nature_of(part["nature"])
    columns = [part["alpha"], *_ends(part["E_GPa"], nature), *_ends(part["nu_cuts"], nature)]
    head = ("alpha", "E from [GPa]", "E to [GPa]", "nu from", "nu to")
    rows = [(*row, error * row[2], nature) for row in zip(*columns, strict=True)]
    return (*head, "error of E [GPa]", "nature"), rows


def image(part: Document) -> Table:
    """Proved α-cuts of E of an image."""
    cuts, nature = part["cuts"], nature_of(part["nature"])
    rows = zip(cuts["alpha"], *_ends(cuts["E_GPa"], nature), strict=True)
    return ("alpha", "E from [GPa]", "E to [GPa]", "nature"), [(*row, nature) for row in rows]


def _ends(cuts: Document, nature: Nature) -> Iterator[list[float]]:
    for side in ("lower", "upper"):
        yield [rounded(end, side, nature, 6) for end in cuts[side]]


def envelope(data: xarray.Dataset, output: str) -> Table:
    """Bounds of one output by time, those of each level beside each other with their error."""
    one, unit = data.sel(output=output), Output(output).unit
    nature = nature_of(data.attrs["nature"])
    error = "gap to attained" if nature is Nature.GUARANTEED else "error"
    columns = {"time [s]": [*map(float, one["time"].values)]}
    for level in one["alpha"].values:
        at = one.sel(alpha=level)
        for band in ("lower", "upper", "error"):
            if band in at:
                title = f"{nature} {band}" if band != "error" else error
                ends = (rounded(float(x), band, nature, 6) for x in at[band].values)
                columns[f"{title} at alpha {level:g} [{unit}]"] = [*ends]
    return tuple(columns), zip(*columns.values(), strict=True)


PEAKS = ("study", "output", "unit", "alpha", "least peak", "greatest peak", "error", "nature")


def peaks(studies: Document) -> Iterator[Sequence[object]]:
    """Rows of the peaks of all studies, an output and a level each."""
    for name, study in studies.items():
        for output, peak in study.get("peak", {}).items():
            nature, unit = nature_of(study["nature"]), Output(output).unit
            for level, alpha in enumerate(study["alpha"]):
                error = peak["error"][level] if "error" in peak else 0.0
                low, high, rest = whole(peak, level, error, nature)
                ends = rounded(low, "lower", nature, 6), rounded(high, "upper", nature, 6)
                yield name, output, unit, alpha, *ends, rest, nature
