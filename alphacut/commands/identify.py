"""Command ``alphacut identify``: inputs of a frame from its measured modes."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from typing import TextIO

from alphacut.case.load import load
from alphacut.commands.options import add_common, add_modulus, answer, modulus_option
from alphacut.io.files import Document
from alphacut.io.text_table import text_table
from alphacut.io.units import engineering
from alphacut.stages.material.modulus import stand_in
from alphacut.stages.vibration.structure import structure
from alphacut.stages.vibration.update import input_unit, learned

ABOUT = "inputs of a frame from its measured natural modes"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options of the command."""
    add_common(parser)
    add_modulus(parser)


def run(options: argparse.Namespace, petsc: Mapping[str, str], out: TextIO) -> int:
    """Identifies and reports; status 0 also where the measurement refutes the frame."""
    case = load(options.case, options.set)
    if case.sections.update is None:
        raise case.without("update")
    frame = structure(case, modulus_option(options.modulus) or stand_in(case))
    document = learned(case, frame).document()
    answer(options, document, out, summary(document))
    return 0


def summary(document: Document) -> str:
    """Intervals of the inputs before and after, and the modes that were predicted."""
    if "refuted" in document:
        return f"{document['refuted']}\n"
    rows = []
    for name, ends in document["inputs"].items():
        before, after = document["prior"][name], (ends["lower"][0], ends["upper"][0])
        words = (
            " … ".join(engineering(x, input_unit(name)) for x in pair) for pair in (before, after)
        )
        rows.append((name, *words, f"{document['narrowed'][name]:.0%}"))
    head = ("input", "before", f"after, α = {document['alpha'][0]:g}", "width left")
    text = text_table(head, rows)
    for mode in document["held_out"]:
        low, high = mode["predicted"]
        inside = "inside" if mode["inside"] else "outside"
        text += (
            f"mode {mode['mode']}: {low:.4g} … {high:.4g} Hz predicted,"
            f" {mode['measured']:.4g} Hz measured, {inside}\n"
        )
    return text
