"""``alphacut repair``: drop what is damaged in a store of samples."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import TextIO

from alphacut.commands.options import add_flag
from alphacut.fuzzy import Store
from alphacut.io.problem import BadInput

ABOUT = "drop what is damaged in a store of samples; the next run computes only that anew"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parser.add_argument("file", metavar="STORE", help="as results/NAME/samples.db")
    add_flag(parser, "--quiet", "print nothing")


def run(options: argparse.Namespace, petsc: Mapping[str, str], out: TextIO) -> int:
    """Repair and report."""
    path = Path(options.file)
    if not path.is_file():
        raise BadInput.of("STORE", "there is no such file", str(path), "a store of samples")
    try:
        with Store(path) as store:
            done = store.repair()
    except ValueError as error:
        raise BadInput.of("STORE", str(error), str(path), "a store of samples") from None
    if not options.quiet:
        out.write(
            f"{done.kept} records are whole; {done.size} bytes at {done.places} places were"
            " dropped\n"
        )
    return 0
