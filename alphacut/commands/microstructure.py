"""Command ``alphacut microstructure``: from particles to the fuzzy radius map."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import TextIO

from alphacut.case.load import load
from alphacut.commands.options import add_common, add_workers, answer, require_workers
from alphacut.io.progress import progress
from alphacut.io.provenance import attributes, fingerprint, versions
from alphacut.stages.material import microstructure

ABOUT = "from particles, packed or measured, to the random radius and its fuzzy map"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options of the command."""
    add_common(parser)
    add_workers(parser)
    parser.add_argument(
        "--out", metavar="FOLDER", help="write radius.toml, microstructure.nc and figures here"
    )


def run(options: argparse.Namespace, petsc: Mapping[str, str], out: TextIO) -> int:
    """Computes the map, writes it and prints the section [radius]."""
    from alphacut.stochastic.microstructure_summary import fragment, summary

    require_workers(options.workers)
    case = load(options.case, options.set)
    with progress("Microstructure", quiet=options.quiet) as tick:
        map_of = microstructure.compute(case, workers=options.workers, progress=tick)
    files: list[str] = []
    if options.out:
        key = fingerprint({"case": case.sections}, ("stochastic",))
        facts = attributes(case.text_of_file, key)
        files = microstructure.write(map_of, Path(options.out), facts)
    section = fragment(map_of)
    document = {**summary(map_of), "fragment": section, "files": files, "versions": versions()}
    answer(options, document, out, section)
    return 0
