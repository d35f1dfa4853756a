"""Command ``alphacut cell``, also ``python -m rve solve``: one sample of the cell."""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TextIO

from alphacut.case.load import load
from alphacut.case.material import CELL_METHODS, RadiusMap, RoundCell
from alphacut.commands import options as common
from alphacut.commands.modulus import image_table
from alphacut.fuzzy.refused import FailedError, RefusedError
from alphacut.io.files import Document, ranks
from alphacut.io.text_table import text_table
from alphacut.io.units import fixed
from alphacut.report.results import ISOTROPIC, fibre_label
from alphacut.rve.result import Homogenised
from alphacut.stages import cell, image

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
    content = load(options.case, common.changes(options, common.SAMPLE)).content
    common.require_prism(petsc, content)
    if content.picture is not None:
        data = image.stage(content.picture, (1.0,), content.modulus.average).once(
            quiet=options.quiet
        )
        document: Document = json.loads(data.attrs["document"])
        common.answer(options, document, out, image_table(document))
        return 0
    if content.round is None or content.radius is None:
        raise RefusedError("radius", None, "sections [radius] and [cell]")
    choice = cell.CellChoice.of(content.round, content.mesh, content.modulus, petsc)
    choice = replace(choice, parallel=ranks() > 1, estimate=True)
    result = cell.solve(content.radius, content.round, choice)
    cell.require_tolerance(result.error, content.modulus.tolerance)
    document = {
        **cell.document(result),
        "references": cell.references(content.radius, content.round),
    }
    if options.cross_check:
        document["difference"] = difference(
            content.radius, content.round, choice, result, options.cross_check
        )
    if options.export:
        path, cross_section = Path(options.export), (content.radius, content.round)
        document["export"] = export(*cross_section, choice, path)
    common.answer(options, document, out, summary(result, document))
    return 0


def difference(
    radius: RadiusMap, phases: RoundCell, choice: cell.CellChoice, first: Homogenised, method: str
) -> float:
    """Relative difference of E from that of a second method.

    Raises:
        RefusedError: There is no such method, or it is the first one's.
        FailedError: The difference is above the tolerance.
    """
    if method not in CELL_METHODS or method == choice.method:
        known = ", ".join(x for x in CELL_METHODS if x != choice.method)
        raise RefusedError("--cross-check", method, known)
    second = cell.solve(radius, phases, replace(choice, method=method, petsc={}))
    if first.method == second.method:
        raise RefusedError("--cross-check", method, f"another method than {first.method}")
    gap, tolerance = abs(first.modulus / second.modulus - 1), choice.tolerance or 1e-4
    if not gap <= tolerance:
        values = (f"{one.method} gives E = {one.modulus:.10g} Pa" for one in (first, second))
        raise FailedError(
            f"{' and '.join(values)}: {gap:.2e} apart, {tolerance:.2e} is allowed",
            "refine the coarser of the two or allow more",
        )
    return gap


def export(radius: RadiusMap, phases: RoundCell, choice: cell.CellChoice, path: Path) -> Document:
    """Writes the mesh with displacements and stresses; returns counts."""
    from alphacut.export.fields import cell_fields, check_ending, write_mesh

    check_ending(path)
    mesh = cell_fields(cell.modal_cell(radius, phases), choice.size, choice.layers)
    write_mesh(mesh, path)
    return {"file": str(path), "nodes": len(mesh.points)}


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
    for key, number in document["fibres"].items():
        rows.append((fibre_label(key), f"{number['value']:.6g}", f"{number['error']:.1e}"))
    if ends := document["references"].get("hashin_shtrikman_E_GPa"):
        rows.append((f"{ISOTROPIC}, GPa", f"{ends[0]:.4f} … {ends[1]:.4f}", ""))
    if "difference" in document:
        rows.append(("difference of both methods", f"{document['difference']:.1e}", ""))
    iterations = ", ".join(map(str, result.iterations))
    words = f", {result.solver}, iterations {iterations}" if iterations else ""
    return text_table((result.convention, "value", "± error"), rows) + (
        f"{result.method}, {result.unknowns} unknowns{words}\n"
    )
