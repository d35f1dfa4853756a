"""Every result as a data frame of numbers in SI: as CSV, and as tables of texts for the page."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from alphacut.base.csv_text import csv_cell
from alphacut.base.kept_files import write_text
from alphacut.base.number_text import MINUS, Table, rounded_ends
from alphacut.frame import LearnedInputs, Sensitivity
from alphacut.frame.analyses.answer import Answer
from alphacut.frame.structures.quantities import output_of
from alphacut.fuzzy.result import Nature, of_enclosing_box
from alphacut.io.files import Document
from alphacut.io.results import ResultsFolder
from alphacut.stages.envelope import EnvelopeResult
from alphacut.stages.image import ImageResult
from alphacut.stages.modulus import ModulusResult
from alphacut.stages.summary import Parts

if TYPE_CHECKING:
    import xarray

DIGITS = 6
RANGES = (("E from [GPa]", "E to [GPa]", "nature of E"), ("least peak", "greatest peak", "nature"))
"""Columns of lower and upper ends that are rounded as the nature in a third one demands."""
SIGNS = {"−": "-", "≤": r"\leq", "≥": r"\geq", "±": r"\pm", "²": "^2", "α": r"\alpha"}
SIGNS |= {"ν": r"\nu", "ζ": r"\zeta"}
SYMBOLS = str.maketrans({x: f"${sign}$" for x, sign in SIGNS.items()})
SYMBOLS |= str.maketrans({"…": r"\dots{}", "µ": r"\textmu{}"})
"""What LaTeX's fonts do not have."""


def frames(parts: Parts) -> dict[str, pd.DataFrame]:
    """Numbers of all results as data frames by name: of stages, then of questions."""
    refuted = parts.update is not None and parts.update.is_refuted
    of_stages: tuple[tuple[str, Callable[[Any], pd.DataFrame], object], ...] = (
        ("radius_map", radius_map, parts.microstructure),
        ("modulus", modulus, parts.modulus),
        ("image", modulus, parts.image),
        ("update", rows_of, None if refuted else parts.update),
        ("peaks", peaks, parts.envelopes),
        ("records", rows_of, parts.records),
        ("shares", rows_of, Sensitivity(parts.shares) if parts.shares else None),
    )
    found = {name: frame_of(part) for name, frame_of, part in of_stages if part}
    if parts.fragility is not None and parts.fragility.increments:
        found["fragility_sets"] = pd.DataFrame(parts.fragility.crossings())
        found["fragility_curves"] = pd.DataFrame(parts.fragility.curves())
    return found | {answer.key: rows_of(answer) for answer in parts.answers}


def tables(parts: Parts) -> dict[str, Table]:
    """Tables of texts of all results: numbers rounded as their nature allows, answers in words."""
    texts = {name: shown(frame) for name, frame in frames(parts).items()}
    return texts | {answer.key: answer.table() for answer in parts.answers}


