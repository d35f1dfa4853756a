"""Command ``alphacut measure-next``: by how much the answer narrows if an input is known better."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import TextIO

from alphacut.case.idle import require_read
from alphacut.case.load import load
from alphacut.commands import options as common
from alphacut.io.files import as_json, write_text
from alphacut.io.progress import progress
from alphacut.io.provenance import digest
from alphacut.io.units import engineering
from alphacut.stages.material.modulus import stand_in
from alphacut.stages.measure_next import advice_document, measure_next
from alphacut.stages.vibration.studies import fixed_line

ABOUT = "by how much the answer narrows if an input is known better"
KEYS = {
    "--fuzzy": common.KeyOption("envelope.fuzzy", "inputs that may be measured, as E,m", "NAMES"),
    "--duration": common.KeyOption("envelope.duration", "length of the simulation", bare="s"),
}
READ = ("frame", "field", "tower", "envelope", "update", "radius", "cell", "mesh", "modulus")


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    common.add_common(parser)
    common.add_keys(parser, KEYS)
    common.add_modulus(parser)
    parser.add_argument(
        "--output", metavar="NAME", help="output whose width is compared (default: the first)"
    )
    parser.add_argument(
        "--out",
        metavar="FOLDER",
        help="write measure-next.json and its figure; the report of a run in FOLDER shows them",
    )


def run(options: argparse.Namespace, petsc: Mapping[str, str], out: TextIO) -> int:
    """Compute again for every input, and report."""
    case = load(options.case, common.changes(options, KEYS))
    require_read(case, ("stages", *READ), "measure-next")
    folder = Path(options.out) if options.out else None
    given = common.given_modulus(options.modulus)
    with progress("Measure next", quiet=options.quiet) as tick:
        name, every, found, fixed = measure_next(
            case, given or stand_in(case), options.output, tick
        )
    sections = case.traces(*READ) | ({"--modulus": digest(given)} if given else {})
    document = {**advice_document(found, name, fixed), "nodes_every": every, "sections": sections}
    if folder is not None:
        from alphacut.figures.questions import gains
        from alphacut.figures.style import save, style

        with style():
            save(gains(document), folder / "figures" / "measure-next")
        write_text(folder / "measure-next.json", as_json(document, indent=2))
    width = engineering(found.width, document["unit"], digits=6)
    of = "width" if name == "E" else f"mean width at nodes every {every:.6g} s"
    lines = [f"{name}: {found.told(f'{of} {width}')}", *fixed_line(fixed)]
    common.answer(options, document, out, "".join(f"{line}\n" for line in lines))
    return 0
