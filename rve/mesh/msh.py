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
from typing import Any

import numpy as np
from numpy.typing import NDArray

from alphacut.base.arrays import Array, Ints
from alphacut.base.errors import RefusedError
from alphacut.base.extras import extra_named

VOLUME = 3
"""Dimension of the entities that hold prisms."""
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

        read = read_apart("alphacut.rve.mesh.msh:arrays_of_gmsh", path, library="Gmsh")
    order = np.argsort(read["tags"], kind="stable")
    rising = read["tags"][order]
    is_sound = bool(np.isfinite(read["points"]).all() and (np.diff(rising) > 0).all())
    elements: dict[tuple[int, int], Ints] = {}
    kinds: dict[int, str] = {}
    for key, wanted in read.items():
        if not key.startswith("block "):
            continue
        _, entity, kind, *words = key.split()
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
    names = dict(zip(groups, map(str, read["names"]), strict=True))
    entities = {int(entity) for entity in read["entities"]}
    dimension, partitions = (int(number) for number in read["numbers"])
    points = np.asarray(read["points"], float)
    return MshFile(points, elements, kinds, groups, names, entities, partitions, dimension)


def arrays_of_gmsh(path: Path) -> dict[str, NDArray[Any]]:
    """Return what Gmsh reads from a mesh, in arrays: the reader that runs apart.

    Returns:
        tags (nodes,) and points (nodes, 3); for each type of element of an entity "block ENTITY
        TYPE NAME", the tags of their nodes, shape (elements, nodes of one); groups and their names;
        members (group, entity); entities; and numbers: the dimension and the count of partitions.

    Raises:
        RuntimeError: Gmsh says that the file is wrong.
        Exception: What Gmsh raises.
    """
    import gmsh

    gmsh.initialize(["", "-v", "0"], readConfigFiles=False, interruptible=False)
    gmsh.option.setNumber("General.NumThreads", 1)
    gmsh.logger.start()
    gmsh.merge(str(path))
    for text in gmsh.logger.get():
        if text.startswith("Error"):
            raise RuntimeError(text)
    tags, points, _ = gmsh.model.mesh.getNodes()
    dimension = VOLUME if gmsh.model.getEntities(VOLUME) else SURFACE
    entities = [tag for _, tag in gmsh.model.getEntities(dimension)]
    blocks: dict[str, NDArray[Any]] = {}
    for entity in entities:
        found, _, nodes = gmsh.model.mesh.getElements(dimension, entity)
        for kind, block in zip(found, nodes, strict=True):
            name, _, _, width, _, _ = gmsh.model.mesh.getElementProperties(kind)
            rows = np.asarray(block, np.int64).reshape(-1, width)
            blocks[f"block {entity} {kind} {name}"] = rows
    groups = [tag for _, tag in gmsh.model.getPhysicalGroups(dimension)]
    members = [
        (group, int(entity))
        for group in groups
        for entity in gmsh.model.getEntitiesForPhysicalGroup(dimension, group)
    ]
    return blocks | {
        "tags": np.asarray(tags, np.int64),
        "points": np.reshape(points, (-1, 3)),
        "groups": np.array(groups, np.int64),
        "names": np.array([gmsh.model.getPhysicalName(dimension, g) for g in groups], str),
        "members": np.array(members, np.int64),
        "entities": np.array(entities, np.int64),
        "numbers": np.array([dimension, gmsh.model.getNumberOfPartitions()]),
    }
