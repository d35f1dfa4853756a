"""Command ``alphacut cell``, also ``python -m rve solve``: one sample of the cell."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping
from functools import partial
from itertools import combinations_with_replacement
from pathlib import Path
from typing import NamedTuple, TextIO, cast

import numpy as np

from alphacut.base.kept_files import whole_file
from alphacut.base.number_text import range_text, text_table
from alphacut.case.cell import CellCase
from alphacut.case.material import MeshedCell
from alphacut.case.parse import parse
from alphacut.case.structures import with_structures
from alphacut.commands.options import require_petsc, write_answer
from alphacut.fuzzy.result import Nature
from alphacut.io.files import Document, ranks
from alphacut.io.provenance import versions
from alphacut.rve.cell.cell import STRAIN
from alphacut.rve.guaranteed_cuts import guaranteed_constants
from alphacut.rve.result.engineering_constants import NAMES, engineering_constants
from alphacut.rve.result.moduli import ISOTROPIC
from alphacut.rve.result.result import HomogenisedStiffness
from alphacut.rve.series.fibre_constants import fibre_constants
from alphacut.rve.spheres.result import HomogenisedSpheres, hill_average
from alphacut.stages.cell import (
    BOTH_BOUNDS,
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


def run(options: argparse.Namespace, out: TextIO) -> int:
    """Solve the cell of a case at its nominal values, check the result, and write it.

    Args:
        options: Of the command line: the case file `case` with its changes `set`, PETSc's options
            `petsc`, the file `export` for fields or None, `json` and `quiet`.
        out: Takes the table, or the JSON document with ``--json -``.

    Returns:
        Exit status 0.

    Raises:
        BadInput: The case is not valid.
        RefusedError: The cell does not fit its method, or E of spheres is outside its bounds.
        FailedError: The cell was not solved, or the declared error exceeds the tolerance of the
            case.
    """
    # The section of the structure is not built: a cell is solved whatever its frame is like.
    kind = partial(with_structures, CellCase, built=False)
    content = parse(kind, options.case, options.set).content
    require_petsc(options.petsc, content)
    problem = CellProblem.of(content, options.petsc)
    problem.require_mesh()
    result = problem.solve(parallel=ranks() > 1)
    require_tolerance(result.error, content.modulus.tolerance)
    references = problem.references()
    if result.has_isotropic_constants:
        young = result.modulus / GPA  # of one sample, so that it is both bounds
        require_bounds((young, young), references, problem.cell.particles)
    document = document_of(result)
    document["references"] = references
    document["bounds"] = None
    if problem.mesh.bounds:
        document["bounds"] = bounds_document(problem)
    if options.export:
        document["export"] = export(problem, Path(options.export))
    text = summary(document, result.convention)
    if solver := problem.model(parallel=ranks() > 1).solver_text:
        text += f"Cell: {solver}\n"
    write_answer(options, document, out, text)
    return 0


def export(problem: CellProblem, path: Path) -> Document:
    """Write the mesh of prisms with displacements and stresses at the nominal values.

    The fields are those of finite elements on prisms, whatever model the case names.

    Args:
        problem: The cell.
        path: File whose ending names the format: .msh, .vtu or .xdmf.

    Returns:
        Document with the "file" and the number of its "nodes".

    Raises:
        RefusedError: The ending is none of these, or a library is missing.
        OSError: The file cannot be written.
    """
    # DOLFINx takes seconds to import, and only this option needs it here.
    from alphacut.rve.prism.model import PrismModel
    from alphacut.rve.prism.own_mesh import MeshModel

    mesh = problem.mesh
    cell = problem.cell
    if isinstance(cell, MeshedCell):
        assert mesh.file is not None  # a cell of phases is one of a mesh from a file
        theta = cast("ThetaDistribution", problem.nominal_radius)
        fields = MeshModel(mesh.file).fields(theta, cell.nominal_phases)
    else:
        nominal = problem.nominal
        outline = nominal.outline
        model = PrismModel(mesh.size, mesh.layers, outline=outline, lattice=cell.lattice)
        fields = model.fields(nominal.radius_map, nominal.matrix, [nominal.inclusion])
    with whole_file(path) as partial:
        nodes = fields.write(partial)
    return {"file": str(path), "nodes": nodes}


def bounds_document(problem: CellProblem) -> Document:
    """Return guaranteed bounds of a mesh from a file at the nominal values.

    Args:
        problem: The cell.

    Returns:
        "constants" with the lower and upper end of each by its key, such as E_GPa and nu; and
        "stiffness_GPa", the lower and the upper bound as quadratic forms, shape (2, 3, 3).

    Raises:
        FailedError: The mesh is too coarse for a lower bound.
    """
    [bounds] = problem.mesh_bounds([None], parallel=ranks() > 1)
    constants = {}
    for name, cuts in guaranteed_constants([bounds], problem.average or ISOTROPIC).items():
        key, unit = key_and_unit(name)
        if name == "E":
            key = "E_GPa"
        constants[key] = cuts[0] / unit
    stiffness = np.array([bounds.lower, bounds.upper]) / GPA
    return {"constants": constants, "stiffness_GPa": stiffness}


def document_of(result: HomogenisedStiffness) -> Document:
    """Return the result of a cell as a JSON document, moduli and stresses in GPa.

    Args:
        result: Homogenised stiffness of the cell, in SI units.

    Returns:
        E and ν are None if no isotropic solid has the moduli of the cell. "stress_GPa" has the mean
        σ11 and σ12. "fibres" has the constants of a transversely isotropic cell, and is else empty.
        "stiffness_GPa" is the plane stiffness, shape (3, 3). "plane" has E_x, E_y, ν_xy and G_xy
        for each of their definitions, such as plane strain. "curve" has the stresses over θ with
        the weights of the mean. Errors are absolute, and None where the model declares none. The
        other entries are facts of the computation.
    """
    curve = result.curve
    document: Document = {"E_GPa": None, "nu": None}
    if result.has_isotropic_constants:
        document |= {"E_GPa": result.modulus / GPA, "nu": result.poisson}
    s11, s12 = np.asarray(curve.mean) / GPA
    document["stress_GPa"] = {"s11": s11, "s12": s12}
    document["fibres"] = {}
    if result.is_of_fibres:
        fibres = fibre_constants(result)
        document["fibres"] = _constants(fibres.values, fibres.errors)
    errors = result.stiffness_errors if result.errors else None
    for key, moduli in (("stiffness_GPa", result.stiffness), ("stiffness_error_GPa", errors)):
        document[key] = None if moduli is None else moduli / GPA
    document["plane"] = {
        definition: _constants(
            dict(zip(NAMES, constants.values, strict=True)),
            dict(zip(NAMES, constants.errors, strict=True)),
        )
        for definition, constants in engineering_constants(result).items()
    }
    document["curve"] = {
        "theta": curve.theta,
        "weights": curve.weights,
        "s11": curve.s11 / GPA,
        "s12": curve.s12 / GPA,
    }
    for name in ("unknowns", "iterations", "seconds", "method", "solver", "error", "checks"):
        document[name] = getattr(result, name)
    document["declared_error"] = declared_errors(result)
    document["versions"] = versions()
    return document


def _constants(values: Mapping[str, float], errors: Mapping[str, float]) -> Document:
    """Return value and error of each constant by its key: moduli in GPa, ratios as they are.

    Args:
        values: Values in SI units by name, such as "E_T" and "nu_LT".
        errors: Absolute errors by the same names, NaN where unknown, which becomes None.
    """
    found: Document = {}
    for name, value in values.items():
        key, unit = key_and_unit(name)
        error = None  # JSON has no NaN
        if not np.isnan(errors[name]):
            error = errors[name] / unit
        found[key] = {"value": value / unit, "error": error}
    return found


def declared_errors(result: HomogenisedStiffness) -> Document | None:
    """Return the declared absolute errors of E, ν and the mean stresses.

    Args:
        result: Homogenised stiffness of a cell with one fibre or sphere, or of an own mesh, with
            relative errors of its moduli, if the model declares some.

    Returns:
        "E_GPa" and "stress_GPa" with s11 and s12 in GPa, and "nu"; None if no errors are declared.
    """
    if not result.errors:
        return None
    if isinstance(result, HomogenisedSpheres):
        modulus, nu = result.error_of(hill_average)
        # `error_of(f)` gives the absolute error of f(m), of which the three moduli of the cube
        # m = (K, (C11 − C12)/2, C44) have errors. Under ε11 = ε22 = ε the stress is
        # σ11 = ε (C11 + C12) = ε (2 K + 2/3 m[1]); under the shear ε12 = ε it is σ12 = 2 ε C44.
        # Both rise with each modulus, as `error_of` needs.
        stresses = result.error_of(lambda m: STRAIN * np.array([2 * m[0] + 2 / 3 * m[1], 2 * m[2]]))
    else:
        modulus = result.estimated_error * result.modulus
        nu = result.poisson_error
        # The mean σ11 is proportional to C11 + C12, and σ12 to C33. These are moduli 0 and 2 of the
        # plane, so that stresses have their relative errors.
        stresses = np.abs(result.curve.mean) * result.modulus_errors[[0, 2]]
    s11, s12 = np.asarray(stresses) / GPA
    return {"E_GPa": modulus / GPA, "nu": nu, "stress_GPa": {"s11": s11, "s12": s12}}


def summary(document: Document, convention: str) -> str:
    """Return the result of a cell as a text table, each number with its declared error.

    Args:
        document: Result of the cell, moduli in GPa, as `document_of` makes it, and "references".
            Their bounds "hashin_shtrikman_E_GPa" are shown if they are there, and a
            "declared_error" of None gives a warning.
        convention: Average of the stiffness that E and ν belong to, in words.

    Returns:
        Lines that end with a newline: the table, the method with its cost, and the warning.
    """
    rows: list[tuple[str, str, str]] = []
    for label, value, error in table_rows(document):
        error_words = "not declared"
        if error is not None:
            error_words = f"{error:.1e}"
        rows.append((label, value, error_words))
    if bounds := document["references"].get("hashin_shtrikman_E_GPa"):
        lower, upper = bounds
        rows.append((f"{isotropic_label(convention)}, GPa", f"{lower:.4f} … {upper:.4f}", ""))
    bounds_of_file = document.get("bounds")
    if bounds_of_file:
        for key, (lower, upper) in bounds_of_file["constants"].items():
            value = range_text(lower, upper, Nature.GUARANTEED, 6)
            rows.append((f"{constant_label(key)}, bounds", value, ""))
    text = text_table((convention, "value", "± error"), rows)
    text += f"{document['method']}, {document['unknowns']} unknowns"
    if document["iterations"]:
        text += f", iterations {', '.join(map(str, document['iterations']))}"
    if bounds_of_file:
        text += f"\n{BOTH_BOUNDS}"
    elif document["declared_error"] is None:
        text += f"\n{UPPER_BOUND}"
    return f"{text}\n"


class Row(NamedTuple):
    """Label and text of a number, and its declared error; None without one."""

    label: str
    value: str
    error: float | None


def table_rows(document: Document) -> Iterator[Row]:
    """Yield the rows of a cell's table.

    Args:
        document: Result of the cell, moduli and stresses in GPa. "E_GPa", "nu", "declared_error"
            and "stiffness_error_GPa" may be None. "stress_GPa" has the mean stresses s11 and s12,
            and "declared_error" errors by these keys. "fibres" and "plane" have "value" and "error"
            of constants, and may be empty. The matrices of the stiffness have the shape (3, 3).

    Yields:
        Label, text and declared error in the unit of the label. The rows are E, ν, the mean
        stresses and the constants of fibres. If "plane" is not empty, the entries C11, C12, C16,
        C22, C26 and C66 of the stiffness and the constants along x and y follow.
    """
    errors = document["declared_error"] or {"stress_GPa": {}}
    for key, digits in (("E_GPa", "#.8g"), ("nu", ".6f")):
        number = document[key]
        # In plane strain E = G (3 − G/k) with the shear modulus G = G_T of the average and the
        # bulk modulus k = (C11 + C12)/2 of the plane: it is positive for G < 3 k alone.
        text = "none: 2 G_T > 3 (C11 + C12)"
        if number is not None:
            text = f"{number:{digits}}"
        yield Row(constant_label(key), text, errors.get(key))
    for key, stress in document["stress_GPa"].items():
        label = f"mean {key.replace('s', 'σ')}, GPa"
        yield Row(label, f"{stress:#.9g}", errors["stress_GPa"].get(key))
    for key, constant in document["fibres"].items():
        yield Row(constant_label(key), f"{constant['value']:.6g}", constant["error"])
    if not document["plane"]:
        return
    indices = "126"  # of Voigt's order for the components 11, 22 and 12 of the plane
    stiffness = document["stiffness_GPa"]
    stiffness_errors = document["stiffness_error_GPa"]
    for i, j in combinations_with_replacement(range(3), 2):  # the upper triangle, row by row
        error = None
        if stiffness_errors is not None:
            error = stiffness_errors[i, j]
        yield Row(f"C{indices[i]}{indices[j]}, GPa", f"{stiffness[i, j]:.6g}", error)
    for definition, constants in document["plane"].items():
        for key, constant in constants.items():
            label = f"{constant_label(key)} ({definition})"
            yield Row(label, f"{constant['value']:.6g}", constant["error"])
