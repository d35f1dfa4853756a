"""A plane mesh of the user's cell, which is extruded along θ to prisms of the product space."""

from __future__ import annotations

import numpy as np

from alphacut.rve.mesh import square
from alphacut.rve.mesh.columns import stacked
from alphacut.rve.mesh.periodicity import SAME_PLACE, MeshError
from alphacut.rve.mesh.prism_grid import Elements, Prisms


class PlaneMesh(Elements):
    """Triangles of a cell whose geometry does not depend on θ.

    They have three vertices, or also the middles of the edges 01, 02 and 12. All nodes have one
    third coordinate.
    """

    def prisms(self, theta: tuple[float, float], layers: int) -> Prisms:
        """Return the prisms above the triangles, in layers of equal height.

        Triangles of three nodes get the midpoints of their edges as further nodes, so that elements
        are quadratic and have straight sides.

        Args:
            theta: Lowest and highest level of θ.
            layers: Number of layers, at least 1.

        Raises:
            MeshError: The triangles do not lie in a plane of x1 and x2.
        """
        points = self.points
        triangles = self.cells
        if (span := np.ptp(points[:, 2])) > SAME_PLACE:
            what = f"the plane mesh spans {span:.4g} along x3"
            raise MeshError(what, "mesh the cell in the plane of x1 and x2")
        if triangles.shape[1] == 3:
            ends, edges, _ = square.edges(triangles, np.zeros(len(triangles), bool))
            # `square.edges` gives each triangle's edges as 12, 02, 01.
            triangles = np.hstack([triangles, len(points) + edges[:, ::-1]])
            points = np.concatenate([points, points[ends].mean(axis=1)])
        nodes = len(points)
        levels = np.linspace(theta[0], theta[1], 2 * layers + 1)
        in_space = np.tile(points, (len(levels), 1))
        in_space[:, 2] = np.repeat([*levels[::2], *levels[1::2]], nodes)  # mid-levels are last
        cells = stacked(triangles, layers, nodes=nodes, vertices=nodes)
        # Midpoints of edges have no nodes on mid-levels, and a file may have nodes of no triangle.
        used, compact = np.unique(cells, return_inverse=True)
        compact = compact.reshape(cells.shape)
        return Prisms(in_space[used], compact, np.tile(self.phase, layers), self.names)
