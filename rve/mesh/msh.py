"""Meshes in Gmsh's format MSH, versions 2 and 4.1, text or binary, read without Gmsh.

Gmsh takes a file that is no mesh for a script and runs it, and damaged files end its process. Here
each count must fit the bytes that follow it, and each node of an element must be there.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from alphacut.base.arrays import Array, Ints

NODES = {
    1: 2, 2: 3, 3: 4, 4: 4, 5: 8, 6: 6, 7: 5, 8: 3, 9: 6, 10: 9, 11: 10, 12: 27, 13: 18, 14: 14,
    15: 1, 16: 8, 17: 20, 18: 15, 19: 13, 20: 9, 21: 10, 22: 12, 23: 15, 24: 15, 25: 21, 26: 4,
    27: 5, 28: 6, 29: 20, 30: 35, 31: 56, 92: 64, 93: 125,
}  # fmt: skip
"""Number of nodes of an element by Gmsh's number of its type."""
SOLIDS = {
    4: "Tetrahedron", 5: "Hexahedron", 6: "Prism", 7: "Pyramid", 11: "Tetrahedron",
    12: "Hexahedron", 13: "Prism", 14: "Pyramid", 17: "Hexahedron", 18: "Prism", 19: "Pyramid",
    29: "Tetrahedron", 30: "Tetrahedron", 31: "Tetrahedron", 92: "Hexahedron", 93: "Hexahedron",
}  # fmt: skip
"""Names of the elements of three dimensions by their type."""
VERSIONS = ("2", "2.0", "2.1", "2.2", "4.1")
REWRITE = "write it as MSH 4.1 or 2.2"
FORMAT = re.compile(rb"\s*(\S+)\s+([01])\s+(\d+)[ \t\r]*\n")
NAME = re.compile(rb'\s*(\d+)\s+(-?\d+)\s+"([^"]*)"')
SECTION = re.compile(rb"^\$(\w+)[ \t\r]*\n", re.MULTILINE)
VOLUME = 3  # dimension of the entities that hold prisms


_Source = Callable[[bytes], "_Numbers"]
"""The numbers of a section by its name."""


class DamagedMeshError(ValueError):
    """A file that does not agree with itself, or is of a version that is not read."""


@dataclass
class MshFile:
    """What a file in the format MSH says of its volumes.

    Args:
        points: Coordinates of the nodes, shape (n, 3).
        elements: Of each volume and type of element, the indices of the nodes in `points`, shape
            (elements, nodes of one).
        groups: Volumes of each physical group.
        names: Names of physical groups, of those that have one.
        volumes: All volumes that have elements or are named among the entities.
        partitions: Number of parts into which the mesh is divided; 0 if it is whole.
    """

    points: Array
    elements: dict[tuple[int, int], Ints]
    groups: dict[int, list[int]] = field(default_factory=dict)
    names: dict[int, str] = field(default_factory=dict)
    volumes: set[int] = field(default_factory=set)
    partitions: int = 0


