"""Command ``alphacut envelope``, also ``python -m frame envelope``: fuzzy dynamics."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import TextIO

from alphacut.case.load import load
from alphacut.commands import options as common
from alphacut.fuzzy.refused import RefusedError
from alphacut.io.netcdf import write_dataset
from alphacut.io.provenance import attributes
from alphacut.report.results import run_text
from alphacut.stages import envelope

ABOUT = "envelopes of the structure's vibration on every α-cut"
KEYS = {
    "--fuzzy": ("envelope.fuzzy", "inputs that are fuzzy, as E,m"),
    "--duration": ("envelope.duration", "length of the simulation, as '5 s'"),
    "--method": ("envelope.method", "auto, proof, search, graph-follower, improved-graph-follower"),
}


def arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options of the command."""
    common.add_common(parser)
    common.add_keys(parser, KEYS)
    common.add_modulus(parser)
    parser.add_argument("--out", metavar="FILE.nc", help="NetCDF file for the envelopes")


def run(options: argparse.Namespace, petsc: Mapping[str, str], out: TextIO) -> int:
    """Computes and reports."""
    case = load(options.case, common.changes(options, KEYS))
    content, number = case.content, common.modulus_option(options.modulus)
    section = content.frame or content.pendulum
    if section is None or content.envelope is None:
        raise RefusedError("envelope", None, "a structure and a section [envelope]")
    if number is None and content.frame and not content.frame.is_whole:
        raise RefusedError("frame.modulus", None, "a modulus, or --modulus FILE.nc")
    structure = section.structure(number)
    (task,) = envelope.tasks(content.envelope, ())
    stage = envelope.stage(structure, task)
    path = Path(options.out) if options.out else None
    data = stage.once(quiet=options.quiet, kept=path.parent if path else None)
    envelope.require_tolerance(data, task, structure)
    if path:
        write_dataset(data, path, attributes(case.text, stage.key))
    document = envelope.document(data, task.fuzzy)
    common.answer(options, document, out, run_text({"envelopes": {"all": document}}))
    return 0
