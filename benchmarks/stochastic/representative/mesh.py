"""Conforming periodic meshes of many discs by Gmsh: curved quadratic triangles."""

from __future__ import annotations

from typing import TYPE_CHECKING

import gmsh
import numpy as np

from alphacut.rve.mesh.geometry import PeriodicSquare
from alphacut.stochastic.particles.discs import Discs
from alphacut.stochastic.particles.relaxation import smallest_gap

if TYPE_CHECKING:
    from dolfinx.mesh import Mesh

    from alphacut.stochastic.theta.truncated_normal import Array


def many_mesh(discs: Discs, *, size: float, around: int = 12) -> tuple[Mesh, Array]:
    """Mesh the periodic box of `discs`, scaled to the unit square.

    The box is shifted so that no circle grazes a side: the moduli do not depend on where a periodic
    box begins.

    Args:
        discs: Non-overlapping discs in a periodic square, with gaps.
        size: Wanted edge length in the matrix, over the mean spacing of the discs √(area/n).
        around: Edges around each circle, at least.

    Returns:
        The DOLFINx mesh and whether each of its cells lies in a disc, shape (m,).

    Raises:
        ValueError: The discs touch or overlap, or the box is not a periodic square.
        RuntimeError: Gmsh made no valid mesh.
    """
    from mpi4py import MPI

    import alphacut.rve.petsc  # noqa: F401

    try:
        from dolfinx.io import gmsh as reader
    except ImportError:  # its name before DOLFINx 0.10
        from dolfinx.io import gmshio as reader

    if not discs.periodic or discs.size[0] != discs.size[1]:
        raise ValueError("the cell must be a periodic square")
    if smallest_gap(discs) <= 0:
        raise ValueError(
            "discs of the cell touch or overlap; pack them with a gap, so that they can be meshed"
        )
    side = float(discs.size[0])
    centres, radii = _off_the_sides(discs) / side, discs.radii / side
    gmsh.initialize(["", "-v", "1"], readConfigFiles=False, interruptible=False)
    try:
        square = PeriodicSquare(0.0, 1.0)
        inside = square.cut(np.column_stack([centres, radii]))
        square.bind_sides()
        gmsh.option.setNumber("General.NumThreads", 1)
        gmsh.option.setNumber("Mesh.MeshSizeMax", size / np.sqrt(len(discs)))
        gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", around)
        gmsh.option.setNumber("Mesh.MeshSizeExtendFromBoundary", 1)
        gmsh.model.mesh.generate(2)
        gmsh.model.mesh.setOrder(2)
        surfaces = [tag for _, tag in gmsh.model.getEntities(2)]
        gmsh.model.addPhysicalGroup(2, [tag for tag in surfaces if tag not in inside], 1)
        gmsh.model.addPhysicalGroup(2, [tag for tag in surfaces if tag in inside], 2)
        mesh, tags = reader.model_to_mesh(gmsh.model, MPI.COMM_SELF, 0, gdim=2)[:2]
    finally:
        gmsh.finalize()
    values = np.empty(mesh.topology.index_map(2).size_local, int)
    values[tags.indices] = tags.values
    return mesh, values == 2


def _off_the_sides(discs: Discs) -> Array:
    """Centres in a box that starts where circles least graze its sides or corners."""
    best, centres = -1.0, discs.centres
    for shift in np.random.default_rng(0).random((400, 2)):
        moved = np.mod(discs.centres + shift * discs.size, discs.size)
        beyond = moved - discs.size * np.round(moved / discs.size)
        side = np.abs(np.abs(beyond) - discs.radii[:, None]).min()
        corner = np.abs(np.hypot(*beyond.T) - discs.radii).min()
        if min(side, corner) > best:
            best, centres = min(side, corner), moved
    return centres
