"""Fields of a cell at its nodes, and their files: Gmsh's, VTK's and XDMF."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import permutations
from pathlib import Path

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.base.errors import RefusedError
from alphacut.base.extras import extra_named
from alphacut.rve.mesh.file import write


@dataclass(frozen=True)
class CellFields:
    """Total fields under each load; nodes on the interface stand twice, once for each phase.

    Args:
        points: (x1, x2, θ), shape (n, 3).
        cells: Nodes of the prisms in Basix's order, shape (m, 15).
        phase: Index of the phase of each prism in `names`, shape (m,).
        displacement: In halves of the cell's side, or in the unit of a mesh from a file, shape (n,
            2, loads).
        stress: (σ11, σ22, σ12), means over the prisms of one phase that meet in a node, shape
            (n, 3, loads), in Pa.
        names: Names of the phases.
        node: Node of the mesh that each point is, shape (n,).
        scalars: Fields of the user by name, shape (n,) each.
        writes: Whether `write` writes the file: of MPI ranks that have the same fields, one does.
    """

    points: Array
    cells: Ints
    phase: Ints
    displacement: Array
    stress: Array
    names: tuple[str, ...]
    node: Ints
    writes: bool = True
    scalars: Mapping[str, Array] = field(default_factory=dict)

    def write(self, path: Path | str) -> int:
        """Write mesh, phases and fields; return the number of nodes in the file.

        Ranks that solved one cell together have the same fields, and the first one writes the file;
        the others go on at once, so that they must wait before they read it.

        The ending of the name chooses the format. A file of Gmsh (.msh) holds the mesh once, with
        fields as values at the nodes of its elements. In those of VTK (.vtu) and in XDMF (.xdmf)
        nodes of the interface stand twice, since stresses jump there, and each prism is three
        quadratic tetrahedra, which ParaView and PyVista draw. A file that exists is replaced.
        Fields are named by load, counted from 1: "displacement_1_in_half_sides", "stress_1_11_Pa"
        and so on, and scalars of the user as the user names them.

        Args:
            path: Name that ends in .msh, .vtu or .xdmf.

        Raises:
            RefusedError: The name has none of these endings.
            MissingLibraryError: Gmsh is not installed, or for .vtu and .xdmf meshio.
            OSError: A file of VTK or XDMF cannot be written; Gmsh raises an Exception of its own.
        """
        path = Path(path)
        formats = {".msh": "gmsh", ".vtu": "vtu", ".xdmf": "xdmf"}
        kind = formats.get(path.suffix)
        if kind is None:
            raise RefusedError("file", str(path), f"names that end in {', '.join(formats)}")
        if kind == "gmsh":
            return self._write_gmsh(path)
        fine = self.in_tetrahedra()
        if not self.writes:
            return len(fine.points)
        with extra_named():
            import meshio

        mesh = meshio.Mesh(
            fine.points,
            [("tetra10", fine.cells)],
            point_data=fine._point_fields(),
            cell_data={"phase": [fine.phase]},
        )
        # By default XDMF keeps its arrays in a second file in HDF5, which needs the package h5py.
        options = {"data_format": "XML"} if kind == "xdmf" else {}
        meshio.write(path, mesh, file_format=kind, **options)
        return len(fine.points)

    def _write_gmsh(self, path: Path) -> int:
        """Write the mesh with its fields to a file of Gmsh, and return the number of its nodes.

        Points that are one node of the mesh (one for each phase that meets there) become one node
        again; values are written for each node of each prism, so jumps of stresses stay.

        Args:
            path: Name that ends in .msh; a file that exists is replaced.
        """
        points: Array = np.empty((self.node.max() + 1, 3))
        points[self.node] = self.points
        if not self.writes:
            return len(points)
        values = {
            name: data[self.cells].reshape(*self.cells.shape, -1)
            for name, data in self._point_fields().items()
        }
        write(path, points, self.node[self.cells], self.phase, self.names, values)
        return len(points)

    def _point_fields(self) -> dict[str, Array]:
        """Return the values at the n points by names that end in the unit.

        Loads are counted from 1.

        Returns:
            "displacement_K_in_half_sides": (u1, u2, 0) in halves of the cell's side, shape (n, 3);
            "stress_K_11_Pa", "stress_K_22_Pa" and "stress_K_12_Pa", shape (n,) each; and `scalars`.
        """
        data = dict(self.scalars)
        for load in range(self.displacement.shape[-1]):
            # Viewers want vectors of three components; the one along θ is 0.
            in_space = np.pad(self.displacement[..., load], ((0, 0), (0, 1)))
            data[f"displacement_{load + 1}_in_half_sides"] = in_space
            for row, name in enumerate(("11", "22", "12")):
                data[f"stress_{load + 1}_{name}_Pa"] = self.stress[:, row, load]
        return data

    def in_tetrahedra(self) -> CellFields:
        """Return the fields with each prism divided into three quadratic tetrahedra.

        Returns:
            New fields whose `cells` are the ten nodes of each tetrahedron in VTK's order, shape (3
            m, 10) for m prisms. The three tetrahedra of a prism follow one another. The centres of
            the prisms' sides become new points, the last ones, since the division has diagonals
            with their midpoints there. Their coordinates and values are interpolated in the prism,
            and their `node` is −1.
        """
        # `SIDES` has the four corners and then the four edge midpoints of each of the three
        # rectangular sides. Sides that two prisms share get one number, by their corners.
        prism_sides = self.cells[:, SIDES].reshape(-1, 8)
        corners = np.sort(prism_sides[:, :4], axis=1)
        _, first, number = np.unique(corners, axis=0, return_index=True, return_inverse=True)
        nodes = np.column_stack([self.cells, len(self.points) + number.reshape(-1, 3)])

        # A diagonal rises from the column with the smaller node number to the one with the larger,
        # so that both prisms of a side have the same diagonal. `_tetrahedra_nodes` gives the nodes
        # of the three tetrahedra, shape (3, 10).
        columns = np.argsort(self.node[self.cells[:, :3]], axis=1)
        cells = np.empty((len(nodes), 3, 10), int)
        for order in permutations(range(3)):
            chosen = (columns == order).all(axis=1)
            cells[chosen] = nodes[chosen][:, _tetrahedra_nodes(order)]

        sides = prism_sides[first]

        def with_centres(values: Array) -> Array:
            """Append the values at the centres of the prisms' sides to those at points.

            `sides` has the corners and then the edge midpoints of each rectangular side, shape
            (sides, 8). At the centre the serendipity shape functions are 1/2 at the four midpoints
            and −1/4 at the four corners.

            Args:
                values: Values at the n points, shape (n, …).

            Returns:
                New array of shape (n + sides, …).
            """
            at_midpoints = values[sides[:, 4:]].sum(axis=1) / 2
            at_corners = values[sides[:, :4]].sum(axis=1) / 4
            return np.concatenate([values, at_midpoints - at_corners])

        return CellFields(
            points=with_centres(self.points),
            cells=cells.reshape(-1, 10),
            phase=np.repeat(self.phase, 3),
            displacement=with_centres(self.displacement),
            stress=with_centres(self.stress),
            names=self.names,
            node=np.concatenate([self.node, np.full(len(sides), -1)]),
            writes=self.writes,
            scalars={name: with_centres(values) for name, values in self.scalars.items()},
        )


SIDES = np.array(
    [[0, 1, 3, 4, 6, 8, 10, 12], [0, 2, 3, 5, 7, 8, 11, 13], [1, 2, 4, 5, 9, 10, 11, 14]]
)
"""Nodes of the three rectangular sides of Basix's prism: four corners, then four midpoints."""


