"""Command ``alphacut modulus``, also ``python -m fuzzy modulus``: the fuzzy modulus."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import TextIO

from alphacut.case.case import Case
from alphacut.case.load import load
from alphacut.commands.cell import named_models, remark
from alphacut.commands.options import (
    CELL_OPTIONS,
    add_common,
    add_keys,
    add_workers,
    changes,
    check_workers,
)
from alphacut.fuzzy import Explanation, Store
from alphacut.io.files import as_json, say, write_text
from alphacut.io.problem import BadInput, Problem
from alphacut.io.progress import progress
from alphacut.io.provenance import fingerprint
from alphacut.stages import modulus, response
from alphacut.stages.campaign import campaign
from alphacut.stages.cell import GPA

ABOUT = "fuzzy effective modulus by the transformation method over all fuzzy inputs of the cell"
KEYS = {**CELL_OPTIONS, "--plan": "modulus.plan", "--alpha": "modulus.alpha"}


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    add_common(parser)
    add_keys(parser, KEYS)
    add_workers(parser)
    parser.add_argument(
        "--out", metavar="FILE.nc", help="write the α-cuts and all samples as NetCDF"
    )
    parser.add_argument(
        "--store",
        metavar="FILE",
        help="keep every sample here; the same command then goes on where it was stopped",
    )
    parser.add_argument(
        "--resume",
        action="store_true",
        help="keep and take samples in results/NAME-OF-THE-CASE/samples.db",
    )
    parser.add_argument(
        "--explain", action="store_true", help="say what would be run and why, and run nothing"
    )
    parser.add_argument(
        "--exclude",
        metavar="NAMES",
        default="",
        help="models that method auto must not take, separated by commas",
    )


def run(options: argparse.Namespace, petsc: Mapping[str, str], out: TextIO) -> int:
    """Compute and report."""
    check_workers(options.workers)
    case = load(options.case, changes(options, KEYS))
    exclude = named_models("--exclude", options.exclude)
    wanted = campaign(case, petsc=petsc, exclude=exclude, store=store_of(options, case))
    if options.explain:
        explain(modulus.explain(wanted), options, out)
        return 0
    with progress("Fuzzy modulus", quiet=options.quiet) as tick:
        found = modulus.compute(wanted, workers=options.workers, progress=tick)
    if options.out:
        key = fingerprint(case.values, ("stochastic", "rve", "fuzzy"))
        modulus.write(found, options.out, case_text=case.text_of_file, key=key)
    stress = (
        response.document(response.dataset(case, found.dataset()))
        if case.has("response.quantity")
        else None
    )
    answer = {**found.document(), **({"response": stress} if stress else {})}
    document = as_json(answer, indent=None if options.json == "-" else 2)
    if options.json == "-":
        out.write(document)
    elif options.json:
        write_text(options.json, document)
    if options.json != "-" and not options.quiet:
        out.write(summary(found) + (f"\n{response.text(stress)}" if stress else ""))
        if not options.out:
            say(
                "to keep this and hand it on: the same command with --out modulus.nc, then alphacut"
                " envelope CASE --modulus modulus.nc"
            )
    return 0


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
            raise BadInput(
                Problem("--store", str(error), str(path), "a new file, or a store of this program")
            ) from None
    path.parent.mkdir(parents=True, exist_ok=True)
    return path


def explain(explanation: Explanation, options: argparse.Namespace, out: TextIO) -> None:
    """Print what would be run."""
    out.write(
        as_json({"explanation": str(explanation)}) if options.json == "-" else f"{explanation}\n"
    )


def summary(found: modulus.FuzzyModulus) -> str:
    """The α-cuts as a small table."""
    lower, upper = (ends / GPA for ends in found.result.bounds("E"))
    rows = "".join(
        f"{a:5.2f}  {low:10.5f}  {high:10.5f}\n"
        for a, low, high in zip(found.result.alpha, lower, upper, strict=True)
    )
    cost = (
        f"{found.result.runs} samples, {found.solves} linear systems, {found.result.seconds:.1f} s,"
        f" {found.choice.method}"
    )
    return (
        "alpha  lower GPa   upper GPa   (E of eq."
        f" 16)\n{rows}{cost}\n{found.worth}\n{remark(found.shear_ratio)}"
    )
