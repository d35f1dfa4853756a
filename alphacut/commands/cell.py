"""``alphacut cell``, also ``python -m rve solve``: homogenise one crisp cell."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TextIO

from alphacut.case.case import Case
from alphacut.case.idle import idle_mesh, require_read
from alphacut.case.load import load
from alphacut.case.sections.material import CELL_METHODS, SPHERE_METHODS
from alphacut.commands import options as common
from alphacut.export.material_card import check_format, export
from alphacut.io.files import ranks, say
from alphacut.io.problem import BadInput, Problem, refuse
from alphacut.io.units import fixed
from alphacut.rve.anisotropy import ISOTROPIC_ENOUGH, ratio_of, shear_ratio_in_words
from alphacut.rve.auto.model import ORDER
from alphacut.rve.cell import STRAIN
from alphacut.rve.model import cross_check
from alphacut.rve.result import Homogenised, error_of_means
from alphacut.rve.spheres.result import HomogenisedSpheres
from alphacut.stages.contract import contract, keep_modulus, require_choice
from alphacut.stages.material import cell, spheres
from alphacut.stages.material.cell_models import cell_model
from alphacut.stages.material.references import beside, text_of
from alphacut.stages.plausible import say_unlikely_material

ABOUT = "homogenise the cell at crisp values; a fuzzy input takes its modal value"
KEYS = {**common.SAMPLE, **common.MESH, **common.MODEL}
READ = ("radius", "cell", "mesh", "modulus.method", "modulus.tolerance", "modulus.average")


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    common.add_common(parser)
    common.add_keys(parser, KEYS)
    common.add_exclude(parser, ", ".join(ORDER))
    common.add_radius(parser)
    common.add_flag(parser, "--stiffness", "a third load for the whole planar stiffness: prism")
    parser.add_argument(
        "--export",
        metavar="FILE",
        help="material and plane-strain stiffness for other programs: .inp, .comm, .mac or .json",
    )
    parser.add_argument(
        "--cross-check",
        metavar="A,B",
        help="run two models; fail if E differs by more than --tolerance (1e-4)",
    )


def named_models(option: str, text: str | None) -> tuple[str, ...]:
    """Names of models, separated by commas; none if the option is not given."""
    names = tuple(name.strip() for name in (text or "").split(",") if name.strip())
    for name in names:
        if name not in CELL_METHODS:
            what = f"there is no model {name}"
            raise BadInput.of(option, what, text or "", ", ".join(CELL_METHODS))
    return names


def named_pair(text: str | None) -> tuple[str, ...]:
    """The two models of ``--cross-check``; none if it is not asked for."""
    names = named_models("--cross-check", text)
    if text and (len(names) != 2 or len(set(names)) != 2):
        raise BadInput.of(
            "--cross-check", "this takes two different models", text, "for example series,slices"
        )
    return names


def run(options: argparse.Namespace, petsc: Mapping[str, str], out: TextIO) -> int:
    """Solve and report."""
    case = load(
        options.case, [*common.changes(options, KEYS), *common.one_radius(options)], modal=True
    )
    require_read(case, READ, "cell")
    if options.export:
        check_format(options.export)
    say_unlikely_material(case)
    pair = named_pair(options.cross_check)
    models = pair or (case.modulus.method,)
    require_effect(options, case, models)
    excluded = named_models("--exclude", options.exclude)
    choice = cell.cell_choice(case, exclude=excluded, petsc=petsc)
    full = options.stiffness or bool(options.export)
    choice = replace(
        choice,
        parallel=ranks() > 1,
        named=choice.named or full or ranks() > 1,
        estimate=True,
        stiffness=full or choice.averages,
    )
    if pair:
        result, difference = compared(case, choice, pair)
    else:
        result, difference = cell.solve(case, cell_model(choice)), None
        keep_modulus(case, result.method, result.error, best_effort=options.best_effort)
    if options.export:
        export(result, options.export)
    found = {**cell.document(result), **({} if difference is None else {"difference": difference})}
    found["model"] = choice.words
    found["tolerance"] = contract(case, sum(result.error.values()) if result.error else None)
    known = result.stiffness is not None and result.errors
    parts = cell.modal_parts(case)
    ratio = ratio_of(result) if known else cell.anisotropy(*parts, case.cell.particles)
    found |= beside(case, result.modulus, result.poisson, ratio and ratio[0])
    if common.answer(options, found, out, summary(result)):
        out.write(agreement(pair, difference, case.modulus.tolerance))
        out.write(remark(ratio, choice.meaning) + text_of(case, found))
    return 0


def require_effect(options: argparse.Namespace, case: Case, models: Sequence[str]) -> None:
    """Refuse options that none of the models to be run has.

    Raises:
        BadInput: One problem for each option.
    """
    problems = list(idle_mesh(case, models))
    if options.cross_check and "modulus.method" in case.changed:
        what = "this has no effect beside --cross-check, which names both models"
        problems.append(Problem("modulus.method", what, case.modulus.method))
    if case.cell.particles == "spheres" and not set(models) <= set(SPHERE_METHODS):
        what, allowed = "one of these models is of cylinders alone", ", ".join(SPHERE_METHODS)
        problems.append(Problem("--cross-check", what, options.cross_check, allowed))
    if options.exclude and "auto" not in models:
        what = f"the method is {' and '.join(models)}, and only method auto leaves a choice"
        problems.append(Problem("--exclude", what, options.exclude, "beside --method auto"))
    if options.stiffness and (options.export or "prism" not in models):
        beside = "--export, which solves it" if options.export else f"method {models[0]}"
        problems.append(Problem("--stiffness", f"this has no effect beside {beside}"))
    refuse(problems)
    if options.cross_check:
        common.refuse_beside(options, "--cross-check", {"--best-effort": ""})
    elif options.best_effort:
        require_choice(case, modulus=True, envelope=False)


def compared(case: Case, choice: cell.CellChoice, pair: Sequence[str]) -> tuple[Homogenised, float]:
    """The first model's result, and its relative difference in E from the second's.

    Raises:
        BadInput: Method auto took the model that it is compared with.
        CrossCheckError: The difference is above the tolerance.
    """
    steered = "table" if choice.particles == "spheres" else "auto"  # minutes for a needless digit
    results = [
        cell.solve(
            case,
            cell_model(
                replace(
                    choice,
                    method=name,
                    tolerance=choice.tolerance if name == "auto" or steered == name else None,
                    exclude=choice.exclude if name == "auto" else (),
                    petsc=choice.petsc if name == "prism" else {},
                )
            ),
        )
        for name in pair
    ]
    first, second = results
    if first.method == second.method:
        what = f"method auto takes {first.method} here, so both are one model"
        cure = f"auto with --exclude {first.method}, or two names of {', '.join(ORDER)}"
        raise BadInput.of("--cross-check", what, ",".join(pair), cure)
    return first, cross_check([first], [second], tolerance=case.modulus.tolerance)


def agreement(pair: Sequence[str], difference: float | None, allowed: float) -> str:
    """The difference of two models as a line; empty without."""
    if difference is None:
        return ""
    return f"{' and '.join(pair)} differ by {difference:.1e} of E; {allowed:.1e} is allowed\n"


def remark(ratio: tuple[float, float] | None, meaning: str = "cylinders") -> str:
    """The array's shear ratio as a line; where it matters to E of eq. 16, a warning besides."""
    if ratio is None:
        return ""
    value, error = ratio
    if meaning == "cylinders" and abs(value - 1) > ISOTROPIC_ENOUGH:
        say(
            f"warning: {shear_ratio_in_words(value)}; --export and --stiffness give the whole"
            " plane-strain stiffness"
        )
    return (
        f"shear_ratio = {value:.4f} ± {error:.1e}: shear modulus along the diagonals over that"
        " along the axes, 1 in an isotropic plane\n"
    )


