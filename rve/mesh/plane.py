"""A plane mesh of the user's cell, which is extruded along θ to prisms of the product space."""

from __future__ import annotations

import numpy as np

from alphacut.rve.mesh import square
from alphacut.rve.mesh.columns import ABOVE, BELOW, MID_LEVEL
from alphacut.rve.mesh.periodicity import SAME_PLACE, MeshError
from alphacut.rve.mesh.prism_grid import Elements, Prisms


class PlaneMesh(Elements):
    """Triangles of a cell whose geometry does not depend on θ.

    They have three vertices, or also the middles of the edges 01, 02 and 12. All nodes have one
    third coordinate.
    """

    def prisms(self, theta: tuple[float, float]) -> Prisms:
        """Return one layer of prisms above the triangles, from one level of θ to another.

        Triangles of three nodes get the midpoints of their edges as further nodes, so that elements
        are quadratic and have straight sides.

        Raises:
            MeshError: The triangles do not lie in a plane of x1 and x2.
        """
        points = self.points
        triangles = self.cells
        if (span := np.ptp(points[:, 2])) > SAME_PLACE:
            cure = "mesh the cell in the plane of x1 and x2"
            raise MeshError(f"the plane mesh spans {span:.4g} along x3", cure)
        if triangles.shape[1] == 3:
            ends, edges, _ = square.edges(triangles, np.zeros(len(triangles), bool))
            # `square.edges` gives each triangle's edges as 12, 02, 01.
            triangles = np.hstack([triangles, len(points) + edges[:, ::-1]])
            points = np.concatenate([points, points[ends].mean(axis=1)])
        nodes = len(points)
        cells = np.empty((len(triangles), 15), np.int64)
        cells[:, BELOW] = triangles
        cells[:, ABOVE] = triangles + nodes
        cells[:, MID_LEVEL] = triangles[:, :3] + 2 * nodes
        in_space = np.tile(points, (3, 1))
        in_space[:, 2] = np.repeat([*theta, sum(theta) / 2], nodes)
        # Midpoints of edges have no nodes on the mid-level, and some nodes may be of no triangle.
        used, compact = np.unique(cells, return_inverse=True)
        return Prisms(in_space[used], compact.reshape(cells.shape), self.phase, self.names)
