"""Command ``alphacut cell``, also ``python -m rve solve``: one sample of the cell."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TextIO

from alphacut.case.case import Case
from alphacut.case.load import load
from alphacut.case.sections.material import CELL_METHODS
from alphacut.commands import modulus
from alphacut.commands import options as common
from alphacut.fuzzy.refused import RefusedError
from alphacut.io.files import Document, ranks
from alphacut.io.text_table import text_table
from alphacut.io.units import fixed
from alphacut.rve.model import cross_check
from alphacut.rve.result import Homogenised
from alphacut.stages.material import cell
from alphacut.stages.material.cell_models import cell_model
from alphacut.stages.material.references import references
from alphacut.stages.tolerance import require_modulus

ABOUT = "effective modulus and stresses of the cell at the modal values"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options of the command."""
    common.add_common(parser)
    common.add_keys(parser, common.SAMPLE)
    parser.add_argument(
        "--cross-check",
        metavar="METHOD",
        help="solve by a second method; fail if E differs by more than modulus.tolerance",
    )
    parser.add_argument(
        "--export", metavar="FILE", help="mesh, displacements, stresses: .vtu, .vtk, .xdmf, .msh"
    )


def run(options: argparse.Namespace, petsc: Mapping[str, str], out: TextIO) -> int:
    """Solves and reports."""
    case = load(options.case, common.changes(options, common.SAMPLE), modal=True)
    if case.sections.picture:
        return modulus.run_image(options, case, out, alpha=(1.0,))
    choice = cell.cell_choice(case, petsc=petsc)
    choice = replace(choice, parallel=ranks() > 1, estimate=True)
    result = cell.solve(case, cell_model(choice))
    require_modulus(case, sum(result.error.values()))
    document: Document = {**cell.document(result), "references": references(case)}
    if options.cross_check:
        document["difference"] = difference(case, choice, result, options.cross_check)
    if options.export:
        document["export"] = export(case, Path(options.export))
    common.answer(options, document, out, summary(result, document))
    return 0


def difference(case: Case, choice: cell.CellChoice, first: Homogenised, method: str) -> float:
    """Relative difference of E from that of a second method.

    Raises:
        RefusedError: There is no such method.
        FailedError: The difference is above the tolerance.
    """
    if method not in CELL_METHODS or method == choice.method:
        known = ", ".join(x for x in CELL_METHODS if x != choice.method)
        raise RefusedError("--cross-check", method, known)
    second = cell.solve(case, cell_model(replace(choice, method=method, petsc={})))
    return cross_check([first], [second], tolerance=case.modulus.tolerance)


def export(case: Case, path: Path) -> Document:
    """Writes the mesh with displacements and stresses; returns counts and errors."""
    from alphacut.export.fields import cell_fields, check_ending, write_mesh

    check_ending(path, fields=True)
    mesh = cell_fields(case)
    write_mesh(mesh, path)
    return {"file": str(path), "nodes": len(mesh.points), "error": mesh.info or None}


def summary(result: Homogenised, document: Document) -> str:
    """The result as a table, every number with its declared error."""
    errors = document["declared_error"] or {"E_GPa": 0.0, "nu": 0.0, "stress_GPa": {}}
    stress, off = document["stress_GPa"], errors["stress_GPa"]
    rows = [
        ("E, GPa", fixed(document["E_GPa"], 6), f"{errors['E_GPa']:.1e}"),
        ("ν", f"{document['nu']:.6f}", f"{errors['nu']:.1e}"),
        ("mean σ11, GPa", fixed(stress["s11"], 9), f"{off.get('s11', 0.0):.1e}"),
        ("mean σ12, GPa", fixed(stress["s12"], 9), f"{off.get('s12', 0.0):.1e}"),
    ]
    low, high = document["references"]["hashin_shtrikman_E_GPa"]
    rows.append(("Hashin–Shtrikman bounds of E, GPa", f"{low:.4f} … {high:.4f}", ""))
    if "difference" in document:
        rows.append(("difference of both methods", f"{document['difference']:.1e}", ""))
    iterations = ", ".join(map(str, result.iterations)) or "none"
    return text_table((result.convention, "value", "± error"), rows) + (
        f"{result.method}, {result.unknowns} unknowns, {result.solver}, iterations {iterations},"
        f" {sum(result.seconds.values()):.2f} s\n"
    )
