"""Gmsh's quadratic prisms of the product space, and their names: to and from its model.

Its 15-node prisms ("Prism 15", type 18) have Basix's order of nodes. Physical groups name phases.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from alphacut.fuzzy.arrays import Array, Ints
from alphacut.rve.mesh.periodicity import MeshError

PRISM_15 = 18
"""Gmsh's type of the element."""
MATRIX, INCLUSION = NAMES = "matrix", "inclusion"
"""Names of the phases in their order."""


@dataclass(frozen=True, eq=False)
class Prisms:
    """Prisms of the product space as Gmsh numbers them.

    Args:
        points: (x1, x2, θ) of all nodes, shape (n, 3).
        cells: Nodes of each prism in Basix's order, shape (m, 15).
        phase: Phase of each prism, an index of `names`, shape (m,).
        names: Names of the phases.
    """

    points: Array
    cells: Ints
    phase: Ints
    names: tuple[str, ...]


def read(gmsh: Any) -> Prisms:
    """All prisms of Gmsh's current model, each physical group of volumes a phase.

    Raises:
        MeshError: A volume is in no physical group or in two, or has other elements.
    """
    if parts := gmsh.model.getNumberOfPartitions():
        cure = "write the mesh before it is divided among processes"
        raise MeshError(f"the mesh is partitioned into {parts} parts", cure)
    tags, xyz, _ = gmsh.model.mesh.getNodes()
    number_of_tag = np.zeros(int(tags.max(initial=0)) + 1, np.int64)
    number_of_tag[tags] = np.arange(len(tags))
    names: list[str] = []
    cells: list[Ints] = []
    phases: list[Ints] = []
    grouped: set[int] = set()
    for _, group in gmsh.model.getPhysicalGroups(3):
        name = gmsh.model.getPhysicalName(3, group) or f"group {group}"
        volumes = gmsh.model.getEntitiesForPhysicalGroup(3, group).tolist()
        if grouped & set(volumes):
            raise MeshError(f"prisms of the physical group {name!r} are in another one too")
        grouped |= set(volumes)
        for volume in volumes:
            cells.append(_cells_of(gmsh, volume, name))
            phases.append(np.full(len(cells[-1]), len(names)))
        names.append(name)
    ungrouped = [tag for _, tag in gmsh.model.getEntities(3) if tag not in grouped]
    if ungrouped or not names:
        what = f"volume {ungrouped[0]}" if ungrouped else "the mesh"
        raise MeshError(f"{what} has no physical group that names its phase")
    # nodes of curves and surfaces alone belong to no prism
    used, compact = np.unique(number_of_tag[np.concatenate(cells)], return_inverse=True)
    points: Array = np.asarray(xyz, float).reshape(-1, 3)[used]
    return Prisms(points, compact.reshape(-1, 15), np.concatenate(phases), tuple(names))


def _cells_of(gmsh: Any, volume: int, name: str) -> Ints:
    """Node tags of the prisms of a volume, shape (m, 15), in Basix's order."""
    kinds, _, nodes = gmsh.model.mesh.getElements(3, volume)
    if list(kinds) != [PRISM_15]:
        found = ", ".join(gmsh.model.mesh.getElementProperties(kind)[0] for kind in kinds)
        raise MeshError(
            f"the physical group {name!r} holds {found or 'no elements'}",
            "mesh with Prism 15: extrude with recombine, Mesh.SecondOrderIncomplete = 1, order 2",
        )
    return np.asarray(nodes[0].astype(np.int64)).reshape(-1, 15)


ABAQUS_ORDER = [0, 1, 2, 3, 4, 5, 6, 9, 7, 12, 14, 13, 8, 10, 11]
"""Of a prism in Abaqus and VTK: edges of the lower triangle, of the upper, and vertical ones."""
