"""What Gmsh reads from a mesh; `msh.py` has it run in a process of its own, without NumPy."""

from __future__ import annotations

import sys
from array import array
from pathlib import Path
from typing import Any, cast


def arrays_of_gmsh(path: Path) -> dict[str, array[Any]]:
    """Return what Gmsh reads from a mesh, in flat arrays.

    Returns:
        tags of nodes and their points, three coordinates each; for each type of element of an
        entity "block ENTITY TYPE WIDTH NAME", the tags of the nodes, WIDTH of each element; groups;
        their names in UTF-8, each with a zero byte at its end; members, group and entity in turn;
        entities; and numbers: the dimension and the count of partitions.

    Raises:
        RuntimeError: Gmsh says that the file is wrong.
        Exception: What Gmsh raises.
    """
    # Gmsh gives lists where it finds no NumPy, which takes as long to import as Gmsh itself.
    cast("dict[str, object]", sys.modules).setdefault("numpy", None)
    import gmsh

    gmsh.initialize(["", "-v", "0"], readConfigFiles=False, interruptible=False)
    gmsh.option.setNumber("General.NumThreads", 1)
    gmsh.logger.start()
    gmsh.merge(str(path))
    for text in gmsh.logger.get():
        if text.startswith("Error"):
            raise RuntimeError(text)
    tags, points, _ = gmsh.model.mesh.getNodes()
    dimension = 3 if gmsh.model.getEntities(3) else 2  # of volumes, or of surfaces
    entities = [tag for _, tag in gmsh.model.getEntities(dimension)]
    arrays: dict[str, array[Any]] = {}
    for entity in entities:
        found, _, nodes = gmsh.model.mesh.getElements(dimension, entity)
        for kind, block in zip(found, nodes, strict=True):
            name, _, _, width, _, _ = gmsh.model.mesh.getElementProperties(kind)
            if not width or len(block) % width:
                raise RuntimeError(f"{name} has no fixed number of nodes")
            arrays[f"block {entity} {kind} {width} {name}"] = array("q", block)
    groups = [tag for _, tag in gmsh.model.getPhysicalGroups(dimension)]
    names = [gmsh.model.getPhysicalName(dimension, group) for group in groups]
    members: list[int] = []
    for group in groups:
        for entity in gmsh.model.getEntitiesForPhysicalGroup(dimension, group):
            members += [group, entity]
    return arrays | {
        "tags": array("q", tags),
        "points": array("d", points),
        "groups": array("q", groups),
        "names": array("B", "".join(f"{name}\0" for name in names).encode()),
        "members": array("q", members),
        "entities": array("q", entities),
        "numbers": array("q", [dimension, gmsh.model.getNumberOfPartitions()]),
    }
