"""Command ``alphacut modulus``, also ``python -m fuzzy modulus``: the fuzzy modulus."""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

from alphacut.case.load import load
from alphacut.commands import options as common
from alphacut.fuzzy.refused import RefusedError
from alphacut.io.files import Document
from alphacut.io.netcdf import write_dataset
from alphacut.io.provenance import attributes
from alphacut.io.text_table import text_table
from alphacut.io.units import between, ends
from alphacut.report.results import ISOTROPIC, fibre_label, nature_of, width_text
from alphacut.stages import cell, image, modulus
from alphacut.stages.store import Stage

if TYPE_CHECKING:
    from alphacut.case.content import Content

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
    parser.add_argument(
        "--out",
        metavar="FILE.nc",
        help="NetCDF file for α-cuts and samples; samples.db beside it goes on after a stop",
    )


def run(options: argparse.Namespace, petsc: Mapping[str, str], out: TextIO) -> int:
    """Computes and reports."""
    common.require_workers(options.workers)
    case = load(options.case, common.changes(options, KEYS))
    content, path = case.content, Path(options.out) if options.out else None
    common.require_prism(petsc, content)
    stage = stage_of(content, petsc)
    kept = path.parent if path else None
    data = stage.once(workers=options.workers, quiet=options.quiet, kept=kept)
    if path:
        write_dataset(data, path, attributes(case.text, stage.key))
    if content.picture is not None:
        document: Document = json.loads(data.attrs["document"])
        common.answer(options, document, out, image_table(document))
        return 0
    assert content.radius is not None
    assert content.round is not None
    cell.require_tolerance(modulus.listed(data, "error"), content.modulus.tolerance)
    beside = cell.references(content.radius, content.round)
    document = modulus.document(data) | {"references": beside}
    common.answer(options, document, out, summary(document))
    return 0


def stage_of(content: Content, petsc: Mapping[str, str]) -> Stage:
    """The stage of the cell that a case has.

    Raises:
        RefusedError: It has none.
    """
    if content.picture is not None:
        return image.stage(content.picture, content.modulus.alpha, content.modulus.average)
    if content.round is None or content.radius is None:
        raise RefusedError("radius", None, "sections [radius] and [cell]")
    samples = modulus.campaign(
        content.radius, content.round, content.mesh, content.modulus, petsc=petsc
    )
    return modulus.stage(samples)


def image_table(document: Document) -> str:
    """The proved α-cuts as a table, and the phases."""
    cuts = document["cuts"]
    sides = (cuts["E_GPa"]["lower"], cuts["E_GPa"]["upper"])
    rows = [
        (f"{a:g}", *ends(low, high, nature_of(nature), 7), nature)
        for a, low, high, nature in zip(cuts["alpha"], *sides, cuts["nature"], strict=True)
    ]
    table = text_table(("α", "lower E, GPa", "upper E, GPa", "nature"), rows)
    shares = (f"{name}: {share:.1%} of the area\n" for name, share in document["fractions"].items())
    return table + "".join(shares) + width_text(document) + "\n"


def fibres(document: Document) -> str:
    """Constants of fibres at the lowest and the highest level; empty of spheres."""
    nature = nature_of(document["nature"])
    rows = [
        (
            fibre_label(key),
            *(between(cuts["lower"][k], cuts["upper"][k], nature, 5) for k in (0, -1)),
        )
        for key, cuts in document["fibres"].items()
    ]
    levels = (f"α = {document['alpha'][k]:g}" for k in (0, -1))
    return text_table(("of fibres", *levels), rows) if rows else ""


def summary(document: Document) -> str:
    """The α-cuts as a table, and what they cost."""
    columns = [document[key][side] for key in ("E_GPa", "nu_cuts") for side in ("lower", "upper")]
    nature = nature_of(document["nature"])
    rows = [
        (f"{alpha:g}", *ends(low, high, nature, 7), *ends(least, most, nature, 7))
        for alpha, low, high, least, most in zip(document["alpha"], *columns, strict=True)
    ]
    head = ("α", "lower E, GPa", "upper E, GPa", "lower ν", "upper ν")
    known = document["references"].get("hashin_shtrikman_E_GPa")
    bounds = f"{ISOTROPIC}: {known[0]:.4f} … {known[1]:.4f} GPa\n" if known else ""
    error = sum(document["error"].values())
    return (
        text_table(head, rows)
        + fibres(document)
        + f"E is {document['nature']}; error of the cell's model {error:.1e} of E\n"
        + bounds
        + f"{document['samples']} samples, {document['solves']} linear systems,"
        f" {document['seconds']:.1f} s, {document['method']}\n"
    )
