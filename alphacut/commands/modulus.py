"""Command ``alphacut modulus``, also ``python -m fuzzy modulus``: the fuzzy modulus."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import TextIO

from alphacut.case.case import Case
from alphacut.case.idle import idle_mesh, require_read
from alphacut.case.load import load
from alphacut.case.sections.material import PLANS
from alphacut.commands import options as common
from alphacut.commands.cell import named_models, remark
from alphacut.fuzzy import Store
from alphacut.io.files import Document, say
from alphacut.io.problem import BadInput, refuse
from alphacut.io.progress import progress
from alphacut.io.provenance import door, fingerprint
from alphacut.io.units import fixed
from alphacut.rve.auto.model import ORDER
from alphacut.stages.contract import contract, keep_modulus, require_choice
from alphacut.stages.material import modulus, response
from alphacut.stages.material.campaign import Campaign, campaign
from alphacut.stages.material.cell import GPA
from alphacut.stages.material.references import of_modulus, text_of
from alphacut.stages.plausible import say_unlikely_material

ABOUT = "fuzzy effective modulus by the transformation method over all fuzzy inputs of the cell"
KEYS = {
    **common.MODEL,
    "--plan": common.KeyOption("modulus.plan", ", ".join(PLANS), "CHOICE"),
    "--alpha": common.KeyOption("modulus.alpha", "levels, as 0,0.5,1", "LIST"),
}
READ = ("radius", "cell", "mesh", "modulus", "response")
UNEXPLAINED = {"--out": "", "--workers": "1", "--best-effort": ""}
"""Options without an effect where nothing is run."""


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    common.add_common(parser)
    common.add_keys(parser, KEYS)
    common.add_exclude(parser, ", ".join(ORDER))
    common.add_workers(parser)
    parser.add_argument("--out", metavar="FILE.nc", help="write α-cuts and samples as NetCDF")
    place = parser.add_mutually_exclusive_group()
    place.add_argument(
        "--store",
        metavar="FILE",
        help="keep every sample; the same command goes on where it was stopped",
    )
    common.add_flag(place, "--resume", "the same in results/NAME-OF-THE-CASE/samples.db")
    common.add_flag(parser, "--explain", "say what would be run and why, and run nothing")


def run(options: argparse.Namespace, petsc: Mapping[str, str], out: TextIO) -> int:
    """Compute and report."""
    case = asked(options)
    say_unlikely_material(case)
    exclude = named_models("--exclude", options.exclude)
    wanted = campaign(case, petsc=petsc, exclude=exclude, store=store_of(options, case))
    if options.explain:
        words = explained(wanted)
        common.answer(options, {"explanation": words}, out, f"{words}\n")
        return 0
    with progress("Fuzzy modulus", quiet=options.quiet) as tick:
        found = modulus.compute(wanted, workers=options.workers, progress=tick)
    keep_modulus(case, found.choice.method, found.error, best_effort=options.best_effort)
    others = of_modulus(case, found)
    document, text = told(case, wanted, found, others)
    if options.out:
        key = fingerprint({"case": case.sections}, ("stochastic", "rve", "fuzzy"))
        modulus.write(
            found, options.out, case_text=case.text_of_file, key=key, outside=others["outside"]
        )
    if common.answer(options, document, out, text) and not options.out:
        say(
            "to keep this and hand it on: the same command with --out modulus.nc, then"
            f" {door('envelope', options.case)} --modulus modulus.nc"
        )
    return 0


def asked(options: argparse.Namespace) -> Case:
    """The case, whose keys and the command's options go together.

    Raises:
        BadInput: They do not.
    """
    common.check_workers(options.workers)
    case = load(options.case, common.changes(options, KEYS))
    require_read(case, READ, "modulus")
    refuse(idle_mesh(case, (case.modulus.method,)))
    if options.explain:
        common.refuse_beside(options, "--explain", UNEXPLAINED)
    elif options.best_effort:
        require_choice(case, modulus=True, envelope=False)
    return case


def explained(wanted: Campaign) -> str:
    """Samples that would be run and why, and what they have in common."""
    crisp = ", ".join(f"{name} {value:.6g}" for name, value in wanted.task.crisp.items())
    return f"{modulus.explain(wanted)}\n{wanted.task.choice.words}; crisp (SI): {crisp}"


def told(
    case: Case, wanted: Campaign, found: modulus.FuzzyModulus, others: Document
) -> tuple[Document, str]:
    """The result for ``--json``, and in words."""
    reached = sum(found.error.values()) if found.error else None
    document = {
        **found.document(),
        **others,
        "model": wanted.task.choice.words,
        "tolerance": contract(case, reached),
    }
    text = summary(found) + text_of(case, others)
    if not case.sections.response:
        return document, text
    stress = response.document(response.dataset(case, found.dataset()))
    return {**document, "response": stress}, f"{text}\n{response.text(stress)}"


def store_of(options: argparse.Namespace, case: Case) -> Path | None:
    """The file that keeps the samples, if one is wanted.

    Raises:
        BadInput: There is such a file, and it holds something else.
    """
    if not (options.store or options.resume):
        return None
    path = Path(options.store or f"results/{case.name}/samples.db")
    if path.is_file():
        try:
            Store(path).close()
        except ValueError as error:
            raise BadInput.of(
                "--store", str(error), str(path), "a new file, or a store of this program"
            ) from None
    path.parent.mkdir(parents=True, exist_ok=True)
    return path


def summary(found: modulus.FuzzyModulus) -> str:
    """The α-cuts as a small table."""
    lower, upper = ([fixed(float(x), 5) for x in ends / GPA] for ends in found.result.bounds("E"))
    cuts = zip(found.result.alpha, lower, upper, *found.result.bounds("nu"), strict=True)
    rows = "".join(
        f"{a:5.2f}  {low:>10}  {high:>10}  {least:8.5f}  {most:8.5f}\n"
        for a, low, high, least, most in cuts
    )
    cost = (
        f"{found.result.runs} samples, {found.solves} linear systems, {found.result.seconds:.1f} s,"
        f" {found.choice.method}"
    )
    return (
        "alpha  lower GPa   upper GPa   lower nu  upper nu  (E and nu of"
        f" {modulus.AVERAGE[found.choice.meaning]})\n"
        f"{rows}{cost}\n"
        f"{found.worth}\n{remark(found.shear_ratio, found.choice.meaning)}"
    )
