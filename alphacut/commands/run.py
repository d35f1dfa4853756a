"""Command ``alphacut run``: all stages, files, figures and the comparison."""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator, Mapping
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any, TextIO

from alphacut.case.case import Case
from alphacut.case.idle import idle_mesh, require_read
from alphacut.case.load import load
from alphacut.case.quick import banner, quick, settings
from alphacut.commands import options as common
from alphacut.figures.captions import core, in_words, widest
from alphacut.figures.showing import Showing
from alphacut.frame.structures.quantities import Output
from alphacut.fuzzy.campaign.workers import pool
from alphacut.io.files import Document, as_json, rank, say, write_text
from alphacut.io.netcdf import fingerprint_of, stored
from alphacut.io.output_paths import alone, unwritable
from alphacut.io.problem import BadInput, refuse
from alphacut.io.provenance import door
from alphacut.io.units import engineering, fixed, largest_by_unit
from alphacut.stages import summary
from alphacut.stages import width_shares as shares
from alphacut.stages.contract import require_choice
from alphacut.stages.image.document import interval, own_of_window
from alphacut.stages.material.references import lines
from alphacut.stages.pipeline import Chain
from alphacut.stages.readiness import ready
from alphacut.stages.vibration import decision, joint, update
from alphacut.stages.vibration import exceedance as outcomes
from alphacut.stages.vibration.studies import fixed_line

ABOUT = (
    "run every stage of a case: files, figures, summary, and the comparison with the paper where"
    " the case has one"
)


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    common.add_common(parser)
    common.add_workers(parser)
    parser.add_argument(
        "--out", metavar="FOLDER", help="where results go (default: results/NAME-OF-THE-CASE)"
    )
    again = parser.add_mutually_exclusive_group()
    common.add_flag(
        again,
        "--resume",
        "go on from what an earlier run has left, where nothing changed: the default",
    )
    common.add_flag(
        again, "--fresh", "compute everything anew instead of taking what is up to date"
    )
    common.add_flag(parser, "--strict", "refuse a step or tolerance too coarse for the motion")
    common.add_best_effort(parser)
    common.add_flag(parser, "--quick", "all stages in seconds, coarse: numbers mean nothing")
    common.add_flag(parser, "--no-figures", "numbers only")


def run(options: argparse.Namespace, petsc: Mapping[str, str], out: TextIO) -> int:
    """Compute, draw, compare."""
    chain = prepared(options, petsc)
    with alone("--out", chain.folder) if rank() == 0 else nullcontext():
        return computed(options, chain, out)


def computed(options: argparse.Namespace, chain: Chain, out: TextIO) -> int:
    """The numbers and figures of a chain, and its answer."""
    start = time.perf_counter()
    asked_of = load(options.case, options.set) if options.quick else chain.case
    with pool(chain.workers) as executor:
        showing = Showing(chain, not options.no_figures, executor)
        results = replace(chain, executor=executor, meanwhile=showing.begin).run()
        drawn, driving = showing.drawn(results), showing.driving()
    found: dict[str, Any] = {
        **summary.summary(results),
        **({"quick": settings(results.case)} if options.quick else {}),
        "shares": shares.mean_shares(driving),
        **({"shares_notes": notes.split("\n")} if (notes := driving.attrs.get("notes")) else {}),
        **({"changes": options.set} if options.set else {}),
        "sections": asked_of.traces(),
        "figures": drawn,
        "seconds": time.perf_counter() - start,
    }
    found["fingerprints"] = {name: fingerprint_of(chain.file(name)) for name in stored(found)}
    write_text(chain.file("summary.json"), as_json(found, indent=2))
    if common.answer(options, found, out, words(found)):
        many = len({Path(name).stem for name in drawn})
        told = f"{many} figures among them, after {found['seconds']:.0f} s"
        say(f"results are in {chain.folder}, {told}")
        say(f"next: {door('report', chain.folder)}")
    return 0


def prepared(options: argparse.Namespace, petsc: Mapping[str, str]) -> Chain:
    """The stages of the case, with every warning told.

    Raises:
        BadInput: The case or the options cannot be used.
    """
    case, folder = asked(options)
    first = ready(case)
    if first.rough and options.strict:
        raise BadInput(first.rough)
    # of what is rough the stage itself warns, with the modulus that it gets
    for warning in first.warnings:
        say(f"warning: {warning}")
    return Chain(
        case,
        folder,
        options.workers,
        options.fresh,
        options.quiet,
        petsc,
        options.strict,
        options.best_effort or options.quick,
        first.structure,
    )


def asked(options: argparse.Namespace) -> tuple[Case, Path]:
    """The case, and the folder where its results go.

    Raises:
        BadInput: The case or the options cannot be used.
    """
    common.check_workers(options.workers)
    case = load(options.case, options.set)
    require_read(case, read_by(case), "run")
    require_effect(options, case)
    case = quick(case) if options.quick else case
    folder = folder_of(options)
    refuse(unwritable("--out", folder, folder=True))
    return case, folder


def folder_of(options: argparse.Namespace) -> Path:
    """Where results go."""
    name = f"{Path(options.case).stem}{'-quick' if options.quick else ''}"
    return Path(options.out or f"results/{name}")


