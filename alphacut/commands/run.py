"""Commands on runs: ``run`` computes all stages, ``report`` makes a page or compares two runs.

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
from alphacut.commands.options import Command, add_common, add_quiet, add_run, write_answer
from alphacut.commands.pipeline import Pipeline, open_results, read_case
from alphacut.fuzzy.campaign.workers import pool
from alphacut.io.files import say
from alphacut.io.provenance import FORMAT, command_line, command_to_paste, versions
from alphacut.io.results import ResultsFolder
from alphacut.io.typed_json import to_document
from alphacut.report import tables
from alphacut.report.page import comparison_page, render_page
from alphacut.report.results import (
    comparison,
    fractions_text,
    guaranteed_of,
    material,
    run_text,
    width_text,
)
from alphacut.rve.result.engineering_constants import PLANE_STRAIN
from alphacut.stages.cell import UPPER_BOUND, isotropic_label
from alphacut.stages.identify import identify_inputs
from alphacut.stages.image import ImageResult
from alphacut.stages.microstructure import fragment
from alphacut.stages.modulus import ModulusResult
from alphacut.stages.summary import SUMMARY, Parts, Results, Summary

PAGE = "report.html"


def add_modulus(parser: argparse.ArgumentParser, default_place: str = "nothing is kept") -> None:
    """Add the options of a command that computes stage modulus."""
    add_run(parser, default_place)
    about = "where an image is solved: cpu (default), or cuda by CuPy"
    parser.add_argument("--device", choices=("cpu", "cuda"), default="cpu", help=about)


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of a run."""
    add_modulus(parser, "results/NAME")
    parser.add_argument("--fresh", action="store_true", help="compute everything anew")
    parser.add_argument("--no-figures", action="store_true", help="numbers only")


def run(options: argparse.Namespace, out: TextIO) -> int:
    """Compute all stages of a case, draw figures, and show tables; return exit status 0."""
    folder = options.out or f"results/{Path(options.case).stem}"
    start, names = time.perf_counter(), list[str]()
    has_figures = not options.no_figures
    with open_results(options, folder) as (case, store):
        with pool(store.workers) as executor:
            results = Pipeline(
                Results(case.content), store, options.petsc, has_figures, executor, options.device
            ).run()
        if has_figures:
            from alphacut.figures.all import draw_figures  # whose libraries take time to import

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
        store.put_text(SUMMARY, summary.to_json())
    write_answer(options, summary.parts(), out, run_text(summary))
    if options.json != "-" and not options.quiet:
        say(f"results are in {folder}, after {summary.seconds:.0f} s")
        if store.up_to_date:
            say(f"{len(store.up_to_date)} of the stages were up to date")
        say(f"next: {command_to_paste('report', folder)}")
    return 0


def add_page(parser: argparse.ArgumentParser) -> None:
    """Add the options of a report."""
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
    """Write the page of a run and the tables requested, or compare two; return exit status 0."""
    if len(options.folder) > 1:
        return compare(options, out)
    folder = ResultsFolder.read(Path(options.folder[0]))
    page = render_page(folder)
    path = Path(options.out) if options.out else folder.path / PAGE
    if path.name == PAGE and path.parent.resolve() == folder.path.resolve():
        # A page within the folder is listed among its files, which a run must not write meanwhile.
        with locked("FOLDER", folder.path):
            ResultsFolder.read(folder.path).put_text(PAGE, page)
    else:
        write_text(path, page)
    summary, files = Summary.read(folder), list[Path]()
    if options.csv:
        files = tables.write_tables(summary, folder, Path(options.csv))
    if options.tables:
        files += tables.write_markup(tables.tables(summary), Path(options.tables))
    document = {"file": str(path), "bytes": len(page.encode()), "tables": [*map(str, files)]}
    write_answer(options, document, out, "".join(f"{file}\n" for file in (path, *files)))
    return 0


def compare(options: argparse.Namespace, out: TextIO) -> int:
    """Show two runs side by side, and write the files requested; return exit status 0."""
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
        files += tables.write_csv({"comparison": pd.DataFrame(rows)}, Path(options.csv))
    if options.tables:
        files += tables.write_markup({"comparison": table}, Path(options.tables))
    text = text_table(*table) + "".join(f"{file}\n" for file in files)
    write_answer(options, {"rows": rows, "tables": [*map(str, files)]}, out, text)
    return 0


def microstructure(options: argparse.Namespace, out: TextIO) -> int:
    """Compute the radius map of particles, and print its section [radius]; return exit status 0."""
    with open_results(options) as (case, store):
        numbers = Pipeline(Results(case.content), store).compute_microstructure().numbers
    text = fragment(numbers)
    write_answer(options, numbers | {"fragment": text}, out, text)
    return 0


def modulus(options: argparse.Namespace, out: TextIO) -> int:
    """Compute the fuzzy modulus of the cell or image, print its tables; return exit status 0."""
    with open_results(options) as (case, store):
        results = Results(case.content)
        Pipeline(results, store, options.petsc, device=options.device).compute_modulus()
    if results.image is not None:
        image = results.image.numbers
        part: ModulusResult | ImageResult = image
        constants = material(Parts(image=image), every_constant=True)
        lines = [fractions_text(image), guaranteed_of(image), width_text(image)]
    else:
        assert results.modulus is not None
        part = cell = results.modulus.numbers
        constants = material(Parts(modulus=cell), every_constant=True)
        cost = f"{cell.samples} samples, {cell.solves} linear systems, {cell.seconds:.1f} s"
        lines = [UPPER_BOUND] if cell.particles == "mesh" else []
        lines += [f"{cost}, {cell.method}"] + ([cell.solver] if cell.solver else [])
        if [*cell.plane] == [PLANE_STRAIN]:
            why = "the other definition is for one particle of two isotropic phases"
            lines.insert(0, f"Plane strain alone: {why}")
    if bounds := part.references.get("hashin_shtrikman_E_GPa"):
        lower, upper = bounds
        lines.insert(0, f"{isotropic_label(part.average)}: {lower:.4f} … {upper:.4f} GPa")
    text = text_table(*tables.shown(tables.modulus(part))) + text_table(*constants)
    write_answer(options, to_document(part), out, text + "".join(f"{line}\n" for line in lines))
    return 0


def identify(options: argparse.Namespace, out: TextIO) -> int:
    """Identify inputs from measured modes; return exit status 0 even if these refute the frame."""
    content = read_case(options).content
    section = content.structure_section
    if content.identify is None or section is None or content.envelope is None:
        raise RefusedError("identify", None, "sections [identify], [frame] and [envelope]")
    alpha, structure = content.envelope.alpha, section.nominal
    learned, _ = identify_inputs(content.identify, structure, alpha)
    write_answer(options, to_document(learned), out, run_text(Parts(update=learned)))
    return 0


COMMANDS = {
    "microstructure": Command(
        "from particles, packed or measured, to the random radius and its fuzzy map",
        add_run,
        microstructure,
    ),
    "modulus": Command("fuzzy effective modulus of the cell or of the image", add_modulus, modulus),
    "identify": Command("inputs of a frame from its measured natural modes", add_common, identify),
    "run": Command("run every stage of a case: files, figures, summary", add_options, run),
    "report": Command("one self-contained HTML page of a run's results", add_page, report),
}
