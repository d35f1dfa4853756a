"""Fields of a cell at its nodes, and their files: Gmsh's, VTK's, XDMF and Abaqus's."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations
from pathlib import Path

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.base.errors import RefusedError
from alphacut.rve.mesh.file import ABAQUS_ORDER, write

COMPONENTS = ("11", "22", "12")
FORMATS = {".msh": "gmsh", ".vtu": "vtu", ".xdmf": "xdmf", ".inp": "abaqus"}
"""Endings of names with the format that they mean."""
VERTICES = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [0, 1, 1]])
EDGES = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 4), (2, 5), (3, 4), (3, 5), (4, 5)]
SIDES = np.array(
    [[0, 1, 3, 4, 6, 8, 10, 12], [0, 2, 3, 5, 7, 8, 11, 13], [1, 2, 4, 5, 9, 10, 11, 14]]
)
"""Corners of Basix's prism, ends of its edges, and of each side the corners and middle nodes."""


@dataclass(frozen=True)
class CellFields:
    """Total fields under each load; nodes on the interface stand twice, once for each phase.

    Args:
        points: (x1, x2, θ), shape (n, 3).
        cells: Nodes of the prisms in Basix's order, shape (m, 15).
        phase: Index of the phase of each prism in `names`, shape (m,).
        displacement: In halves of the cell's side, shape (n, 2, loads).
        stress: (σ11, σ22, σ12), means over the prisms of one phase that meet in a node, shape
            (n, 3, loads), in Pa.
        names: Names of the phases.
        node: Node of the mesh that each point is, shape (n,).
    """

    points: Array
    cells: Ints
    phase: Ints
    displacement: Array
    stress: Array
    names: tuple[str, ...]
    node: Ints

    def write(self, path: Path | str) -> int:
        """Write mesh, phases, displacements and stresses; return the number of nodes written.

        The name ends in .vtu or .xdmf (tetrahedra that ParaView and PyVista draw), .msh or .inp
        (without fields); see `write_fields`.
        """
        return write_fields(self, Path(path))

    def in_tetrahedra(self) -> CellFields:
        """The same with each prism as three quadratic tetrahedra in VTK's order, (3 m, 10).

        Centres of the prisms' sides, where diagonals have their middle nodes, come last among the
        points, with values interpolated as in the prism and −1 as their `node`.
        """
        columns = np.argsort(self.node[self.cells[:, :3]], axis=1)  # same diagonals from both sides
        prism_sides = self.cells[:, SIDES].reshape(-1, 8)
        corners = np.sort(prism_sides[:, :4], axis=1)
        _, first, number = np.unique(corners, axis=0, return_index=True, return_inverse=True)
        nodes = np.column_stack([self.cells, len(self.points) + number.reshape(-1, 3)])
        cells = np.empty((len(nodes), 3, 10), int)
        for order in permutations(range(3)):
            chosen = (columns == order).all(axis=1)
            cells[chosen] = nodes[chosen][:, _tetrahedra_nodes(order)]
        sides = prism_sides[first]
        points, displacement, stress = (
            np.concatenate([x, x[sides[:, 4:]].sum(axis=1) / 2 - x[sides[:, :4]].sum(axis=1) / 4])
            for x in (self.points, self.displacement, self.stress)
        )
        phase, names = np.repeat(self.phase, 3), self.names
        node = np.concatenate([self.node, np.full(len(sides), -1)])
        return CellFields(points, cells.reshape(-1, 10), phase, displacement, stress, names, node)


