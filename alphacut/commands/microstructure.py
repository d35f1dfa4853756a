"""Command ``alphacut microstructure``: from particles to the fuzzy radius map."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from typing import TextIO

from alphacut.commands.options import add_common, add_run, answer, opened
from alphacut.io.netcdf import document_of
from alphacut.stages.chain import Chain

ABOUT = "from particles, packed or measured, to the random radius and its fuzzy map"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options of the command."""
    add_common(parser)
    add_run(parser)


def run(options: argparse.Namespace, petsc: Mapping[str, str], out: TextIO) -> int:
    """Computes the map, writes it and prints the section [radius]."""
    case, store = opened(options)
    data = Chain(case.content, store).particles()
    fragment = str(data.attrs["radius"])
    answer(options, document_of(data) | {"fragment": fragment}, out, fragment)
    return 0
