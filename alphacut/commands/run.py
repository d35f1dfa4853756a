"""Commands on runs: ``run`` computes all stages, ``report`` makes a page or compares several.

``microstructure``, ``modulus`` and ``identify`` compute one stage each.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import TextIO

import pandas as pd

from alphacut.base.errors import RefusedError, require
from alphacut.base.kept_files import locked, write_text
from alphacut.base.number_text import text_table
from alphacut.commands.options import read_case, write_answer
from alphacut.commands.pipeline import Pipeline, open_results
from alphacut.fuzzy.campaign.workers import pool
from alphacut.io.files import as_json, say
from alphacut.io.provenance import FORMAT, command_line, command_to_paste, versions
from alphacut.io.results import ResultsFolder
from alphacut.io.typed_json import to_document
from alphacut.report import tables
from alphacut.report.page import comparison_page, render_page
from alphacut.report.results import (
    compared,
    comparison,
    run_text,
)
from alphacut.stages.identify import identify_inputs
from alphacut.stages.microstructure import fragment
from alphacut.stages.summary import SUMMARY, Parts, Results, Summary


def run(options: argparse.Namespace, out: TextIO) -> int:
    """Compute all stages of a case, keep results and figures in a folder, and show tables.

    Args:
        options: Of the command line: the case file `case` with its changes `set`, the folder `out`
            (by default results/NAME of the case), `fresh` to compute everything anew, `no_figures`,
            `workers`, `device`, PETSc's options `petsc`, `json` and `quiet`.
        out: Takes the tables, or the JSON document with ``--json -``.

    Returns:
        Exit status 0.

    Raises:
        BadInput: The case is not valid.
        RefusedError: An option does not fit the case, or the folder holds other files.
        FailedError: A computation failed, or an error exceeds a tolerance. Finished stages are
            kept.
        CampaignError: Samples of a cell failed. The others are kept.
    """
    folder = options.out or f"results/{Path(options.case).stem}"
    start = time.perf_counter()
    names = list[str]()
    has_figures = not options.no_figures
    # The lock on the folder is held until the summary is written, so that all files are of one run.
    with open_results(options, folder) as (case, store):
        with pool(store.workers) as executor:
            results = Pipeline(
                Results(case.content),
                store,
                petsc=options.petsc,
                figures=has_figures,
                executor=executor,
                device=options.device,
            ).run()
        if has_figures:
            from alphacut.figures.all import draw_figures  # Matplotlib takes a second to import

            names = draw_figures(results, store)
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
        store.put_text(SUMMARY, as_json(summary.parts(), indent=2))
    write_answer(options, summary.parts(), out, run_text(summary))
    if options.json != "-" and not options.quiet:
        say(f"results are in {folder}, after {summary.seconds:.0f} s")
        if store.up_to_date:
            say(f"{len(store.up_to_date)} of the stages were up to date")
        say(f"next: {command_to_paste('report', folder)}")
    return 0


def report(options: argparse.Namespace, out: TextIO) -> int:
    """Write the HTML page of a run, and the tables requested; or compare several runs.

    Args:
        options: Of the command line: `folder`, a list with one folder of results, or more to
            compare; the file `out` of the page or None; the folders `csv` and `tables` or None;
            `json` and `quiet`.
        out: Takes the names of the files, or the JSON document with ``--json -``.

    Returns:
        Exit status 0.

    Raises:
        RefusedError: Results are missing, damaged or of different runs; or another process writes
            into the folder.
        OSError: A file cannot be written.
    """
    if len(options.folder) > 1:
        return compare(options, out)
    folder = ResultsFolder.read(Path(options.folder[0]))
    page = render_page(folder)
    page_name = "report.html"
    path = folder.path / page_name
    if options.out:
        path = Path(options.out)
    if path.name == page_name and path.parent.resolve() == folder.path.resolve():
        # A page within the folder is listed among its files, which a run must not write meanwhile.
        with locked("FOLDER", folder.path):
            ResultsFolder.read(folder.path).put_text(page_name, page)
    else:
        write_text(path, page)
    summary = Summary.read(folder)
    files = list[Path]()
    if options.csv:
        files = tables.write_tables(summary, folder, Path(options.csv))
    if options.tables:
        files += tables.write_markup(tables.tables(summary), Path(options.tables))
    names = [str(file) for file in files]
    document = {"file": str(path), "bytes": len(page.encode()), "tables": names}
    write_answer(options, document, out, "".join(f"{file}\n" for file in [str(path), *names]))
    return 0


def compare(options: argparse.Namespace, out: TextIO) -> int:
    """Show several runs side by side, and write the files requested.

    Args:
        options: Of the command line: `folder`, a list of two folders of results or more; the file
            `out` of an HTML page, and the folders `csv` and `tables`, or None; `json` and `quiet`.
        out: Takes the table and the names of the files, or the JSON document with ``--json -``.

    Returns:
        Exit status 0.

    Raises:
        RefusedError: Results are missing or damaged, or have no quantity in common.
        OSError: A file cannot be written.
    """
    folders = options.folder
    runs = [Summary.read(ResultsFolder.read(Path(name))) for name in folders]
    rows = compared(runs)
    require(bool(rows), "FOLDER", " and ".join(folders), "runs with a quantity in common")
    table = comparison(rows)
    files = list[Path]()
    if options.out:
        write_text(Path(options.out), comparison_page(runs, table))
        files.append(Path(options.out))
    if options.csv:
        files += tables.write_csv({"comparison": pd.DataFrame(rows)}, Path(options.csv))
    if options.tables:
        files += tables.write_markup({"comparison": table}, Path(options.tables))
    names = [str(file) for file in files]
    text = text_table(table.head, table.rows) + "".join(f"{name}\n" for name in names)
    write_answer(options, {"rows": rows, "tables": names}, out, text)
    return 0


def microstructure(options: argparse.Namespace, out: TextIO) -> int:
    """Compute the radius map of particles, and print its section [radius]; return exit status 0."""
    with open_results(options) as (case, store):
        numbers = Pipeline(Results(case.content), store).compute_microstructure().numbers
    text = fragment(numbers)
    write_answer(options, numbers | {"fragment": text}, out, text)
    return 0


def modulus(options: argparse.Namespace, out: TextIO) -> int:
    """Compute the fuzzy modulus of the cell or image of a case, and show its tables.

    Args:
        options: Of the command line: the case file `case` with its changes `set`, the folder `out`
            for results or None to keep none, `workers`, `device`, PETSc's options `petsc`, `json`
            and `quiet`.
        out: Takes the tables of α-cuts and of all constants, and sentences on them; or the JSON
            document with ``--json -``.

    Returns:
        Exit status 0.

    Raises:
        BadInput: The case is not valid.
        RefusedError: The case has no cell, or an option does not fit it.
        FailedError: A linear system was not solved, or the error exceeds the tolerance of the case.
        CampaignError: Samples failed.
    """
    with open_results(options) as (case, store):
        results = Results(case.content)
        Pipeline(results, store, options.petsc, device=options.device).compute_modulus()
    parts = Parts.of(results)
    part = parts.image or parts.modulus
    assert part is not None
    cuts = tables.shown(tables.modulus(part))
    text = text_table(cuts.head, cuts.rows) + run_text(parts, every_constant=True)
    write_answer(options, to_document(part), out, text)
    return 0


def identify(options: argparse.Namespace, out: TextIO) -> int:
    """Identify inputs of a structure from measured modes, and show what was learned.

    Args:
        options: Of the command line: the case file `case` with its changes `set`, PETSc's options
            `petsc`, `json` and `quiet`.
        out: Takes the table, or the JSON document with ``--json -``.

    Returns:
        Exit status 0, even if the measurement refutes the structure: that is a result.

    Raises:
        BadInput: The case is not valid.
        RefusedError: The case lacks [identify], a structure or [envelope]; the file of the modes is
            not read; or measurement and structure do not fit.
    """
    content = read_case(options).content
    section = content.structure_section
    if content.identify is None or section is None or content.envelope is None:
        raise RefusedError("identify", None, "sections [identify], [frame] and [envelope]")
    alpha = content.envelope.alpha
    structure = section.nominal
    learned, _ = identify_inputs(content.identify, structure, alpha)
    write_answer(options, to_document(learned), out, run_text(Parts(update=learned)))
    return 0
