"""The prism mesh of a case as a meshio mesh: for ParaView, Gmsh or any other program that reads one of meshio's formats."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from alphacut.case import Case
from alphacut.cell import modal_values, parts
from alphacut.output import whole_file
from alphacut.problem import BadInput, Problem

if TYPE_CHECKING:
    import meshio

# From Basix's order of a wedge's edges to meshio's, Abaqus's and Gmsh's reader's: lower triangle, upper triangle, vertical edges.
ORDER = [0, 1, 2, 3, 4, 5, 6, 9, 7, 12, 14, 13, 8, 10, 11]
MIRRORED = [0, 2, 1, 3, 5, 4, 8, 7, 6, 11, 10, 9, 12, 14, 13]  # from there to VTK's: the lower triangle seen from outside
VTK_ENDINGS = (".vtu", ".vtk")


def prism_mesh(case: Case) -> meshio.Mesh:
    """Quadratic wedges of the physical-stochastic domain at the modal radius map, with the phase of each (0 matrix, 1 particle)."""
    import meshio
    from meshio._mesh import topological_dimension

    from rve.prism import reference_radius
    from rve.prism_grid import PrismGrid
    from rve.triangulation import triangulate

    radius, _, _ = parts(modal_values(case), case.numbers("radius.theta"))
    plane = triangulate(size=case.number("mesh.size"), radius=reference_radius(radius))
    grid = PrismGrid(plane, case.integer("mesh.layers"), case.text("mesh.interface") == "conforming")
    phase = np.tile(plane.inside.astype(np.int64), grid.layers)
    topological_dimension.setdefault("wedge15", 3)  # meshio 5.3 reads and writes this cell but has forgotten its dimension
    return meshio.Mesh(grid.positions(radius), [("wedge15", grid.cells[:, ORDER])], cell_data={"phase": [phase]})


def write_mesh(mesh: meshio.Mesh, path: Path) -> None:
    """Write a mesh in the format that the file's ending names, whole or not at all.

    Raises:
        BadInput: meshio knows no such ending, or the format has no quadratic wedges.
    """
    import meshio

    if path.suffix not in meshio.extension_to_filetypes:
        raise BadInput(Problem("--out", "this ending is not known", str(path), ".vtu, .vtk, .msh, .inp and others of meshio's"))
    if path.suffix in VTK_ENDINGS:
        mesh = meshio.Mesh(mesh.points, [("wedge15", mesh.cells[0].data[:, MIRRORED])], mesh.point_data, mesh.cell_data)
    try:
        with whole_file(path) as partial:
            meshio.write(partial, mesh, file_format="gmsh" if path.suffix == ".msh" else None)
    except meshio.WriteError as error:
        raise BadInput(Problem("--out", f"this format cannot hold the mesh: {error}", str(path), ".vtu, .msh, .inp")) from None
