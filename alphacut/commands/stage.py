"""Commands of one stage each: ``microstructure``, ``modulus``, ``envelope``, ``identify``."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TextIO

from alphacut.commands.options import (
    Command,
    add_common,
    add_run,
    write_answer,
)
from alphacut.commands.results import open_results, read_case
from alphacut.fuzzy.refused import RefusedError
from alphacut.fuzzy.result import Nature
from alphacut.io.columns import ISOTROPIC, fibre_label, text_table
from alphacut.io.files import Document
from alphacut.io.netcdf import read_dataset
from alphacut.report.results import cut_text, width_text
from alphacut.report.tables import run_text, tables
from alphacut.rve.result.engineering_constants import FREE, PLANE_STRAIN
from alphacut.rve.result.loss_factors import CONSTANTS
from alphacut.stages.identify import identify_inputs
from alphacut.stages.pipeline import Pipeline
from alphacut.stages.results import Results
from alphacut.stochastic.microstructure_summary import fragment

ONLY = "Plane strain alone: the other definition is for one particle of two isotropic phases"


def microstructure(options: argparse.Namespace, out: TextIO) -> int:
    """Computes the radius map of particles, and prints its section [radius]; exit status 0."""
    with open_results(options) as (case, store):
        numbers = Pipeline(Results(case.content), store).compute_microstructure().document
    text = fragment(numbers)
    write_answer(options, numbers | {"fragment": text}, out, text)
    return 0


def modulus(options: argparse.Namespace, out: TextIO) -> int:
    """Computes the fuzzy modulus of the cell, and prints its tables; returns exit status 0."""
    with open_results(options) as (case, store):
        results = Results(case.content)
        Pipeline(results, store, options.petsc).compute_modulus()
    document, texts = results.document(), {"modulus": modulus_text, "image": image_text}
    for name in document.keys() & texts.keys():
        text = text_table(*tables(document)[name]) + texts[name](document[name])
        write_answer(options, document[name], out, text)
    return 0


def image_text(document: Document) -> str:
    """Lines on an image: its constants, area fractions, and what widens the bounds of E."""
    shares = (f"{name}: {share:.1%} of the area\n" for name, share in document["fractions"].items())
    return (
        plane_text(document["plane"], document["cuts"]["alpha"], Nature.GUARANTEED)
        + loss_text(document.get("loss"))
        + bounds_text(document)
        + "".join(shares)
        + f"{width_text(document)}\n"
    )


def modulus_text(document: Document) -> str:
    """Lines on a modulus: constants on the lowest and highest level, references, and the cost."""
    alpha, plane = document["alpha"], document["plane"]
    return (
        cuts_text("of fibres", document["fibres"], alpha, Nature(document["nature"]))
        + (plane_text(plane, alpha, Nature.ATTAINED) if plane else "")
        + loss_text(document.get("loss"))
        + bounds_text(document)
        + f"{document['samples']} samples, {document['solves']} linear systems,"
        f" {document['seconds']:.1f} s, {document['method']}\n"
    )


def bounds_text(document: Document) -> str:
    """Line on the Hashin–Shtrikman bounds; empty where there are none."""
    bounds = document["references"].get("hashin_shtrikman_E_GPa")
    return f"{ISOTROPIC}: {bounds[0]:.4f} … {bounds[1]:.4f} GPa\n" if bounds else ""


def cuts_text(title: str, cuts: Document, alpha: Sequence[float], nature: Nature) -> str:
    """Table of the lowest and highest cut of each constant; empty where there are none."""
    rows = [
        (fibre_label(x), cut_text(bounds, 0, nature), cut_text(bounds, -1, nature))
        for x, bounds in cuts.items()
    ]
    return text_table((title, f"α = {alpha[0]:g}", f"α = {alpha[-1]:g}"), rows) if rows else ""


def plane_text(cuts: Document, alpha: Sequence[float], nature: Nature) -> str:
    """Constants along x and y: a table in plane strain, and one with free extension."""
    free = {x.replace("_free", ""): bounds for x, bounds in cuts.items() if "_free" in x}
    plane_strain = {x: bounds for x, bounds in cuts.items() if "_free" not in x}
    text = cuts_text(PLANE_STRAIN, plane_strain, alpha, nature)
    return text + (cuts_text(FREE, free, alpha, nature) or f"{ONLY}\n")


def loss_text(losses: Document | None) -> str:
    """Table of loss factors on the lowest and highest level; empty where there are none."""
    if losses is None:
        return ""
    rows = []
    for name in CONSTANTS:
        cuts = (cut_text(losses[name], level, Nature.ATTAINED) for level in (0, -1))
        error = f"{losses['error'][name]:.1e}" if losses["error"] else "not declared"
        rows.append((f"loss factor of {name}", *cuts, error))
    return text_table(("tan δ = 2 ζ", "α = 0", "α = 1", "± error"), rows)


def add_envelope(parser: argparse.ArgumentParser) -> None:
    """Adds the options of an envelope."""
    add_run(parser)
    parser.add_argument("--modulus", metavar="FILE.nc", help="fuzzy modulus of an earlier command")


def envelope(options: argparse.Namespace, out: TextIO) -> int:
    """Computes the envelope of section [envelope] alone, and prints it; returns exit status 0."""
    data = read_dataset(Path(options.modulus), "--modulus") if options.modulus else None
    with open_results(options) as (case, store):
        pipeline = Pipeline(Results(case.content), store)
        pipeline.compute_envelopes(pipeline.structure(data, "--modulus"), studies=False)
    document = pipeline.results.document()
    write_answer(options, document["envelopes"]["all"], out, run_text(document))
    return 0


def identify(options: argparse.Namespace, out: TextIO) -> int:
    """Identifies inputs from measured modes; exit status 0 even if these refute the frame."""
    content = read_case(options).content
    if content.identify is None or content.frame is None or content.envelope is None:
        raise RefusedError("identify", None, "sections [identify], [frame] and [envelope]")
    document, _ = identify_inputs(
        content.identify, content.frame.structure(), content.envelope.alpha
    )
    write_answer(options, document, out, run_text({"update": document}))
    return 0


COMMANDS = {
    "microstructure": Command(
        "from particles, packed or measured, to the random radius and its fuzzy map",
        add_run,
        microstructure,
    ),
    "modulus": Command("fuzzy effective modulus of the cell or of the image", add_run, modulus),
    "envelope": Command(
        "envelopes of the structure's vibration on every α-cut", add_envelope, envelope
    ),
    "identify": Command("inputs of a frame from its measured natural modes", add_common, identify),
}
