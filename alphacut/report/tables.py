"""Every result as a data frame of numbers in SI: as CSV, and as tables of texts for the page."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from alphacut.base.number_text import MINUS, rounded_ends
from alphacut.frame import LearnedInputs
from alphacut.fuzzy.result import Nature, of_enclosing_box
from alphacut.io.files import Document, write_text
from alphacut.io.results import ResultsFolder
from alphacut.questions.question import Table
from alphacut.questions.summary import Parts
from alphacut.report.results import unit_of
from alphacut.stages.envelope import EnvelopeResult, PeakResult
from alphacut.stages.image import ImageResult
from alphacut.stages.modulus import ModulusResult
from alphacut.stages.suite import SuiteResult

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
        ("update", _rows_of_update, None if refuted else parts.update),
        ("peaks", peaks, parts.envelopes),
        ("records", records, parts.records),
        ("shares", shares, parts.shares),
    )
    found = {name: frame_of(part) for name, frame_of, part in of_stages if part}
    if parts.fragility is not None and parts.fragility.increments:
        found["fragility_sets"] = pd.DataFrame(parts.fragility.crossings())
    return found | {answer.key: pd.DataFrame(answer.records()) for answer in parts.answers}


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


def _rows_of_update(learned: LearnedInputs) -> pd.DataFrame:
    return pd.DataFrame(learned.records())


def peaks(studies: Mapping[str, EnvelopeResult]) -> pd.DataFrame:
    """The peaks of all studies, a row for each output and level."""
    return pd.concat(
        pd.DataFrame(
            {
                "study": name,
                "output": output,
                "unit": unit_of(study.units, output),
                "α": study.alpha,
                "least peak": peak.lower,
                "greatest peak": peak.upper,
                "error": peak.error,
                "nature": str(peak.nature),
                "peak reached": peak.reached,
                "gap, share": [peak.gap(level) for level in range(len(study.alpha))],
                **_box_column(peak),
            }
        )
        for name, study in studies.items()
        for output, peak in study.peak.items()
    )


def _box_column(peak: PeakResult) -> dict[str, str]:
    """A column that says of which box the peaks are, where this is not the set meant."""
    return {"inputs": of_enclosing_box(peak.encloses)} if peak.encloses else {}


def records(result: SuiteResult) -> pd.DataFrame:
    """Measures of each record and its peaks farthest out on the lowest level, then statistics."""
    head = ["record", "PGA [m/s^2]", "Sa(T1) [m/s^2]", "output", "unit"]
    head += ["farthest peak", "peak reached", "nature", "inputs"]
    rows: list[tuple[object, ...]] = []
    for name, record in result.records.items():
        sizes = record.measures["PGA"], record.measures["Sa(T1)"]
        for output, peak in record.peak.items():
            box = of_enclosing_box(peak.encloses) if peak.encloses else None
            peak_cells = peak.far_end[0], peak.reached[0], str(peak.nature), box
            rows.append((name, *sizes, output, unit_of(result.units, output), *peak_cells))
    for output, statistics in result.statistics.items():
        unit = unit_of(result.units, output)
        for name, proved in statistics.proved.items():  # mean, median …
            row = (f"{name} of all", np.nan, np.nan, output, unit, proved[0], np.nan, np.nan, None)
            rows.append(row)
    found = pd.DataFrame(rows, columns=head)
    return found if found["inputs"].any() else found.drop(columns="inputs")


def shares(table: Mapping[str, Mapping[str, float]]) -> pd.DataFrame:
    """Each input's share in the width of each result at the lowest level, the largest first."""
    rows = [
        (result, name, share)
        for result, values in table.items()
        for name, share in sorted(values.items(), key=lambda pair: -pair[1])
    ]
    return pd.DataFrame(rows, columns=["width of", "input", "share"])


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
    if isinstance(value, str):
        return value
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
        text = frame.to_csv(index=False, lineterminator="\n").replace(MINUS, "-")
        write_text(folder / f"{name}.csv", text, follow_links=False)
    return [folder / f"{name}.csv" for name in found]


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
