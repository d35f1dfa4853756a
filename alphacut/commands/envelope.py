"""Command ``alphacut envelope``, also ``python -m frame envelope``: fuzzy dynamics."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import TextIO

from alphacut.case.load import load
from alphacut.commands import options as common
from alphacut.io.files import Document
from alphacut.io.kept_arrays import KeptArrays
from alphacut.io.progress import progress
from alphacut.io.provenance import fingerprint
from alphacut.stages.material.modulus import stand_in
from alphacut.stages.summary import envelope_numbers
from alphacut.stages.vibration import envelope
from alphacut.stages.vibration.envelope_task import task_of
from alphacut.stages.vibration.structure import structure
from alphacut.stages.vibration.studies import envelope_of
from alphacut.stages.words import motion_table

ABOUT = "envelopes of the structure's vibration on every α-cut"
KEYS = {
    "--fuzzy": ("envelope.fuzzy", "inputs that are fuzzy, as E,m"),
    "--duration": ("envelope.duration", "length of the simulation, as '5 s'"),
    "--method": ("envelope.method", "auto, modal, graph-follower …"),
}


def arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options of the command."""
    common.add_common(parser)
    common.add_keys(parser, KEYS)
    common.add_modulus(parser)
    common.add_workers(parser)
    parser.add_argument("--out", metavar="FILE.nc", help="write the envelopes as NetCDF")


def run(options: argparse.Namespace, petsc: Mapping[str, str], out: TextIO) -> int:
    """Computes and reports."""
    common.require_workers(options.workers)
    case = load(options.case, common.changes(options, KEYS))
    number = common.modulus_option(options.modulus) or stand_in(case)
    task, model = task_of(case), structure(case, number)
    content = {"case": case.sections, "task": task, "modulus": number}
    content["files"] = case.digests(*case.sections.files)
    key = fingerprint(content, ("fuzzy", "frame"))
    path = Path(options.out) if options.out else None
    kept = KeptArrays(path.with_suffix(".partial.npz"), key) if path else None
    with progress("Envelopes", quiet=options.quiet) as tick:
        dataset = envelope_of(model, task, kept, workers=options.workers, progress=tick)
    envelope.keep_tolerance(case, dataset)
    if path and kept:
        envelope.write(dataset, path, case_text=case.text_of_file, key=key)
        kept.done()
    document: Document = envelope_numbers(dataset)
    common.answer(options, document, out, motion_table("all", document))
    return 0
