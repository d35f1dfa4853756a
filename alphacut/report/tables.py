"""Every result as a data frame of numbers in SI: as CSV, and as tables of texts for the page."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from alphacut.base.csv_text import csv_cell
from alphacut.base.kept_files import write_text
from alphacut.base.number_text import MINUS, Table, rounded_ends
from alphacut.frame import Sensitivity
from alphacut.frame.analyses.answer import Answer
from alphacut.frame.structures.quantities import output_of
from alphacut.fuzzy.result import Nature, of_enclosing_box
from alphacut.io.files import Document
from alphacut.io.results import ResultsFolder
from alphacut.stages.envelope import EnvelopeResult
from alphacut.stages.image import ImageResult
from alphacut.stages.modulus import ModulusResult, infinite_if_unknown
from alphacut.stages.summary import Parts

if TYPE_CHECKING:
    import xarray

DIGITS = 6
"""Significant digits of numbers that are shown; files have all."""


def frames(parts: Parts) -> dict[str, pd.DataFrame]:
    """Return the numbers of all results as data frames, by the names of their CSV files.

    The results of stages come first, then the answers to questions. Stages that the run lacks and
    identified inputs that are refuted have none.

    Args:
        parts: Numbers of the results, in SI units but for moduli in GPa.
    """
    found: dict[str, pd.DataFrame] = {}
    if parts.microstructure:
        found["radius_map"] = radius_map(parts.microstructure)
    if parts.modulus:
        found["modulus"] = modulus(parts.modulus)
    if parts.image:
        found["image"] = modulus(parts.image)
    if parts.update is not None and not parts.update.is_refuted:
        found["update"] = rows_of(parts.update)
    if parts.envelopes:
        found["peaks"] = peaks(parts.envelopes)
    if parts.records:
        found["records"] = rows_of(parts.records)
    if parts.shares:
        found["shares"] = rows_of(Sensitivity(parts.shares))
    for answer in parts.answers:
        found |= {name: pd.DataFrame(rows) for name, rows in answer.further_records().items()}
    for answer in parts.answers:
        found[answer.key] = rows_of(answer)
    return found


def tables(parts: Parts) -> dict[str, Table]:
    """Return all results as tables of texts, by the names of their CSV files.

    Numbers have six significant digits; bounds are rounded in the direction that keeps their
    guarantee. Answers to questions have tables of their own.

    Args:
        parts: Numbers of the results.
    """
    # Answers know what their numbers mean, and say it better than a frame of numbers.
    texts = {name: shown(frame) for name, frame in frames(parts).items()}
    return texts | {answer.key: answer.table() for answer in parts.answers}


def radius_map(numbers: Document) -> pd.DataFrame:
    """Return the parameters a1 … a4 of a radius map, a row for each.

    Args:
        numbers: Results of stage microstructure. Each parameter is a number, or the three corners
            of a triangular one.

    Returns:
        Columns of the name, minimum, nominal value and maximum; of a number all three are equal.

    Raises:
        KeyError: A parameter is missing.
    """
    rows = []
    for name in ("a1", "a2", "a3", "a4"):
        # A triangular number has three corners; a crisp one is a single value, and all three.
        corners = np.atleast_1d(numbers[name])
        rows.append((name, corners[0], corners[len(corners) // 2], corners[-1]))
    head = ["parameter of the radius map", "minimum", "nominal", "maximum"]
    return pd.DataFrame(rows, columns=head)


def modulus(result: ModulusResult | ImageResult) -> pd.DataFrame:
    """Return the α-cuts of E, and of a cell those of ν and the error of E, a row for each level.

    Args:
        result: α-cuts in GPa. Ends without a bound become infinite. The error of E is the sum of
            the relative errors by source times the upper end; NaN if none is declared.
    """
    lower, upper = infinite_if_unknown(result.E_GPa)
    columns = {"α": result.alpha, "E from [GPa]": lower, "E to [GPa]": upper}
    if isinstance(result, ModulusResult):
        columns["ν from"] = result.nu_cuts.lower
        columns["ν to"] = result.nu_cuts.upper
        # Errors are fractions of E by their causes; without a cause they are not known.
        error = sum(result.error.values()) or np.nan
        columns["± E [GPa]"] = error * result.E_GPa.upper
    return pd.DataFrame(columns | {"nature of E": str(result.nature)})


def rows_of(answer: Answer) -> pd.DataFrame:
    """Return the rows of numbers of an answer."""
    return pd.DataFrame(answer.records())


def peaks(studies: Mapping[str, EnvelopeResult]) -> pd.DataFrame:
    """Return the bounds of the peaks of all studies, a row for each output and level.

    Args:
        studies: Numbers of each study by name. There must be one with a peak.

    Returns:
        Least and greatest peak, error and attained value in SI units; NaN where no value is known
        to be attained. "gap, share" is the distance from the attained value to the farthest bound,
        as a fraction of this bound. The farthest bound is the least peak for the smallest value of
        an output, and the greatest peak for all others. If bounds hold for a box that encloses a
        set of inputs learned from a measurement, a column "inputs" says so. The index of the rows
        begins at 0 again for each peak.
    """
    found = []
    for name, study in studies.items():
        for output, peak in study.peak.items():
            columns = {
                "study": name,
                "output": output,
                "unit": study.units[output_of(output)],
                "α": study.alpha,
                "least peak": peak.lower,
                "greatest peak": peak.upper,
                "error": peak.error,
                "nature": str(peak.nature),
                # Unknown values are infinite in `reached`; a file has empty cells for NaN.
                "peak reached": np.where(np.isfinite(peak.reached), peak.reached, np.nan),
                "gap, share": peak.gaps,
            }
            if peak.encloses:
                columns["inputs"] = of_enclosing_box(peak.encloses)
            found.append(pd.DataFrame(columns))
    return pd.concat(found)


def over_time(data: xarray.Dataset, output: str, unit: str) -> pd.DataFrame:
    """Return the bounds of one output over time, with up to three columns for each level.

    Args:
        data: Envelope of a study over alpha, output and time, in SI units.
        output: Name of the output.
        unit: Its SI unit, for the titles.

    Returns:
        Row of each time node: the time in s and, for each level, lower bound, upper bound and
        error. Guaranteed bounds contain the error, and have the gap to attained values as their
        third column. This column is left out if bounds hold for a box that encloses a set of inputs
        learned from a measurement, which the titles then say. Variables that `data` does not have
        are left out as well.
    """
    series = data.sel(output=output)
    nature = Nature(data.attrs["nature"])
    encloses = data.attrs.get("encloses", "")
    box = ""
    if encloses:
        box = f" {of_enclosing_box(encloses)}"
    titles = {"lower": f"{nature} lower{box}", "upper": f"{nature} upper{box}"}
    if nature is not Nature.GUARANTEED:
        titles["error"] = "error"
    elif not encloses:
        titles["error"] = "gap to attained"
    columns = {"time [s]": series["time"].values}
    for level in series["alpha"].values:
        for variable, title in titles.items():
            if variable in series:
                values = series[variable].sel(alpha=level).values
                columns[f"{title} at alpha {level:g} [{unit}]"] = values
    return pd.DataFrame(columns)


def shown(frame: pd.DataFrame) -> Table:
    """Return a data frame as a table of texts with six significant digits.

    Columns without any value are left out. The ends of E and of peaks are rounded outwards if they
    are guaranteed and inwards if they are attained, so that the guarantee stays true.

    Args:
        frame: Numbers and texts; a missing number is NaN and becomes an empty text.
    """
    # A rounded bound must stay a bound: columns of bounds are rounded in their own directions here,
    # all other numbers to the nearest at the end.
    filled = frame.dropna(axis=1, how="all")
    for low, high, guarantee in (
        ("E from [GPa]", "E to [GPa]", "nature of E"),
        ("least peak", "greatest peak", "nature"),
    ):
        if low not in filled:
            continue
        ends = [
            rounded_ends(lower, upper, Nature(nature), DIGITS)
            for lower, upper, nature in filled[[low, high, guarantee]].itertuples(index=False)
        ]
        filled = filled.assign(**dict(zip((low, high), zip(*ends, strict=True), strict=True)))
    rows = [tuple(map(_text, row)) for row in filled.itertuples(index=False)]
    return Table(tuple(map(str, filled)), rows)


def _text(value: object) -> str:
    """Return a cell of a table: a number with six significant digits, and a text as it is.

    None and NaN become an empty text, and hyphens of numbers minus signs.

    Raises:
        TypeError, ValueError: The value is neither a text nor a number.
    """
    if value is None or isinstance(value, str):
        return value or ""
    number = float(value)  # type: ignore[arg-type]
    if np.isnan(number):
        return ""
    return f"{number + 0.0:.{DIGITS}g}".replace("-", MINUS)  # adding 0 removes the sign of −0


def write_tables(parts: Parts, results: ResultsFolder, folder: Path) -> list[Path]:
    """Write all results of a run into a folder as CSV files, and return the files.

    Args:
        parts: Numbers of the results.
        results: Folder of the results, for the envelopes over time.
        folder: Folder for the files NAME.csv, which is made if it is missing.

    Raises:
        RefusedError: The dataset of an envelope is missing or damaged.
        OSError: A file cannot be written.
    """
    found = frames(parts)
    # The summary has the extremes of envelopes alone; their courses over time are in datasets.
    for name, study in parts.envelopes.items():
        data = results.dataset(f"envelope_{name}.nc")
        for output in study.min if study.is_over_time else ():
            found[f"envelope_{name}-{output}"] = over_time(data, output, study.units[output])
    return write_csv(found, folder)


def write_csv(found: Mapping[str, pd.DataFrame], folder: Path) -> list[Path]:
    """Write data frames as CSV files, and return the files.

    Numbers have all digits, so that a bound stays one. Texts have hyphens for minus signs, and
    those that a spreadsheet would take for a formula are marked as texts.

    Args:
        found: Data frames by the name of their file.
        folder: Folder for the files NAME.csv. Links in place of a file are replaced, not followed.

    Raises:
        OSError: A file cannot be written.
    """
    for name, frame in found.items():
        # Lines end with "\n" on every system, so that equal results give equal files.
        texts = frame.select_dtypes("object").map(_csv_cell)
        content = frame.assign(**texts).to_csv(index=False, lineterminator="\n")
        write_text(folder / f"{name}.csv", content, follow_links=False)
    return [folder / f"{name}.csv" for name in found]


def _csv_cell(value: object) -> object:
    """Return a text with hyphens for minus signs and no formula in it; other values as they are."""
    # A name in a case may begin with "=", by which a spreadsheet would run it.
    if isinstance(value, str):
        return csv_cell(value.replace(MINUS, "-"))
    return value


def write_markup(named: Mapping[str, Table], folder: Path) -> list[Path]:
    """Write each table that has rows as a LaTeX file, and return the files.

    Args:
        named: Tables by the name of their file.
        folder: Folder for the files NAME.tex, which is made if it is missing.

    Raises:
        OSError: A file cannot be written.
    """
    written = []
    for name, table in named.items():
        if table.rows:
            written.append(folder / f"{name}.tex")
            write_text(written[-1], latex(table), follow_links=False)
    return written


def latex(table: Table) -> str:
    """Return a table as a LaTeX tabular environment with the rules of the package booktabs.

    Special characters of LaTeX in the texts are escaped, and signs that its fonts do not have, such
    as Greek letters and ≤, become commands. The first column is aligned to the left, others to the
    right.

    Args:
        table: Titles of the columns, and rows of as many texts.
    """
    frame = pd.DataFrame(table.rows, columns=table.head)
    columns = "l" + "r" * (len(table.head) - 1)
    text: str = frame.to_latex(index=False, escape=True, column_format=columns)
    # pandas has escaped the texts already, so that the commands are put in afterwards.
    commands: dict[str, str | int | None] = {
        "…": r"\dots{}",
        "µ": r"\textmu{}",
        "−": "$-$",
        "²": "$^2$",
        "≤": r"$\leq$",
        "≥": r"$\geq$",
        "±": r"$\pm$",
        "α": r"$\alpha$",
        "ν": r"$\nu$",
        "ζ": r"$\zeta$",
    }
    return text.translate(str.maketrans(commands))
