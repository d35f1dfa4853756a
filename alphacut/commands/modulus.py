"""Command ``alphacut modulus``: the fuzzy modulus."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from typing import TextIO

from alphacut.commands import options as common
from alphacut.commands.parser import require_prism
from alphacut.io.files import Document
from alphacut.io.units import between
from alphacut.report.results import ISOTROPIC, fibre_label, nature_of, width_text
from alphacut.report.tables import tables, text_table
from alphacut.stages.chain import Chain
from alphacut.stages.results import Results

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
    common.add_run(parser)


def run(options: argparse.Namespace, petsc: Mapping[str, str], out: TextIO) -> int:
    """Computes and reports."""
    case, store = common.opened(options, KEYS)
    require_prism(petsc, case.content)
    results = Results(case.content)
    Chain(case.content, store, petsc).material(results)
    document, out_of = results.document(), {"modulus": summary, "image": image}
    for name in document.keys() & out_of.keys():
        text = text_table(*tables(document)[name]) + out_of[name](document[name])
        common.answer(options, document[name], out, text)
    return 0


def image(document: Document) -> str:
    """The phases, and what widens the bounds."""
    shares = (f"{name}: {share:.1%} of the area\n" for name, share in document["fractions"].items())
    return "".join(shares) + width_text(document) + "\n"


def summary(document: Document) -> str:
    """Constants of fibres on two levels, references, and what the α-cuts cost."""
    nature, levels = nature_of(document["nature"]), (0, -1)
    fibres = [
        (fibre_label(key), *(between(of["lower"][k], of["upper"][k], nature, 5) for k in levels))
        for key, of in document["fibres"].items()
    ]
    head = ("of fibres", *(f"α = {document['alpha'][k]:g}" for k in levels))
    ends = document["references"].get("hashin_shtrikman_E_GPa")
    return (
        (text_table(head, fibres) if fibres else "")
        + (f"{ISOTROPIC}: {ends[0]:.4f} … {ends[1]:.4f} GPa\n" if ends else "")
        + f"{document['samples']} samples, {document['solves']} linear systems,"
        f" {document['seconds']:.1f} s, {document['method']}\n"
    )