def parse_msh(content: bytes) -> MshFile:
    """Return the volumes of a file in the format MSH, from its first section $MeshFormat on.

    Raises:
        DamagedMeshError: The file is cut off, contradicts itself, or is of another version.
    """
    sections = _sections(content)
    match = FORMAT.match(sections.get(b"MeshFormat", b""))
    if match is None:
        raise DamagedMeshError('without the line "4.1 0 8" or "2.2 0 8" below $MeshFormat')
    version, is_binary, size = match[1].decode("latin-1"), match[2] == b"1", int(match[3])
    if version not in VERSIONS or size != 8:
        raise DamagedMeshError(f"of version {version} with numbers of {size} bytes; {REWRITE}")
    order = "<"
    if is_binary:
        one = sections[b"MeshFormat"][match.end() : match.end() + 4]
        if one not in (b"\x01\0\0\0", b"\0\0\0\x01"):
            raise DamagedMeshError("in text, where the line below $MeshFormat says bytes (1)")
        order = "<" if one == b"\x01\0\0\0" else ">"
    elif b"\0" in content:
        raise DamagedMeshError("in bytes, where the line below $MeshFormat says text (0)")

    def numbers(name: bytes) -> _Numbers:
        if name not in sections:
            raise DamagedMeshError(f"without ${name.decode()}")
        kind = _Binary if is_binary else _Text
        return kind(sections[name], order)

    read = _read_version_4 if version == "4.1" else _read_version_2
    mesh = read(numbers, b"Entities" in sections)
    if b"PartitionedEntities" in sections:
        partitions = numbers(b"PartitionedEntities").sizes(1)[0]
        mesh.partitions = max(int(partitions), 1)
    for dimension, tag, name in NAME.findall(sections.get(b"PhysicalNames", b"")):
        if int(dimension) == VOLUME:
            mesh.names[int(tag)] = name.decode("utf-8", "replace")
    return mesh


class _Numbers:
    """Numbers of a section, taken one after another; raises DamagedMeshError where it ends."""

    def take(self, count: int, kind: str) -> NDArray[np.generic]:
        """Return the next numbers of a type of NumPy without its byte order, as "f8"."""
        raise NotImplementedError

    def ints(self, count: int) -> Ints:
        """Return the next numbers that the format calls int."""
        return self.take(count, "i4").astype(np.int64)

    def sizes(self, count: int) -> Ints:
        """Return the next numbers that version 4.1 calls size_t; they are less than 2⁵³."""
        values = self.take(count, "u8").astype(float)
        if (values >= 2.0**53).any():
            raise DamagedMeshError(f"with a count or tag of {values.max():.3g}")
        return values.astype(np.int64)

    def int_list(self, count: int) -> list[int]:
        """Return the next ints as a list."""
        return [int(x) for x in self.ints(count)]

    def size_list(self, count: int) -> list[int]:
        """Return the next numbers, size_t each, as a list."""
        return [int(x) for x in self.sizes(count)]

    def count(self) -> int:
        """Return the next number, a size_t."""
        return int(self.sizes(1)[0])

    def floats(self, count: int) -> Array:
        """Return the next real numbers."""
        return self.take(count, "f8").astype(float)


class _Text(_Numbers):
    """Numbers of a section in text."""

    def __init__(self, content: bytes, order: str) -> None:
        try:
            self.values = np.array(content.split(), float)
        except ValueError as error:
            raise DamagedMeshError(f"with {error}") from None
        self.place = 0

    def take(self, count: int, kind: str) -> NDArray[np.generic]:
        if not 0 <= count <= len(self.values) - self.place:
            raise DamagedMeshError(f"with {count} numbers promised and fewer there")
        values = self.values[self.place : self.place + count]
        self.place += count
        is_whole = np.isfinite(values) & (values == np.floor(values)) & (np.abs(values) < 2.0**53)
        if kind != "f8" and not is_whole.all():
            raise DamagedMeshError("with a count or tag that is no whole number")
        if kind == "u8" and (values < 0).any():
            raise DamagedMeshError("with a count or tag below 0")
        return values


class _Binary(_Numbers):
    """Numbers of a section in bytes."""

    def __init__(self, content: bytes, order: str) -> None:
        self.content, self.order, self.place = content, order, 0

    def take(self, count: int, kind: str) -> NDArray[np.generic]:
        dtype = np.dtype(self.order + kind)
        if not 0 <= count * dtype.itemsize <= len(self.content) - self.place:
            raise DamagedMeshError(f"with {count} numbers promised and fewer there")
        values = np.frombuffer(self.content, dtype, count, self.place)
        self.place += count * dtype.itemsize
        return values


