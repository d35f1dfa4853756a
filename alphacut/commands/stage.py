"""Commands of one stage each: ``microstructure``, ``modulus``, ``identify``."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from typing import TextIO

from alphacut.commands.options import Command, add_common, add_run, write_answer
from alphacut.commands.pipeline import Pipeline, open_results, read_case
from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import RefusedError
from alphacut.fuzzy.result import Nature
from alphacut.io.arrays import text_table
from alphacut.questions.summary import Parts, Results
from alphacut.report import tables
from alphacut.report.results import cut_text, run_text, width_text
from alphacut.report.tables import shown
from alphacut.rve.result.engineering_constants import PLANE_STRAIN
from alphacut.stages.cell import UPPER_BOUND, constant_label, isotropic_label
from alphacut.stages.identify import identify_inputs
from alphacut.stages.image import ImageResult
from alphacut.stages.modulus import ModulusResult
from alphacut.stages.store import CutsResult
from alphacut.stochastic.microstructure import fragment

ONLY = "Plane strain alone: the other definition is for one particle of two isotropic phases"


def microstructure(options: argparse.Namespace, out: TextIO) -> int:
    """Computes the radius map of particles, and prints its section [radius]; exit status 0."""
    with open_results(options) as (case, store):
        numbers = Pipeline(Results(case.content), store).compute_microstructure().numbers
    text = fragment(numbers)
    write_answer(options, numbers | {"fragment": text}, out, text)
    return 0


def modulus(options: argparse.Namespace, out: TextIO) -> int:
    """Computes the fuzzy modulus of the cell, and prints its tables; returns exit status 0."""
    with open_results(options) as (case, store):
        results = Results(case.content)
        Pipeline(results, store, options.petsc).compute_modulus()
    result = results.modulus or results.image
    assert result is not None
    part: ModulusResult | ImageResult = result.numbers
    words = image_text(part) if isinstance(part, ImageResult) else modulus_text(part)
    write_answer(options, dict(part), out, text_table(*shown(tables.modulus(part))) + words)
    return 0


def image_text(result: ImageResult) -> str:
    """Lines on an image: its constants, area fractions, and what widens the bounds of E."""
    measured = "area" if len(result.lower_GPa) == 3 else "volume"
    shares = (
        f"{name}: {share:.1%} of the {measured}\n" for name, share in result.fractions.items()
    )
    constants = constants_text(result, Nature.GUARANTEED)
    title = "tan δ, to first order in it"
    losses = cuts_text(title, result.proved_losses, result.alpha, Nature.GUARANTEED)
    return f"{constants}{losses}{''.join(shares)}{width_text(result)}\n"


def modulus_text(result: ModulusResult) -> str:
    """Lines on a modulus: constants on the lowest and highest level, references, and the cost."""
    return (
        cuts_text("of fibres", result.fibres, result.alpha, result.nature)
        + constants_text(result, Nature.ATTAINED)
        + (f"{UPPER_BOUND}\n" if result.particles == "mesh" else "")
        + f"{result.samples} samples, {result.solves} linear systems,"
        f" {result.seconds:.1f} s, {result.method}\n"
    )


def constants_text(part: ModulusResult | ImageResult, nature: Nature) -> str:
    """Constants along x and y by definition, loss factors, and the bounds of an isotropic E."""
    text = "".join(cuts_text(name, cuts, part.alpha, nature) for name, cuts in part.plane.items())
    if PLANE_STRAIN in part.plane and len(part.plane) == 1:
        text += f"{ONLY}\n"
    if (loss := part.loss) is not None and loss.nature is not Nature.GUARANTEED:
        rows, levels = [], end_levels(part.alpha)
        for name, cuts in (("E", loss.E), ("G", loss.G), ("K", loss.K)):
            texts = (cut_text(cuts, level, Nature.ATTAINED) for level in levels.values())
            error = f"{loss.error[name]:.1e}" if loss.error else "not declared"
            rows.append((f"loss factor of {name}", *texts, error))
        text += text_table(("tan δ = 2 ζ", *levels, "± error"), rows)
    if bounds := part.references.get("hashin_shtrikman_E_GPa"):
        text += f"{isotropic_label(part.average)}: {bounds[0]:.4f} … {bounds[1]:.4f} GPa\n"
    return text


def end_levels(alpha: Array) -> dict[str, int]:
    """Indices of the lowest and the highest level by their titles."""
    return {f"α = {alpha[level]:g}": level for level in (0, len(alpha) - 1)}


def cuts_text(title: str, cuts: Mapping[str, CutsResult], alpha: Array, nature: Nature) -> str:
    """Table of the lowest and highest cut of each constant; empty where there are none."""
    levels = end_levels(alpha)
    rows = [
        (constant_label(x), *(cut_text(ends, level, nature) for level in levels.values()))
        for x, ends in cuts.items()
    ]
    return text_table((title, *levels), rows) if rows else ""


def identify(options: argparse.Namespace, out: TextIO) -> int:
    """Identifies inputs from measured modes; exit status 0 even if these refute the frame."""
    content = read_case(options).content
    if content.identify is None or content.frame is None or content.envelope is None:
        raise RefusedError("identify", None, "sections [identify], [frame] and [envelope]")
    alpha, structure = content.envelope.alpha, content.frame.nominal
    learned, _ = identify_inputs(content.identify, structure, alpha)
    write_answer(options, dict(learned), out, run_text(Parts(update=learned)))
    return 0


COMMANDS = {
    "microstructure": Command(
        "from particles, packed or measured, to the random radius and its fuzzy map",
        add_run,
        microstructure,
    ),
    "modulus": Command("fuzzy effective modulus of the cell or of the image", add_run, modulus),
    "identify": Command("inputs of a frame from its measured natural modes", add_common, identify),
}