def _tetrahedra_nodes(columns: tuple[int, ...]) -> Ints:
    """Nodes, shape (3, 10), of a prism's tetrahedra; its diagonals rise along `columns`."""
    lower, upper = list(columns), [3 + column for column in columns]
    middles = {frozenset(edge): 6 + k for k, edge in enumerate(EDGES)}
    for k, (a, b, c, d, *_) in enumerate(SIDES):
        middles |= dict.fromkeys([frozenset((a, d)), frozenset((b, c))], 15 + k)
    tetrahedra = []
    for k in range(3):
        corners = lower[: k + 1] + upper[k:]
        if np.linalg.det(VERTICES[corners[1:]] - VERTICES[corners[0]]) < 0:
            corners[:2] = corners[1], corners[0]
        ends = [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)]
        tetrahedra.append(corners + [middles[frozenset((corners[i], corners[j]))] for i, j in ends])
    return np.array(tetrahedra)


def write_fields(fields: CellFields, path: Path) -> int:
    """Write mesh, phases, displacements and stresses, and return the number of nodes written.

    The ending of the file's name chooses the format. Gmsh's file holds the mesh once, with fields
    as values at the nodes of its elements; in VTK's and XDMF nodes of the interface stand twice,
    since stresses jump there, and each prism is three quadratic tetrahedra. Abaqus's has no fields.

    Raises:
        RefusedError: The name has none of the endings `FORMATS`.
    """
    kind = FORMATS.get(path.suffix)
    if kind is None:
        raise RefusedError("file", str(path), f"names that end in {', '.join(FORMATS)}")
    if kind == "gmsh":
        return _write_gmsh(fields, path)
    if kind == "abaqus":
        return _write_abaqus(fields, path)
    import meshio

    fine = fields.in_tetrahedra()
    cells, phase = [("tetra10", fine.cells)], {"phase": [fine.phase]}
    mesh = meshio.Mesh(fine.points, cells, _point_fields(fine), phase)
    options = {"data_format": "XML"} if kind == "xdmf" else {}
    meshio.write(path, mesh, file_format=kind, **options)
    return len(fine.points)


def _write_gmsh(fields: CellFields, path: Path) -> int:
    """Write a mesh with its fields by Gmsh, nodes of the interface once; return their number."""
    points = _node_points(fields)
    values = {name: data[fields.cells] for name, data in _point_fields(fields).items()}
    shaped = {name: x.reshape(len(x), 15, -1) for name, x in values.items()}
    write(path, points, fields.node[fields.cells], fields.phase, fields.names, shaped)
    return len(points)


def _point_fields(fields: CellFields) -> dict[str, Array]:
    """Displacements, (n, 3), and stresses, (n,), of each load case by name with their unit."""
    data = {}
    for load in range(fields.displacement.shape[-1]):
        in_space = np.pad(fields.displacement[..., load], ((0, 0), (0, 1)))  # none along θ
        data[f"displacement_{load + 1}_in_half_sides"] = in_space
        for row, name in enumerate(COMPONENTS):
            data[f"stress_{load + 1}_{name}_Pa"] = fields.stress[:, row, load]
    return data


def _node_points(fields: CellFields) -> Array:
    """Points of the nodes, (n, 3); on the interface a point of each phase has the same node."""
    points: Array = np.empty((fields.node.max() + 1, 3))
    points[fields.node] = fields.points
    return points


def _write_abaqus(fields: CellFields, path: Path) -> int:
    """Write nodes, prisms and a set of elements for each phase; return the number of nodes."""
    points, cells = _node_points(fields), 1 + fields.node[fields.cells][:, ABAQUS_ORDER]
    numbers = np.arange(1, 1 + max(len(points), len(cells)))
    with path.open("wb") as file:
        file.write(b"*HEADING\nx1 and x2 in halves of the side of the cell, x3 is theta\n*NODE\n")
        rows = np.column_stack([numbers[: len(points)], points])
        np.savetxt(file, rows, "%d, %.16g, %.16g, %.16g")
        for phase, name in enumerate(fields.names):
            chosen = fields.phase == phase
            file.write(f"*ELEMENT, TYPE=C3D15, ELSET={name}\n".encode())
            rows = np.column_stack([numbers[: len(cells)], cells])[chosen]
            np.savetxt(file, rows, "%d", delimiter=", ")  # 16 numbers, the most of a line
    return len(points)
