"""Command ``alphacut microstructure``: from particles to the fuzzy radius map."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import TextIO

from alphacut.case.load import load
from alphacut.commands.options import add_common, add_workers, answer, require_workers
from alphacut.fuzzy.refused import RefusedError
from alphacut.stages import microstructure
from alphacut.stages.store import Store

ABOUT = "from particles, packed or measured, to the random radius and its fuzzy map"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options of the command."""
    add_common(parser)
    add_workers(parser)
    parser.add_argument(
        "--out", metavar="FOLDER", help="folder for radius.toml, microstructure.nc and figures"
    )


def run(options: argparse.Namespace, petsc: Mapping[str, str], out: TextIO) -> int:
    """Computes the map, writes it and prints the section [radius]."""
    require_workers(options.workers)
    case = load(options.case, options.set)
    section, cell = case.content.microstructure, case.content.round
    if section is None:
        raise RefusedError("microstructure", None, "a section [microstructure]")
    spheres = cell is not None and cell.particles == "spheres"
    stage = microstructure.stage(section, spheres=spheres)
    if options.out:
        folder = Path(options.out)
        data = Store(folder, case.text, True, options.quiet, options.workers).take(stage)
    else:
        data = stage.once(workers=options.workers, quiet=options.quiet)
    fragment = str(data.attrs["radius"])
    answer(options, microstructure.document(data) | {"fragment": fragment}, out, fragment)
    return 0
