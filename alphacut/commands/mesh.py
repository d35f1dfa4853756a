"""``alphacut mesh``: the mesh of a case's cell in a format for other programs."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import TextIO

from alphacut.case.case import Case
from alphacut.case.idle import require_read
from alphacut.case.load import load
from alphacut.commands import options as common
from alphacut.export.fields import cell_fields, check_ending, prism_mesh, sphere_mesh, write_mesh
from alphacut.io.problem import BadInput
from alphacut.stages.material.cell import modal_parts

ABOUT = (
    "write the mesh of the cell at modal values: VTU for ParaView, .msh for Gmsh, .inp for Abaqus"
    " and CalculiX"
)
READ = ("radius", "cell", "mesh")


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    common.add_common(parser)
    common.add_keys(parser, common.MESH)
    common.add_radius(parser)
    common.add_flag(
        parser,
        "--fields",
        "solve, and write displacements and stresses as well (not with .inp): cylinders",
    )
    parser.add_argument(
        "--out",
        metavar="FILE",
        required=True,
        help="the mesh, in the format of its ending: .vtu, .vtk, .xdmf, .msh or .inp",
    )


def run(options: argparse.Namespace, petsc: Mapping[str, str], out: TextIO) -> int:
    """Mesh and write."""
    case = load(
        options.case,
        [*common.changes(options, common.MESH), *common.one_radius(options)],
        modal=True,
    )
    spheres = case.sections.cell is not None and case.cell.particles == "spheres"
    require_effect(options, case, spheres=spheres)
    check_ending(Path(options.out), fields=options.fields)
    counts: dict[str, object] = {}
    if spheres:
        radius, source = sphere_radius(options, case)
        mesh = sphere_mesh(case, radius)
        counts |= {"radius": radius, "radius_from": source}
    else:
        mesh = cell_fields(case) if options.fields else prism_mesh(case)
    write_mesh(mesh, Path(options.out))
    kind = "tetrahedra" if spheres else "wedges"
    counts |= {"nodes": len(mesh.points), kind: len(mesh.cells[0].data), "file": options.out}
    text = f"{counts['nodes']} nodes and {counts[kind]} quadratic {kind} in {options.out}\n"
    if spheres:
        text += f"radius {radius:.6g} of half the cell's side, from {source}\n"
    if options.fields:
        counts["declared_error"] = mesh.info or None
        errors = ", ".join(f"{name} {error:.1e}" for name, error in (mesh.info or {}).items())
        text += f"relative errors in L²: {errors or 'not known, particles nearly touch'}\n"
    common.answer(options, counts, out, text)
    return 0


def require_effect(options: argparse.Namespace, case: Case, *, spheres: bool) -> None:
    """Refuse options and keys that have no effect on the mesh.

    Raises:
        BadInput: One problem for each.
    """
    if spheres and options.fields:
        raise BadInput.of("--fields", "fields are those of cylinders, the case has spheres")
    if options.radius is not None and not spheres and case.mesh.interface == "sign":
        what = "prisms that do not follow the interface take no radius"
        raise BadInput.of("--radius", what, options.radius, "mesh.interface = conforming")
    # another kind of particles may need another method to be read at all
    chosen = ("cell.particles", "modulus.method") if "cell.particles" in case.changed else ()
    if spheres:
        require_read(case, ("radius", *chosen, "mesh.size"), "mesh of spheres")
    else:
        require_read(case, (*(READ if options.fields else ("radius", "mesh")), *chosen), "mesh")


def sphere_radius(options: argparse.Namespace, case: Case) -> tuple[float, str]:
    """The radius of the sphere over half the cell's side, and what it is from, in words."""
    radius = modal_parts(case)[0]
    middle = round(float(radius.distribution.quantile(0.5)), 12) + 0.0
    if options.radius is not None:
        source = "--radius"
    elif radius.extremes()[0] == radius.extremes()[1]:
        source = "the case, whose map is constant"
    else:
        source = f"the map at the median θ = {middle:g}"
    return float(radius(middle)), source
