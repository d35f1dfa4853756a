"""Prisms or sphere's cell of a case as a meshio mesh, for ParaView, Gmsh, Abaqus and CalculiX."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from alphacut.case.case import Case
from alphacut.io.files import whole_file
from alphacut.io.problem import BadInput, Problem
from alphacut.stages.material.cell import modal_parts

if TYPE_CHECKING:
    import meshio

# From Basix's order of a wedge's edges to meshio's, Abaqus's and Gmsh's reader's: lower triangle,
# upper triangle, vertical edges.
ORDER = [0, 1, 2, 3, 4, 5, 6, 9, 7, 12, 14, 13, 8, 10, 11]
# from there to VTK's: the lower triangle seen from outside
MIRRORED = [0, 2, 1, 3, 5, 4, 8, 7, 6, 11, 10, 9, 12, 14, 13]
# from Basix's order of a quadratic tetrahedron to meshio's, VTK's and Abaqus's
TETRAHEDRON = [0, 1, 2, 3, 9, 6, 8, 7, 5, 4]
FINEST = 0.02  # mesh size of a sphere's cell: some millions of tetrahedra
# names of the element sets, where a format has sets in place of data
PHASES = ("MATRIX", "PARTICLE")
VTK_ORDER = {".vtu", ".vtk", ".xdmf"}
# read back, they give points, cells and phase
FORMATS = {".vtu": "vtu", ".vtk": "vtk", ".xdmf": "xdmf", ".msh": "gmsh", ".inp": "abaqus"}
FIELDLESS = {".inp"}


def prism_mesh(case: Case) -> meshio.Mesh:
    """Quadratic wedges at the modal radius map, with phases (0 matrix, 1 particle)."""
    import meshio
    from meshio._mesh import topological_dimension

    from alphacut.rve.mesh.prism_grid import PrismGrid
    from alphacut.rve.mesh.triangulation import reference_radius, triangulate

    radius, _, _ = modal_parts(case)
    plane = triangulate(size=case.mesh.size, radius=reference_radius(radius))
    grid = PrismGrid(plane, case.mesh.layers, case.mesh.interface == "conforming")
    phase = np.tile(plane.inside.astype(np.int64), grid.layers)
    # meshio 5.3 reads and writes this cell but has forgotten its dimension
    topological_dimension.setdefault("wedge15", 3)
    return meshio.Mesh(
        grid.positions(radius), [("wedge15", grid.cells[:, ORDER])], cell_data={"phase": [phase]}
    )


def sphere_mesh(case: Case, radius: float) -> meshio.Mesh:
    """Curved quadratic tetrahedra of the periodic cell with its sphere, phases as of `prism_mesh`.

    Args:
        case: Gives the mesh size.
        radius: Over half the cell's side.

    Raises:
        BadInput: Spheres nearly touch, or the mesh size is below 0.02.
    """
    import meshio

    from alphacut.rve.mesh.planar import TouchingError
    from alphacut.rve.spheres.fem.octant import whole_cell

    if case.mesh.size < FINEST:
        what = "a cell of a sphere would have tens of millions of elements"
        raise case.refuse("mesh.size", what, f"{FINEST:g} or more")
    try:
        points, cells, inside = whole_cell(radius, size=case.mesh.size)
    except TouchingError as error:
        raise BadInput(Problem("radius", str(error))) from None
    phase = inside.astype(np.int64)
    return meshio.Mesh(points, [("tetra10", cells[:, TETRAHEDRON])], cell_data={"phase": [phase]})


def check_ending(path: Path, *, fields: bool = False) -> None:
    """Refuse an ending whose format cannot hold what is to be written, before anything is computed.

    Raises:
        BadInput: The ending names no format that keeps quadratic elements and their phase, or one
            without `fields` where they are wanted.
    """
    allowed = [ending for ending in FORMATS if not (fields and ending in FIELDLESS)]
    if path.suffix in allowed:
        return
    lacks = (
        "this format cannot hold fields"
        if path.suffix in FORMATS
        else "this ending names no format that holds quadratic elements and phases"
    )
    raise BadInput(Problem("--out", lacks, str(path), ", ".join(allowed)))


def write_mesh(mesh: meshio.Mesh, path: Path) -> None:
    """Write a mesh in the format that the file's ending names, whole or not at all.

    Where a format has no data on elements, the element sets MATRIX and PARTICLE tell the phases.

    Raises:
        BadInput: See `check_ending`.
    """
    import meshio

    check_ending(path, fields=bool(mesh.point_data))
    kind, elements, phase = mesh.cells[0].type, mesh.cells[0].data, mesh.cell_data["phase"]
    if path.suffix in VTK_ORDER and kind == "wedge15":
        mesh = meshio.Mesh(
            mesh.points, [(kind, elements[:, MIRRORED])], mesh.point_data, mesh.cell_data
        )
    if path.suffix in FIELDLESS:
        sets = {name: [np.flatnonzero(phase[0] == number)] for number, name in enumerate(PHASES)}
        mesh = meshio.Mesh(mesh.points, [(kind, elements)], cell_sets=sets)
    # else its numbers are in a second file, by the partial one's name
    own = {"data_format": "XML"} if path.suffix == ".xdmf" else {}
    with whole_file(path) as partial:
        meshio.write(partial, mesh, file_format=FORMATS[path.suffix], **own)
