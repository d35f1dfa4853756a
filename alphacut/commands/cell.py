"""``alphacut cell``, also ``python -m rve solve``: homogenise one crisp cell."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import replace
from typing import TextIO

from alphacut.case.load import load
from alphacut.case.schema import CELL_METHODS
from alphacut.commands.options import CELL_OPTIONS, add_common, add_keys, changes
from alphacut.export.material_card import check_format, export
from alphacut.io.files import as_json, ranks, say, write_text
from alphacut.io.problem import BadInput, Problem
from alphacut.rve.anisotropy import ISOTROPIC_ENOUGH, shear_ratio_in_words
from alphacut.rve.cell import STRAIN
from alphacut.rve.model import cross_check
from alphacut.rve.result import Homogenised
from alphacut.stages import cell

ABOUT = "homogenise the cell at crisp values; a fuzzy input takes its modal value"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    add_common(parser)
    add_keys(parser, CELL_OPTIONS)
    parser.add_argument(
        "--exclude",
        metavar="NAMES",
        default="",
        help="models that method auto must not take, separated by commas",
    )
    parser.add_argument(
        "--stiffness",
        action="store_true",
        help="with method prism, solve a third load for the whole planar stiffness",
    )
    parser.add_argument(
        "--export",
        metavar="FILE",
        help=(
            "write the material and its plane-strain stiffness for another program: .inp, .comm,"
            " .mac or .json"
        ),
    )
    parser.add_argument(
        "--cross-check",
        metavar="A,B",
        default="",
        help="run two models; fail if their moduli differ by more than --tolerance",
    )


def named_models(option: str, text: str) -> tuple[str, ...]:
    """Names of models, separated by commas."""
    names = tuple(name.strip() for name in text.split(",") if name.strip())
    for name in names:
        if name not in CELL_METHODS:
            raise BadInput(
                Problem(option, f"there is no model {name}", text, ", ".join(CELL_METHODS))
            )
    return names


def named_pair(text: str) -> tuple[str, ...]:
    """The two models of ``--cross-check``; none if it is not asked for."""
    names = named_models("--cross-check", text)
    if text and (len(names) != 2 or len(set(names)) != 2):
        raise BadInput(
            Problem(
                "--cross-check",
                "this takes two different models",
                text,
                "for example series,slices",
            )
        )
    return names


def run(options: argparse.Namespace, petsc: Mapping[str, str], out: TextIO) -> int:
    """Solve and report."""
    case = load(options.case, changes(options, CELL_OPTIONS), modal=True)
    if options.export:
        check_format(options.export)
    pair = named_pair(options.cross_check)
    choice = cell.cell_choice(case, exclude=named_models("--exclude", options.exclude), petsc=petsc)
    choice = replace(
        choice,
        parallel=ranks() > 1,
        estimate=True,
        stiffness=options.stiffness or bool(options.export),
    )
    result = cell.solve(case, replace(choice, method=pair[0] if pair else choice.method).model())
    difference = None
    if pair:
        difference = cross_check(
            [result],
            [cell.solve(case, replace(choice, method=pair[1]).model())],
            tolerance=choice.tolerance,
        )
    if options.export:
        export(result, options.export)
    found = {**cell.document(result), **({} if difference is None else {"difference": difference})}
    document = as_json(found, indent=None if options.json == "-" else 2)
    if options.json == "-":
        out.write(document)
    elif options.json:
        write_text(options.json, document)
    if options.json != "-" and not options.quiet:
        out.write(summary(result))
        if difference is not None:
            out.write(
                f"{' and '.join(pair)} differ by {difference:.1e} of E; {choice.tolerance:.1e} is"
                " allowed\n"
            )
        out.write(
            remark(
                cell.anisotropy(*cell.parts(cell.modal_values(case), case.numbers("radius.theta")))
            )
        )
    return 0


def remark(ratio: float | None) -> str:
    """The square array's anisotropy as a line; where it matters, a warning besides."""
    if ratio is None:
        return ""
    if abs(ratio - 1) > ISOTROPIC_ENOUGH:
        say(
            f"warning: {shear_ratio_in_words(ratio)}; --export and --stiffness give the whole"
            " plane-strain stiffness"
        )
    return (
        f"shear_ratio = {ratio:.4f}: shear modulus along the diagonals over that along the axes, 1"
        " in an isotropic plane\n"
    )


def summary(result: Homogenised) -> str:
    """The result in a few lines for people."""
    s11, s12 = (stress / cell.GPA for stress in result.curve.mean)
    seconds = ", ".join(f"{name} {value:.3f}" for name, value in result.seconds.items())
    parts = ", ".join(f"{name} {value:.1e}" for name, value in result.error.items())
    error = (
        f"estimated relative error of E: {result.estimated_error:.1e} ({parts})\n" if parts else ""
    )
    return (
        f"E = {result.modulus / cell.GPA:.6f} GPa, nu = {result.poisson:.6f} (eq. 16)\n{error}mean"
        f" s11 = {s11:.9f} GPa under ε11 = ε22 = {STRAIN:g}, mean s12 = {s12:.9f} GPa under ε12 ="
        f" {STRAIN:g}\n{result.method}, {result.unknowns} unknowns, {result.solver}, iterations"
        f" {', '.join(map(str, result.iterations)) or 'none'}\nseconds: {seconds}\n"
    )
