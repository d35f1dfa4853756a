"""Commands on whole runs: ``run`` computes every stage of a case, ``report`` makes a page of it."""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import TextIO

import pandas as pd

from alphacut.commands.options import Command, add_quiet, add_run, write_answer
from alphacut.commands.pipeline import Pipeline, open_results
from alphacut.fuzzy.campaign.workers import pool
from alphacut.fuzzy.refused import require
from alphacut.io.arrays import text_table
from alphacut.io.files import locked, say, write_text
from alphacut.io.provenance import FORMAT, command_line, command_to_paste, versions
from alphacut.io.results import ResultsFolder
from alphacut.questions.summary import SUMMARY, Results, Summary
from alphacut.report.page import comparison_page, render_page
from alphacut.report.results import comparison, run_text
from alphacut.report.tables import tables, write_csv, write_markup, write_tables

PAGE = "report.html"


def add_options(parser: argparse.ArgumentParser) -> None:
    """Adds the options of a run."""
    add_run(parser, "results/NAME")
    parser.add_argument("--fresh", action="store_true", help="compute everything anew")
    parser.add_argument("--no-figures", action="store_true", help="numbers only")


def run(options: argparse.Namespace, out: TextIO) -> int:
    """Computes all stages of a case, draws figures and shows tables; returns exit status 0."""
    folder = options.out or f"results/{Path(options.case).stem}"
    start, names, figures = time.perf_counter(), list[str](), not options.no_figures
    with open_results(options, folder) as (case, store):
        with pool(store.workers) as executor:
            first = Results(case.content)
            results = Pipeline(first, store, options.petsc, figures, executor).run()
            if figures:
                from alphacut.figures.all import draw_figures  # which takes time to import

                names = draw_figures(results, store, executor)
        summary = Summary.of(
            results,
            format_version=FORMAT,
            case=case.name,
            title=case.content.title,
            about=case.content.about,
            case_text=case.text,
            command=command_line(),
            versions=versions(),
            changes=case.changes,
            figures=tuple(names),
            seconds=time.perf_counter() - start,
            fingerprints=results.fingerprints,
        )
        store.put_text(SUMMARY, summary.to_json())
    write_answer(options, summary.parts(), out, run_text(summary))
    if options.json != "-" and not options.quiet:
        say(f"results are in {folder}, after {summary.seconds:.0f} s")
        if store.up_to_date:
            say(f"{len(store.up_to_date)} of the stages were up to date")
        say(f"next: {command_to_paste('report', folder)}")
    return 0


def add_page(parser: argparse.ArgumentParser) -> None:
    """Adds the options of a report."""
    parser.add_argument(
        "folder", metavar="FOLDER", nargs="+", help="results of a run; of two to compare them"
    )
    parser.add_argument(
        "--out", metavar="FILE.html", help="file for the page (default: FOLDER/report.html)"
    )
    parser.add_argument("--csv", metavar="FOLDER", help="folder for every table as a CSV file")
    parser.add_argument("--tables", metavar="FOLDER", help="folder for every table in LaTeX")
    add_quiet(parser)


def report(options: argparse.Namespace, out: TextIO) -> int:
    """Writes the page of a run and the tables requested, or compares two; returns exit status 0."""
    if len(options.folder) > 1:
        return compare(options, out)
    folder = ResultsFolder.read(Path(options.folder[0]))
    page = render_page(folder)
    path = Path(options.out) if options.out else folder.path / PAGE
    if path.name == PAGE and path.parent.resolve() == folder.path.resolve():
        with locked("FOLDER", folder.path):
            ResultsFolder.read(folder.path).put_text(PAGE, page)
    else:
        write_text(path, page)
    summary, files = Summary.read(folder), list[Path]()
    if options.csv:
        files = write_tables(summary, folder, Path(options.csv))
    if options.tables:
        files += write_markup(tables(summary), Path(options.tables))
    document = {"file": str(path), "bytes": len(page.encode()), "tables": [*map(str, files)]}
    write_answer(options, document, out, "".join(f"{file}\n" for file in (path, *files)))
    return 0


def compare(options: argparse.Namespace, out: TextIO) -> int:
    """Shows two runs side by side, and writes the files requested; returns exit status 0."""
    folders = options.folder
    require(len(folders) == 2, "FOLDER", f"{len(folders)} folders", "one or two")
    first, second = (Summary.read(ResultsFolder.read(Path(name))) for name in folders)
    table = comparison(first, second)
    require(bool(table.rows), "FOLDER", " and ".join(folders), "two runs with a quantity in common")
    rows = [dict(zip(table.head, row, strict=True)) for row in table.rows]
    files = list[Path]()
    if options.out:
        write_text(Path(options.out), comparison_page(first, second, table))
        files.append(Path(options.out))
    if options.csv:
        files += write_csv({"comparison": pd.DataFrame(rows)}, Path(options.csv))
    if options.tables:
        files += write_markup({"comparison": table}, Path(options.tables))
    text = text_table(*table) + "".join(f"{file}\n" for file in files)
    write_answer(options, {"rows": rows, "tables": [*map(str, files)]}, out, text)
    return 0


COMMANDS = {
    "run": Command("run every stage of a case: files, figures, summary", add_options, run),
    "report": Command("one self-contained HTML page of a run's results", add_page, report),
}
