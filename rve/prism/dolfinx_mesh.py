"""Plane meshes of DOLFINx with tags of their cells, as triangles of the user's cell."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from alphacut.base.errors import RefusedError, require
from alphacut.rve.fenicsx import dolfinx
from alphacut.rve.mesh.plane import PlaneMesh

ORDERS = {3: [0, 1, 2], 6: [0, 1, 2, 5, 4, 3]}
"""Places of the vertices and of the middles of the edges 01, 02 and 12 among the nodes of a
triangle in Basix's order, by their number."""


def plane_of_dolfinx(mesh: object, cell_tags: object, names: Mapping[int, str]) -> PlaneMesh:
    """Return the triangles of a DOLFINx mesh, with a phase for each tag of its cells.

    Args:
        mesh: Mesh of triangles of three or six nodes, whole on this process.
        cell_tags: MeshTags of its cells.
        names: Names of the phases by tag; "group TAG" for tags that are not in it.

    Raises:
        RefusedError: They are no such mesh and tags, a cell has no tag, or a name is of no tag.
    """
    if not isinstance(mesh, dolfinx.mesh.Mesh):
        raise RefusedError("mesh", type(mesh).__name__, "a mesh of DOLFINx")
    cell = mesh.topology.cell_name()
    cells = mesh.geometry.dofmap
    allowed = "plane triangles of three or six nodes"
    is_plane = cell == "triangle" and cells.shape[1] in ORDERS
    require(is_plane, "cells of the mesh", f"{cell} of {cells.shape[1]} nodes", allowed)
    cure = "make it with MPI.COMM_SELF; `parallel=True` divides the work"
    require(mesh.comm.size == 1, "processes of the mesh", mesh.comm.size, "1", cure)

    if not isinstance(cell_tags, dolfinx.mesh.MeshTags) or cell_tags.dim != 2:
        raise RefusedError("cell_tags", type(cell_tags).__name__, "MeshTags of the cells")
    # DOLFINx sorts the tags by cell and has one for each.
    missing = len(cells) - len(cell_tags.indices)
    require(not missing, "cell_tags", f"{missing} cells without one", f"a tag for {len(cells)}")
    tags, phase = np.unique(cell_tags.values, return_inverse=True)
    for tag in names:
        require(tag in tags, "tag of a name", tag, ", ".join(map(str, tags)))
    of_phases = tuple(names.get(int(tag), f"group {tag}") for tag in tags)
    triangles = cells[:, ORDERS[cells.shape[1]]].astype(np.int64)
    return PlaneMesh(mesh.geometry.x, triangles, phase, of_phases)
