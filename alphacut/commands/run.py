"""Command ``alphacut run``: all stages of a case, with files, figures and summary."""

from __future__ import annotations

import argparse
import time
from collections.abc import Mapping
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import TextIO

from alphacut.case.load import Case
from alphacut.commands import options as common
from alphacut.commands.parser import require_prism
from alphacut.figures.all import drawn
from alphacut.fuzzy.campaign.workers import pool
from alphacut.io.files import Document, as_json, rank, say, write_text
from alphacut.io.output_paths import alone, require_writable
from alphacut.io.provenance import FORMAT, command, door, versions
from alphacut.report.tables import run_text
from alphacut.stages.chain import Chain
from alphacut.stages.store import Store

ABOUT = "run every stage of a case: files, figures, summary"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options of the command."""
    common.add_common(parser)
    common.add_run(parser, "results/NAME")
    parser.add_argument("--fresh", action="store_true", help="compute everything anew")
    parser.add_argument("--no-figures", action="store_true", help="numbers only")


def run(options: argparse.Namespace, petsc: Mapping[str, str], out: TextIO) -> int:
    """Computes, draws, reports."""
    folder = Path(options.out or f"results/{Path(options.case).stem}")
    case, store = common.opened(options)
    store = replace(store, folder=folder, fresh=options.fresh)
    require_prism(petsc, case.content if "modulus" in case.stages else None)
    require_writable("--out", str(folder), folder=True)
    with alone("--out", folder) if rank() == 0 else nullcontext():
        document = computed(case, store, folder, petsc, figures=not options.no_figures)
    common.answer(options, document, out, run_text(document))
    if options.json != "-" and not options.quiet:
        say(f"results are in {folder}, after {document['seconds']:.0f} s")
        if store.taken:
            say(f"{len(dict.fromkeys(store.taken))} of the stages were up to date")
        say(f"next: {door('report', folder)}")
    return 0


def computed(
    case: Case, store: Store, folder: Path, petsc: Mapping[str, str], *, figures: bool
) -> Document:
    """The numbers and figures of a case; summary.json is written last."""
    start = time.perf_counter()
    with pool(store.workers) as executor:
        results = Chain(case.content, store, petsc, figures, executor).run()
        look = {"fresh": store.fresh, "quiet": store.quiet}
        names = drawn(results, folder, executor, **look) if figures else []
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
        "fingerprints": {x: data.attrs["fingerprint"] for x, data in results.datasets.items()},
    }
    write_text(folder / "summary.json", as_json(document, indent=2))
    return document
