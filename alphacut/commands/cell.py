"""Command ``alphacut cell``, also ``python -m rve solve``: one sample of the cell."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import TextIO, cast

import numpy as np
from numpy.typing import ArrayLike

from alphacut.base.kept_files import whole_file
from alphacut.base.number_text import text_table
from alphacut.case.cell import CellCase
from alphacut.case.material import MeshedCell
from alphacut.case.parse import parse
from alphacut.case.structures import with_structures
from alphacut.commands.options import Command, add_common, require_petsc, write_answer
from alphacut.io.files import Document, ranks
from alphacut.io.provenance import versions
from alphacut.rve.cell.cell import STRAIN
from alphacut.rve.result.engineering_constants import NAMES, engineering_constants
from alphacut.rve.result.result import HomogenisedStiffness
from alphacut.rve.series.fibre_constants import fibre_constants
from alphacut.rve.spheres.result import HomogenisedSpheres, hill_average
from alphacut.stages.cell import (
    GPA,
    UPPER_BOUND,
    CellProblem,
    constant_label,
    isotropic_label,
    key_and_unit,
    require_bounds,
    require_tolerance,
)
from alphacut.stochastic import ThetaDistribution

PLANE_INDICES = "126"
"""Of Voigt: 11, 22 and 12."""


def arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options of `alphacut cell`."""
    add_common(parser)
    change, about = "modulus.method={}".format, "prism, slices, series or auto; short for --set"
    parser.add_argument("--method", dest="set", action="append", type=change, help=about)
    parser.add_argument(
        "--export", metavar="FILE", help="mesh, displacements, stresses: .msh, .vtu, .xdmf"
    )


def run(options: argparse.Namespace, out: TextIO) -> int:
    """Solves the cell at the nominal values, checks and writes its result; exit status 0."""
    kind = with_structures(CellCase, built=False)
    content = parse(kind, options.case, options.set).content
    require_petsc(options.petsc, content)
    problem = CellProblem.of(content, options.petsc)
    problem.require_mesh()
    result = problem.solve(parallel=ranks() > 1)
    require_tolerance(result.error, content.modulus.tolerance)
    references = problem.references()
    if result.has_isotropic_constants:
        require_bounds((result.modulus / GPA,) * 2, references, problem.cell.particles)
    document = {**document_of(result), "references": references}
    if options.export:
        document["export"] = export(problem, Path(options.export))
    text = summary(document, result.convention)
    if solver := problem.model().solver_text:
        text += f"Cell: {solver}\n"
    write_answer(options, document, out, text)
    return 0


def export(problem: CellProblem, path: Path) -> Document:
    """Writes the mesh with displacements and stresses; returns the file and its number of nodes."""
    from alphacut.rve.prism.model import PrismModel
    from alphacut.rve.prism.own_mesh import MeshModel

    mesh, cell = problem.mesh, problem.cell
    if isinstance(cell, MeshedCell):
        assert mesh.file is not None
        law = cast("ThetaDistribution", problem.nominal_radius)
        fields = MeshModel(mesh.file).fields(law, cell.nominal_phases)
    else:
        nominal = problem.nominal
        model = PrismModel(mesh.size, mesh.layers, outline=nominal.outline)
        fields = model.fields(nominal.radius_map, nominal.matrix, [nominal.inclusion])
    with whole_file(path) as partial:
        nodes = fields.write(partial)
    return {"file": str(path), "nodes": nodes}


def document_of(result: HomogenisedStiffness) -> Document:
    """The result of a cell as a JSON document; moduli and stresses in GPa, errors beside them."""
    curve, is_isotropic = result.curve, result.has_isotropic_constants
    errors = result.stiffness_errors if result.errors else None
    return {
        "E_GPa": result.modulus / GPA if is_isotropic else None,
        "nu": result.poisson if is_isotropic else None,
        "stress_GPa": _stresses(curve.mean),
        "fibres": fibres(result),
        "stiffness_GPa": None if result.stiffness is None else result.stiffness / GPA,
        "stiffness_error_GPa": None if errors is None else errors / GPA,
        "plane": {
            definition: dict(map(_constant, NAMES, constants.values, constants.errors))
            for definition, constants in engineering_constants(result).items()
        },
        "curve": {
            "theta": curve.theta,
            "weights": curve.weights,
            "s11": curve.s11 / GPA,
            "s12": curve.s12 / GPA,
        },
        "unknowns": result.unknowns,
        "iterations": list(result.iterations),
        "seconds": result.seconds,
        "method": result.method,
        "solver": result.solver,
        "error": dict(result.error),
        "declared_error": declared_errors(result),
        "checks": dict(result.checks),
        "versions": versions(),
    }


