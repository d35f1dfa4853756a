"""Command ``alphacut run``: all stages of a case, with files, figures and summary."""

from __future__ import annotations

import argparse
import time
from collections.abc import Mapping
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any, TextIO

from alphacut.case.load import load
from alphacut.commands import options as common
from alphacut.figures.showing import Showing
from alphacut.fuzzy.campaign.workers import pool
from alphacut.io.files import as_json, rank, say, write_text
from alphacut.io.netcdf import fingerprint_of, stored
from alphacut.io.output_paths import alone, unwritable
from alphacut.io.problem import refuse
from alphacut.io.provenance import door
from alphacut.stages import summary
from alphacut.stages import width_shares as shares
from alphacut.stages.pipeline import Chain
from alphacut.stages.words import run_tables

ABOUT = "run every stage of a case: files, figures, summary"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options of the command."""
    common.add_common(parser)
    common.add_workers(parser)
    parser.add_argument("--out", metavar="FOLDER", help="where results go (default: results/NAME)")
    parser.add_argument("--fresh", action="store_true", help="compute everything anew")
    parser.add_argument("--no-figures", action="store_true", help="numbers only")


def run(options: argparse.Namespace, petsc: Mapping[str, str], out: TextIO) -> int:
    """Computes, draws, reports."""
    common.require_workers(options.workers)
    case, folder = load(options.case, options.set), folder_of(options)
    refuse(unwritable("--out", folder, folder=True))
    chain = Chain(case, folder, options.workers, options.fresh, options.quiet, petsc)
    with alone("--out", folder) if rank() == 0 else nullcontext():
        return computed(options, chain, out)


def computed(options: argparse.Namespace, chain: Chain, out: TextIO) -> int:
    """The numbers and figures of a chain, and its answer."""
    start = time.perf_counter()
    with pool(chain.workers) as executor:
        showing = Showing(chain, not options.no_figures, executor)
        results = replace(chain, executor=executor, meanwhile=showing.begin).run()
        drawn, driving = showing.drawn(results), showing.driving()
    document: dict[str, Any] = {
        **summary.summary(results),
        "shares": shares.mean_shares(driving),
        **({"changes": options.set} if options.set else {}),
        "sections": chain.case.traces(),
        "figures": drawn,
        "seconds": time.perf_counter() - start,
    }
    document["fingerprints"] = {x: fingerprint_of(chain.file(x)) for x in stored(document)}
    write_text(chain.file("summary.json"), as_json(document, indent=2))
    common.answer(options, document, out, run_tables(document))
    if options.json != "-" and not options.quiet:
        say(f"results are in {chain.folder}, after {document['seconds']:.0f} s")
        say(f"next: {door('report', chain.folder)}")
    return 0


def folder_of(options: argparse.Namespace) -> Path:
    """Folder where results go."""
    return Path(options.out or f"results/{Path(options.case).stem}")
