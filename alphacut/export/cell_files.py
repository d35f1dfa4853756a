"""Files of a cell with its fields: Gmsh's, VTK's, XDMF and Abaqus's."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import RefusedError
from alphacut.io.files import say, whole_file
from alphacut.rve.mesh.file import ABAQUS_ORDER, write

if TYPE_CHECKING:
    from alphacut.rve.prism.fields import CellFields

COMPONENTS = ("11", "22", "12")
FORMATS = {".msh": "gmsh", ".vtu": "vtu", ".xdmf": "xdmf", ".inp": "abaqus"}
"""Endings of names with the format that they mean."""


def write_cell(fields: CellFields, path: Path) -> int:
    """Writes mesh, phases, displacements and stresses; returns the number of nodes written.

    The ending of the file's name chooses the format. Gmsh's file holds the mesh once, with fields
    as values at the nodes of its elements; in VTK's and XDMF nodes of the interface stand twice,
    since stresses jump there, and each prism is three quadratic tetrahedra. Abaqus's has no fields.
    """
    kind = FORMATS.get(path.suffix)
    if kind is None:
        allowed = f"names that end in {', '.join(FORMATS)}"
        raise RefusedError("--export", str(path), allowed)
    if kind == "gmsh":
        return _write_gmsh(fields, path)
    if kind == "abaqus":
        say(f"{path} holds mesh and phases; displacements and stresses go to .msh, .vtu or .xdmf")
        return _write_abaqus(fields, path)
    import meshio

    fine = fields.in_tetrahedra()
    cells, phase = [("tetra10", fine.cells)], {"phase": [fine.phase]}
    mesh = meshio.Mesh(fine.points, cells, _point_fields(fine), phase)
    if kind == "xdmf":
        meshio.write(path, mesh, file_format=kind, data_format="XML")
    else:
        with whole_file(path) as partial:
            meshio.write(partial, mesh, file_format=kind)
    return len(fine.points)


def _write_gmsh(fields: CellFields, path: Path) -> int:
    """Writes a mesh with its fields by Gmsh, nodes of the interface once; returns their number."""
    points = _node_points(fields)
    values = {name: data[fields.cells] for name, data in _point_fields(fields).items()}
    shaped = {name: x.reshape(len(x), 15, -1) for name, x in values.items()}
    write(path, points, fields.node[fields.cells], fields.phase, fields.names, shaped)
    return len(points)


def _point_fields(fields: CellFields) -> dict[str, Array]:
    """Displacements, (n, 3), and stresses, (n,), of each load case by name with their unit."""
    data = {}
    for load in range(fields.displacement.shape[-1]):
        in_space = np.pad(fields.displacement[..., load], ((0, 0), (0, 1)))  # none along θ
        data[f"displacement_{load + 1}_in_half_sides"] = in_space
        for row, name in enumerate(COMPONENTS):
            data[f"stress_{load + 1}_{name}_Pa"] = fields.stress[:, row, load]
    return data


def _node_points(fields: CellFields) -> Array:
    """Points of the nodes, (n, 3); on the interface a point of each phase has the same node."""
    points: Array = np.empty((fields.node.max() + 1, 3))
    points[fields.node] = fields.points
    return points


def _write_abaqus(fields: CellFields, path: Path) -> int:
    """Writes nodes, prisms and a set of elements for each phase; returns the number of nodes."""
    points, cells = _node_points(fields), 1 + fields.node[fields.cells][:, ABAQUS_ORDER]
    numbers = np.arange(1, 1 + max(len(points), len(cells)))
    with whole_file(path) as partial, partial.open("wb") as file:
        file.write(b"*HEADING\nx1 and x2 in halves of the side of the cell, x3 is theta\n*NODE\n")
        rows = np.column_stack([numbers[: len(points)], points])
        np.savetxt(file, rows, "%d, %.16g, %.16g, %.16g")
        for phase, name in enumerate(fields.names):
            chosen = fields.phase == phase
            file.write(f"*ELEMENT, TYPE=C3D15, ELSET={name}\n".encode())
            rows = np.column_stack([numbers[: len(cells)], cells])[chosen]
            np.savetxt(file, rows, "%d", delimiter=", ")  # 16 numbers, the most of a line
    return len(points)
