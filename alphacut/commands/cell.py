"""Command ``alphacut cell``, also ``python -m rve solve``: one sample of the cell."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import TextIO

import numpy as np

from alphacut.case.cell import CellContent
from alphacut.commands.options import Command, add_common, read_cell, write_answer
from alphacut.fuzzy.refused import FailedError, require
from alphacut.io.arrays import text_table
from alphacut.io.files import Document, ranks
from alphacut.rve.result.result import HomogenisedStiffness
from alphacut.stages import cell
from alphacut.stages.cell import ISOTROPIC, constant_label

KEYS = {
    "--a2": ("radius.a2", "slope of the radius at the lower end of θ"),
    "--a4": ("radius.a4", "slope of the radius at the upper end"),
    "--inclusion-modulus": ("cell.inclusion_modulus", "as '80 GPa'"),
    "--method": ("modulus.method", "prism, slices, series or auto"),
}
"""Options that change a key of the case, each with its key and help."""


def arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options of `alphacut cell`; those of `KEYS` are short for ``--set KEY=VALUE``."""
    add_common(parser)
    for option, (key, about) in KEYS.items():
        as_change = f"{key}={{}}".format
        parser.add_argument(
            option, dest="set", action="append", type=as_change, metavar="VALUE", help=about
        )
    parser.add_argument(
        "--cross-check",
        metavar="METHOD",
        help="solve by a second method; fail if E differs by more than modulus.tolerance",
    )
    parser.add_argument(
        "--export", metavar="FILE", help="mesh, displacements, stresses: .msh, .vtu, .xdmf, .inp"
    )


def run(options: argparse.Namespace, out: TextIO) -> int:
    """Solves the cell at the modal values, checks and writes its result; returns exit status 0."""
    content = read_cell(options)
    radius, phases = content.random_cell
    elements = {"petsc": options.petsc, "parallel": ranks() > 1, "estimate": True}
    model = cell.model_of(phases, content.mesh, content.modulus, **elements)
    result = cell.solve(radius, phases, model)
    cell.require_tolerance(result.error, content.modulus.tolerance)
    references = cell.references(radius, phases, content.stated_fraction)
    if result.has_isotropic_constants:
        cell.require_bounds((result.modulus, result.modulus), references, phases.particles)
    document = {**cell.document(result), "references": references}
    if options.cross_check:
        method, methods = options.cross_check, {*phases.methods} - {"auto", result.method}
        allowed = ", ".join(sorted(methods))
        require(method in methods, "--cross-check", value=method, allowed=allowed)
        modulus = content.modulus.model_copy(update={"method": method})
        second = cell.solve(radius, phases, cell.model_of(phases, content.mesh, modulus))
        document["difference"] = difference(result, second, content.modulus.tolerance or 1e-4)
    if options.export:
        document["export"] = export(content, Path(options.export))
    write_answer(options, document, out, summary(result, document))
    return 0


def difference(
    first: HomogenisedStiffness, second: HomogenisedStiffness, tolerance: float
) -> float:
    """Relative difference of E between the results of two methods; above the tolerance it fails."""
    gap = abs(first.modulus / second.modulus - 1)
    if not gap <= tolerance:
        values = (f"{x.method} gives E = {x.modulus:.10g} Pa" for x in (first, second))
        raise FailedError(
            f"{' and '.join(values)}: {gap:.2e} apart, {tolerance:.2e} is allowed",
            "refine the coarser of the two or allow more",
        )
    return gap


def export(content: CellContent, path: Path) -> Document:
    """Writes the mesh with displacements and stresses; returns the file and its number of nodes."""
    from alphacut.export.cell_files import write_cell
    from alphacut.rve.prism.fields import cell_fields, mesh_fields
    from alphacut.rve.prism.model import PrismModel
    from alphacut.rve.prism.own_mesh import MeshModel

    mesh = content.mesh
    if mesh.file is not None:
        sample = cell.modal_sample(*content.law_and_phases)
        fields = mesh_fields(MeshModel(mesh.file), sample.law, sample.phases)
    else:
        modal = cell.modal_cell(*content.radius_and_phases)
        model = PrismModel(mesh.size, mesh.layers, outline=modal.outline)
        fields = cell_fields(model, modal.radius, modal.matrix, modal.inclusion, modal.interphase)
    return {"file": str(path), "nodes": write_cell(fields, path)}


def summary(result: HomogenisedStiffness, document: Document) -> str:
    """The result as a table, each number with its declared error."""
    errors, stress = document["declared_error"], document["stress_GPa"]
    error_texts = ["not declared"] * 4
    if errors is not None:
        values = (errors["E_GPa"], errors["nu"], *errors["stress_GPa"].values())
        error_texts = [f"{value:.1e}" for value in values]
    names = ("E, GPa", "ν", "mean σ11, GPa", "mean σ12, GPa")
    value_texts = ["none: 2 G_T > 3 (C11 + C12)"] * 2
    if result.has_isotropic_constants:
        value_texts = [f"{document['E_GPa']:#.8g}", f"{document['nu']:.6f}"]
    value_texts += [f"{stress['s11']:#.9g}", f"{stress['s12']:#.9g}"]
    rows = [*zip(names, value_texts, error_texts, strict=True)]
    for key, number in document["fibres"].items():
        rows.append((constant_label(key), *_value_and_error(number)))
    rows += plane_rows(document)
    if bounds := document["references"].get("hashin_shtrikman_E_GPa"):
        rows.append((f"{ISOTROPIC}, GPa", f"{bounds[0]:.4f} … {bounds[1]:.4f}", ""))
    if "difference" in document:
        rows.append(("difference of both methods", f"{document['difference']:.1e}", ""))
    iterations = ", ".join(map(str, result.iterations))
    solver = f", {result.solver}, iterations {iterations}" if iterations else ""
    table = text_table((result.convention, "value", "± error"), rows)
    return f"{table}{result.method}, {result.unknowns} unknowns{solver}\n"


def plane_rows(document: Document) -> Iterator[tuple[str, str, str]]:
    """Rows (name, value, error) of the plane stiffness C_ij and of the constants along x and y."""
    stiffness, errors = document["stiffness_GPa"], document["stiffness_error_GPa"]
    if not document["plane"]:
        return
    for i, j in zip(*np.triu_indices(3), strict=True):
        error = "not declared" if errors is None else f"{errors[i, j]:.1e}"
        yield f"C{PLANE_INDICES[i]}{PLANE_INDICES[j]}, GPa", f"{stiffness[i, j]:.6g}", error
    for definition, constants in document["plane"].items():
        for key, number in constants.items():
            yield f"{constant_label(key)} ({definition})", *_value_and_error(number)


def _value_and_error(number: Document) -> tuple[str, str]:
    """A constant and its declared error, for people."""
    error = number["error"]
    return f"{number['value']:.6g}", "not declared" if error is None else f"{error:.1e}"


PLANE_INDICES = "126"  # of Voigt: 11, 22 and 12
ABOUT = "effective modulus and stresses of the cell at the modal values"
COMMANDS = dict.fromkeys(("cell", "solve"), Command(ABOUT, arguments, run))