def words(found: Document) -> str:
    """A run in words: that it was quick, the paper's numbers beside its own, the main ones."""
    text = f"{banner(found['quick'])}\n" if "quick" in found else ""
    text += summary.table(found["paper"]) if found["paper"] else ""
    return text + main_numbers(found)


ASKED = ("update", "exceedance", "decision", "joint", "modulus")
PARTS = {
    "microstructure": ("microstructure",),
    "modulus": ("radius", "cell", "mesh", "modulus", "response"),
    "image": ("cell", "modulus.alpha"),
    "envelope": ("frame", "field", "pendulum", "tower", "envelope", *ASKED),
}
"""Sections that a stage reads."""


def read_by(case: Case) -> tuple[str, ...]:
    """Sections and keys that the stages of a case read."""
    own = (section for stage in case.stages for section in PARTS[stage])
    return ("stages", "title", "about", *dict.fromkeys(own))


def require_effect(options: argparse.Namespace, case: Case) -> None:
    """Refuse options that have no effect on this case.

    Raises:
        BadInput: One is given.
    """
    computed = "modulus" in case.stages and not case.stand_ins
    models = (case.modulus.method,) if computed else ()
    if computed:
        refuse(idle_mesh(case, models))
    if options.quick:
        common.refuse_beside(options, "--quick", {"--best-effort": ""})
    if options.best_effort:
        require_choice(case, modulus=computed, envelope="envelope" in case.stages)


def main_numbers(found: Document) -> str:
    """The fuzzy modulus and every study's extremes, a line each."""
    lines = [*modulus_lines(found), *image_lines(found)]
    for name, study in found.get("envelopes", {}).items():
        lines += envelope_lines(name, study)
    lines += fixed_line(found.get("structure", {}).get("words", {}).get("fixed", ()))
    lines += update.sentences(found["update"]) if "update" in found else []
    lines += decision.sentences(found["decision"]) if "decision" in found else []
    lines += [joint.sentence(found["joint"])] if "joint" in found else []
    limit = outcomes.sentences(found["exceedance"]) if "exceedance" in found else ""
    return "".join(f"{line}\n" for line in lines) + limit


def modulus_lines(found: Document) -> Iterator[str]:
    """The fuzzy modulus, if one was computed, and its references."""
    if cell := found.get("modulus"):
        inner, ends = (
            [f"{cell['nu_cuts'][s][k]:.4f}" for s in ("lower", "upper")] for k in (-1, 0)
        )
        nu = f"{cell['nu']:.4f}"
        if inner[0] != inner[1]:
            nu = f"[{', '.join(inner)}] at α = {cell['alpha'][-1]:g}"
        outer = widest(cell)
        nu += f", {outer} [{', '.join(ends)}]" if ends[0] != ends[1] else ""
        support = ", ".join(fixed(cell[f"{end}_GPa"], 4) for end in ("lower", "upper"))
        yield (f"E = {core(cell)}, {outer} [{support}] GPa, bounds {cell['nature']}; nu = {nu}")
        yield from filter(None, [cell.get("crisp")])
        ranked = sorted(found.get("shares", {}).get("E", {}).items(), key=lambda one: -one[1])
        first = [f"{in_words(name)} {share:.0%}" for name, share in ranked[:3] if share > 0]
        if first:
            some = f" (the first {len(first)} of {len(ranked)})" if len(ranked) > len(first) else ""
            told = f"the width of E shrinks by this share if the input were known{some}"
            yield f"{told}: {'; '.join(first)}"
        yield from lines(cell["beside"], cell["particles"])
        if told := cell["outside"]:  # why, and the cure, was said before the run
            yield f"warning: {told.partition(', and ')[0] if cell.get('shape') else told}"
        yield cell["publish"]


def image_lines(found: Document) -> Iterator[str]:
    """The bounds of an image's modulus, if there is one."""
    if picture := found.get("image"):
        yield from picture.get("phases", ())  # results of an older program have none
        yield from filter(None, [picture.get("boundary")])
        cuts, own, nu = picture["cuts"], own_of_window(picture), picture["nu"]
        ends = ({side: cuts["E_GPa"][side][k] for side in nu} for k in (-1, 0))
        core_of, support = map(interval, ends)
        top = f"at α = {cuts['alpha'][-1]:g}"
        yield (
            f"E = {core_of} {top}, support {support}, {picture['nature']}; nu"
            f"{own and ' of the tiles'} = [{nu['lower']:.4f}, {nu['upper']:.4f}] {top}"
        )
        yield from filter(None, [own])
        grains = interval(picture["grains_E_GPa"])
        yield f"Hashin–Shtrikman bounds of E if the particles are grains: {grains} {top}"


def envelope_lines(name: str, study: Document) -> Iterator[str]:
    """Extremes of each output of a study; outputs of one unit have one prefix."""
    ends = [
        (output, Output(output).unit, float(low), float(study["max"][output]))
        for output, low in study["min"].items()
    ]
    largest = largest_by_unit((value, unit) for _, unit, *values in ends for value in values)
    for output, unit, *values in ends:
        low, high = (engineering(value, unit, beside=largest[unit]) for value in values)
        where = f", at nodes every {study['step']:g} s" if "step" in study else ""
        yield f"{output} from {low} to {high} at the lowest α{where} (study {name})"
    if study.get("unproved"):
        yield f"these bounds are {study['nature']}, not proved: {study['unproved']}"
