"""Command ``alphacut envelope``: fuzzy dynamics."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from typing import TextIO

from alphacut.commands import options as common
from alphacut.report.tables import run_text
from alphacut.stages.chain import Chain
from alphacut.stages.results import Results

ABOUT = "envelopes of the structure's vibration on every α-cut"
KEYS = {
    "--fuzzy": ("envelope.fuzzy", "inputs that are fuzzy, as E,m"),
    "--duration": ("envelope.duration", "length of the simulation, as '5 s'"),
    "--method": ("envelope.method", "as the key, for example proof, search or graph-follower"),
}


def arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options of the command."""
    common.add_common(parser)
    common.add_keys(parser, KEYS)
    common.add_modulus(parser)
    common.add_run(parser)


def run(options: argparse.Namespace, petsc: Mapping[str, str], out: TextIO) -> int:
    """Computes and reports."""
    case, store = common.opened(options, KEYS)
    chain, results = Chain(case.content, store), Results(case.content)
    chain.motion(results, chain.structure(common.modulus_option(options.modulus)), studies=False)
    document = results.document()
    common.answer(options, document["envelopes"]["all"], out, run_text(document))
    return 0
