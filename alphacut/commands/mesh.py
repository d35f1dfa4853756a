"""``alphacut mesh``: the prism mesh of a case in a format for other programs."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import TextIO

from alphacut.case.load import load
from alphacut.commands.options import CELL_OPTIONS, add_common, add_keys, changes
from alphacut.export.fields import cell_fields
from alphacut.export.prism_mesh import check_ending, prism_mesh, write_mesh
from alphacut.io.files import as_json

ABOUT = (
    "write the prism mesh of the cell at modal values: VTU for ParaView, .msh for Gmsh, .inp for"
    " Abaqus and CalculiX"
)
KEYS = {option: key for option, key in CELL_OPTIONS.items() if key.startswith(("radius.", "mesh."))}


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    add_common(parser)
    add_keys(parser, KEYS)
    parser.add_argument(
        "--fields",
        action="store_true",
        help="solve, and write displacements and stresses of both loads as well (not with .inp)",
    )
    parser.add_argument(
        "--out",
        metavar="FILE",
        required=True,
        help="the mesh; its ending names the format: .vtu, .vtk, .xdmf, .msh or .inp",
    )


def run(options: argparse.Namespace, petsc: Mapping[str, str], out: TextIO) -> int:
    """Mesh and write."""
    case = load(options.case, changes(options, KEYS), modal=True)
    check_ending(Path(options.out), fields=options.fields)
    mesh = cell_fields(case) if options.fields else prism_mesh(case)
    write_mesh(mesh, Path(options.out))
    counts = {"nodes": len(mesh.points), "wedges": len(mesh.cells[0].data), "file": options.out}
    if options.json == "-":
        out.write(as_json(counts))
    elif not options.quiet:
        out.write(
            f"{counts['nodes']} nodes and {counts['wedges']} quadratic wedges in {options.out}\n"
        )
    return 0
