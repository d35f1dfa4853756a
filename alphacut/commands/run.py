"""Commands on runs: ``run`` computes all stages, ``report`` makes a page or compares two runs.

``microstructure``, ``modulus`` and ``identify`` compute one stage each.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Mapping
from pathlib import Path
from typing import TextIO

import pandas as pd

from alphacut.base.arrays import Array
from alphacut.base.errors import RefusedError, require
from alphacut.base.kept_files import locked, write_text
from alphacut.base.number_text import text_table
from alphacut.commands.options import Command, add_common, add_quiet, add_run, write_answer
from alphacut.commands.pipeline import Pipeline, open_results, read_case
from alphacut.fuzzy.campaign.workers import pool
from alphacut.fuzzy.result import Nature
from alphacut.io.files import say
from alphacut.io.provenance import FORMAT, command_line, command_to_paste, versions
from alphacut.io.results import ResultsFolder
from alphacut.io.typed_json import to_document
from alphacut.report import tables
from alphacut.report.page import comparison_page, render_page
from alphacut.report.results import comparison, cut_text, guaranteed_of, run_text, width_text
from alphacut.rve.result.engineering_constants import PLANE_STRAIN
from alphacut.stages.cell import UPPER_BOUND, constant_label, isotropic_label
from alphacut.stages.identify import identify_inputs
from alphacut.stages.image import ImageResult
from alphacut.stages.microstructure import fragment
from alphacut.stages.modulus import ModulusResult
from alphacut.stages.store import CutsResult
from alphacut.stages.summary import SUMMARY, Parts, Results, Summary

PAGE = "report.html"
DEVICES = "where an image is solved: cpu (default), or cuda by CuPy"
ONLY = "Plane strain alone: the other definition is for one particle of two isotropic phases"


def add_modulus(parser: argparse.ArgumentParser, default_place: str = "nothing is kept") -> None:
    """Adds the options of a command that computes stage modulus."""
    add_run(parser, default_place)
    parser.add_argument("--device", choices=("cpu", "cuda"), default="cpu", help=DEVICES)


def add_options(parser: argparse.ArgumentParser) -> None:
    """Adds the options of a run."""
    add_modulus(parser, "results/NAME")
    parser.add_argument("--fresh", action="store_true", help="compute everything anew")
    parser.add_argument("--no-figures", action="store_true", help="numbers only")


def run(options: argparse.Namespace, out: TextIO) -> int:
    """Computes all stages of a case, draws figures and shows tables; returns exit status 0."""
    folder = options.out or f"results/{Path(options.case).stem}"
    start, names, figures = time.perf_counter(), list[str](), not options.no_figures
    with open_results(options, folder) as (case, store):
        if figures:  # before processes are forked, which then need not import it
            from alphacut.figures.all import draw_figures  # which takes time to import
        with pool(store.workers) as executor:
            first = Results(case.content)
            results = Pipeline(first, store, options.petsc, figures, executor, options.device).run()
            if figures:
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
        files = tables.write_tables(summary, folder, Path(options.csv))
    if options.tables:
        files += tables.write_markup(tables.tables(summary), Path(options.tables))
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
        files += tables.write_csv({"comparison": pd.DataFrame(rows)}, Path(options.csv))
    if options.tables:
        files += tables.write_markup({"comparison": table}, Path(options.tables))
    text = text_table(*table) + "".join(f"{file}\n" for file in files)
    write_answer(options, {"rows": rows, "tables": [*map(str, files)]}, out, text)
    return 0


def microstructure(options: argparse.Namespace, out: TextIO) -> int:
    """Computes the radius map of particles, and prints its section [radius]; exit status 0."""
    with open_results(options) as (case, store):
        numbers = Pipeline(Results(case.content), store).compute_microstructure().numbers
    text = fragment(numbers)
    write_answer(options, numbers | {"fragment": text}, out, text)
    return 0


def modulus(options: argparse.Namespace, out: TextIO) -> int:
    """Computes the fuzzy modulus of the cell, and prints its tables; returns exit status 0."""
    with open_results(options) as (case, store):
        results = Results(case.content)
        Pipeline(results, store, options.petsc, device=options.device).compute_modulus()
    result = results.modulus or results.image
    assert result is not None
    part: ModulusResult | ImageResult = result.numbers
    text = text_table(*tables.shown(tables.modulus(part))) + constants_text(part)
    if isinstance(part, ImageResult):
        measured = "area" if len(part.lower_GPa) == 3 else "volume"
        text += "".join(f"{x}: {y:.1%} of the {measured}\n" for x, y in part.fractions.items())
        text += f"{guaranteed_of(part)}\n{width_text(part)}\n"
    else:
        text += f"{UPPER_BOUND}\n" if part.particles == "mesh" else ""
        text += f"{part.samples} samples, {part.solves} linear systems, "
        text += f"{part.seconds:.1f} s, {part.method}\n"
        text += f"{part.solver}\n" if part.solver else ""
    write_answer(options, to_document(part), out, text)
    return 0


def constants_text(part: ModulusResult | ImageResult) -> str:
    """Constants of fibres, along x and y by definition, loss factors, and bounds of isotropic E."""
    groups, nature, proved_losses = part.plane, Nature.GUARANTEED, dict[str, CutsResult]()
    if isinstance(part, ImageResult):
        proved_losses = part.proved_losses
    else:  # of a cell at most E is proved
        groups, nature = {"of fibres": part.fibres, **groups}, Nature.ATTAINED
    text = "".join(cuts_text(name, cuts, part.alpha, nature) for name, cuts in groups.items())
    if [*part.plane] == [PLANE_STRAIN]:
        text += f"{ONLY}\n"
    text += cuts_text("tan δ, to first order in it", proved_losses, part.alpha, nature)
    if (loss := part.loss) is not None:
        rows, levels = [], end_levels(part.alpha)
        for name, cuts in (("E", loss.E), ("G", loss.G), ("K", loss.K)):
            texts = (cut_text(cuts, level, Nature.ATTAINED) for level in levels.values())
            error = f"{loss.error[name]:.1e}" if loss.error else "not declared"
            rows.append((f"loss factor of {name}", *texts, error))
        text += text_table(("tan δ = 2 ζ", *levels, "± error"), rows)
    if bounds := part.references.get("hashin_shtrikman_E_GPa"):
        text += f"{isotropic_label(part.average)}: {bounds[0]:.4f} … {bounds[1]:.4f} GPa\n"
    return text


def end_levels(alpha: Array) -> dict[str, int]:
    """Indices of the lowest and the highest level by their titles."""
    return {f"α = {alpha[level]:g}": level for level in (0, len(alpha) - 1)}


def cuts_text(title: str, cuts: Mapping[str, CutsResult], alpha: Array, nature: Nature) -> str:
    """Table of the lowest and highest cut of each constant; empty where there are none."""
    levels = end_levels(alpha)
    rows = [
        (constant_label(x), *(cut_text(ends, level, nature) for level in levels.values()))
        for x, ends in cuts.items()
    ]
    return text_table((title, *levels), rows) if rows else ""


def identify(options: argparse.Namespace, out: TextIO) -> int:
    """Identifies inputs from measured modes; exit status 0 even if these refute the frame."""
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
