"""Commands on whole runs: ``run`` computes every stage of a case, ``report`` makes a page of it."""

from __future__ import annotations

import argparse
import time
from collections.abc import Mapping
from pathlib import Path
from typing import TextIO

from alphacut.case.load import Case
from alphacut.commands.options import Command, add_quiet, add_run, answer, opened
from alphacut.figures.all import drawn
from alphacut.fuzzy.campaign.workers import pool
from alphacut.io.files import Document, alone, as_json, say, write_text
from alphacut.io.manifest import ResultsFolder
from alphacut.io.netcdf import read_summary
from alphacut.io.provenance import FORMAT, command, door, versions
from alphacut.report.page import render_page
from alphacut.report.tables import run_text, write_tables
from alphacut.stages.pipeline import Pipeline
from alphacut.stages.results import Results
from alphacut.stages.store import StageStore, put_text

PAGE = "report.html"


def add_options(parser: argparse.ArgumentParser) -> None:
    """Adds the options of a run."""
    add_run(parser, "results/NAME")
    parser.add_argument("--fresh", action="store_true", help="compute everything anew")
    parser.add_argument("--no-figures", action="store_true", help="numbers only")


def run(options: argparse.Namespace, out: TextIO) -> int:
    """Computes, draws, reports."""
    folder = options.out or f"results/{Path(options.case).stem}"
    with opened(options, folder) as (case, store):
        document = computed(case, store, options.petsc, figures=not options.no_figures)
    answer(options, document, out, run_text(document))
    if options.json != "-" and not options.quiet:
        say(f"results are in {folder}, after {document['seconds']:.0f} s")
        if store.taken:
            say(f"{len(store.taken)} of the stages were up to date")
        say(f"next: {door('report', folder)}")
    return 0


def computed(case: Case, store: StageStore, petsc: Mapping[str, str], *, figures: bool) -> Document:
    """The numbers and figures of a case; summary.json is written last."""
    start = time.perf_counter()
    with pool(store.workers) as executor:
        results = Pipeline(Results(case.content), store, petsc, figures, executor).run()
        names = drawn(results, store, executor) if figures else []
    document: Document = {
        "format_version": FORMAT,
        "case": case.name,
        "title": case.content.title,
        "about": case.content.about,
        "case_text": case.text,
        "command": command(),
        "versions": versions(),
        **results.document(),
        "changes": list(case.changes),
        "figures": names,
        "seconds": time.perf_counter() - start,
        "fingerprints": {name: result.fingerprint for name, result in results.stages.items()},
    }
    store.put_text("summary.json", as_json(document, indent=2))
    return document


def add_page(parser: argparse.ArgumentParser) -> None:
    """Adds the options of a report."""
    parser.add_argument("folder", metavar="FOLDER", help="results of a run, as results/paper")
    parser.add_argument(
        "--out", metavar="FILE.html", help="file for the page (default: FOLDER/report.html)"
    )
    parser.add_argument("--csv", metavar="FOLDER", help="folder for every table as a CSV file")
    add_quiet(parser)


def report(options: argparse.Namespace, out: TextIO) -> int:
    """Writes the page, and the tables where they are requested."""
    folder = ResultsFolder.opened(Path(options.folder))
    page = render_page(folder)
    path = Path(options.out) if options.out else folder.path / PAGE
    if path.name == PAGE and path.parent.resolve() == folder.path.resolve():
        with alone("FOLDER", folder.path):
            put_text(ResultsFolder.opened(folder.path), PAGE, page)
    else:
        write_text(path, page)
    tables = []
    if options.csv:
        tables = write_tables(read_summary(folder), folder, Path(options.csv))
    document = {"file": str(path), "bytes": len(page.encode()), "tables": [*map(str, tables)]}
    answer(options, document, out, "".join(f"{file}\n" for file in (path, *tables)))
    return 0


COMMANDS = {
    "run": Command("run every stage of a case: files, figures, summary", add_options, run),
    "report": Command("one self-contained HTML page of a run's results", add_page, report),
}