def fibres(result: HomogenisedStiffness) -> Document:
    """Constants of fibres with their declared errors, moduli in GPa; empty for other particles."""
    if not result.is_of_fibres:
        return {}
    constants = fibre_constants(result)
    return dict(_constant(x, value, constants.errors[x]) for x, value in constants.values.items())


def _constant(name: str, value: float, error: float) -> tuple[str, Document]:
    """Key and entry of a constant: a modulus in GPa, a ratio as it is; error None if unknown."""
    key, unit = key_and_unit(name)
    return key, {"value": value / unit, "error": None if np.isnan(error) else error / unit}


def _stresses(values: ArrayLike) -> Document:
    return dict(zip(("s11", "s12"), np.asarray(values) / GPA, strict=True))


def declared_errors(result: HomogenisedStiffness) -> Document | None:
    """Declared absolute errors of E, ν and the mean stresses; None where there are none."""
    if not result.errors:
        return None
    if isinstance(result, HomogenisedSpheres):
        modulus, nu = result.error_of(hill_average)
        # σ11 under ε11 = ε22 and σ12 under ε12, from the moduli m = K, (C11 − C12)/2 and C44
        stresses = result.error_of(lambda m: STRAIN * np.array([2 * m[0] + 2 / 3 * m[1], 2 * m[2]]))
    else:
        modulus, nu = result.estimated_error * result.modulus, result.poisson_error
        stresses = np.abs(result.curve.mean) * result.modulus_errors[[0, 2]]
    return {"E_GPa": modulus / GPA, "nu": nu, "stress_GPa": _stresses(stresses)}


def summary(document: Document, convention: str) -> str:
    """The result as a table, each number with its declared error."""
    rows = [
        (label, value, "not declared" if error is None else f"{error:.1e}")
        for label, value, error in table_rows(document)
    ]
    if bounds := document["references"].get("hashin_shtrikman_E_GPa"):
        label, ends = f"{isotropic_label(convention)}, GPa", f"{bounds[0]:.4f} … {bounds[1]:.4f}"
        rows.append((label, ends, ""))
    iterations = ", ".join(map(str, document["iterations"]))
    cost = f", iterations {iterations}" if iterations else ""
    table = text_table((convention, "value", "± error"), rows)
    text = f"{table}{document['method']}, {document['unknowns']} unknowns{cost}\n"
    if document["declared_error"] is None:
        text += f"{UPPER_BOUND}\n"
    return text


def table_rows(document: Document) -> Iterator[tuple[str, str, float | None]]:
    """Yields (label, value, error) of E, ν, mean stresses, constants of fibres and of the plane."""
    errors = document["declared_error"] or {"stress_GPa": {}}
    for key, digits in (("E_GPa", "#.8g"), ("nu", ".6f")):
        number, none = document[key], "none: 2 G_T > 3 (C11 + C12)"
        text = none if number is None else f"{number:{digits}}"
        yield constant_label(key), text, errors.get(key)
    for key, stress in document["stress_GPa"].items():
        yield f"mean {key.replace('s', 'σ')}, GPa", f"{stress:#.9g}", errors["stress_GPa"].get(key)
    for key, number in document["fibres"].items():
        yield constant_label(key), f"{number['value']:.6g}", number["error"]
    if not document["plane"]:
        return
    stiffness, stiffness_errors = document["stiffness_GPa"], document["stiffness_error_GPa"]
    for i, j in zip(*np.triu_indices(3), strict=True):
        error = None if stiffness_errors is None else stiffness_errors[i, j]
        label = f"C{PLANE_INDICES[i]}{PLANE_INDICES[j]}, GPa"
        yield label, f"{stiffness[i, j]:.6g}", error
    for definition, constants in document["plane"].items():
        for key, number in constants.items():
            label = f"{constant_label(key)} ({definition})"
            yield label, f"{number['value']:.6g}", number["error"]


ABOUT = "effective modulus and stresses of the cell at the nominal values"
COMMANDS = dict.fromkeys(("cell", "solve"), Command(ABOUT, arguments, run))
