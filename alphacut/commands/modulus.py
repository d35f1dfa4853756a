"""Command ``alphacut modulus``, also ``python -m fuzzy modulus``: the fuzzy modulus."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TextIO

from alphacut.case.case import Case
from alphacut.case.load import load
from alphacut.commands import options as common
from alphacut.io.files import Document
from alphacut.io.progress import progress
from alphacut.io.provenance import attributes, fingerprint
from alphacut.io.text_table import text_table
from alphacut.io.units import fixed
from alphacut.stages.image import bounds
from alphacut.stages.image import document as image
from alphacut.stages.image.reading import study_of
from alphacut.stages.material import modulus
from alphacut.stages.material.campaign import campaign
from alphacut.stages.material.references import references
from alphacut.stages.tolerance import require_modulus

ABOUT = "fuzzy effective modulus of the cell or of the image"
KEYS = {
    "--method": common.SAMPLE["--method"],
    "--plan": ("modulus.plan", "general, reduced, extended or signed"),
    "--alpha": ("modulus.alpha", "levels, as 0,0.5,1"),
}


def arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options of the command."""
    common.add_common(parser)
    common.add_keys(parser, KEYS)
    common.add_workers(parser)
    parser.add_argument("--out", metavar="FILE.nc", help="write α-cuts and samples as NetCDF")
    parser.add_argument(
        "--store", metavar="FILE", help="keep every sample; the same command goes on from there"
    )


def run(options: argparse.Namespace, petsc: Mapping[str, str], out: TextIO) -> int:
    """Computes and reports."""
    common.require_workers(options.workers)
    case = load(options.case, common.changes(options, KEYS))
    if case.sections.picture:
        return run_image(options, case, out, alpha=case.modulus.alpha)
    store = Path(options.store) if options.store else None
    task = campaign(case, petsc=petsc, store=store)
    with progress("Fuzzy modulus", quiet=options.quiet) as tick:
        result = modulus.compute(task, workers=options.workers, progress=tick)
    require_modulus(case, sum(result.error.values()))
    document = {
        **result.document(),
        "model": task.task.choice.words,
        "references": references(case),
    }
    if options.out:
        key = fingerprint({"case": case.sections}, ("stochastic", "rve", "fuzzy"))
        modulus.write(result, options.out, case_text=case.text_of_file, key=key)
    common.answer(options, document, out, summary(document))
    return 0


def run_image(
    options: argparse.Namespace, case: Case, out: TextIO, *, alpha: Sequence[float]
) -> int:
    """Proves bounds of an image's modulus at some levels, and reports."""
    study = replace(study_of(case), alpha=tuple(alpha))
    path = getattr(options, "out", None)
    partial = Path(path).with_suffix(".partial") if path else None
    with progress("Image", quiet=options.quiet) as tick:
        result = bounds.compute(study, progress=tick, kept=partial)
    if path and partial:
        content = {"case": case.sections, "files": case.digests(case.picture)}
        key = fingerprint(content, ("stochastic", "rve", "fuzzy"))
        image.write(result, Path(path), attributes(case.text_of_file, key), partial)
    document = image.document(result)
    common.answer(options, document, out, image_summary(document))
    return 0


def image_summary(document: Document) -> str:
    """The proved α-cuts as a table, and the phases."""
    cuts = document["cuts"]
    ends = (cuts["E_GPa"]["lower"], cuts["E_GPa"]["upper"])
    rows = [
        (f"{a:g}", fixed(low, 5), fixed(high, 5), nature)
        for a, low, high, nature in zip(cuts["alpha"], *ends, cuts["nature"], strict=True)
    ]
    table = text_table(("α", "lower E, GPa", "upper E, GPa", "nature"), rows)
    return table + "".join(f"{line}\n" for line in document["phases"])


def summary(document: Document) -> str:
    """The α-cuts as a table, and what they cost."""
    columns = [document[key][side] for key in ("E_GPa", "nu") for side in ("lower", "upper")]
    rows = [
        (f"{alpha:g}", *(fixed(float(x), 5) for x in ends))
        for alpha, *ends in zip(document["alpha"], *columns, strict=True)
    ]
    head = ("α", "lower E, GPa", "upper E, GPa", "lower ν", "upper ν")
    low, high = document["references"]["hashin_shtrikman_E_GPa"]
    return text_table(head, rows) + (
        f"{document['nature']}; error of the cell's model {sum(document['error'].values()):.1e}"
        f" of E\nHashin–Shtrikman bounds of E at the modal values: {low:.4f} … {high:.4f} GPa\n"
        f"{document['samples']} samples, {document['solves']} linear systems,"
        f" {document['seconds']:.1f} s, {document['method']}\n"
    )