def _sections(content: bytes) -> dict[bytes, bytes]:
    """What stands between $NAME and $EndNAME, by name; of a name that comes twice the first."""
    sections: dict[bytes, bytes] = {}
    place = 0
    while match := SECTION.search(content, place):
        end = content.find(b"$End" + match[1], match.end())
        if end < 0:
            raise DamagedMeshError(f"cut off inside ${match[1].decode('latin-1')}")
        sections.setdefault(match[1], content[match.end() : end])
        place = end + len(match[1]) + 4
    return sections


def _read_version_4(numbers: _Source, has_entities: bool) -> MshFile:
    """The volumes of version 4.1, whose physical groups stand with the entities."""
    mesh = MshFile(np.empty((0, 3)), {})
    groups = defaultdict[int, list[int]](list)
    if has_entities:
        for volume, physical in _entities(numbers(b"Entities")):
            mesh.volumes.add(volume)
            for group in physical:
                groups[group].append(volume)
    mesh.groups = dict(groups)
    source = numbers(b"Nodes")
    n_blocks, n_nodes, _, _ = source.size_list(4)
    tags, points = [], []
    for _ in range(n_blocks):
        dimension, _, is_parametric = source.int_list(3)
        count = source.count()
        if is_parametric not in (0, 1) or dimension not in range(4):
            raise DamagedMeshError("with a block of nodes of an unknown kind")
        tags.append(source.sizes(count))
        width = 3 + dimension * is_parametric
        points.append(source.floats(count * width).reshape(count, width)[:, :3])
    all_tags = np.concatenate([np.empty(0, np.int64), *tags])
    mesh.points = np.concatenate([np.empty((0, 3)), *points])
    if len(all_tags) != n_nodes:
        raise DamagedMeshError(f"with {n_nodes} nodes promised and {len(all_tags)} there")
    source = numbers(b"Elements")
    n_blocks, _, _, _ = source.size_list(4)
    cells = defaultdict[tuple[int, int], list[Ints]](list)
    for _ in range(n_blocks):
        dimension, entity, kind = source.int_list(3)
        width = _node_count(kind)
        count = source.count()
        block = source.sizes(count * (1 + width)).reshape(count, 1 + width)
        if dimension == VOLUME:
            cells[entity, kind].append(block[:, 1:])
    return _with_elements(mesh, all_tags, cells)


def _entities(source: _Numbers) -> Iterator[tuple[int, list[int]]]:
    """Yield each volume of version 4.1 and the physical groups that it is in."""
    counts = source.size_list(4)
    for dimension, count in enumerate(counts):
        for _ in range(count):
            tag = int(source.ints(1)[0])
            source.floats(3 if dimension == 0 else 6)  # the point, or its box
            physical = source.int_list(source.count())
            if dimension > 0:
                source.ints(source.count())  # the entities that bound it
            if dimension == VOLUME:
                yield tag, physical


def _read_version_2(numbers: _Source, has_entities: bool) -> MshFile:
    """The volumes of version 2, whose elements name their physical group and their entity."""
    source = numbers(b"Nodes")
    tags, points = _nodes_of_version_2(source)
    mesh = MshFile(points, {})
    source = numbers(b"Elements")
    groups = defaultdict[int, set[int]](set)
    cells = defaultdict[tuple[int, int], list[Ints]](list)
    for kind, labels, nodes in _elements_of_version_2(source):
        if kind not in SOLIDS:
            continue
        if labels.shape[1] < 2:
            raise DamagedMeshError("with elements that name no entity")
        # behind group and entity stand the number of an element's parts, and these; − if a ghost
        mesh.partitions = max(mesh.partitions, int(np.abs(labels[:, 3:]).max(initial=0)))
        for entity in map(int, np.unique(labels[:, 1])):
            is_inside = labels[:, 1] == entity
            cells[entity, kind].append(nodes[is_inside])
            for group in map(int, np.unique(labels[is_inside, 0])):
                if group:
                    groups[group].add(entity)
    mesh.groups = {group: sorted(groups[group]) for group in sorted(groups)}
    return _with_elements(mesh, tags, cells)


