"""The cell's mesh for other programs, with displacements and stresses on prisms."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from alphacut.fuzzy.arrays import Array, Rows
from alphacut.io.files import whole_file
from alphacut.rve.cell import LOADS, Cell

if TYPE_CHECKING:
    import meshio

    from alphacut.rve.prism.fields import CellFields

# From Basix's order of a wedge's edges to that of meshio, Abaqus and Gmsh: lower triangle, upper
# triangle, vertical edges; from there to VTK's, the lower triangle seen from outside.
ORDER = [0, 1, 2, 3, 4, 5, 6, 9, 7, 12, 14, 13, 8, 10, 11]
MIRRORED = [0, 2, 1, 3, 5, 4, 8, 7, 6, 11, 10, 9, 12, 14, 13]
COMPONENTS = ("11", "22", "12")


def write_mesh(mesh: meshio.Mesh, path: Path) -> None:
    """Writes a mesh for VTK, whole or not at all."""
    import meshio

    with whole_file(path) as partial:
        meshio.write(partial, mesh, file_format="vtu")


def wedges(
    points: Array, cells: Rows, phase: Rows, data: dict[str, Array] | None = None
) -> meshio.Mesh:
    """Quadratic wedges in VTK's order with their phase, 0 the matrix, 1 the particle.

    Args:
        points: (x1, x2, θ), shape (n, 3).
        cells: Nodes in Basix's order, shape (m, 15).
        phase: Shape (m,).
        data: Fields at the points by name.
    """
    import meshio
    from meshio._mesh import topological_dimension

    # meshio 5.3 reads and writes this cell but has forgotten its dimension
    topological_dimension.setdefault("wedge15", 3)
    cells = cells[:, ORDER][:, MIRRORED]
    return meshio.Mesh(points, [("wedge15", cells)], data, {"phase": [phase]})


def prism_mesh(cell: Cell, size: float, layers: int) -> meshio.Mesh:
    """The mesh at a radius map.

    Args:
        cell: Radius map and phases.
        size: Of the triangles, in halves of the cell's side.
        layers: In θ.
    """
    from alphacut.rve.mesh.prism_grid import PrismGrid
    from alphacut.rve.mesh.triangulation import reference_radius, triangulate

    outline = cell.outline
    radius = reference_radius(cell.radius, outline)
    plane = triangulate(size=size, radius=radius, outline=outline)
    grid = PrismGrid(plane, layers)
    phase = np.tile(plane.inside.astype(np.int64), grid.layers)
    return wedges(grid.positions(cell.radius), grid.cells, phase)


def cell_fields(cell: Cell, size: float, layers: int) -> meshio.Mesh:
    """The mesh with total displacements and stresses under both loads.

    Stresses are means over the wedges of one phase that meet in a node; nodes on the interface
    stand twice, once for each phase, since stresses jump there. Point data:
    ``displacement_1_in_half_sides`` (halves of the cell's side) and ``stress_1_11_Pa`` … under ε11
    = ε22 = 0.01 (load 1) and ε12 = 0.01 (load 2).
    """
    from alphacut.rve.prism import fields as prism
    from alphacut.rve.prism.model import PrismModel

    model = PrismModel(size, layers, outline=cell.outline)
    fields = prism.cell_fields(model, cell.radius, cell.matrix, cell.inclusion)
    return wedges(fields.points, fields.cells, fields.phase, point_data(fields))


def point_data(fields: CellFields) -> dict[str, Array]:
    """Fields of both loads by name."""
    data = {}
    for load in range(len(LOADS)):
        flat = np.pad(fields.displacement[..., load], ((0, 0), (0, 1)))
        data[f"displacement_{load + 1}_in_half_sides"] = flat
        for row, name in enumerate(COMPONENTS):
            data[f"stress_{load + 1}_{name}_Pa"] = fields.stress[:, row, load]
    return data
