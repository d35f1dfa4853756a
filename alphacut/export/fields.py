"""Meshes of a case's cell for other programs, with displacements and stresses on prisms."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from alphacut.io.files import whole_file
from alphacut.io.problem import BadInput
from alphacut.rve.cell import LOADS, Phase
from alphacut.stochastic import RadiusMap
from alphacut.stochastic.theta.truncated_normal import Array

if TYPE_CHECKING:
    import meshio

    from alphacut.rve.prism.fields import CellFields

Cell = tuple[RadiusMap, Phase, Phase]
"""Radius map, matrix and inclusion."""
# From Basix's order of a wedge's edges to meshio's, Abaqus's and Gmsh's reader's: lower triangle,
# upper triangle, vertical edges.
ORDER = [0, 1, 2, 3, 4, 5, 6, 9, 7, 12, 14, 13, 8, 10, 11]
# from there to VTK's: the lower triangle seen from outside
MIRRORED = [0, 2, 1, 3, 5, 4, 8, 7, 6, 11, 10, 9, 12, 14, 13]
# names of the element sets, where a format has sets in place of data
PHASES = ("MATRIX", "PARTICLE")
VTK_ORDER = {".vtu", ".vtk", ".xdmf"}
# read back, they give points, cells and phase
FORMATS = {".vtu": "vtu", ".vtk": "vtk", ".xdmf": "xdmf", ".msh": "gmsh", ".inp": "abaqus"}
FIELDLESS = {".inp"}


def prism_mesh(cell: Cell, size: float, layers: int) -> meshio.Mesh:
    """Quadratic wedges at a radius map, with phases (0 matrix, 1 particle)."""
    import meshio
    from meshio._mesh import topological_dimension

    from alphacut.rve.mesh.prism_grid import PrismGrid
    from alphacut.rve.mesh.triangulation import reference_radius, triangulate

    radius, _, _ = cell
    plane = triangulate(size=size, radius=reference_radius(radius))
    grid = PrismGrid(plane, layers)
    phase = np.tile(plane.inside.astype(np.int64), grid.layers)
    # meshio 5.3 reads and writes this cell but has forgotten its dimension
    topological_dimension.setdefault("wedge15", 3)
    return meshio.Mesh(
        grid.positions(radius), [("wedge15", grid.cells[:, ORDER])], cell_data={"phase": [phase]}
    )


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
    raise BadInput.of("--out", lacks, str(path), ", ".join(allowed))


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


COMPONENTS = ("11", "22", "12")
SIZES = (("displacement", 2), ("stress", 3))


def cell_fields(cell: Cell, size: float, layers: int) -> meshio.Mesh:
    """Total displacements and stresses under both loads at modal values.

    Stresses are means over the wedges of one phase that meet in a node; nodes on the interface
    stand twice, once for each phase, since
    stresses jump there. Point data: ``displacement_1_in_half_sides``,
    ``displacement_2_in_half_sides`` (halves of the cell's side) and ``stress_1_11_Pa`` … under ε11
    = ε22 = 0.01 (load 1) and ε12 = 0.01 (load 2); cell data: ``phase``.
    """
    import meshio
    from meshio._mesh import topological_dimension

    from alphacut.rve.prism import fields as prism
    from alphacut.rve.prism.model import PrismModel

    radius, matrix, inclusion = cell
    model = PrismModel(size, layers)
    fields = prism.cell_fields(model, radius, matrix, inclusion)
    data = point_data(fields.displacement, fields.stress)
    topological_dimension.setdefault("wedge15", 3)  # see alphacut.export.fields
    errors = relative_errors(fields, radius, (matrix, inclusion), data)
    wedges = [("wedge15", fields.cells[:, ORDER])]
    return meshio.Mesh(fields.points, wedges, data, {"phase": [fields.phase]}, info=errors)


def point_data(displacement: Array, stress: Array) -> dict[str, Array]:
    """Fields of both loads by name.

    Args:
        displacement: At n nodes, shape (n, 2, loads), in halves of the cell's side.
        stress: At the nodes, shape (n, 3, loads), in Pa.
    """
    displacements = {
        f"displacement_{load + 1}_in_half_sides": np.pad(displacement[..., load], ((0, 0), (0, 1)))
        for load in (0, 1)
    }
    stresses = {
        f"stress_{load + 1}_{name}_Pa": stress[:, row, load]
        for load in (0, 1)
        for row, name in enumerate(COMPONENTS)
    }
    return displacements | stresses


def relative_errors(
    fields: CellFields,
    radius: RadiusMap,
    phases: tuple[Phase, Phase],
    data: dict[str, Array],
) -> dict[str, float]:
    """Relative error of each load's displacement and stress in L², weighted with f_Θ.

    The truth is the multipole series at every node; empty where it refuses.

    Args:
        fields: Nodes, wedges and their volumes.
        radius: The radius map.
        phases: Matrix and inclusion.
        data: The fields at the nodes by name.
    """
    from alphacut.rve.series.field import SeriesField
    from alphacut.rve.series.truncation import SeriesError

    points, inside = fields.points, np.zeros(len(fields.points), bool)
    inside[fields.cells[fields.phase == 1]] = True
    weight = np.zeros(len(points))
    np.add.at(weight, fields.cells, fields.volume[:, None])
    exact = {
        f"{what}_{load + 1}": np.empty((len(points), size))
        for what, size in SIZES
        for load in (0, 1)
    }
    for theta in np.unique(points[:, 2]):
        at = np.flatnonzero(points[:, 2] == theta)
        field = SeriesField(float(radius(theta)), *phases)
        for load, strain in enumerate(LOADS):
            for what, function in (("displacement", field.displacement), ("stress", field.stress)):
                try:
                    values = function(points[at, :2], strain, inside=inside[at])
                except SeriesError:
                    return {}
                exact[f"{what}_{load + 1}"][at] = values
    return {name: _relative(_own(data, name), truth, weight) for name, truth in exact.items()}


def _own(data: dict[str, Array], name: str) -> Array:
    """A field of the export, shape (n, 2) or (n, 3)."""
    if name.startswith("stress"):
        return np.stack([data[f"{name}_{part}_Pa"] for part in COMPONENTS], axis=-1)
    return data[f"{name}_in_half_sides"][:, :2]


def _relative(own: Array, exact: Array, weight: Array) -> float:
    """Relative distance in L²; of stresses as tensors, σ12 counted twice."""
    twice = np.array([1.0, 1.0, 2.0])[: exact.shape[1]]
    apart, size = (weight @ (field**2 @ twice) for field in (own - exact, exact))
    return float(np.sqrt(apart / size))