def _nodes_of_version_2(source: _Numbers) -> tuple[Ints, Array]:
    """Tags (n,) and points (n, 3) of the nodes of version 2."""
    if isinstance(source, _Binary):
        count = _count_line(source)
        kind = np.dtype([("tag", f"{source.order}i4"), ("point", f"{source.order}f8", (3,))])
        if count * kind.itemsize > len(source.content) - source.place:
            raise DamagedMeshError(f"with {count} nodes promised and fewer there")
        table = np.frombuffer(source.content, kind, count, source.place)
        return table["tag"].astype(np.int64), table["point"].astype(float)
    count = source.count()
    rows = source.floats(4 * count).reshape(count, 4)
    return rows[:, 0].astype(np.int64), rows[:, 1:].copy()


def _elements_of_version_2(source: _Numbers) -> Iterator[tuple[int, Ints, Ints]]:
    """Yield types, labels (m, labels) and tags of nodes (m, nodes) of runs of elements."""
    if isinstance(source, _Binary):
        remaining = _count_line(source)
        while remaining > 0:
            kind, count, n_labels = source.int_list(3)
            width = 1 + _label_count(n_labels) + _node_count(kind)
            if not 0 < count <= remaining:
                raise DamagedMeshError(f"with a run of {count} elements")
            run = source.ints(count * width).reshape(count, width)
            yield kind, run[:, 1 : 1 + n_labels], run[:, 1 + n_labels :]
            remaining -= count
        return
    rows = defaultdict[tuple[int, int], list[Ints]](list)
    for _ in range(source.count()):
        _, kind, n_labels = source.int_list(3)
        row = source.ints(_label_count(n_labels) + _node_count(kind))
        rows[kind, n_labels].append(row)
    for (kind, n_labels), rows_of_kind in rows.items():
        table = np.array(rows_of_kind)
        yield kind, table[:, :n_labels], table[:, n_labels:]


def _count_line(source: _Binary) -> int:
    """The count that stands as a line of text before the bytes of a section of version 2."""
    line = source.content[source.place : source.place + 32].partition(b"\n")[0]
    if not re.fullmatch(rb"\s*\d{1,15}\s*", line):
        raise DamagedMeshError("without a count")
    source.place += len(line) + 1
    return int(line)


def element_name(kind: int) -> str:
    """Return Gmsh's name of a type of element, as "Prism 15"."""
    return f"{SOLIDS.get(kind, 'type ' + str(kind))} {NODES[kind]}"


def _node_count(kind: int) -> int:
    if kind not in NODES:
        raise DamagedMeshError(f"with elements of the unknown type {kind}")
    return NODES[kind]


def _label_count(count: int) -> int:
    if not 0 <= count <= 1000:
        raise DamagedMeshError(f"with {count} tags of an element")
    return count


def _with_elements(mesh: MshFile, tags: Ints, cells: dict[tuple[int, int], list[Ints]]) -> MshFile:
    """The mesh with its elements, whose nodes are turned from tags into indices.

    Args:
        mesh: Its points, shape (n, 3).
        tags: Tags of the points, shape (n,).
        cells: Runs of elements of a volume and a type, each the tags of nodes, shape (m, nodes).
    """
    if not np.isfinite(mesh.points).all():
        raise DamagedMeshError("with a node whose place is no number")
    order = np.argsort(tags, kind="stable")
    rising = tags[order]
    if (np.diff(rising) == 0).any():
        raise DamagedMeshError("with two nodes of one tag")
    for key, runs in cells.items():
        wanted = np.concatenate(runs)
        place = np.minimum(np.searchsorted(rising, wanted), max(len(rising) - 1, 0))
        if wanted.size and (not len(rising) or (rising[place] != wanted).any()):
            raise DamagedMeshError("with an element whose node is not there")
        mesh.elements[key] = order[place]
        mesh.volumes.add(key[0])
    return mesh
