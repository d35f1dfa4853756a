"""Meshes in Gmsh's format MSH, versions 2 and 4.1, text or binary, read without Gmsh.

Gmsh takes a file that is no mesh for a script and runs it, and damaged files end its process. Here
each count must fit the bytes that follow it, and each node of an element must be there.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

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
FACES = {
    2: "Triangle", 3: "Quadrangle", 9: "Triangle", 10: "Quadrangle", 16: "Quadrangle",
    20: "Triangle", 21: "Triangle", 22: "Triangle", 23: "Triangle", 24: "Triangle",
    25: "Triangle",
}  # fmt: skip
"""Names of the elements of two dimensions by their type."""
REWRITE = "write it as MSH 4.1 or 2.2"
VOLUME = 3
"""Dimension of the entities that hold prisms."""
SURFACE = 2
"""Dimension of the entities that hold plane triangles."""

_Source = Callable[[bytes], "_Numbers"]
"""The numbers of a section by its name."""


class DamagedMeshError(ValueError):
    """A file that does not agree with itself, or is of a version that is not read."""


@dataclass
class MshFile:
    """What a file in the format MSH says of its volumes, or of its surfaces.

    Args:
        points: Coordinates of the nodes, shape (n, 3).
        elements: Indices of the nodes in `points`, shape (elements, nodes of one), by the tag of
            the entity and the type of the element.
        groups: Tags of the entities of each physical group.
        names: Names of physical groups, of those that have one.
        entities: Tags of all volumes (or surfaces) that have elements or are listed in the file.
        partitions: Number of parts into which the mesh is divided; 0 if it is whole.
    """

    points: Array
    elements: dict[tuple[int, int], Ints]
    groups: dict[int, list[int]] = field(default_factory=dict)
    names: dict[int, str] = field(default_factory=dict)
    entities: set[int] = field(default_factory=set)
    partitions: int = 0


def parse_msh(content: bytes, dimension: int = VOLUME) -> MshFile:
    """Return what a mesh file in Gmsh's format MSH says of its volumes, or of its surfaces.

    Versions 2 to 2.2 and 4.1 are read, in text or in bytes of either order. Only elements of one
    dimension are kept, by the tag of their entity and the number of their type, and only physical
    groups of that dimension.

    Args:
        content: The file from its first section $MeshFormat on.
        dimension: 3 for volumes, 2 for surfaces.

    Returns:
        MshFile with the coordinates of all nodes; elements as indices of these nodes; entities of
        the dimension, also empty ones; groups; names of groups; and the number of partitions, 0 for
        a mesh that is whole. A file without such entities gives empty ones.

    Raises:
        DamagedMeshError: The file is cut off, contradicts itself (counts that do not fit, tags that
            come twice or are missing), lacks $Nodes or $Elements, or is of another version.
    """
    sections = _sections(content)
    match = re.match(rb"\s*(\S+)\s+([01])\s+(\d+)[ \t\r]*\n", sections.get(b"MeshFormat", b""))
    if match is None:
        raise DamagedMeshError('without the line "4.1 0 8" or "2.2 0 8" below $MeshFormat')
    version = match[1].decode("latin-1")
    is_binary = match[2] == b"1"
    size = int(match[3])
    if version not in ("2", "2.0", "2.1", "2.2", "4.1") or size != 8:
        raise DamagedMeshError(f"of version {version} with numbers of {size} bytes; {REWRITE}")
    order = "<"
    if is_binary:
        # The number 1 in four bytes tells their order.
        one = sections[b"MeshFormat"][match.end() : match.end() + 4]
        if one not in (b"\x01\0\0\0", b"\0\0\0\x01"):
            raise DamagedMeshError("in text, where the line below $MeshFormat says bytes (1)")
        order = "<" if one == b"\x01\0\0\0" else ">"
    elif b"\0" in content:
        raise DamagedMeshError("in bytes, where the line below $MeshFormat says text (0)")

    def numbers(name: bytes) -> _Numbers:
        """Return the numbers of a section; DamagedMeshError if there is no such section."""
        if name not in sections:
            raise DamagedMeshError(f"without ${name.decode()}")
        return _Binary(sections[name], order) if is_binary else _Text(sections[name])

    if version == "4.1":
        mesh = _read_version_4(numbers, dimension, has_entities=b"Entities" in sections)
    else:
        mesh = _read_version_2(numbers, dimension)
    if b"PartitionedEntities" in sections:
        mesh.partitions = max(numbers(b"PartitionedEntities").count(), 1)
    names = re.findall(rb'\s*(\d+)\s+(-?\d+)\s+"([^"]*)"', sections.get(b"PhysicalNames", b""))
    for of_dimension, tag, name in names:
        if int(of_dimension) == dimension:
            mesh.names[int(tag)] = name.decode("utf-8", "replace")
    return mesh


class _Numbers:
    """Numbers of a section, taken one after another; DamagedMeshError is raised where it ends."""

    def take(self, count: int, kind: str) -> NDArray[np.generic]:
        """Return the next numbers, and move behind them.

        Args:
            count: How many; 0 gives an empty array.
            kind: Type of NumPy without its byte order: "i4", "u8" or "f8".

        Returns:
            Array of shape (count,). Its type is `kind` for bytes, and float for text.

        Raises:
            DamagedMeshError: `count` is negative or more than what is left, or a number in text is
                not of the type: broken or too large for "i4" and "u8", negative for "u8".
        """
        raise NotImplementedError

    def ints(self, count: int) -> Ints:
        """Return the next numbers that the format calls int."""
        return self.take(count, "i4").astype(np.int64)

    def sizes(self, count: int) -> Ints:
        """Return the next numbers that version 4.1 calls size_t, shape (count,).

        Raises:
            DamagedMeshError: One is 2⁵³ or more, which no mesh has and a float does not hold; or
                fewer than `count` are left, or `count` or a number is negative.
        """
        values = self.take(count, "u8").astype(float)
        if (values >= 2.0**53).any():
            raise DamagedMeshError(f"with a count or tag of {values.max():.3g}")
        return values.astype(np.int64)

    def int_list(self, count: int) -> list[int]:
        """Return the next ints as a list."""
        return [int(number) for number in self.ints(count)]

    def size_list(self, count: int) -> list[int]:
        """Return the next numbers, size_t each, as a list."""
        return [int(number) for number in self.sizes(count)]

    def count(self) -> int:
        """Return the next number, a size_t."""
        return int(self.sizes(1)[0])

    def floats(self, count: int) -> Array:
        """Return the next real numbers."""
        return self.take(count, "f8").astype(float)


class _Text(_Numbers):
    """Numbers of a section in text."""

    def __init__(self, content: bytes) -> None:
        try:
            self.values = np.array(content.split(), float)
        except ValueError as error:
            reason = "decimal commas: write points" if b"," in content else str(error)
            raise DamagedMeshError(f"with {reason}") from None
        self.place = 0

    def take(self, count: int, kind: str) -> NDArray[np.generic]:
        """Return the next numbers of a text as floats, shape (count,), and move behind them.

        Args:
            count: How many; 0 gives an empty array.
            kind: "f8" for any numbers, NaN and infinite ones too; "i4" for whole numbers; "u8" for
                whole numbers that are not negative.

        Raises:
            DamagedMeshError: `count` is negative or more than what is left; a number for "i4" or
                "u8" is not whole, not finite, or 2⁵³ or more in magnitude; or one for "u8" is
                negative.
        """
        if not 0 <= count <= len(self.values) - self.place:
            raise DamagedMeshError(f"with {count} numbers promised and fewer there")
        values = self.values[self.place : self.place + count]
        self.place += count
        if kind != "f8":
            _require_whole(values)
        if kind == "u8" and (values < 0).any():
            raise DamagedMeshError("with a count or tag below 0")
        return values


def _require_whole(values: Array) -> None:
    """Raise DamagedMeshError unless numbers of a text, shape (n,), are counts or tags.

    Each must be whole and below 2⁵³ in magnitude, up to which floats hold whole numbers exactly.
    """
    is_whole = np.isfinite(values) & (values == np.floor(values)) & (np.abs(values) < 2.0**53)
    if not is_whole.all():
        raise DamagedMeshError("with a count or tag that is no whole number")


class _Binary(_Numbers):
    """Numbers of a section in bytes, whose order is that of NumPy, < or >."""

    def __init__(self, content: bytes, order: str) -> None:
        self.content = content
        self.order = order
        self.place = 0

    def take(self, count: int, kind: str) -> NDArray[np.generic]:
        return self.records(count, np.dtype(self.order + kind))

    def records(self, count: int, dtype: np.dtype[Any]) -> NDArray[np.generic]:
        """Return the next records of a structured or plain type of NumPy, and move behind them.

        Args:
            count: How many; 0 gives an empty array.
            dtype: Type of a record, with its byte order.

        Returns:
            Array of shape (count,) that cannot be written to.

        Raises:
            DamagedMeshError: `count` is negative or more than what is left.
        """
        # The count comes from the file. It is compared with the bytes that are there before any
        # memory is taken, so that a damaged count cannot ask for terabytes.
        if not 0 <= count * dtype.itemsize <= len(self.content) - self.place:
            raise DamagedMeshError(f"with {count} numbers promised and fewer there")
        values = np.frombuffer(self.content, dtype, count, self.place)
        self.place += count * dtype.itemsize
        return values

    def line_with_count(self) -> int:
        """Return the count in the line of text before the bytes of a section of version 2."""
        line = self.content[self.place : self.place + 32].partition(b"\n")[0]
        if not re.fullmatch(rb"\s*\d{1,15}\s*", line):
            raise DamagedMeshError("without a count")
        self.place += len(line) + 1
        return int(line)


def _sections(content: bytes) -> dict[bytes, bytes]:
    """Return what stands between the lines $NAME and $EndNAME, by name without the dollar sign.

    Of a name that comes twice the first section counts; what stands between sections is left out. A
    file without sections gives an empty dictionary.

    Raises:
        DamagedMeshError: A section does not end, or there are two of nodes.
    """
    sections: dict[bytes, bytes] = {}
    begins = re.compile(rb"^\$(\w+)[ \t\r]*\n", re.MULTILINE)
    place = 0
    while match := begins.search(content, place):
        end = content.find(b"$End" + match[1], match.end())
        if end < 0:
            raise DamagedMeshError(f"cut off inside ${match[1].decode('latin-1')}")
        if match[1] == b"Nodes" and b"Nodes" in sections:
            raise DamagedMeshError("two meshes in one file: $Nodes stands twice")
        sections.setdefault(match[1], content[match.end() : end])
        place = end + len(match[1]) + 4
    return sections


def _read_version_4(numbers: _Source, dimension: int, *, has_entities: bool) -> MshFile:
    """Read the entities of one dimension of a file of version 4.1.

    The sections $Entities (which gives the physical groups of each entity), $Nodes and $Elements
    are used. Elements of other dimensions are checked and left out.

    Args:
        numbers: Function that returns the numbers of a section, to be taken one after another.
        dimension: 3 for volumes, 2 for surfaces.
        has_entities: Whether the file has the section $Entities; without it there are no groups.

    Returns:
        Points, elements as indices of the points by entity and type, groups, and entities; names
        and partitions are not filled in.

    Raises:
        DamagedMeshError: A section is missing or too short, or the sections contradict themselves
            or one another.
    """
    mesh = MshFile(np.empty((0, 3)), {})
    groups = defaultdict[int, list[int]](list)
    if has_entities:
        for tag, physical_groups in _entities_of_version_4(numbers(b"Entities"), dimension):
            mesh.entities.add(tag)
            for group in physical_groups:
                groups[group].append(tag)
    mesh.groups = dict(groups)

    source = numbers(b"Nodes")
    n_blocks, n_nodes, _, _ = source.size_list(4)
    tags: list[Ints] = [np.empty(0, np.int64)]
    points: list[Array] = [np.empty((0, 3))]
    for _ in range(n_blocks):
        of_block, _, is_parametric = source.int_list(3)
        count = source.count()
        if is_parametric not in (0, 1) or of_block not in range(4):
            raise DamagedMeshError("with a block of nodes of an unknown kind")
        tags.append(source.sizes(count))
        # All tags of a block come before all its coordinates. In a parametric block each node has,
        # behind its coordinates, as many parameters as the entity has dimensions.
        width = 3 + of_block * is_parametric
        points.append(source.floats(count * width).reshape(count, width)[:, :3])
    mesh.points = np.concatenate(points)
    if len(mesh.points) != n_nodes:
        raise DamagedMeshError(f"with {n_nodes} nodes promised and {len(mesh.points)} there")

    source = numbers(b"Elements")
    n_blocks, _, _, _ = source.size_list(4)
    runs = defaultdict[tuple[int, int], list[Ints]](list)
    for _ in range(n_blocks):
        of_block, entity, kind = source.int_list(3)
        width = 1 + _node_count(kind)  # a tag before the nodes
        count = source.count()
        block = source.sizes(count * width).reshape(count, width)
        if of_block == dimension:
            runs[entity, kind].append(block[:, 1:])
    return _with_elements(mesh, np.concatenate(tags), runs)


def _entities_of_version_4(source: _Numbers, dimension: int) -> Iterator[tuple[int, list[int]]]:
    """Yield the entities of one dimension of a section $Entities of version 4.1.

    Those of other dimensions are passed over.

    Args:
        source: Numbers of the section, from its start; they are taken.
        dimension: 3 for volumes, 2 for surfaces.

    Yields:
        The tag of an entity and the tags of the physical groups that it is in, which may be none.

    Raises:
        DamagedMeshError: The section ends too early, or a count is no whole number of 0 or more.
    """
    counts = source.size_list(4)  # of points, curves, surfaces and volumes
    for of_entities, count in enumerate(counts):
        for _ in range(count):
            tag = int(source.ints(1)[0])
            source.floats(3 if of_entities == 0 else 6)  # the point, or the box around the entity
            groups = source.int_list(source.count())
            if of_entities > 0:
                source.ints(source.count())  # the entities that bound it
            if of_entities == dimension:
                yield tag, groups


def _read_version_2(numbers: _Source, dimension: int) -> MshFile:
    """Read a file of version 2, whose elements name their physical group and entity.

    Elements of other dimensions are left out. The group 0 stands for none.

    Args:
        numbers: Function that returns the numbers of a section, to be taken one after another.
        dimension: 3 for volumes, 2 for surfaces.

    Returns:
        Points, elements as indices of the points by entity and type, groups with the entities of
        each, entities, and the largest number of a partition; names are not filled in.

    Raises:
        DamagedMeshError: A section is missing or too short, an element has fewer than two labels,
            or the sections contradict themselves or one another.
    """
    tags, points = _nodes_of_version_2(numbers(b"Nodes"))
    mesh = MshFile(points, {})
    groups = defaultdict[int, set[int]](set)
    runs = defaultdict[tuple[int, int], list[Ints]](list)
    for run in _runs_of_version_2(numbers(b"Elements")):
        if run.kind not in (SOLIDS if dimension == VOLUME else FACES):
            continue
        if run.labels.shape[1] < 2:
            raise DamagedMeshError("with elements that name no entity")
        # The labels are group, entity, the number of the element's partitions, and the partitions
        # themselves, which are negative for a ghost element.
        partitions = np.abs(run.labels[:, 3:]).max(initial=0)
        mesh.partitions = max(mesh.partitions, int(partitions))
        for entity in map(int, np.unique(run.labels[:, 1])):
            is_inside = run.labels[:, 1] == entity
            runs[entity, run.kind].append(run.nodes[is_inside])
            for group in map(int, np.unique(run.labels[is_inside, 0])):
                if group:  # 0 stands for none
                    groups[group].add(entity)
    mesh.groups = {group: sorted(groups[group]) for group in sorted(groups)}
    return _with_elements(mesh, tags, runs)


def _nodes_of_version_2(source: _Numbers) -> tuple[Ints, Array]:
    """Read the section $Nodes of version 2: a count, then tag and coordinates of each node.

    Args:
        source: Numbers of the section, from its start, in text or in bytes; they are taken.

    Returns:
        Tags, shape (n,), and coordinates, shape (n, 3). Neither need be unique or finite here.

    Raises:
        DamagedMeshError: There are fewer numbers than the count says, no count, or a tag in text
            that is no whole number.
    """
    if isinstance(source, _Binary):
        order = source.order
        kind = np.dtype([("tag", f"{order}i4"), ("point", f"{order}f8", (3,))])
        table: Any = source.records(source.line_with_count(), kind)
        return table["tag"].astype(np.int64), table["point"].astype(float)
    count = source.count()
    rows = source.floats(4 * count).reshape(count, 4)
    _require_whole(rows[:, 0])
    return rows[:, 0].astype(np.int64), rows[:, 1:].copy()


class _Run(NamedTuple):
    """Elements of one type of version 2.

    Args:
        kind: Gmsh's number of the type.
        labels: Physical group, entity and partitions of each, shape (elements, labels).
        nodes: Tags of their nodes, shape (elements, nodes of one).
    """

    kind: int
    labels: Ints
    nodes: Ints


def _runs_of_version_2(source: _Numbers) -> Iterator[_Run]:
    """Yield the elements of version 2 in runs with one type and one number of labels.

    In bytes the file has such runs itself; in text, where each element stands by itself, elements
    are collected by type and number of labels.

    Args:
        source: Numbers of the section $Elements, from its start; they are taken.

    Yields:
        Gmsh's number of the type; labels (physical group, volume, and perhaps partitions), shape
        (elements, labels); and tags of the nodes, shape (elements, nodes of one).

    Raises:
        DamagedMeshError: The section is too short, a run has no elements or more than remain, an
            element is of no known type, or it has a negative number of labels or more than 1000.
    """
    if isinstance(source, _Binary):
        remaining = source.line_with_count()
        while remaining > 0:
            kind, count, n_labels = source.int_list(3)
            width = 1 + _label_count(n_labels) + _node_count(kind)
            if not 0 < count <= remaining:
                raise DamagedMeshError(f"with a run of {count} elements")
            run = source.ints(count * width).reshape(count, width)
            yield _Run(kind, run[:, 1 : 1 + n_labels], run[:, 1 + n_labels :])
            remaining -= count
        return
    rows = defaultdict[tuple[int, int], list[Ints]](list)
    for _ in range(source.count()):
        _, kind, n_labels = source.int_list(3)
        row = source.ints(_label_count(n_labels) + _node_count(kind))
        rows[kind, n_labels].append(row)
    for (kind, n_labels), rows_of_kind in rows.items():
        table = np.array(rows_of_kind)
        yield _Run(kind, table[:, :n_labels], table[:, n_labels:])


def element_name(kind: int) -> str:
    """Return Gmsh's name of a type of element, as "Prism 15"."""
    return f"{(SOLIDS | FACES).get(kind, f'type {kind}')} {NODES[kind]}"


