"""Files of a cell with its fields: Gmsh's, VTK's, XDMF and Abaqus's."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from alphacut.export.mesh import COMPONENTS, meshio_with_wedges, wedge_mesh
from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import RefusedError
from alphacut.io.files import say, whole_file
from alphacut.rve.mesh.file import write
from alphacut.rve.mesh.gmsh_prisms import MESHIO_ORDER

if TYPE_CHECKING:
    import meshio

    from alphacut.rve.prism.fields import CellFields

FORMATS = {".msh": "gmsh", ".vtu": "vtu", ".xdmf": "xdmf", ".inp": "abaqus"}
"""Endings of names with the format that they mean."""


def write_cell(fields: CellFields, path: Path) -> int:
    """Writes mesh, phases, displacements and stresses; returns the number of nodes written.

    The ending of the file's name chooses the format. Gmsh's file holds the mesh once, with fields
    as values at the nodes of its elements; in VTK's and XDMF nodes of the interface stand twice,
    since stresses jump there. Abaqus's has no fields.
    """
    kind = FORMATS.get(path.suffix)
    if kind is None:
        allowed = f"names that end in {', '.join(FORMATS)}"
        raise RefusedError("--export", str(path), allowed)
    if kind == "gmsh":
        return _write_gmsh(fields, path)
    import meshio

    if kind == "abaqus":
        say(f"{path} holds mesh and phases; displacements and stresses go to .msh, .vtu or .xdmf")
        mesh = _abaqus_mesh(fields)
    else:
        mesh = wedge_mesh(fields.points, fields.cells, fields.phase, _point_fields(fields))
    if kind == "xdmf":
        meshio.write(path, mesh, file_format=kind, data_format="XML")
        return len(fields.points)
    with whole_file(path) as partial:
        meshio.write(partial, mesh, file_format=kind)
    return len(mesh.points)


def _write_gmsh(fields: CellFields, path: Path) -> int:
    """Writes a mesh with its fields by Gmsh, nodes of the interface once; returns their number."""
    count = int(fields.node.max()) + 1  # nodes; a point of each phase has the same one
    points: Array = np.empty((count, 3))
    points[fields.node] = fields.points
    values = {name: data[fields.cells] for name, data in _point_fields(fields).items()}
    shaped = {name: x.reshape(len(x), 15, -1) for name, x in values.items()}
    write(path, points, fields.node[fields.cells], fields.phase, fields.names, shaped)
    return count


def _point_fields(fields: CellFields) -> dict[str, Array]:
    """Displacements, (n, 3), and stresses, (n,), of each load case by name with their unit."""
    data = {}
    for load in range(fields.displacement.shape[-1]):
        in_space = np.pad(fields.displacement[..., load], ((0, 0), (0, 1)))  # none along θ
        data[f"displacement_{load + 1}_in_half_sides"] = in_space
        for row, name in enumerate(COMPONENTS):
            data[f"stress_{load + 1}_{name}_Pa"] = fields.stress[:, row, load]
    return data


def _abaqus_mesh(fields: CellFields) -> meshio.Mesh:
    """Mesh of meshio for Abaqus: interface nodes once, a set of elements for each phase."""
    count = int(fields.node.max()) + 1  # nodes; a point of each phase has the same one
    points: Array = np.empty((count, 3))
    points[fields.node] = fields.points
    cells = fields.node[fields.cells][:, MESHIO_ORDER]
    sets = {name: [np.flatnonzero(fields.phase == k)] for k, name in enumerate(fields.names)}
    return meshio_with_wedges().Mesh(points, [("wedge15", cells)], cell_sets=sets)
