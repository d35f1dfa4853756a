"""Command ``alphacut microstructure``: from particles to the fuzzy radius map."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import TextIO

from alphacut.case.idle import require_read
from alphacut.case.load import load
from alphacut.commands.options import add_common, add_flag, add_workers, answer, check_workers
from alphacut.io.files import say
from alphacut.io.problem import BadInput
from alphacut.io.progress import progress
from alphacut.io.provenance import attributes, door, fingerprint, versions
from alphacut.stages.material import microstructure

ABOUT = "from particles, packed or measured, to the random radius and its fuzzy map"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    add_common(parser)
    add_workers(parser)
    parser.add_argument(
        "--out",
        metavar="FOLDER",
        help="write radius.toml (a case fragment), microstructure.nc and figures here",
    )
    add_flag(parser, "--no-figures", "numbers only")


def run(options: argparse.Namespace, petsc: Mapping[str, str], out: TextIO) -> int:
    """Compute, write, report."""
    from alphacut.stochastic.microstructure_summary import fragment, summary

    check_workers(options.workers)
    case = load(options.case, options.set)
    require_read(case, ("microstructure",), "microstructure")
    if options.no_figures and not options.out:
        raise BadInput.of("--no-figures", "there are none without --out", allowed="beside --out")
    for remark in microstructure.dense_remark(case):
        say(f"warning: {remark}")
    with progress("Microstructure", quiet=options.quiet) as tick:
        found = microstructure.compute(case, workers=options.workers, progress=tick, quiet=True)
    written: list[str] = []
    if options.out:
        key = fingerprint({"case": case.sections}, ("stochastic",))
        written = microstructure.write(
            found,
            Path(options.out),
            attributes(case.text_of_file, key),
            figures=not options.no_figures,
        )
    section = fragment(found)
    document = {**summary(found), "fragment": section, "files": written, "versions": versions()}
    for remark in microstructure.findings(case, found):
        say(remark)
    if answer(options, document, out, section):
        advise(section, options.out)
    return 0


def advise(fragment: str, folder: str | None) -> None:
    """Say what the fragment is for, and warn of a slope that came out crisp."""
    for remark in microstructure.crisp_slopes(fragment):
        say(remark)
    place = (
        f"{folder}/radius.toml" if folder else "this section (--out FOLDER keeps it as radius.toml)"
    )
    say(
        f"next: put {place} in place of [radius] of a case with [cell] and [mesh], then {door()}"
        " modulus CASE"
    )