def _node_count(kind: int) -> int:
    """Return the number of nodes of an element.

    Args:
        kind: Gmsh's number of the type of the element, such as 4 for a tetrahedron of four nodes.

    Raises:
        DamagedMeshError: Gmsh has no such type.
    """
    if kind not in NODES:
        raise DamagedMeshError(f"with elements of the unknown type {kind}")
    return NODES[kind]


def _label_count(count: int) -> int:
    """Return the number of labels of an element of version 2, after a check.

    Raises:
        DamagedMeshError: The number is not in 0 … 1000. More labels (group, volume, partitions)
            than that mean that the file is damaged; a product with it could be huge.
    """
    if not 0 <= count <= 1000:
        raise DamagedMeshError(f"with {count} tags of an element")
    return count


def _with_elements(
    mesh: MshFile, tags: Ints, runs: Mapping[tuple[int, int], list[Ints]]
) -> MshFile:
    """Add elements to a mesh, with their nodes as indices of the mesh's points in place of tags.

    Args:
        mesh: The mesh with its points, shape (n, 3). Its `elements` and `entities` are changed in
            place.
        tags: Tags of the points, any whole numbers in any order, shape (n,).
        runs: Elements by the tag of their entity and the number of their type: arrays of the tags
            of their nodes, each of shape (elements, nodes of one), which are concatenated.

    Returns:
        `mesh` itself.

    Raises:
        DamagedMeshError: A point is not finite, two have one tag, or an element names a tag that no
            point has.
    """
    if not np.isfinite(mesh.points).all():
        raise DamagedMeshError("with a node whose place is no number")
    order = np.argsort(tags, kind="stable")
    rising = tags[order]
    if (np.diff(rising) == 0).any():
        raise DamagedMeshError("with two nodes of one tag")
    for key, arrays in runs.items():
        wanted = np.concatenate(arrays)
        # `searchsorted` gives the length, one too many, for a tag above all others.
        place = np.minimum(np.searchsorted(rising, wanted), max(len(rising) - 1, 0))
        if wanted.size and (not len(rising) or (rising[place] != wanted).any()):
            raise DamagedMeshError("with an element whose node is not there")
        mesh.elements[key] = order[place]
        mesh.entities.add(key[0])
    return mesh
