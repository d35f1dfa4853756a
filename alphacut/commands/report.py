"""Command ``alphacut report``: the results of a run as one self-contained HTML page."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import TextIO

from alphacut.commands.options import add_quiet, answer
from alphacut.io.files import write_text
from alphacut.io.netcdf import read_summary
from alphacut.report.page import report
from alphacut.report.tables import write_tables

ABOUT = "one self-contained HTML page of a run's results"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options of the command."""
    parser.add_argument("folder", metavar="FOLDER", help="results of a run, as results/paper")
    parser.add_argument(
        "--out", metavar="FILE.html", help="file for the page (default: FOLDER/report.html)"
    )
    parser.add_argument("--csv", metavar="FOLDER", help="folder for every table as a CSV file")
    add_quiet(parser)


def run(options: argparse.Namespace, petsc: Mapping[str, str], out: TextIO) -> int:
    """Writes the page, and the tables where they are requested."""
    folder = Path(options.folder)
    path = Path(options.out) if options.out else folder / "report.html"
    page = report(folder)
    write_text(path, page)
    tables = []
    if options.csv:
        tables = write_tables(read_summary(folder), folder, Path(options.csv))
    document = {"file": str(path), "bytes": len(page.encode()), "tables": [*map(str, tables)]}
    answer(options, document, out, "".join(f"{file}\n" for file in (path, *tables)))
    return 0
