"""Plane meshes of DOLFINx with tags of their cells, as triangles of the user's cell."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from alphacut.base.errors import RefusedError, require
from alphacut.rve.fenicsx import dolfinx
from alphacut.rve.mesh.plane import PlaneMesh

KINDS = {"triangle of 3 nodes": [0, 1, 2], "triangle of 6 nodes": [0, 1, 2, 5, 4, 3]}
"""Places of the vertices and of the middles of the edges 01, 02 and 12 among the nodes of a
triangle in Basix's order."""


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
    cells = mesh.geometry.dofmap
    kind = f"{mesh.topology.cell_name()} of {cells.shape[1]} nodes"
    require(kind in KINDS, "cells of the mesh", kind, ", ".join(KINDS))
    cure = "make it with MPI.COMM_SELF; `parallel=True` divides the work"
    require(mesh.comm.size == 1, "processes of the mesh", mesh.comm.size, "1", cure)

    if not isinstance(cell_tags, dolfinx.mesh.MeshTags):
        raise RefusedError("cell_tags", type(cell_tags).__name__, "MeshTags of the cells")
    # DOLFINx sorts the tags by cell and has one for each.
    tagged = cell_tags.indices if cell_tags.dim == 2 else []
    require(len(tagged) == len(cells), "tagged cells", len(tagged), f"all {len(cells)}")
    tags, phase = np.unique(cell_tags.values, return_inverse=True)
    unknown = set(names) - set(tags)
    require(not unknown, "tag of a name", unknown, f"tags of the cells: {tags}")
    of_phases = tuple(names.get(int(tag), f"group {tag}") for tag in tags)
    triangles = cells[:, KINDS[kind]].astype(np.int64)
    return PlaneMesh(mesh.geometry.x, triangles, phase, of_phases)