def radius_map(numbers: Document) -> pd.DataFrame:
    """The parameters a1 … a4 of the radius map: minimum, nominal value and maximum."""
    corners = {name: np.atleast_1d(numbers[name]) for name in ("a1", "a2", "a3", "a4")}  # 3 or 1
    rows = [(name, x[0], x[len(x) // 2], x[-1]) for name, x in corners.items()]
    head = ["parameter of the radius map", "minimum", "nominal", "maximum"]
    return pd.DataFrame(rows, columns=head)


def modulus(result: ModulusResult | ImageResult) -> pd.DataFrame:
    """The α-cuts of E, and of a cell those of ν and the error of E."""
    young = result.E_GPa
    lower, upper = young.ends
    columns = {"α": result.alpha, "E from [GPa]": lower, "E to [GPa]": upper}
    if isinstance(result, ModulusResult):
        error = sum(result.error.values())
        columns |= {"ν from": result.nu_cuts.lower, "ν to": result.nu_cuts.upper}
        columns["± E [GPa]"] = error * young.upper if error else np.full(len(young.upper), np.nan)
    return pd.DataFrame(columns | {"nature of E": str(result.nature)})


def rows_of(answer: Answer | LearnedInputs) -> pd.DataFrame:
    """The rows of numbers of an answer."""
    return pd.DataFrame(answer.records())


def peaks(studies: Mapping[str, EnvelopeResult]) -> pd.DataFrame:
    """The peaks of all studies, a row for each output and level."""
    return pd.concat(
        pd.DataFrame(
            {
                "study": name,
                "output": output,
                "unit": study.units[output_of(output)],
                "α": study.alpha,
                "least peak": peak.lower,
                "greatest peak": peak.upper,
                "error": peak.error,
                "nature": str(peak.nature),
                "peak reached": np.where(np.isfinite(peak.reached), peak.reached, np.nan),
                "gap, share": peak.gaps,
                **({"inputs": of_enclosing_box(peak.encloses)} if peak.encloses else {}),
            }
        )
        for name, study in studies.items()
        for output, peak in study.peak.items()
    )


def over_time(data: xarray.Dataset, output: str, unit: str) -> pd.DataFrame:
    """The bounds of one output over time, with three columns for each level."""
    series, nature = data.sel(output=output), Nature(data.attrs["nature"])
    encloses = data.attrs.get("encloses", "")
    box = f" {of_enclosing_box(encloses)}" if encloses else ""
    titles = {"lower": f"{nature} lower{box}", "upper": f"{nature} upper{box}"}
    if nature is not Nature.GUARANTEED:
        titles["error"] = "error"
    elif not encloses:
        titles["error"] = "gap to attained"
    columns = {"time [s]": series["time"].values}
    for level in series["alpha"].values:
        for kind, title in titles.items():
            if kind in series:
                name = f"{title} at alpha {level:g} [{unit}]"
                columns[name] = series[kind].sel(alpha=level).values
    return pd.DataFrame(columns)


def shown(frame: pd.DataFrame) -> Table:
    """A data frame as texts, without columns that are empty."""
    filled = frame.dropna(axis=1, how="all")
    for low, high, nature in RANGES:
        if low in filled:
            columns = (filled[x] for x in (low, high, nature))
            ends = [rounded_ends(x, y, Nature(z), DIGITS) for x, y, z in zip(*columns, strict=True)]
            filled = filled.assign(**dict(zip((low, high), zip(*ends, strict=True), strict=True)))
    rows = [tuple(map(_text, row)) for row in filled.itertuples(index=False)]
    return Table(tuple(map(str, filled)), rows)


def _text(value: object) -> str:
    if value is None or isinstance(value, str):
        return value or ""
    number = float(value)  # type: ignore[arg-type]
    return "" if np.isnan(number) else f"{number + 0.0:.{DIGITS}g}".replace("-", MINUS)


def write_tables(parts: Parts, results: ResultsFolder, folder: Path) -> list[Path]:
    """Writes the results of a run as CSV files into a folder; returns the files."""
    found = frames(parts)
    for name, study in parts.envelopes.items():
        data = results.dataset(f"envelope_{name}.nc")
        for output in study.min:
            found[f"envelope_{name}-{output}"] = over_time(data, output, study.units[output])
    return write_csv(found, folder)


def write_csv(found: Mapping[str, pd.DataFrame], folder: Path) -> list[Path]:
    """Writes data frames as CSV files, exact so that a bound stays one; returns the files."""
    for name, frame in found.items():
        texts = frame.select_dtypes("object")
        text = frame.assign(**texts.map(_csv_cell)).to_csv(index=False, lineterminator="\n")
        write_text(folder / f"{name}.csv", text, follow_links=False)
    return [folder / f"{name}.csv" for name in found]


def _csv_cell(value: object) -> object:
    """A text with plain signs that no spreadsheet takes for a formula; another value as it is."""
    return csv_cell(value.replace(MINUS, "-")) if isinstance(value, str) else value


def write_markup(named: Mapping[str, Table], folder: Path) -> list[Path]:
    """Writes each table as a file of LaTeX; returns the files."""
    texts = {folder / f"{name}.tex": latex(table) for name, table in named.items() if table.rows}
    for path, text in texts.items():
        write_text(path, text, follow_links=False)
    return [*texts]


def latex(table: Table) -> str:
    """A tabular environment, with rules of the package booktabs."""
    frame, columns = pd.DataFrame(table.rows, columns=table.head), "l" + "r" * (len(table.head) - 1)
    text: str = frame.to_latex(index=False, escape=True, column_format=columns)
    return text.translate(SYMBOLS)