def _tetrahedra_nodes(columns: tuple[int, ...]) -> Ints:
    """Return the nodes of three quadratic tetrahedra that fill a prism, shape (3, 10).

    Nodes are numbered 0 to 14 as in Basix's 15-node prism (vertices 0-2 below, 3-5 above, midpoints
    of edges), and 15 to 17 are the centres of the three sides. VTK's order is four corners,
    counterclockwise seen from the fourth, and the midpoints of the edges 01, 12, 20, 03, 13, 23.

    Args:
        columns: The vertical edges 0, 1, 2 in some order. The diagonal of each side rises from the
            lower end of the edge that comes earlier to the upper end of the later one.
    """
    edges = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 4), (2, 5), (3, 4), (3, 5), (4, 5)]  # of Basix
    midpoints = {frozenset(edge): 6 + number for number, edge in enumerate(edges)}
    for number, side in enumerate(SIDES):
        # A side has its corners first. One diagonal joins its corners 0 and 3, the other 1 and 2.
        # The midpoint of both is the centre of the side.
        midpoints[frozenset((int(side[0]), int(side[3])))] = 15 + number
        midpoints[frozenset((int(side[1]), int(side[2])))] = 15 + number
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [0, 1, 1]])
    lower = list(columns)
    upper = [3 + column for column in columns]
    tetrahedra = []
    # Kuhn's subdivision: with the lower ends a, b, c of the vertical edges in the given order and
    # the upper ends a', b', c' the tetrahedra are a a' b' c', a b b' c' and a b c c'. All their
    # edges are edges of the prism or rising diagonals, ab', ac' and bc'.
    for k in range(3):
        corners = lower[: k + 1] + upper[k:]
        # VTK wants a positive volume; exchanging two corners turns the sign.
        if np.linalg.det(vertices[corners[1:]] - vertices[corners[0]]) < 0:
            corners[:2] = corners[1], corners[0]
        nodes = list(corners)
        for i, j in ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)):  # edges in VTK's order
            nodes.append(midpoints[frozenset((corners[i], corners[j]))])
        tetrahedra.append(nodes)
    return np.array(tetrahedra)
