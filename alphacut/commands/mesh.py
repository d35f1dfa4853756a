"""``alphacut mesh``: the prism mesh of a case in a format for other programs."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import TextIO

from alphacut.case.idle import require_read
from alphacut.case.load import load
from alphacut.commands.options import MESH, add_common, add_keys, answer, changes
from alphacut.export.fields import cell_fields
from alphacut.export.prism_mesh import check_ending, prism_mesh, write_mesh

ABOUT = (
    "write the prism mesh of the cell at modal values: VTU for ParaView, .msh for Gmsh, .inp for"
    " Abaqus and CalculiX"
)
READ = ("radius", "cell", "mesh")


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    add_common(parser)
    add_keys(parser, MESH)
    parser.add_argument(
        "--fields",
        action="store_true",
        help="solve, and write displacements and stresses as well (not with .inp)",
    )
    parser.add_argument(
        "--out",
        metavar="FILE",
        required=True,
        help="the mesh, in the format of its ending: .vtu, .vtk, .xdmf, .msh or .inp",
    )


def run(options: argparse.Namespace, petsc: Mapping[str, str], out: TextIO) -> int:
    """Mesh and write."""
    case = load(options.case, changes(options, MESH), modal=True)
    require_read(case, READ if options.fields else ("radius", "mesh"), "mesh")
    check_ending(Path(options.out), fields=options.fields)
    if case.sections.cell and case.cell.particles == "spheres":
        raise case.refuse("cell.particles", "the mesh is one of cylinders", "cylinders")
    mesh = cell_fields(case) if options.fields else prism_mesh(case)
    write_mesh(mesh, Path(options.out))
    counts: dict[str, object] = {
        "nodes": len(mesh.points),
        "wedges": len(mesh.cells[0].data),
        "file": options.out,
    }
    text = f"{counts['nodes']} nodes and {counts['wedges']} quadratic wedges in {options.out}\n"
    if options.fields:
        counts["declared_error"] = mesh.info or None
        parts = ", ".join(f"{name} {error:.1e}" for name, error in (mesh.info or {}).items())
        text += f"relative errors in L²: {parts or 'not known, particles nearly touch'}\n"
    answer(options, counts, out, text)
    return 0