def summary(result: Homogenised) -> str:
    """The result in a few lines for people, every number with its declared error."""
    if isinstance(result, HomogenisedSpheres):
        return spheres.lines(result)
    s11, s12 = (stress / cell.GPA for stress in result.curve.mean)
    seconds = ", ".join(f"{name} {value:.3f}" for name, value in result.seconds.items())
    parts = ", ".join(f"{name} {value:.1e}" for name, value in result.error.items())
    error, off = "", [""] * 4
    if parts:
        error = f"estimated relative error of E: {result.estimated_error:.1e} ({parts})\n"
        units = (cell.GPA, 1.0, cell.GPA, cell.GPA)
        absolute = zip(error_of_means(result), units, strict=True)
        off = [f" ± {value / unit:.1e}" for value, unit in absolute]
    iterations = ", ".join(map(str, result.iterations)) or "none"
    return (
        f"E = {fixed(result.modulus / cell.GPA, 6)}{off[0]} GPa,"
        f" nu = {result.poisson:.6f}{off[1]} ({result.convention})\n{error}"
        f"mean s11 = {fixed(s11, 9)}{off[2]} GPa under ε11 = ε22 = {STRAIN:g},"
        f" mean s12 = {fixed(s12, 9)}{off[3]} GPa under ε12 = {STRAIN:g}\n"
        f"{result.method}, {result.unknowns} unknowns, {result.solver}, iterations {iterations}\n"
        f"seconds: {seconds}\n"
    )
