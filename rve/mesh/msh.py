"""Meshes in Gmsh's format MSH, read by Gmsh in a process of its own.

Gmsh takes a file that is no mesh for a script and runs it, reads a file of options beside a mesh,
and damaged files end its process. So it is handed a copy that begins with $MeshFormat, alone in a
folder, without the section $Periodic: Gmsh moves the nodes of a mesh that was scaled by it.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.base.errors import RefusedError
from alphacut.base.extras import extra_named

SURFACE = 2
"""Dimension of the entities that hold plane triangles."""


@dataclass
class MshFile:
    """What a file in the format MSH says of its volumes, or of its surfaces where it has none.

    Args:
        points: Coordinates of the nodes, shape (n, 3).
        elements: Indices of the nodes in `points`, shape (elements, nodes of one), by the tag of
            the entity and Gmsh's number of the type of the element.
        kinds: Gmsh's name of each type of element, as "Prism 15".
        groups: Tags of the entities of each physical group.
        names: Names of physical groups, empty of those that have none.
        entities: Tags of all volumes (or surfaces).
        partitions: Number of parts into which the mesh is divided; 0 if it is whole.
        dimension: 3 of volumes, 2 of surfaces.
    """

    points: Array
    elements: dict[tuple[int, int], Ints]
    kinds: dict[int, str]
    groups: dict[int, list[int]]
    names: dict[int, str]
    entities: set[int]
    partitions: int
    dimension: int


def read_msh(content: bytes) -> MshFile:
    """Return what a mesh file in Gmsh's format MSH, of any version, says.

    Args:
        content: The file, which has nothing but comments before its section $MeshFormat.

    Raises:
        MissingLibraryError: Gmsh is not installed.
        RefusedError: Gmsh cannot read the file, ends, or takes too much memory or time; or a node
            has no finite place, or an element a node that is not there.
    """
    with extra_named():
        if find_spec("gmsh") is None:
            raise ModuleNotFoundError(name="gmsh")
    with TemporaryDirectory(prefix="alphacut-") as folder:
        path = Path(folder, "mesh.msh")
        # Results on nodes and elements, which some versions of Gmsh refuse, are not needed.
        others = rb"(?s)\$(Periodic|\w*Data|InterpolationScheme|Comments)\s.*?\$End\1\s*"
        path.write_bytes(re.sub(others, b"", content).lstrip())
        from alphacut.base.apart import read_apart  # which a cell without a file needs not

        read = read_apart("alphacut.rve.mesh.gmsh_arrays:arrays_of_gmsh", path, library="Gmsh")
    order = np.argsort(read["tags"], kind="stable")
    rising = read["tags"][order]
    is_sound = bool(np.isfinite(read["points"]).all() and (np.diff(rising) > 0).all())
    elements: dict[tuple[int, int], Ints] = {}
    kinds: dict[int, str] = {}
    for key, wanted in read.items():
        if not key.startswith("block "):
            continue
        _, entity, kind, width, *words = key.split()
        wanted = wanted.reshape(-1, int(width))
        place = np.minimum(np.searchsorted(rising, wanted), max(len(rising) - 1, 0))
        is_sound = is_sound and bool(len(rising)) and bool((rising[place] == wanted).all())
        if is_sound:
            elements[int(entity), int(kind)] = order[place]
        kinds[int(kind)] = " ".join(words)
    if not is_sound:
        reason = "with a node that is not there, stands twice or has no place"
        raise RefusedError("mesh.file", reason, "whole meshes", "write it anew by Gmsh")
    groups: dict[int, list[int]] = {int(group): [] for group in read["groups"]}
    for group, entity in read["members"].reshape(-1, 2):
        groups[int(group)].append(int(entity))
    names = dict(zip(groups, bytes(read["names"]).decode().split("\0")[:-1], strict=True))
    entities = {int(entity) for entity in read["entities"]}
    dimension, partitions = (int(number) for number in read["numbers"])
    points = read["points"].astype(float).reshape(-1, 3)
    return MshFile(points, elements, kinds, groups, names, entities, partitions, dimension)
